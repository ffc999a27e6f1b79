# SPDX-License-Identifier: Apache-2.0
"""UsdLuxMeshLightAPI compared with closed forms, and the appearance of such lights in cameras and
mirrors.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from stages import (
    camera,
    ground,
    light,
    material,
    matrix,
    moved,
    numbers,
    sphere,
    turned,
    write_stage,
)

import wavecomb
from wavecomb import _core

ALBEDO = 0.6
FLOOR = material("M", "diffuse", diffuseColor=(ALBEDO, ALBEDO, ALBEDO)) + "\n" + ground("M", 20)
AT_FLOOR = camera((4, 2, 0.5), (0, 0, 0), half=1e-3)
SQUARE = [(-0.5, 0.5, 0), (0.5, 0.5, 0), (0.5, -0.5, 0), (-0.5, -0.5, 0)]
"""Geometry of a RectLight: 1 x 1, facing -z, corners counter-clockwise from that side."""
DOWN = turned(x=-90) @ moved(0, 1, 0)
GLOW = material("G", "emissive", emissiveColor=(0.5, 1, 2))


def lamp(*body: str, place: Any = DOWN, name: str = "Lamp", bound: str = "", points: Any = SQUARE,
         faces: str = "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]",
         scheme: str = "none", apis: str = '"MeshLightAPI"') -> str:  # fmt: skip
    lines = [
        f"point3f[] points = {numbers(points)}",
        faces,
        f'uniform token subdivisionScheme = "{scheme}"',
        "texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = \"vertex\" )"
        if points is SQUARE else "",
        f"rel material:binding = </World/{bound}>" if bound else "",
        "" if place is None else matrix(place),
        *body,
    ]  # fmt: skip
    apis += ', "MaterialBindingAPI", "ShapingAPI"' if "shaping" in "".join(body) else (
        ', "MaterialBindingAPI"')  # fmt: skip
    return f'def Mesh "{name}" ( prepend apiSchemas = [{apis}] ) {{\n' + "\n".join(lines) + "\n}"


def sync(mode: str) -> str:
    return f'uniform token light:materialSyncMode = "{mode}"'


ALONE = sync("noMaterialResponse")


def under_square(half: float = 0.5, height: float = 1.0) -> float:
    """Radiance of FLOOR below the centre of a square of radiance 1, by form factors."""
    x = half / height
    corner = x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / np.pi
    return float(ALBEDO * 4 * corner)


@pytest.fixture
def shot(tmp_path: Path, beauty: Any) -> Any:
    """Function that renders prims with direct light only and returns the mean colour."""

    def render(
        *prims: str, spp: int = 512, size: int = 16, load: Any = None, **settings: Any
    ) -> Any:
        stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims), **(load or {}))
        picture = beauty(stage, size, spp, **({"max_depth": 1} | settings))
        return picture.mean(axis=(0, 1), dtype=np.float64)

    return render


def close(found: Any, expected: Any, within: float = 1.5e-3) -> None:
    expected = np.broadcast_to(np.asarray(expected, float), (3,))
    assert np.abs(found - expected).max() <= within * max(expected.max(), 1e-12), (found, expected)


def test_square_is_a_rect_light(shot: Any) -> None:
    colour = np.array((3, 2, 1.0))
    mesh = lamp(ALONE, f"color3f inputs:color = {numbers(colour / 4)}", "float inputs:exposure = 2")
    close(shot(AT_FLOOR, FLOOR, mesh), colour * under_square())
    rect = light("Rect", colour=tuple(colour), transform=DOWN)
    close(shot(AT_FLOOR, FLOOR, rect), colour * under_square())
    seen = camera((0, 0.1, 0), (0, 1, 0), half=0.1)
    close(shot(seen, FLOOR, mesh, spp=4), colour, 1e-6)


def test_light_api_alone_has_no_material_response(shot: Any) -> None:
    """The default sync mode is noMaterialResponse, on implicit shapes too, for any emission."""
    mesh = lamp(bound="G", apis='"LightAPI"')
    close(shot(AT_FLOOR, FLOOR, GLOW, mesh), under_square())
    cube = f"""def Cube "Lamp" ( prepend apiSchemas = ["LightAPI"] ) {{
        double size = 1
        {matrix(moved(0, 1.5, 0))}
    }}"""
    close(shot(AT_FLOOR, FLOOR, cube, spp=4096), under_square())


def test_glow_tints_light(shot: Any) -> None:
    """The floor receives emission times light colour; the camera sees the emission."""
    mesh = lamp("color3f inputs:color = (4, 1, 0.5)", bound="G")
    glow = np.array((0.5, 1, 2))
    close(shot(AT_FLOOR, FLOOR, GLOW, mesh), glow * (4, 1, 0.5) * under_square())
    seen = camera((0, 0.1, 0), (0, 1, 0), half=0.1)
    close(shot(seen, FLOOR, GLOW, mesh, spp=4), glow, 1e-6)
    close(shot(AT_FLOOR, FLOOR, lamp(bound="M")), 0)


def test_independent(shot: Any) -> None:
    """The floor receives the light colour; the camera sees the emission, or else the material."""
    mesh = lamp("color3f inputs:color = (4, 1, 0.5)", sync("independent"), bound="G")
    close(shot(AT_FLOOR, FLOOR, GLOW, mesh), np.array((4, 1, 0.5)) * under_square())
    seen = camera((0, 0.1, 0), (0, 1, 0), half=0.1)
    close(shot(seen, FLOOR, GLOW, mesh, spp=4), (0.5, 1, 2), 1e-6)
    plain = lamp(sync("independent"), bound="M")
    close(shot(AT_FLOOR, FLOOR, plain), under_square())


def glossy(roughness: float) -> str:
    return (
        material("M", "metal", diffuseColor=(0.9, 0.9, 0.9), roughness=roughness)
        + "\n"
        + ground("M")
    )


@pytest.mark.parametrize("mode", ["materialGlowTintsLight", "noMaterialResponse", "independent"])
def test_both_halves_of_mis_tell_of_the_same_light(shot: Any, mode: str) -> None:
    """On a glossy floor, both MIS techniques give the image of a rect light of equal radiance."""
    tint = np.array((4, 1, 0.5))
    glow = 1 if mode != "materialGlowTintsLight" else np.array((0.5, 1, 2))
    mesh = lamp(f"color3f inputs:color = {numbers(tint)}", sync(mode), bound="G")
    view = camera((0, 1, 2), (0, 0, 1), half=0.2)
    rect = light("Rect", colour=tuple(tint * glow), transform=DOWN)
    expected = shot(view, glossy(0.4), rect)
    close(shot(view, glossy(0.4), GLOW, mesh), expected, 4e-3)


def test_mirrors_show_what_cameras_see(shot: Any) -> None:
    view = camera((0, 1, 2), (0, 0, 1), half=0.05)
    mesh = lamp("float inputs:intensity = 7", bound="G")
    close(shot(view, glossy(0), GLOW, mesh, spp=16), np.array((0.5, 1, 2)) * 0.9, 0.05)
    alone = lamp("float inputs:intensity = 7", ALONE)
    close(shot(view, glossy(0), alone, spp=16), 6.3, 0.05)


@pytest.mark.parametrize(("scale", "scheme"), [(1.0, "none"), (3.0, "none"), (3.0, "catmullClark")])
def test_normalize_divides_by_the_area(shot: Any, scale: float, scheme: str) -> None:
    """inputs:normalize keeps radiance times world-space area constant, also with subdivision."""
    place = np.diag((scale, 2 * scale, scale, 1)) @ turned(x=-90) @ moved(0, 1, 0)
    mesh = lamp(ALONE, "bool inputs:normalize = 1", "float inputs:intensity = 5", place=place,
                scheme=scheme)  # fmt: skip
    seen = camera((0, 0.1, 0), (0, 1, 0), half=0.05)
    close(shot(seen, FLOOR, mesh, spp=4), 5 / (2 * scale * scale), 1e-5)


@pytest.mark.slow
def test_sphere_of_triangles_is_a_sphere_light(shot: Any) -> None:
    """A normalised light far away has radiance 1 / (4 pi r^2) over a visible disk of pi r^2."""
    ball = sphere("Lamp", "M", (0, 30, 0), rings=48)
    ball = ball.replace('["MaterialBindingAPI"]', '["LightAPI", "MaterialBindingAPI"]')
    power = "bool inputs:normalize = 1\nfloat inputs:intensity = 100\n"
    ball = ball.replace("point3f[] points", power + "point3f[] points")
    close(shot(AT_FLOOR, FLOOR, ball, spp=8192), ALBEDO / np.pi * 100 / 4 / 30**2)


def test_textured_glow_is_tinted(shot: Any, tmp_path: Path) -> None:
    """A tinted mesh light looks like an emissive mesh whose texture is scaled by the tint."""
    pixels = np.random.default_rng(3).random((8, 8, 3)).astype(np.float32)
    out = oiio.ImageBuf(oiio.ImageSpec(8, 8, 3, "float"))
    out.set_pixels(oiio.ROI(), pixels)
    out.write(str(tmp_path / "glow.exr"))

    def screen(scale: Any) -> str:
        body = material("T", "emissive", texture="glow.exr", emissiveColor=(0, 0, 0))
        read = "color3f inputs:emissiveColor.connect = </World/T/Map.outputs:rgb>"
        body = body.replace("color3f inputs:emissiveColor = (0, 0, 0)", read)
        body = body.replace("color3f inputs:diffuseColor.connect = </World/T/Map.outputs:rgb>", "")
        scaled = f"float4 inputs:scale = {numbers((*scale, 1))}\nfloat3 outputs:rgb"
        return body.replace("float3 outputs:rgb", scaled)

    tint = (2, 3, 0.5)
    plain = lamp(bound="T", apis='"GeomModelAPI"')
    expected = shot(AT_FLOOR, FLOOR, screen(tint), plain)
    assert expected.min() > 0.01
    mesh = lamp(f"color3f inputs:color = {numbers(tint)}", bound="T")
    close(shot(AT_FLOOR, FLOOR, screen((1, 1, 1)), mesh), expected, 3e-3)
    once = lamp("float inputs:intensity = 3", sync("independent"), bound="T")
    close(shot(AT_FLOOR, FLOOR, screen((1, 1, 1)), once), 3 * under_square())


def test_instances_are_lights_of_their_own(shot: Any) -> None:
    """Each of two normalised instances of a prototype is divided by its world-space area."""
    inner = lamp(ALONE, "bool inputs:normalize = 1", place=None)
    big = np.diag((2.0, 2.0, 2.0, 1))
    prims = f"""class "Lamps" {{
        {inner}
    }}
    def Xform "A" ( instanceable = true\n inherits = </World/Lamps> ) {{
        {matrix(turned(x=-90) @ moved(-5, 1, 0))}
    }}
    def Xform "B" ( instanceable = true\n inherits = </World/Lamps> ) {{
        {matrix(big @ turned(x=-90) @ moved(5, 1, 0))}
    }}"""
    for x, area in ((-5, 1), (5, 4)):
        seen = camera((x, 0.1, 0), (x, 1, 0), half=0.05)
        close(shot(seen, FLOOR, prims, spp=4), 1 / area, 1e-5)
    under_small = camera((-5, 0.1, 0.2), (-5, 0, 0), half=1e-3)
    alone = lamp(ALONE, place=turned(x=-90) @ moved(-5, 1, 0))
    other = lamp(ALONE, "float inputs:intensity = 0.25", name="Big",
                 place=big @ turned(x=-90) @ moved(5, 1, 0))  # fmt: skip
    close(shot(under_small, FLOOR, prims), shot(under_small, FLOOR, alone, other), 3e-3)


def test_multipliers(shot: Any) -> None:
    mesh = lamp(ALONE, "float inputs:diffuse = 0.25", "float inputs:specular = 2")
    close(shot(AT_FLOOR, FLOOR, mesh), 0.25 * under_square())
    view = camera((0, 1, 2), (0, 0, 1), half=0.05)
    close(shot(view, glossy(0), mesh, spp=16), 1.8, 0.05)


def test_linking(shot: Any) -> None:
    away = "rel collection:lightLink:excludes = </World/Ground>"
    assert shot(AT_FLOOR, FLOOR, lamp(ALONE, away)).max() == 0
    glow = lamp("float inputs:intensity = 3", away, bound="G")
    assert shot(AT_FLOOR, FLOOR, GLOW, glow).max() == 0
    assert shot(AT_FLOOR, FLOOR, GLOW, glow, cosine_sampling=True).max() == 0

    shade = lamp(name="Shade", place=np.diag((4.0, 4, 4, 1)) @ turned(x=-90) @ moved(0, 0.5, 0),
                 apis='"GeomModelAPI"', bound="M")  # fmt: skip
    view = camera((4, 0.2, 0.5), (0, 0, 0), half=1e-4)
    assert shot(view, FLOOR, shade, lamp(ALONE)).max() == 0
    through = lamp(ALONE, "rel collection:shadowLink:excludes = </World/Shade>")
    close(shot(view, FLOOR, shade, through), under_square())


def test_shaping(shot: Any) -> None:
    """A cone around the mesh's -z; focus and cone also affect the visible radiance."""
    for angle, expected in ((60, 1), (20, 0)):
        mesh = lamp(ALONE, f"float inputs:shaping:cone:angle = {angle}")
        view = camera((0, 0.01, 0), (0.45, 1, 0), half=0.01)
        close(shot(view, FLOOR, mesh, spp=4), expected if expected else 0, 1e-6)
    small = np.diag((0.05,) * 3 + (1,)) @ DOWN
    focused = lamp(ALONE, "float inputs:shaping:focus = 2", place=small)
    where = camera((2, 1, 1), (1, 0, 0), half=1e-3)
    plain = lamp(ALONE, place=small)
    close(shot(where, FLOOR, focused), 0.5 * shot(where, FLOOR, plain), 4e-3)


@pytest.mark.slow
def test_moving_mesh_lights_shine(shot: Any) -> None:
    """Only bounces find moving mesh lights; the colour is correct."""
    time = "double3 xformOp:translate.timeSamples = { -1: (-1e-3, 1, 0), 1: (1e-3, 1, 0) }"
    order = (
        'float xformOp:rotateX = -90\nuniform token[] xformOpOrder = ["xformOp:translate", '
        '"xformOp:rotateX"]'
    )
    shutter = "double shutter:open = -0.5\ndouble shutter:close = 0.5"
    view = camera((4, 2, 0.5), (0, 0, 0), half=1e-3, lens=shutter)
    big = [(3 * x, 3 * y, z) for x, y, z in SQUARE]
    for mode, expected in (("noMaterialResponse", 6), ("materialGlowTintsLight", (3, 6, 12))):
        mesh = lamp("float inputs:intensity = 6", sync(mode), time, order, place=None, bound="G",
                    points=big)  # fmt: skip
        found = shot(view, FLOOR, GLOW, mesh, spp=4096, load={"frame": 0})
        close(found, np.array(expected) * under_square(1.5), 4e-3)


def test_hidden_lamps_are_not_seen(shot: Any) -> None:
    mesh = lamp(ALONE)
    hidden = {"lights": "hidden"}
    close(shot(AT_FLOOR, FLOOR, mesh, load=hidden), under_square())
    seen = camera((0, 0.1, 0), (0, 1, 0), half=0.1)
    assert shot(seen, FLOOR, mesh, spp=4, load=hidden).max() == 0


def test_every_way_gives_the_same_picture(tmp_path: Path) -> None:
    """All modes, shaped and linked, on glossy surfaces and glass: bitwise equal images."""
    at = [np.diag((0.5, 0.5, 0.5, 1)) @ turned(x=-70) @ moved(x, 1, 0) for x in (-1, 0, 1)]
    prims = [
        camera((0, 1.5, 4), (0, 0.3, 0), half=0.5), GLOW, glossy(0.3),
        material("Glass", "dielectric"),
        lamp("float inputs:intensity = 9", name="A", place=at[0], bound="G"),
        lamp("float inputs:intensity = 9", sync("independent"), name="B", place=at[1], bound="G",
             points=SQUARE),
        lamp("float inputs:intensity = 9", ALONE, "float inputs:shaping:focus = 3",
             "float inputs:specular = 0.5", "rel collection:lightLink:excludes = </World/Ball>",
             name="C", place=at[2]),
        f'def Sphere "Ball" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{\n'
        f"double radius = 0.4\nrel material:binding = </World/Glass>\n"
        f"{matrix(moved(0, 0.4, 0.5))}\n}}",
    ]  # fmt: skip
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    plain: dict[str, Any] = {"size": (48, 32), "spp": 4, "max_depth": 6}
    reference = wavecomb.render(stage, integrator="reference", **plain).beauty
    assert reference.max() > 0.5
    for policy in _core.policies():
        for wave_size in (64, 0):
            picture = wavecomb.render(stage, policy=policy, wave_size=wave_size, **plain).beauty
            assert np.array_equal(picture, reference), policy
