# SPDX-License-Identifier: Apache-2.0
"""Tests the translators of benchmarks/references.py on small scenes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from reference_scenes import arnold, mitsuba, shapes
from reference_scenes.mitsuba_scene import Scene, referee
from reference_scenes.stage import Inexpressible

BOX = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="3"/></integrator>
  <sensor type="{sensor}">
    {fov}
    <transform name="to_world">
      {scale}
      <lookat origin="1, 2, 6" target="0, 0.3, 0" up="0, 1, 0"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="32"/><integer name="height" value="24"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <shape type="rectangle">
    <transform name="to_world">
      <scale value="3"/><rotate x="1" angle="-90"/><translate y="-1"/>
    </transform>
    <bsdf type="twosided"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
      <rgb name="color0" value="0.9, 0.1, 0.1"/><rgb name="color1" value="0.1, 0.2, 0.8"/>
      <transform name="to_uv"><scale x="1.5" y="2.5"/></transform>
    </texture></bsdf></bsdf>
  </shape>
  <shape type="cube">
    <transform name="to_world">
      <scale value="0.6"/><rotate y="1" angle="30"/><translate x="-1" y="-0.4"/>
    </transform>
    <bsdf type="conductor"><string name="material" value="Au"/></bsdf>
  </shape>
  <shape type="sphere">
    <point name="center" x="1" y="-0.2" z="0"/><float name="radius" value="0.8"/>
    <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.2, 0.5, 0.3"/></bsdf>
  </shape>
  <shape type="rectangle">
    <transform name="to_world">
      <scale x="1.5" y="0.7"/><rotate x="1" angle="90"/><translate y="3"/>
    </transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="6, 5, 3"/></emitter>
  </shape>
  <emitter type="point">
    <point name="position" x="-3" y="3" z="3"/><rgb name="intensity" value="5, 8, 12"/>
  </emitter>
  <emitter type="directional">
    <vector name="direction" value="-1, -2, -0.5"/><rgb name="irradiance" value="0.3, 0.2, 0.4"/>
  </emitter>
  <emitter type="constant"><rgb name="radiance" value="0.1, 0.15, 0.2"/></emitter>
</scene>
"""
PERSPECTIVE = BOX.format(
    sensor="perspective",
    fov='<float name="fov" value="40"/><string name="fov_axis" value="y"/>',
    scale="",
)
ORTHOGRAPHIC = BOX.format(sensor="orthographic", fov="", scale='<scale x="3" y="3"/>')


@pytest.fixture(scope="module")
def mi() -> Any:
    pytest.importorskip("mitsuba", reason="Mitsuba 3 is needed (make setup-test)")
    from reference_scenes.mitsuba_files import load_mitsuba

    return load_mitsuba()


def parsed(mi: Any, folder: Path, text: str) -> Scene:
    file = folder / "scene.xml"
    file.write_text(text, encoding="utf-8")
    return Scene(mi, file)


@pytest.mark.slow
@pytest.mark.parametrize("text", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_a_translated_scene_looks_as_mitsuba_renders_it(mi: Any, tmp_path: Path, text: str) -> None:
    stage = tmp_path / "scene.usda"
    film = mitsuba.to_stage(parsed(mi, tmp_path, text), stage)
    assert film.size == (32, 24) and film.max_depth == 2 and not film.notes
    ours = wavecomb.render(
        stage, size=film.size, spp=256, max_depth=2, filter="box", filter_width=1.0
    ).beauty
    scene = referee(parsed(mi, tmp_path, text), as_ours=True)
    theirs = np.asarray(mi.render(scene, spp=256))[:, :, :3]
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.01)
    blocks = [image.reshape(6, 4, 8, 4, 3).mean((1, 3)) for image in (ours, theirs)]
    assert abs(blocks[0] - blocks[1]).max() < 0.12 * theirs.mean()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('<emitter type="constant">', '<emitter type="projector">', "no projector"),
        ('type="cube"', 'type="cylinder"', "shape cylinder"),
        ('<bsdf type="plastic">', '<bsdf type="principled">', "material principled"),
        ('<rfilter type="box"/>', '<rfilter type="mitchell"/>', "filter mitchell"),
        ('<integrator type="path">', '<integrator type="volpath">', "integrator volpath"),
    ],
)
def test_what_cannot_be_said_is_named(
    mi: Any, tmp_path: Path, old: str, new: str, reason: str
) -> None:
    assert old in PERSPECTIVE
    scene = parsed(mi, tmp_path, PERSPECTIVE.replace(old, new))
    with pytest.raises(Inexpressible, match=reason):
        mitsuba.to_stage(scene, tmp_path / "scene.usda")


def test_a_shape_whose_image_is_missing_is_left_out_with_its_pixels(
    mi: Any, tmp_path: Path
) -> None:
    image = (
        '<bsdf type="diffuse"><texture type="bitmap" name="reflectance">'
        '<string name="filename" value="gone.png"/></texture></bsdf>'
    )
    start = PERSPECTIVE.index('<bsdf type="conductor">')
    end = PERSPECTIVE.index("</bsdf>", start) + len("</bsdf>")
    scene = parsed(mi, tmp_path, PERSPECTIVE[:start] + image + PERSPECTIVE[end:])
    film = mitsuba.to_stage(scene, tmp_path / "scene.usda")
    assert film.notes and "gone.png" in film.notes[0]
    assert film.left_out[13, 10] and not film.left_out[13, 24] and film.left_out.mean() < 0.25


def test_reflectance_of_a_conductor_is_the_textbooks() -> None:
    # ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) at normal incidence; 1 at grazing incidence.
    normal = mitsuba.conductor_reflectance([0.2, 1.5], [3.9, 0.0], 0.0)
    assert normal == pytest.approx([(0.64 + 15.21) / (1.44 + 15.21), 0.04])
    assert mitsuba.conductor_reflectance([0.2], [3.9], 90.0) == pytest.approx([1.0])


def test_a_mesh_of_four_right_corners_is_a_rect_light() -> None:
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 2], [0, 0, 2]], np.float64)
    to_world, width, height = shapes.as_rectangle(points, np.array([[0, 1, 2], [0, 2, 3]]))
    assert {width, height} == {2.0, 4.0}
    assert np.allclose(to_world[:3, 2], (0, 1, 0)), "it shines along -z, to -y"
    assert np.allclose(to_world[:3, 3], (2, 0, 1)) and np.linalg.det(to_world) > 0
    points[0] += (1, 0, 0)
    with pytest.raises(Inexpressible):
        shapes.as_rectangle(points, np.array([[0, 1, 2], [0, 2, 3]]))


def test_an_arnold_scene_gets_its_camera_light_and_shaders(tmp_path: Path) -> None:
    data = tmp_path / "test" / "data"
    data.mkdir(parents=True)
    (data / "scene.usda").write_text(
        """#usda 1.0
def Mesh "square" (apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    rel material:binding = </matt>
}
def Material "matt"
{
    token outputs:arnold:surface.connect = </matt/lambert.outputs:surface>
    def Shader "lambert"
    {
        uniform token info:id = "arnold:lambert"
        float inputs:Kd = 0.8
        color3f inputs:Kd_color = (0.5, 0.25, 0.125)
        token outputs:surface
    }
}
""",
        encoding="utf-8",
    )
    (data / "scene.ass").write_text(
        """options
{
 camera "perspShape"
}
persp_camera
{
 matrix
 1 0 0 0
 0 1 0 0
 0 0 1 0
 0 5 4 1
 fov 28
}
distant_light
{
 matrix
 1 0 0 0
 0 1 0 0
 0 0 1 0
 0 0 0 1
 exposure 2
 angle 0
}
usd
{
 matrix
 1 0 0 0
 0 1 0 0
 0 0 1 0
 0 5 0 1
}
""",
        encoding="utf-8",
    )
    test = arnold.to_stage(tmp_path / "test", tmp_path / "out" / "scene.usda")
    assert "arnold:lambert becomes diffuse" in test.notes and test.space == "rec709"
    picture = wavecomb.render(test.stage, size=(16, 12), spp=4, max_depth=1)
    # Radiance 2^2 times albedo / pi at normal incidence; the square fills the image.
    expected = 4 * 0.8 * np.array([0.5, 0.25, 0.125]) / np.pi
    assert picture.beauty[6, 8] == pytest.approx(expected, rel=1e-4)
    assert np.isfinite(picture.depth).all()
