# SPDX-License-Identifier: Apache-2.0
"""Light paths combined with camera paths: unbiased for all lights, lenses and materials, and equal
to closed forms where camera paths find nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from stages import (
    box,
    camera,
    ground,
    light,
    look_at,
    material,
    moved,
    quad,
    sphere,
    write_sky,
    write_stage,
)

import wavecomb

DOWN = look_at((0.4, 1.9, 0.3), (0.2, 0.0, -0.2))
VIEW = camera((0.3, 1.6, 3.4), (0.0, 0.6, 0.0), half=0.42)
LOOKS = (
    material("White", "diffuse", diffuseColor=(0.7, 0.65, 0.6)),
    material("Blue", "diffuse", diffuseColor=(0.2, 0.3, 0.6)),
    material("Gloss", "plastic", diffuseColor=(0.5, 0.2, 0.1), roughness=0.4, ior=1.5),
    material("Rough", "metal", diffuseColor=(0.9, 0.7, 0.4), roughness=0.5),
    material("Frosted", "dielectric", roughness=0.5, ior=1.4, diffuseColor=(0.9, 0.95, 0.9)),
)


def corner(*prims: str) -> tuple[str, ...]:
    """A floor, a back wall, a block and a ball in the open, where infinite lights reach them."""
    wall = quad("Wall", [(-2, 0, -1.5), (2, 0, -1.5), (2, 2.5, -1.5), (-2, 2.5, -1.5)], "Blue")
    return (
        *LOOKS,
        VIEW,
        ground("White", 2.0),
        wall,
        box("Block", (-1.2, 0.0, -0.8), (-0.5, 0.9, -0.1), "Gloss"),
        sphere("Ball", "Rough", (0.6, 0.45, 0.2), 0.45, rings=16),
        *prims,
    )


def spot(angle: float) -> str:
    lamp = light("Disk", colour=(30, 28, 25), transform=DOWN, radius=0.1)
    cone = f"float inputs:shaping:cone:angle = {angle}\nfloat inputs:shaping:cone:softness = 0.3\n"
    lamp = lamp.replace('"Light" {', '"Light" ( prepend apiSchemas = ["ShapingAPI"] ) {')
    return lamp.replace("{\n", "{\n" + cone + "float inputs:shaping:focus = 2\n", 1)


def portal_dome(sky: Path) -> str:
    return (
        f'def DomeLight "Dome" {{ asset inputs:texture:file = @{sky}@\n'
        "rel portals = [</World/Portal>]\n}\n"
        'def PortalLight "Portal" {\nfloat inputs:width = 3\nfloat inputs:height = 2\n'
        "double3 xformOp:translate = (0, 1.2, 2)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}'
    )


def lights(folder: Path) -> dict[str, tuple[str, ...]]:
    sky = write_sky(folder, 32)
    glow = material("Glow", "emissive", emissiveColor=(9, 8, 6))
    turned = look_at((1.2, 1.6, 1.2), (0, 0.4, 0))
    return {
        "rect": (light("Rect", colour=(9, 8, 7), transform=DOWN, width=0.5, height=0.3),),
        "picture": (
            light("Rect", colour=(5, 5, 5), transform=DOWN, width=1, height=0.6, texture=sky),
        ),
        "disk": (light("Disk", colour=(9, 8, 7), transform=DOWN, radius=0.25),),
        "sphere": (
            light("Sphere", colour=(20, 18, 15), transform=moved(0.5, 1.5, 0.9), radius=0.12),
        ),
        "point": (light("Sphere", colour=(20, 18, 15), transform=moved(0.5, 1.5, 0.9), radius=0),),
        "cylinder": (
            light("Cylinder", colour=(9, 8, 7), transform=turned, radius=0.06, length=0.8),
        ),
        "sun": (light("Distant", colour=(900, 850, 800), transform=turned, angle=3.0),),
        "direction": (light("Distant", colour=(2, 2, 2), transform=turned, angle=0.0),),
        "dome": (light("Dome", colour=(1, 0.9, 0.8)),),
        "sky": (light("Dome", texture=sky),),
        "portal": (portal_dome(sky),),
        "mesh": (glow, sphere("Lamp", "Glow", (0.4, 1.6, 0.8), 0.2, rings=5)),
        "spot": (spot(35.0),),
        "several": (
            glow,
            sphere("Lamp", "Glow", (0.4, 1.6, 0.8), 0.15, rings=4),
            light("Rect", "One", (4, 3, 2), DOWN, width=0.5, height=0.3),
            light("Sphere", "Two", (8, 9, 9), moved(-1.4, 1.4, 0.9), radius=0.1),
            light("Distant", "Three", (1, 1, 2), turned, angle=0.0),
            light("Dome", "Four", (0.1, 0.1, 0.1)),
        ),
    }


KINDS = (
    "rect",
    "picture",
    "disk",
    "sphere",
    "point",
    "cylinder",
    "sun",
    "direction",
    "dome",
    "sky",
)
KINDS += ("portal", "mesh", "spot", "several")


def compare(
    name: str,
    stage: Any,
    beauty: Any,
    size: int = 32,
    spp: int = 16,
    transport: str = "light",
    **settings: Any,
) -> None:
    """Images with and without light paths agree."""
    plain: dict[str, Any] = {"max_depth": 4, **settings}
    joined = batches(
        lambda seed: beauty(stage, size, spp, seed=seed, transport=transport, **plain), 12
    )
    alone = batches(lambda seed: beauty(stage, size, 2 * spp, seed=seed, **plain), 12, 500)
    assert_agree(name, joined, alone)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_lights_are_unbiased(kind: str, tmp_path: Path, beauty: Any) -> None:
    path = write_stage(tmp_path / "stage.usda", *corner(*lights(tmp_path)[kind]))
    compare(f"light paths {kind}", wavecomb.load(path), beauty)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sky", "several"])
def test_connections_are_unbiased(kind: str, tmp_path: Path, beauty: Any) -> None:
    path = write_stage(tmp_path / "stage.usda", *corner(*lights(tmp_path)[kind]))
    stage = wavecomb.load(path)
    compare(f"connections {kind}", stage, beauty, transport="bdpt", max_depth=5)


@pytest.mark.slow
def test_connections_find_light_that_a_shade_hides(tmp_path: Path, beauty: Any) -> None:
    """A light in a box that is open at the top: all light arrives via the ceiling."""
    shade = [
        quad("X0", [(0, 1, 0), (0, 1, 0.6), (0, 1.5, 0.6), (0, 1.5, 0)], "White"),
        quad("X1", [(0.6, 1, 0), (0.6, 1, 0.6), (0.6, 1.5, 0.6), (0.6, 1.5, 0)], "White"),
        quad("Z0", [(0, 1, 0), (0.6, 1, 0), (0.6, 1.5, 0), (0, 1.5, 0)], "White"),
        quad("Z1", [(0, 1, 0.6), (0.6, 1, 0.6), (0.6, 1.5, 0.6), (0, 1.5, 0.6)], "White"),
        quad("Floor", [(0, 1, 0), (0.6, 1, 0), (0.6, 1, 0.6), (0, 1, 0.6)], "White"),
        quad("Ceiling", [(-2, 2.4, -2), (2, 2.4, -2), (2, 2.4, 2), (-2, 2.4, 2)], "Gloss"),
        light("Sphere", colour=(60, 55, 50), transform=moved(0.3, 1.2, 0.3), radius=0.08),
    ]
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *corner(*shade)))
    compare("connections shade", stage, beauty, transport="bdpt", max_depth=6)


@pytest.mark.slow
def test_a_tree_of_lights(tmp_path: Path, beauty: Any) -> None:
    path = write_stage(tmp_path / "stage.usda", *corner(*lights(tmp_path)["several"]))
    compare("light paths tree", wavecomb.load(path), beauty, light_selection="tree")


LENSES = {
    "lens": camera((0.3, 1.6, 3.4), (0.0, 0.6, 0.0), half=0.42).replace(
        "float focalLength", "float fStop = 0.35\nfloat focusDistance = 3.2\nfloat focalLength"
    ),
    "parallel": camera((0.3, 1.6, 3.4), (0.0, 0.6, 0.0), half=0.3).replace(
        "float focalLength", 'token projection = "orthographic"\nfloat focalLength'
    ),
    "clipped": camera((0.3, 1.6, 3.4), (0.0, 0.6, 0.0), half=0.42, clip=(2.9, 4.3)),
    # A camera inside the room with a corner behind it, so that the corner's image covers both sides
    # of the latlong seam.
    "all round": camera((0.3, 0.7, 0.9), (0.5, 0.7, 3.0), half=0.42),
}


@pytest.mark.slow
@pytest.mark.parametrize("lens", list(LENSES))
def test_cameras_are_unbiased(lens: str, tmp_path: Path, beauty: Any) -> None:
    prims = [p if "Camera" not in p else LENSES[lens] for p in corner(*lights(tmp_path)["rect"])]
    shown = {"projection": "latlong"} if lens == "all round" else {}
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims), **shown)
    # Use a wide filter, except where light reaches the image edge: camera paths do not cover the
    # tails of wide filters there.
    wide: dict[str, Any] = {"filter": "blackman-harris", "filter_width": 3.0}
    if lens == "clipped":
        wide = {}
    elif lens == "all round":
        wide = {"filter": "box", "filter_width": 2.0}
    compare(f"light paths {lens}", stage, beauty, **wide)
    if lens in ("lens", "all round"):
        compare(f"connections {lens}", stage, beauty, transport="bdpt", **wide)


@pytest.mark.slow
def test_connections_are_unbiased_in_motion(tmp_path: Path, beauty: Any) -> None:
    """A ball that moves while the shutter is open: camera and light path share a time."""
    shutter = "double shutter:open = 0\ndouble shutter:close = 1\nfloat focalLength"
    way = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 1: (0.5, 0, 0.3) }"
    ball = sphere("Moving", "Gloss", (-0.3, 0.6, 0.7), 0.35, rings=12)
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    mover = f'def Xform "Mover" {{\n{way}\n{order}\n{ball}\n}}'
    prims = corner(*lights(tmp_path)["rect"], mover)
    view = (p.replace("float focalLength", shutter) if "Camera" in p else p for p in prims)
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *view), frame=0)
    compare("connections in motion", stage, beauty, 24, 8, transport="bdpt")


@pytest.mark.slow
@pytest.mark.parametrize("ball", ["Frosted", "Clear", "Coated"])
def test_what_transmits_is_unbiased(ball: str, tmp_path: Path, beauty: Any) -> None:
    """A ball under a large light, which camera paths also find through the ball."""
    looks = (
        material("Clear", "dielectric", roughness=0.0, ior=1.4, diffuseColor=(0.9, 0.95, 0.9)),
        material(
            "Coated",
            "principled",
            diffuseColor=(0.5, 0.2, 0.1),
            roughness=0.3,
            clearcoat=1.0,
            clearcoatRoughness=0.2,
            opacity=0.5,
        ),
    )
    lamp = light(
        "Rect",
        colour=(3, 2.8, 2.5),
        transform=look_at((0.4, 2.6, 0.3), (0.2, 0, -0.2)),
        width=2.4,
        height=2.4,
    )
    shape = sphere("Glass", ball, (-0.2, 0.6, 0.9), 0.4, rings=24, smooth=True)
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *corner(*looks, lamp, shape)))
    compare(f"light paths through {ball}", stage, beauty, max_depth=6)
    if ball == "Coated":
        compare(f"connections through {ball}", stage, beauty, transport="bdpt", max_depth=6)


@pytest.mark.slow
def test_shading_normals_are_unbiased(tmp_path: Path, beauty: Any) -> None:
    """Smooth normals on coarse facets, adjusted towards the viewer at silhouettes."""
    shape = sphere("Coarse", "Gloss", (-0.2, 0.6, 0.9), 0.5, rings=5, smooth=True)
    prims = corner(*lights(tmp_path)["sphere"], shape)
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    a = batches(lambda seed: beauty(stage, 32, 16, seed=seed, max_depth=2, transport="light"), 12)
    b = batches(lambda seed: beauty(stage, 32, 32, seed=seed, max_depth=2), 12, 500)
    # Camera paths start from the smooth surface instead of the facets (docs/light-paths.md).
    assert_agree("light paths coarse", a, b, tolerance=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sun", "rect"])
def test_aiming_in_a_wide_stage_is_unbiased(kind: str, tmp_path: Path, beauty: Any) -> None:
    """A glass ball on a wide ground, under lights that camera paths also find through it."""
    clear = material("Clear", "dielectric", roughness=0.0, ior=1.4, diffuseColor=(1, 1, 1))
    lamps = {
        "sun": light("Distant", colour=(20, 19, 18), transform=DOWN, angle=40.0),
        "rect": light(
            "Rect",
            colour=(4, 3.9, 3.7),
            transform=look_at((0.4, 2.6, 0.3), (0.2, 0, -0.2)),
            width=2.4,
            height=2.4,
        ),
    }
    ball = sphere("Glass", "Clear", (0.1, 0.4, 0.5), 0.35, rings=24, smooth=True)
    prims = (*LOOKS, VIEW, clear, ground("White", 40.0), ball, lamps[kind])
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    aimed = wavecomb.render(stage, size=(16, 16), spp=1, transport="light")
    assert aimed.stats["light_aiming"]["targets"] > 0
    compare(f"light paths wide {kind}", stage, beauty, max_depth=6)


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["light", "bdpt"])
def test_light_through_a_plate_of_glass(transport: str, tmp_path: Path, beauty: Any) -> None:
    """A point light above a clear plate above a floor, which camera paths cannot find.

    Below the light, of height h and intensity I, rays are vertical, and a plate of thickness t and
    index n shifts the light by t (1 - 1 / n). Light that is reflected inside m times comes from
    2 m t / n further away, so with R = ((n - 1) / (n + 1))^2 the irradiance is
    E = I sum_m (1 - R)^2 R^(2 m) / (h - t (1 - 1 / n) + 2 m t / n)^2.
    """
    height, thick, index, albedo, power = 2.0, 0.3, 1.5, 0.6, 10.0
    glass = material("Clear", "dielectric", roughness=0.0, ior=index, diffuseColor=(1, 1, 1))
    grey = material("Grey", "diffuse", diffuseColor=(albedo,) * 3)
    # USD: a sphere of radius 0 counts as normalised, which divides the intensity by four.
    point = light("Sphere", colour=(4 * power,) * 3, transform=moved(0, height, 0), radius=0)
    prims = (
        glass,
        grey,
        ground("Grey", 3.0),
        box("Plate", (-3.0, 1.2, -3.0), (3.0, 1.2 + thick, 3.0), "Clear"),
        point,
        camera((0, 1.0, 0.8), (0, 0, 0), half=0.1),
    )
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    r = ((index - 1) / (index + 1)) ** 2
    way = height - thick * (1 - 1 / index)
    reflected = [(1 - r) ** 2 * r ** (2 * m) / (way + 2 * m * thick / index) ** 2 for m in range(3)]
    expected = albedo / np.pi * power * sum(reflected)
    settings: dict[str, Any] = {"max_depth": 7, "sampler": "sobol"}
    found = beauty(stage, 48, 512, transport=transport, **settings)
    # Several thousand light paths reach the camera; 2 % more light arrives by reflections between
    # floor and plate.
    assert found.mean() == pytest.approx(1.01 * expected, rel=0.06)
    assert beauty(stage, 16, 16, **settings).max() == 0.0


@pytest.mark.parametrize("transport", ["light", "bdpt"])
def test_a_furnace_stays_white(transport: str, tmp_path: Path, beauty: Any) -> None:
    """An object without absorption under a uniform sky is invisible."""
    looks = (
        material("White", "diffuse", diffuseColor=(1, 1, 1)),
        material("Ice", "dielectric", roughness=0.4, ior=1.3, diffuseColor=(1, 1, 1)),
    )
    prims = (
        *looks,
        sphere("A", "White", (-0.6, 0, 0), 0.5, rings=20),
        sphere("B", "Ice", (0.6, 0, 0), 0.5, rings=32, smooth=True),
        light("Dome"),
        camera((0, 0.4, 3), (0, 0, 0), half=0.4),
    )
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    picture = beauty(stage, 24, 256, max_depth=24, transport=transport)
    # Rough glass loses multiple scattering between microfacets.
    assert picture[:, :12].mean() == pytest.approx(1.0, abs=0.01)
    alone = beauty(stage, 24, 256, max_depth=24)
    assert picture[:, 12:].mean() == pytest.approx(alone[:, 12:].mean(), abs=0.01)


@pytest.mark.slow
def test_delta_lobes_of_guided_paths(tmp_path: Path, beauty: Any) -> None:
    """Walls with a smooth coat, which guided paths choose less often than unguided ones.

    If the MIS weights of camera paths ignore this, the image is 1.6 % too bright.
    """
    coat = {"diffuseColor": (0.5, 0.4, 0.3), "roughness": 0.0, "ior": 4.0}
    back = [(-2, 0, -1.5), (2, 0, -1.5), (2, 2.5, -1.5), (-2, 2.5, -1.5)]
    left = [(-2, 0, 2), (-2, 0, -1.5), (-2, 2.5, -1.5), (-2, 2.5, 2)]
    path = write_stage(
        tmp_path / "stage.usda",
        *LOOKS, VIEW, ground("White", 2.0), material("Coat", "plastic", **coat),
        quad("Back", back, "Coat"), quad("Left", left, "Coat"),
        light("Rect", colour=(3, 3, 3), transform=DOWN, width=2, height=2),
    )  # fmt: skip
    stage = wavecomb.load(path)
    settings: dict[str, Any] = {"max_depth": 4, "transport": "light"}
    plain = {"filter": "box", "filter_width": 1.0, "sampler": "independent", "roulette": "off"}
    trained = wavecomb.render(stage, size=(32, 32), spp=1024, guiding="on", **plain, **settings)
    assert trained.stats["guiding"]["guided_share"] > 0.5
    guided, alone = (
        batches(
            lambda seed, way=way: beauty(stage, 32, 64, seed=seed, **settings, **way), 12, first
        )
        for way, first in (({"guiding": "on", "learn_from": trained}, 0), ({"guiding": "off"}, 500))
    )
    assert_agree("guided delta lobes", guided, alone)
