# SPDX-License-Identifier: Apache-2.0
"""Tests UsdGeomCamera from the stage to the image."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom
from usd_recorder import load, said, write

import wavecomb
from wavecomb import _core
from wavecomb.image.files.render_output import fitted_window, scene_metadata
from wavecomb.usd import load_stage

LENS = """float focalLength = 40
    float horizontalAperture = 20
    float verticalAperture = 10
    float horizontalApertureOffset = 5
    float verticalApertureOffset = -2
    float2 clippingRange = (0.5, 100)
"""
SKY = 'def DomeLight "Sky" { color3f inputs:color = (0.5, 1, 2) }\n'
BALL = 'def Sphere "Ball" { double radius = 1 }\n'


def camera_of(tmp_path, text, **options):
    scene, loaded = load(tmp_path, f'def Camera "Cam" {{ {LENS} {text} }}', **options)
    return scene.camera, loaded


def back(distance: float) -> str:
    return (
        f"double3 xformOp:translate = (0, 0, {distance})\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    )


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_windows_are_those_of_gf_camera(tmp_path, projection):
    found, loaded = camera_of(tmp_path, f'token projection = "{projection}"')
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    frustum = UsdGeom.Camera.Get(stage, "/Cam").GetCamera(Usd.TimeCode.Default()).frustum
    low, high = frustum.GetWindow().GetMin(), frustum.GetWindow().GetMax()
    assert found["window"] == pytest.approx((low[0], high[0], low[1], high[1]))
    assert found.get("projection", "perspective") == projection
    assert (found["near_clip"], found["far_clip"]) == (0.5, 100)
    assert "perspective" not in said(loaded)


def test_projection_of_an_option_goes_before_the_camera(tmp_path):
    found, _ = camera_of(tmp_path, "float fStop = 2\nfloat focusDistance = 3", projection="latlong")
    assert found["window"] == pytest.approx((-math.pi, math.pi, -math.pi / 2, math.pi / 2))
    assert "lens_radius" not in found
    found, _ = camera_of(tmp_path, "", projection="orthographic")
    assert found["window"] == pytest.approx((-0.5, 1.5, -0.7, 0.3))
    with pytest.raises(wavecomb.WavecombError, match="no camera projection 'fish'"):
        camera_of(tmp_path, "", projection="fish")


@pytest.mark.parametrize(
    ("text", "scale"),
    [
        ("", 1.0),
        ("float exposure = 1.5", 2**1.5),
        ("float exposure:iso = 400\nfloat exposure:time = 0.02\nfloat exposure:fStop = 2.8", None),
        ("float exposure:responsivity = 0.7\nfloat exposure = -2", 0.7 / 4),
    ],
)
def test_exposure_is_that_of_usd(tmp_path, text, scale):
    found, _ = camera_of(tmp_path, text)
    given = found.get("exposure", 1.0)
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    camera = UsdGeom.Camera.Get(stage, "/Cam")
    assert given == pytest.approx(camera.ComputeLinearExposureScale(), rel=1e-6)
    if scale is not None:
        assert given == pytest.approx(scale)
    assert "exposure" not in camera_of(tmp_path, text, exposure=False)[0]


@pytest.mark.parametrize(
    "text", ["float exposure:fStop = 0", "float exposure = 1e30", "float exposure:time = -1"]
)
def test_exposure_that_is_none_is_left_out(tmp_path, text):
    found, loaded = camera_of(tmp_path, text)
    assert "exposure" not in found
    assert "camera exposure left out: one of its values is invalid: /Cam" in said(loaded)


def test_clipping_planes(tmp_path):
    found, loaded = camera_of(
        tmp_path, "float4[] clippingPlanes = [(0, 0, -1, -4), (0, 0, 0, 1), (1, 0, 0, 2)]"
    )
    assert found["clip_planes"] == [(0, 0, -1, -4), (1, 0, 0, 2)]
    assert "clipping plane of a camera left out" in said(loaded)


def test_exposure_multiplies_light_and_nothing_else(tmp_path):
    """Exposure by a power of two scales light exactly, in both integrators and all light layers."""
    text = SKY + BALL + f'def Camera "Cam" {{ {back(5)} float exposure = EV }}'
    aovs = ["albedo", "normal", "depth", "direct", "indirect", "emission", "light_groups"]
    for integrator in ("wavefront", "reference"):
        plain, lit = (
            wavecomb.render(
                load_stage(write(tmp_path, text.replace("EV", stops), f"{stops}.usda")),
                size=(12, 12), spp=16, error=True, integrator=integrator, aovs=aovs,
            )
            for stops in ("0", "2")
        )  # fmt: skip
        assert plain.beauty.max() > 0.4
        for name in ("beauty", "albedo", "normal", "depth"):
            factor = 4.0 if name == "beauty" else 1.0
            np.testing.assert_array_equal(getattr(lit, name), factor * getattr(plain, name))
        np.testing.assert_array_equal(lit.variance, 16 * plain.variance)
        # The error is a difference divided by the square root of the brightness (docs/render.md).
        np.testing.assert_allclose(lit.error, 2 * plain.error, rtol=1e-6)
        for name, layer in plain.aovs.items():
            if layer.shape[2:] == (3,):
                np.testing.assert_array_equal(lit.aovs[name], 4 * layer)
        assert lit.metadata["wavecomb:exposure"] == 4.0


def test_orthographic_picture_is_a_closed_form(tmp_path):
    """An orthographic image of a sphere has the exact silhouette and depth at any distance."""
    text = SKY + BALL + 'def Camera "Cam" { token projection = "orthographic"\n'
    text += "float horizontalAperture = 40\nfloat verticalAperture = 40\nPLACE }"
    size = 32
    pictures = []
    for distance in (3.0, 30.0):
        path = write(tmp_path, text.replace("PLACE", back(distance)), f"{distance}.usda")
        loaded = load_stage(path, subdivision="off")
        pictures.append(
            wavecomb.render(loaded, size=(size, size), spp=16, filter="box", filter_width=0.01)
        )
    at = (np.arange(size) + 0.5) / size * 4 - 2
    radius2 = at[:, None] ** 2 + at[None, :] ** 2
    for picture, distance in zip(pictures, (3.0, 30.0), strict=True):
        depth = picture.depth
        inside, outside = radius2 < 0.9, radius2 > 1.05
        assert np.isinf(depth[outside]).all() and np.isfinite(depth[inside]).all()
        # Tessellation changes the radius by up to a few per cent.
        expected = distance - np.sqrt(np.maximum(1 - radius2, 0))
        np.testing.assert_allclose(depth[inside], expected[inside], atol=0.04)


def test_every_scheduling_gives_the_same_bits(tmp_path):
    """All schedules give the same bits for orthographic, panoramic and thin-lens cameras."""
    text = SKY + BALL + 'def Sphere "Far" { double radius = 4\n' + back(-9) + "}\n"
    text += f'def Camera "Cam" {{ {back(5)} float fStop = 1\nfloat focusDistance = 4\nCLIP }}'
    clip = "float4[] clippingPlanes = [(0.1, 0.1, -1, -4.2)]"
    path = write(tmp_path, text.replace("CLIP", clip))
    for projection in ("orthographic", "latlong"):
        loaded = load_stage(path, projection=projection)
        settings = {"size": (24, 16), "spp": 4, "seed": 3}
        first = wavecomb.render(loaded, **settings)
        assert np.isfinite(first.depth).any()
        for other in (
            {"policy": "none", "wave_size": 64, "threads": 1},
            {"traversal": "single", "lanes": _core.lane_widths()[0], "policy": "texture"},
        ):
            again = wavecomb.render(loaded, **settings, **other)
            np.testing.assert_array_equal(first.beauty, again.beauty)
            np.testing.assert_array_equal(first.depth, again.depth)


def test_projection_matrices_lead_points_to_their_pixels(tmp_path):
    text = SKY + f'def Camera "Cam" {{ {LENS} {back(7)} token projection = "orthographic" }}'
    scene = load_stage(write(tmp_path, text)).scene
    matrix = scene_metadata(scene, 100, 50)["worldToNDC"]
    for corner, near, expected in (((-0.5, -0.7), 0.5, -1.0), ((1.5, 0.3), 100.0, 1.0)):
        projected = np.array([*corner, 7 - near, 1.0]) @ matrix
        np.testing.assert_allclose(projected, [expected] * 3 + [1.0], atol=1e-5)
    assert "PixelAspectRatio" not in scene_metadata(scene, 100, 50)
    around = load_stage(tmp_path / "stage.usda", projection="latlong").scene
    assert "worldToNDC" not in scene_metadata(around, 100, 50)


@pytest.mark.parametrize(
    ("conform", "policy"),
    [
        ("expandAperture", "MatchVertically"),
        ("cropAperture", "MatchHorizontally"),
        ("adjustApertureWidth", "MatchVertically"),
        ("adjustApertureHeight", "MatchHorizontally"),
        ("adjustPixelAspectRatio", "DontConform"),
    ],
)
def test_windows_conform(conform, policy):
    """A 4 x 4 window is fitted to an image of aspect ratio 3 : 1 as UsdRender defines."""
    window = fitted_window((-1, 3, -2, 2), 300, 100, conform)
    expected = {
        "MatchVertically": (-5, 7, -2, 2),
        "MatchHorizontally": (-1, 3, -2 / 3, 2 / 3),
        "DontConform": (-1, 3, -2, 2),
    }[policy]
    assert window == pytest.approx(expected)


def test_core_refuses_what_is_no_camera():
    builder = _core.SceneBuilder()
    window = (-1, 1, -1, 1)
    for options, words in (
        ({"projection": "fish"}, "no projection 'fish'"),
        ({"conform": "fish"}, "no conform 'fish'"),
    ):
        with pytest.raises(_core.Error, match=words):
            builder.set_camera(np.eye(4), window=window, **options)
    for options, words in (
        ({"pixel_aspect": 0}, "pixel_aspect"),
        ({"exposure": -1}, "exposure"),
        ({"clip_planes": [(0, 0, math.nan, 1)]}, "clip_planes are not finite"),
        ({"projection": "latlong", "window": (-1, 1, -2, 2)}, "between the poles"),
    ):
        builder = _core.SceneBuilder()
        with pytest.raises(_core.Error, match=words):
            builder.set_camera(np.eye(4), **{"window": window, **options})
            builder.build()


def test_fingerprints_tell_cameras_apart():
    def digest(**options) -> int:
        builder = _core.SceneBuilder()
        builder.set_camera(np.eye(4), window=(-1, 1, -1, 1), **options)
        return dict(builder.build().fingerprint())["camera"]

    others = [
        {}, {"projection": "orthographic"}, {"conform": "cropAperture"}, {"pixel_aspect": 2},
        {"exposure": 2}, {"clip_planes": [(0, 0, 1, 2)]},
    ]  # fmt: skip
    assert len({digest(**options) for options in others}) == len(others)


def test_a_pose_of_the_window_keeps_the_camera(tmp_path):
    from wavecomb.gui.viewport import navigate
    from wavecomb.gui.viewport.navigate import pose_of_scene

    text = SKY + f'def Camera "Cam" {{ {LENS} {back(7)} token projection = "orthographic" }}'
    scene = load_stage(write(tmp_path, text)).scene
    pose = pose_of_scene(scene.camera, "/Cam")
    assert pose.projection == "orthographic"
    renderer = _core.Renderer(scene)
    renderer.edit(camera=pose.options())
    assert renderer.scene.camera == scene.camera
    nearer = navigate.dolly(pose, np.zeros(3), 0.5)
    assert nearer.window == pytest.approx([0.5 * edge for edge in pose.window])
    framed = navigate.frame(pose, np.array([[-3.0, -3, -3], [3, 3, 3]]), 2.0)
    x0, x1, y0, y1 = framed.fitted(200, 100)
    for corner in (Gf.Vec3d(3, 3, 3), Gf.Vec3d(-3, -3, -3)):
        seen = np.array([*corner, 1.0]) @ np.linalg.inv(framed.to_world)
        assert x0 < seen[0] < x1 and y0 < seen[1] < y1 and seen[2] < 0
