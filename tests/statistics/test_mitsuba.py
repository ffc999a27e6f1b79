# SPDX-License-Identifier: Apache-2.0
"""Tests Wavecomb against Mitsuba 3's `path`: images agree within noise.

Every stage is USD text that our loader reads; Mitsuba gets the arrays that our scene builder
received. A wrong orientation would therefore be wrong in both renderers, so test_closed_forms.py
tests orientations separately. Tests state where the models differ by design.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from agreement import Agreement, assert_agree, batches
from references import Reference
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
    turned,
    write_sky,
)

pytestmark = pytest.mark.slow

EYE = (2.5, 2.6, 5.0)
VIEW = camera(EYE, (0.0, 0.7, 0.0))
GREY = material("Grey", "diffuse", diffuseColor=(0.6, 0.5, 0.4))
BLUE = material("Blue", "diffuse", diffuseColor=(0.2, 0.35, 0.7))
GOLD_ETA, GOLD_K = (0.143, 0.375, 1.442), (3.983, 2.386, 1.603)

Check = Callable[..., Agreement]


@pytest.fixture
def check(mitsuba: ModuleType, beauty: Any, fewer: int) -> Check:
    """Function that renders a recorded scene with both renderers and compares the images."""

    def run(
        name: str,
        recorded: Any,
        *,
        spp: int = 64,
        count: int = 8,
        max_depth: int = 4,
        size: int | None = None,
        tolerance: float = 0.0,
        same_preview: bool = False,
        **settings: Any,
    ) -> Agreement:
        from mitsuba_bridge import PeerSettings

        spp //= fewer
        size = size or (64 if fewer == 1 else 48)
        chosen = PeerSettings(size, size, max_depth, same_preview=same_preview)
        peer = Reference(mitsuba, recorded, chosen)
        a = batches(
            lambda seed: beauty(
                recorded.scene, size, spp, seed=seed, max_depth=max_depth, **settings
            ),
            count,
        )
        b = batches(lambda seed: peer.render(spp, seed), count, first_seed=1000)
        return assert_agree(name, a, b, tolerance=tolerance)

    return run


@pytest.mark.parametrize("max_depth", [0, 1, 2, 8])
def test_cornell_box(check: Check, generated: Any, fewer: int, max_depth: int) -> None:
    from recording import record

    few = max_depth < 8
    found = check(
        f"cornell {max_depth}",
        record(generated("cornell")),
        max_depth=max_depth,
        size=64,
        spp=64 if few else 128,
        count=8 if few else 10,
    )
    assert np.abs(found.excess).max() < (0.004 if fewer == 1 else 0.025)


def test_cornell_box_with_roulette_and_sobol(check: Check, generated: Any) -> None:
    """Default settings except for the filter."""
    from recording import record

    check(
        "cornell sobol roulette",
        record(generated("cornell")),
        max_depth=8,
        sampler="sobol",
        roulette="throughput",
    )


def test_dome_with_image(check: Check, recorded: Any, tmp_path: Path) -> None:
    """An environment without symmetry, rotated about two axes."""
    dome = light("Dome", texture=write_sky(tmp_path), transform=turned(25.0, 70.0))
    scene = recorded(VIEW, dome, GREY, BLUE, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)))
    check("dome", scene)


def test_dome_with_a_small_sun(check: Check, recorded: Any, tmp_path: Path) -> None:
    """Importance sampling of the image: most light comes from a few pixels."""
    from stages import latlong_directions, sky

    from wavecomb.scenes.authoring.textures import write_image

    directions = latlong_directions(64)
    towards = np.array((0.5, 0.7, 0.4)) / np.linalg.norm((0.5, 0.7, 0.4))
    image = 0.3 * sky(directions) + 60.0 * np.exp(150.0 * (directions @ towards - 1.0))[..., None]
    path = tmp_path / "sun.exr"
    write_image(path, image.astype(np.float32), "float")
    dome = light("Dome", texture=path)
    scene = recorded(VIEW, dome, GREY, BLUE, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)))
    # Both renderers interpolate texels bilinearly, but rows are offset by half a texel; the bridge
    # resamples the image.
    check("sun", scene, tolerance=0.004)


def test_disk_light(check: Check, recorded: Any) -> None:
    place = look_at((-1.5, 2.5, 1.5), (0, 0.5, 0))
    lamp = light("Disk", colour=(9, 6, 3), transform=place, radius=0.6, normalize=True)
    scene = recorded(VIEW, lamp, GREY, BLUE, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)))
    check("disk light", scene)


def test_instances_of_both(mitsuba: ModuleType, generated: Any) -> None:
    """In Mitsuba, shape groups, which benchmarks use, and flattened copies give equal images."""
    from mitsuba_bridge import PeerSettings
    from recording import record

    scene = record(generated("cornell-dragon"))
    pictures = [
        batches(partial(Reference(mitsuba, scene, how).render, 64), 6, first)
        for first, how in (
            (0, PeerSettings(32, 32, 2)),
            (50, PeerSettings(32, 32, 2, instancing=True)),
        )
    ]
    assert_agree("mitsuba instances", *pictures)


def test_sphere_light(check: Check, recorded: Any) -> None:
    lamp = light("Sphere", colour=(9, 6, 3), transform=moved(1.4, 2.2, 0.6), radius=0.35)
    scene = recorded(VIEW, lamp, GREY, BLUE, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)))
    check("sphere light", scene)


def test_point_light(check: Check, recorded: Any) -> None:
    lamp = light("Sphere", colour=(30, 20, 10), transform=moved(1.4, 2.2, 0.6), radius=0.0)
    scene = recorded(VIEW, lamp, GREY, BLUE, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)))
    check("point light", scene)


@pytest.mark.parametrize("angle", [0.0, 12.0])
def test_distant_light(check: Check, recorded: Any, angle: float) -> None:
    """Mitsuba has no distant light with an angle; there, a distant sphere replaces the light."""
    sun = light(
        "Distant", colour=(3, 2.5, 2), transform=turned(-50, 30), angle=angle, normalize=True
    )
    scene = recorded(VIEW, sun, GREY, BLUE, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)))
    check(f"distant {angle:.0f}", scene)


def test_several_lights(check: Check, recorded: Any, tmp_path: Path) -> None:
    """Selection among lights of every kind."""
    lights = [
        light("Dome", "Sky", (0.4, 0.4, 0.4), texture=write_sky(tmp_path)),
        light("Sphere", "Ball", (9, 6, 3), moved(1.4, 2.2, 0.6), radius=0.2),
        light("Rect", "Panel", (2, 4, 6), look_at((-2, 2, 2), (0, 0, 0)), width=1, height=0.5),
        light("Distant", "Sun", (0.8, 0.7, 0.6), turned(-50, 30), angle=0, normalize=True),
    ]
    scene = recorded(VIEW, *lights, GREY, BLUE, ground("Grey"), sphere("B", "Blue", (0, 1, 0)))
    check("several lights", scene)


def test_emissive_mesh(check: Check, recorded: Any) -> None:
    """Uses a closed emitter, since emitters have two sides in Wavecomb and one in Mitsuba."""
    lamp = material("Lamp", "emissive", emissiveColor=(5, 7, 3))
    scene = recorded(
        VIEW, GREY, BLUE, lamp, ground("Grey"), sphere("Ball", "Blue", (0, 1, 0)),
        box("Block", (0.9, 0.2, 1.2), (1.5, 0.7, 1.8), "Lamp"),
    )  # fmt: skip
    check("emissive mesh", scene)


@pytest.mark.parametrize("smooth", [False, True])
def test_glass(check: Check, recorded: Any, tmp_path: Path, smooth: bool) -> None:
    """Glass with flat facets, and a ball with smooth normals."""
    dome = light("Dome", texture=write_sky(tmp_path))
    glass = material("Glass", "dielectric", diffuseColor=(0.9, 1.0, 0.8), roughness=0.0, ior=1.5)
    ball = sphere("Ball", "Glass", (0, 1.01, 0), rings=48 if smooth else 8, smooth=smooth)
    scene = recorded(VIEW, dome, GREY, glass, ground("Grey"), ball)
    check(f"glass {'smooth' if smooth else 'flat'}", scene, max_depth=12)


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.2])
def test_gold(check: Check, recorded: Any, tmp_path: Path, roughness: float) -> None:
    """A conductor with measured index.

    Mitsuba's masking and shadowing are separable; Wavecomb's are height-correlated. Only Wavecomb
    compensates for multiple scattering. The differences between the models are invisible up to
    alpha 0.04.
    """
    dome = light("Dome", texture=write_sky(tmp_path))
    gold = material("Gold", "metal", eta=GOLD_ETA, k=GOLD_K, roughness=roughness)
    scene = recorded(VIEW, dome, GREY, gold, ground("Grey"), sphere("Ball", "Gold", (0, 1, 0)))
    check(f"gold {roughness}", scene)


def open_pbr(name: str, **inputs: Any) -> str:
    """A MaterialX OpenPBR Surface."""
    text = material(name, "", **inputs).replace('custom string wavecomb:program = ""', "")
    text = text.replace('"UsdPreviewSurface"', '"ND_open_pbr_surface_surfaceshader"')
    return text.replace("outputs:surface.connect", "outputs:mtlx:surface.connect")


@pytest.mark.parametrize("lobe", ["metal", "rough metal", "glass", "rough glass"])
def test_openpbr(check: Check, recorded: Any, tmp_path: Path, lobe: str) -> None:
    """Metal equals Mitsuba's metallic principled, and glass its dielectric; see test_gold."""
    roughness = 0.2 if lobe.startswith("rough") else 0.0
    if lobe.endswith("metal"):
        body = open_pbr(
            "M", base_color=(0.9, 0.6, 0.3), base_metalness=1.0, specular_roughness=roughness
        )
    else:
        body = open_pbr(
            "M", transmission_weight=1.0, transmission_color=(0.9, 1.0, 0.8),
            specular_roughness=roughness, specular_ior=1.5,
        )  # fmt: skip
    ball = sphere("Ball", "M", (0, 1.01, 0), rings=8)
    dome = light("Dome", texture=write_sky(tmp_path))
    scene = recorded(VIEW, dome, GREY, body, ground("Grey"), ball)
    assert any(m["program"] == "openpbr" for m in scene.materials)
    check(f"openpbr {lobe}", scene, max_depth=8)


@pytest.mark.parametrize("program", ["metal", "dielectric"])
def test_highlight(check: Check, recorded: Any, program: str) -> None:
    """A small light reflected in a rough surface: detects an error of 5 % in the lobe width.

    Glass is a floating pane with the light behind it.
    """
    if program == "metal":
        body = material("M", "metal", eta=GOLD_ETA, k=GOLD_K, roughness=0.2)
        shape, where = ground("M"), moved(-1.6, 1.8, -2.6)
    else:
        body = material("M", "dielectric", diffuseColor=(1, 1, 1), roughness=0.3, ior=1.5)
        shape, where = box("Pane", (-4, 0.3, -1), (4, 2.5, -0.8), "M"), moved(-1.5, 0.5, -4)
    lamp = light("Sphere", colour=(60, 50, 40), transform=where, radius=0.3)
    check(f"highlight {program}", recorded(VIEW, lamp, body, shape), max_depth=3)


def test_rough_gold_gives_back_what_single_scattering_loses(
    mitsuba: ModuleType, beauty: Any, recorded: Any
) -> None:
    """At alpha 0.2 in a white furnace, Mitsuba's gold loses about 7 %, Wavecomb's does not.

    Computed by hand, GGX of alpha 0.2025 loses L = 0.0837 on average (integral of G2 / G1 over
    visible normals). Further bounces return the fraction F^2 (1 - L) / (1 - F L) of the lost
    energy, which is 0.92, 0.64 and 0.12 for the mean reflectances F of red, green and blue, 0.97,
    0.81 and 0.36. A distant ball gains as much energy as the further bounces return.
    """
    from mitsuba_bridge import PeerSettings

    gold = material("Gold", "metal", eta=GOLD_ETA, k=GOLD_K, roughness=0.45)
    view = camera((0, 0, 60), (0, 0, 0), half=0.0165)
    scene = recorded(view, light("Dome"), gold, sphere("Ball", "Gold", rings=64))
    peer = Reference(mitsuba, scene, PeerSettings(32, 32, 1))
    gain = (beauty(scene.scene, 32, 256, max_depth=1) - peer.render(256)).mean(axis=(0, 1))
    gain *= (2 * 0.0165 * 60) ** 2 / np.pi
    assert np.abs(gain - 0.0837 * np.array((0.92, 0.64, 0.12))).max() < 0.008


@pytest.mark.parametrize("roughness", [0.1, 0.2, 0.4])
def test_frosted_glass(check: Check, recorded: Any, tmp_path: Path, roughness: float) -> None:
    """Height-correlated masking and Mitsuba's separable masking show no difference."""
    dome = light("Dome", texture=write_sky(tmp_path))
    glass = material("Glass", "dielectric", diffuseColor=(1, 1, 1), roughness=roughness, ior=1.5)
    ball = sphere("Ball", "Glass", (0, 1.01, 0), rings=8)
    scene = recorded(VIEW, dome, GREY, glass, ground("Grey"), ball)
    check(f"frosted {roughness}", scene, max_depth=8)


def test_depth_of_field(check: Check, recorded: Any, tmp_path: Path) -> None:
    lens = "float fStop = 6\nfloat focusDistance = 5"
    view = camera(EYE, (0.0, 0.7, 0.0), lens=lens)
    dome = light("Dome", texture=write_sky(tmp_path))
    blocks = [
        box(f"Box{k}", (1.4 * k - 2.0, 0, 2.0 - 2 * k), (1.4 * k - 1.2, 1.0, 2.8 - 2 * k), "Blue")
        for k in range(3)
    ]
    check("depth of field", recorded(view, dome, GREY, BLUE, ground("Grey"), *blocks))


def test_orthographic(check: Check, recorded: Any, tmp_path: Path) -> None:
    # 2 x 0.4 x 50 tenths of a unit: four units wide.
    view = camera(EYE, (0.0, 0.7, 0.0), half=0.4, lens='token projection = "orthographic"')
    dome = light("Dome", texture=write_sky(tmp_path))
    blocks = [
        box(f"Box{k}", (1.4 * k - 2.0, 0, 2.0 - 2 * k), (1.4 * k - 1.2, 1.0, 2.8 - 2 * k), "Blue")
        for k in range(3)
    ]
    check("orthographic", recorded(view, dome, GREY, BLUE, ground("Grey"), *blocks))


def test_texture(check: Check, recorded: Any, tmp_path: Path) -> None:
    """A magnified image without symmetry, bilinear, directly lit (bounces use filtered texels)."""
    from wavecomb.scenes.authoring.textures import write_image

    rng = np.random.default_rng(5)
    image = rng.uniform(0.05, 0.95, (5, 7, 3)).astype(np.float32)
    image[:2, :3] = (0.9, 0.1, 0.1)
    path = tmp_path / "map.exr"
    write_image(path, image, "float")
    paint = material("Paint", "diffuse", texture=path)
    corners = [(-1, -1, 0), (1, -1, 0.3), (1, 1, 0.3), (-1, 1, 0)]
    face = quad("Face", corners, "Paint", uv=[(0.1, 0.05), (0.9, 0.0), (0.95, 1.0), (0.0, 0.9)])
    view = camera((0.3, 0.2, 4.0), (0, 0, 0))
    lamp = light("Rect", "Panel", (6, 6, 6), look_at((1, 2, 4), (0, 0, 0)), width=1, height=1)
    check("texture", recorded(view, lamp, paint, face), max_depth=1)


def test_instances_and_smooth_normals(check: Check, recorded: Any, tmp_path: Path) -> None:
    """Smooth normals under a transform that stretches and rotates.

    Wavecomb's rays start on the smooth surface that the vertex normals imply, to avoid shadow
    terminator artefacts. With 64 rings, this difference to Mitsuba is invisible.
    """
    dome = light("Dome", texture=write_sky(tmp_path))
    stretch = np.diag([1.3, 0.6, 0.8, 1.0]) @ turned(20, 40, 10) @ moved(0, 1, 0)
    ball = sphere("Ball", "Blue", rings=64, smooth=True, transform=stretch)
    check("smooth", recorded(VIEW, dome, GREY, BLUE, ground("Grey"), ball))


@pytest.mark.parametrize("look", ["rough", "clear", "tinted", "coat", "metal"])
def test_preview_surface(
    mitsuba: ModuleType, check: Check, recorded: Any, tmp_path: Path, look: str
) -> None:
    """UsdPreviewSurface by the same formulas, with integrals in place of fitted polynomials.

    Below opacity 1, light passes straight through, which Mitsuba counts as a bounce and Wavecomb
    does not; at the 20th bounce, little light is left. The fits are within 1.2 %, and the loss of a
    smooth metal is limited (multiple_scattering.h), so images may differ by 0.5 % of the sky.
    """
    looks: dict[str, dict[str, Any]] = {
        "rough": {"diffuseColor": (0.8, 0.4, 0.2), "roughness": 0.4},
        "clear": {"diffuseColor": (1, 1, 1), "roughness": 0.05, "opacity": 0.0},
        "tinted": {"diffuseColor": (1, 0.6, 0.2), "roughness": 0.2, "opacity": 0.3, "ior": 1.54},
        "coat": {"diffuseColor": (0.1, 0.4, 0.2), "roughness": 0.3, "ior": 1.62, "clearcoat": 0.6,
                 "clearcoatRoughness": 0.1},
        "metal": {"diffuseColor": (0.9, 0.6, 0.3), "roughness": 0.35, "metallic": 1.0},
    }  # fmt: skip
    body = material("M", "principled", **looks[look])
    dome = light("Dome", texture=write_sky(tmp_path))
    lamp = light("Disk", "Lamp", (9, 6, 3), look_at((-1.5, 3, 2.5), (0, 1, 0)), radius=0.6)
    ball = sphere("Ball", "M", (0, 1.01, 0), rings=16)
    scene = recorded(VIEW, dome, lamp, GREY, body, ground("Grey"), ball)
    if mitsuba.variant().startswith("scalar"):
        pytest.skip("the BSDF needs a vectorised variant")
    check(f"preview {look}", scene, max_depth=20, tolerance=0.005, same_preview=True)
