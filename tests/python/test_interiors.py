# SPDX-License-Identifier: Apache-2.0
"""Tests media inside meshes: closed forms, furnaces, priorities, shadows and schedules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_walks import box

import wavecomb
from wavecomb import _core
from wavecomb.scenes.caustics import ball

WIDE = 4.0


def filled(builder: Any, ior: float, roughness: float = 0.0, **layers: Any) -> int:
    """Returns a glass or liquid material; an index of 1 gives the fog that a mesh bounds."""
    return int(
        builder.add_material(
            "openpbr",
            ior=ior,
            roughness=roughness,
            metallic=0.0,
            specular_color=(1, 1, 1),
            openpbr={"transmission_weight": 1.0, **layers},
        )
    )


def absorbing(sigma: Any) -> dict[str, Any]:
    """Returns the OpenPBR inputs of a medium with the given absorption coefficients."""
    return {"transmission_color": tuple(np.exp(-np.array(sigma))), "transmission_depth": 1.0}


def slab(builder: Any, low: float, high: float, material: int) -> None:
    box(builder, (-WIDE, -WIDE, low), (WIDE, WIDE, high), material)


def seen_from_above(builder: Any, spp: int = 4, size: int = 8, depth: int = 8, **more: Any) -> Any:
    """Returns the pixels of an orthographic camera that looks down from height 5."""
    camera = np.eye(4)
    camera[3, 2] = more.pop("height", 5.0)
    builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
    settings = _core.Settings(
        width=size, height=size, spp=spp, max_depth=depth, filter="box", filter_width=1.0, **more
    )
    picture = _core.render(builder.build(), settings, None, None, None).beauty
    return np.asarray(picture, np.float64).reshape(-1, 3)


def shining_floor(builder: Any) -> None:
    slab(builder, -31.0, -30.0, builder.add_material("emissive", emission=(1.0, 2.0, 3.0)))


SIGMA = np.array([0.3, 0.7, 1.1])
LIGHT = np.array([1.0, 2.0, 3.0])


def test_a_clear_slab_absorbs_as_it_should() -> None:
    """The transmittance is exp(-sigma t), without noise."""
    builder = wavecomb.SceneBuilder()
    slab(builder, -2.0, -0.5, filled(builder, 1.0, **absorbing(SIGMA)))
    shining_floor(builder)
    assert np.allclose(seen_from_above(builder), LIGHT * np.exp(-1.5 * SIGMA), rtol=1e-4)


def test_a_camera_in_fog_knows_where_it_is() -> None:
    """A camera at z = 5 inside a slab from z = -2 to 20 sees only the part below the camera."""
    builder = wavecomb.SceneBuilder()
    slab(builder, -2.0, 20.0, filled(builder, 1.0, **absorbing(SIGMA)))
    slab(builder, -1.0, 1.0, filled(builder, 1.0, **absorbing(2 * SIGMA)))
    shining_floor(builder)
    exact = LIGHT * np.exp(-(5.0 + 4.0) * SIGMA)
    assert np.allclose(seen_from_above(builder), exact, rtol=1e-4)


@pytest.mark.parametrize(
    ("priorities", "lengths"),
    [((1.0, 0.0), (1.0, 1.0)), ((0.0, 0.0), (0.75, 1.25)), ((-1.0, 2.0), (0.75, 1.25))],
)
def test_where_two_overlap_the_higher_priority_is_there(priorities: Any, lengths: Any) -> None:
    """Where slabs overlap, the medium has the higher priority or, if equal, was entered last."""
    builder = wavecomb.SceneBuilder()
    other = SIGMA[::-1]
    for (low, high), sigma, priority in zip(
        ((-1.0, 0.0), (-2.0, -0.75)), (SIGMA, other), priorities, strict=True
    ):
        layers = {**absorbing(sigma), "nested_priority": priority}
        slab(builder, low, high, filled(builder, 1.0, **layers))
    shining_floor(builder)
    exact = LIGHT * np.exp(-lengths[0] * SIGMA - lengths[1] * other)
    assert np.allclose(seen_from_above(builder), exact, rtol=1e-4)


def test_indices_are_those_of_both_sides() -> None:
    """Interfaces of stacked clear media transmit 1 / (1 + sum R / (1 - R)) (Stokes 1862)."""
    builder = wavecomb.SceneBuilder()
    slab(builder, -1.0, 0.0, filled(builder, 2.0, nested_priority=1.0))
    slab(builder, -2.0, -0.75, filled(builder, 1.25))
    shining_floor(builder)
    seen = seen_from_above(builder, spp=256, size=32, depth=40)
    interfaces = [((a - b) / (a + b)) ** 2 for a, b in ((1, 2.0), (2.0, 1.25), (1.25, 1))]
    exact = LIGHT / (1 + sum(r / (1 - r) for r in interfaces))
    error = seen.std(axis=0) / np.sqrt(len(seen))
    assert np.all(error < 0.002 * exact)
    assert np.all(np.abs(seen.mean(axis=0) - exact) < 0.001 * exact + 3.5 * error)


def test_shadow_rays_bring_what_passes() -> None:
    """Shadow rays pass straight through a clear slab between a light and the floor."""
    pixels = []
    for sigma in (np.zeros(3) + 1e-6, SIGMA):
        builder = wavecomb.SceneBuilder()
        slab(builder, 6.0, 8.0, filled(builder, 1.0, **absorbing(sigma)))
        floor = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
        slab(builder, -1.0, 0.0, floor)
        builder.add_light("distant", np.eye(4), color=(1, 1, 1), angle=0.0)
        pixels.append(seen_from_above(builder, depth=1))
    assert np.all(pixels[0] > 0.01)
    assert np.allclose(pixels[1] / pixels[0], np.exp(-2.0 * SIGMA), rtol=1e-4)


@pytest.mark.parametrize(
    ("rays", "passes"),
    [({"shadow": False}, 0.0), ({"bounces": False}, 2.0), ({"camera": False}, 2.0)],
)
def test_fog_dims_the_rays_that_see_it(rays: dict[str, bool], passes: float) -> None:
    """Fog of thickness 2 dims light samples if, and only if, it is visible to shadow rays."""
    pixels = []
    for sigma in (np.zeros(3) + 1e-6, SIGMA):
        builder = wavecomb.SceneBuilder()
        fog = filled(builder, 1.0, **absorbing(sigma))
        box(builder, (-WIDE, -WIDE, 6.0), (WIDE, WIDE, 8.0), fog, name="/Fog")
        builder.add_visibility("/Fog", rays)
        floor = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
        slab(builder, -1.0, 0.0, floor)
        builder.add_light("distant", np.eye(4), color=(1, 1, 1), angle=0.0)
        pixels.append(seen_from_above(builder, depth=1))
    assert np.all(pixels[0] > 0.01)
    assert np.allclose(pixels[1] / pixels[0], np.exp(-passes * SIGMA), rtol=1e-4)


@pytest.mark.parametrize(
    ("rays", "passes"),
    [
        ({}, 2.0),
        ({"bounces": False}, 2.0),
        ({"camera": False}, 1.0),
        ({"shadow": False}, 1.0),
        ({"camera": False, "shadow": False}, 0.0),
    ],
)
def test_fog_around_a_floor_dims_the_rays_that_see_it(rays: dict[str, bool], passes: float) -> None:
    """Camera rays and shadow rays each pass 1 unit of fog, unless the fog is invisible to them."""
    pixels = []
    for sigma in (np.zeros(3) + 1e-6, SIGMA):
        builder = wavecomb.SceneBuilder()
        fog = filled(builder, 1.0, **absorbing(sigma))
        box(builder, (-WIDE, -WIDE, -0.5), (WIDE, WIDE, 1.0), fog, name="/Fog")
        builder.add_visibility("/Fog", rays)
        floor = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
        slab(builder, -1.0, 0.0, floor)
        builder.add_light("distant", np.eye(4), color=(1, 1, 1), angle=0.0)
        pixels.append(seen_from_above(builder, depth=1))
    assert np.all(pixels[0] > 0.01)
    assert np.allclose(pixels[1] / pixels[0], np.exp(-passes * SIGMA), rtol=1e-4)


@pytest.mark.parametrize(
    ("rays", "passes"), [({}, 2.0), ({"bounces": False}, 1.0), ({"camera": False}, 1.0)]
)
def test_paths_know_that_they_have_left_fog(rays: dict[str, bool], passes: float) -> None:
    """Paths pass through fog to a mirror and back to a ceiling, outside of the fog."""
    pixels = []
    for sigma in (np.zeros(3) + 1e-6, SIGMA):
        builder = wavecomb.SceneBuilder()
        fog = filled(builder, 1.0, **absorbing(sigma))
        box(builder, (-WIDE, -WIDE, -0.5), (WIDE, WIDE, 1.0), fog, name="/Fog")
        builder.add_visibility("/Fog", rays)
        mirror = builder.add_material(
            "principled", base_color=(1, 1, 1), metallic=1.0, roughness=0.0
        )
        slab(builder, -1.0, 0.0, mirror)
        slab(builder, 4.0, 5.0, builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5)))
        lamp = np.eye(4)
        lamp[3, 2] = 2.0
        builder.add_light("sphere", lamp, color=(1, 1, 1), radius=0.0)
        pixels.append(seen_from_above(builder, depth=2, height=3.0))
    assert np.all(pixels[0] > 0.001)
    assert np.allclose(pixels[1] / pixels[0], np.exp(-passes * SIGMA), rtol=1e-4)


@pytest.mark.parametrize("how", ["visibility", "shadow link"])
@pytest.mark.parametrize("ior", [1.0, 1.5])
def test_what_casts_no_shadow_neither_stops_nor_dims_light(ior: float, how: str) -> None:
    """A slab of fog or glass without shadows does not change the light on the floor below."""
    pixels = []
    for sigma in (np.zeros(3) + 1e-6, SIGMA):
        builder = wavecomb.SceneBuilder()
        inside = filled(builder, ior, **absorbing(sigma), nested_priority=1.0)
        box(builder, (-WIDE, -WIDE, 6.0), (WIDE, WIDE, 8.0), inside, name="/Slab")
        slab(builder, -1.0, 0.0, builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5)))
        more = {}
        if how == "visibility":
            builder.add_visibility("/Slab", {"shadow": False})
        else:
            rules = {"/": "expand", "/Slab": "exclude"}
            more["shadow_link"] = builder.add_geometry_set(rules)
        builder.add_light("distant", np.eye(4), color=(1, 1, 1), angle=0.0, **more)
        pixels.append(seen_from_above(builder, depth=1))
    assert np.all(pixels[0] > 0.01)
    assert np.allclose(pixels[1], pixels[0], rtol=1e-4)


def test_shadow_rays_meet_bounds_close_behind_a_cut_out() -> None:
    """A slab still dims light that passes a card of opacity 1/2 close below the slab."""
    pixels = []
    for sigma in (np.zeros(3) + 1e-6, SIGMA):
        builder = wavecomb.SceneBuilder()
        slab(builder, 6.0, 8.0, filled(builder, 1.0, **absorbing(sigma)))
        floor = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
        slab(builder, -1.0, 0.0, floor)
        half = builder.add_material("diffuse", base_color=(0, 0, 0), opacity=0.5, presence=True)
        corners = [(x * WIDE, y * WIDE, 5.9997) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
        card = builder.add_mesh(np.array(corners, np.float32), faces, material=half)
        builder.add_to_group(0, card)
        builder.add_light("distant", np.eye(4), color=(1, 1, 1), angle=0.0)
        pixels.append(seen_from_above(builder, depth=1, spp=64).mean(0))
    assert np.all(pixels[0] > 0.01)
    assert np.allclose(pixels[1] / pixels[0], np.exp(-2.0 * SIGMA), rtol=1e-3)


@pytest.mark.parametrize(
    ("ior", "roughness", "anisotropy"), [(1.0, 0.0, 0.6), (1.5, 0.0, 0.0), (1.4, 0.0, -0.5)]
)
def test_white_media_lose_nothing(ior: float, roughness: float, anisotropy: float) -> None:
    """A furnace test of albedo 1, with mean free paths that differ by channel."""
    builder = wavecomb.SceneBuilder()
    layers = {
        "transmission_depth": 0.5,
        "transmission_scatter": (0.5, 1.0, 2.0),
        "transmission_color": tuple(np.exp(-np.array((0.5, 1.0, 2.0)))),
        "transmission_scatter_anisotropy": anisotropy,
    }
    mesh = ball(1.0, 8)
    material = filled(builder, ior, roughness, **layers)
    number = builder.add_mesh(mesh.points, mesh.faces.astype(np.uint32), material=material)
    builder.add_to_group(0, number)
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    seen = seen_from_above(builder, spp=64, size=24, depth=100, roulette="off")
    error = seen.std(axis=0) / np.sqrt(len(seen))
    assert np.all(error < 0.006)
    assert np.all(np.abs(seen.mean(axis=0) - 1.0) < 0.001 + 3.5 * error)


def box_of_fog(as_mesh: bool, seed: int, **more: Any) -> Any:
    """Returns a box of fog with a light in it over a floor, as a mesh or as a volume."""
    builder = wavecomb.SceneBuilder()
    scattering, absorption = np.array([0.8, 0.5, 0.3]), np.array([0.1, 0.3, 0.2])
    low, high = (-1.5, -1.0, -1.5), (1.5, 1.0, 1.5)
    if as_mesh:
        layers = {
            **absorbing(scattering + absorption),
            "transmission_scatter": tuple(scattering),
            "transmission_scatter_anisotropy": 0.4,
        }
        box(builder, low, high, filled(builder, 1.0, **layers))
    else:
        extinction = scattering + absorption
        builder.add_volume(
            np.eye(4),
            bounds=(low, high),
            extinction=tuple(extinction),
            albedo=tuple(scattering / extinction),
            anisotropy=0.4,
        )
    slab(builder, -2.0, -1.6, builder.add_material("diffuse", base_color=(0.5, 0.6, 0.7)))
    lamp = np.eye(4)
    lamp[3, :3] = (0.4, 0.3, 0.2)
    builder.add_light("sphere", lamp, color=(20, 18, 15), radius=0.15)
    builder.add_light("dome", np.eye(4), color=(0.3, 0.3, 0.4))
    return seen_from_above(builder, spp=64, size=16, depth=6, seed=seed, **more).mean(axis=0)


@pytest.mark.parametrize("equiangular", ["off", "on"])
def test_fog_in_a_mesh_is_fog(equiangular: str) -> None:
    """A mesh filled with fog renders like a volume with the same coefficients."""
    mesh = np.array([box_of_fog(True, seed, equiangular=equiangular) for seed in range(8)])
    volume = np.array([box_of_fog(False, seed) for seed in range(8, 16)])
    error = np.sqrt(mesh.var(axis=0, ddof=1) / 8 + volume.var(axis=0, ddof=1) / 8)
    assert np.all(error < 0.015 * volume.mean(axis=0))
    assert np.all(np.abs(mesh.mean(axis=0) - volume.mean(axis=0)) < 4.0 * error)


def thin_fog(as_mesh: bool, seed: int, x: float = 3.0, **more: Any) -> Any:
    """Renders a light in thin fog from outside. The fog is a mesh or a volume."""
    builder = wavecomb.SceneBuilder()
    sigma = np.full(3, 0.05)
    low, high = (-2.0, -2.0, -2.0), (2.0, 2.0, 2.0)
    if as_mesh:
        layers = {**absorbing(sigma), "transmission_scatter": tuple(sigma)}
        box(builder, low, high, filled(builder, 1.0, **layers))
    else:
        builder.add_volume(np.eye(4), bounds=(low, high), extinction=tuple(sigma), albedo=(1, 1, 1))
    lamp = np.eye(4)
    lamp[3, 0] = x
    builder.add_light("sphere", lamp, color=(20, 18, 15), radius=0.02, visible=False)
    return seen_from_above(builder, spp=32, size=16, seed=seed, **more)


def test_fog_in_a_mesh_has_no_more_noise() -> None:
    """The noise equals the noise of a volume, since free-flight samples are well distributed."""
    mesh, volume = (
        np.array([thin_fog(as_mesh, seed, depth=4) for seed in range(8)])
        for as_mesh in (True, False)
    )
    ratio = mesh.var(axis=0, ddof=1).mean() / volume.var(axis=0, ddof=1).mean()
    assert np.allclose(mesh.mean(axis=(0, 1)), volume.mean(axis=(0, 1)), rtol=0.05)
    assert ratio < 1.3


def scattered_once(x: float) -> float:
    """Returns the mean image of single scattering in ``thin_fog``, for a light of radiance 1.

    Integrates over fog points by their distance and direction from the light (radius 0.02), so that
    the squared distance cancels.
    """
    sigma, radius, most, rng = 0.05, 0.02, 3.0, np.random.default_rng(1)
    d, c, turn = rng.random((3, 2_000_000)) * [[most], [2.0], [2.0 * np.pi]]
    c -= 1.0
    across, z = d * np.sqrt(1.0 - c * c), d * c
    seen = (abs(x + across * np.cos(turn)) < 1) & (abs(across * np.sin(turn)) < 1) & (abs(z) < 2)
    light = seen * sigma / (4 * np.pi) * np.exp(-sigma * (2.0 - z + d)) * np.pi * radius**2
    return float(light.mean() * most * 4 * np.pi / 4.0)


@pytest.mark.slow
def test_lamps_draw_distances_in_meshes() -> None:
    """Single scattering from a visible light in thin fog, against a closed form."""
    pictures = [thin_fog(True, seed, 0.3, depth=1, equiangular="on") for seed in range(100)]
    means = np.array(pictures).mean(axis=1) / (np.array([20, 18, 15]) * scattered_once(0.3))
    error = means.std(axis=0, ddof=1) / 10.0
    assert np.all(error < 0.01)  # 0.015 without equiangular sampling
    assert np.all(np.abs(means.mean(axis=0) - 1.0) < 3.5 * error)


def scene(hidden: bool = False) -> Any:
    """Returns a glass with a cloudy liquid that overlaps its walls, fog around it, and a floor."""
    builder = wavecomb.SceneBuilder()
    glass = filled(builder, 1.5, nested_priority=1.0)
    juice = filled(
        builder, 1.33, transmission_color=(0.9, 0.5, 0.2), transmission_depth=0.6,
        transmission_scatter=(0.6, 0.5, 0.3), transmission_scatter_anisotropy=0.3,
    )  # fmt: skip
    fog = filled(
        builder, 1.0, transmission_color=(0.8, 0.7, 0.6), transmission_depth=3.0,
        transmission_scatter=(0.2, 0.3, 0.4),
    )  # fmt: skip
    box(builder, (-4, -1.2, -9), (4, 3, -3), fog, name="/Fog")
    for low, high in (((-0.6, -1, -6), (0.6, -0.85, -4.8)), ((-0.6, -1, -6), (-0.45, 1, -4.8)),
                      ((0.45, -1, -6), (0.6, 1, -4.8))):  # fmt: skip
        box(builder, low, high, glass)
    box(builder, (-0.5, -0.9, -5.9), (0.5, 0.6, -4.9), juice)
    cherry = builder.add_material("diffuse", base_color=(0.7, 0.05, 0.05))
    box(builder, (-0.1, -0.2, -5.5), (0.1, 0.0, -5.3), cherry)
    rough = filled(builder, 1.4, 0.3, **absorbing((0.2, 1.0, 2.0)))
    box(builder, (1.0, -1.1, -6), (1.8, 0.0, -5), rough, name="/Rough")
    grey = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
    box(builder, (-5, -1.3, -9), (5, -1.1, -2), grey)
    lamp = np.eye(4)
    lamp[3, :3] = (1.5, 2.2, -4.0)
    link = {}
    if hidden:
        builder.add_visibility("/Fog", {"bounces": False})
        link["shadow_link"] = builder.add_geometry_set({"/": "expand", "/Rough": "exclude"})
    builder.add_light("sphere", lamp, color=(30, 28, 25), radius=0.4, **link)
    builder.add_light("dome", np.eye(4), color=(0.2, 0.25, 0.3))
    builder.set_camera(np.eye(4), window=(-0.45, 0.45, -0.3, 0.3))
    return builder.build()


@pytest.mark.parametrize(("equiangular", "hidden"), [("off", False), ("on", False), ("off", True)])
def test_one_picture_for_all_schedules(equiangular: str, hidden: bool) -> None:
    """All lane widths, waves, threads, policies, packets and the reference integrator give the same
    bits.
    """
    made = scene(hidden)

    def render(**settings: Any) -> Any:
        settings |= {"spp": 4, "max_depth": 6, "equiangular": equiangular}
        return wavecomb.render(made, size=(45, 30), **settings)

    first = render()
    assert first.stats["counts"]["walk_steps"] > 1000
    for other in (
        {"integrator": "reference"},
        {"lanes": 1},
        {"wave_size": 256},
        {"wave_size": 1024, "threads": 2},
        {"policy": "material"},
        {"ray_order": "morton-octant"},
    ):
        assert np.array_equal(render(**other).beauty, first.beauty), other


def test_transport_light_says_that_it_has_none() -> None:
    """Light paths are refused in one line that names the reason."""
    with pytest.raises(ValueError, match="media inside of meshes"):
        wavecomb.render(scene(), size=(8, 8), spp=1, transport="light")


FOG = """#usda 1.0
(
    metersPerUnit = 0.5
    upAxis = "Y"
)
def Cube "Fog" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    double size = 2
    rel material:binding = </M>
}
def Material "M"
{
    token outputs:mtlx:volume.connect = </M/Volume.outputs:out>
    def Shader "Volume"
    {
        uniform token info:id = "ND_volume"
        token inputs:vdf.connect = </M/Vdf.outputs:out>
        token outputs:out
    }
    def Shader "Vdf"
    {
        uniform token info:id = "ND_absorption_vdf"
        vector3f inputs:absorption = (0.6, 1.4, 2.2)
        token outputs:out
    }
}
def DomeLight "Sky"
{
}
def Camera "Camera"
{
    token projection = "orthographic"
    float horizontalAperture = 10
    float verticalAperture = 10
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_a_volume_terminal_fills_a_mesh(tmp_path: Path) -> None:
    """Coefficients are per metre, and a scene unit of this stage is half a metre."""
    file = tmp_path / "fog.usda"
    file.write_text(FOG)
    stage = wavecomb.load(file, camera="/Camera")
    picture = wavecomb.render(stage, size=(8, 8), spp=4, filter="box")
    assert np.allclose(picture.beauty, np.exp(-2.0 * SIGMA), rtol=1e-4)


LIQUID = """#usda 1.0
def Cube "Liquid" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </M>
}
def Material "M"
{
    token outputs:mtlx:surface.connect = </M/S.outputs:out>
    def Shader "S"
    {
        uniform token info:id = "ND_standard_surface_surfaceshader"
        float inputs:transmission = 1
        color3f inputs:transmission_color = (0.5, 0.6, 0.7)
        float inputs:transmission_depth = 2
        color3f inputs:transmission_scatter = (0.1, 0.2, 0.3)
        float inputs:transmission_scatter_anisotropy = 0.25
        int inputs:dielectric_priority = 3
        token outputs:out
    }
}
"""


def test_a_stage_says_what_is_inside(tmp_path: Path) -> None:
    """Scattering, its anisotropy and the nesting priority of standard_surface are read."""
    from usd_recorder import load, said

    scene, loaded = load(tmp_path, LIQUID)
    layers = next(m["openpbr"] for m in scene.materials if m.get("openpbr"))
    assert layers["transmission_scatter"] == pytest.approx((0.1, 0.2, 0.3))
    assert layers["transmission_scatter_anisotropy"] == 0.25
    assert layers["nested_priority"] == 3
    assert "transmission" not in said(loaded) and "priority" not in said(loaded)


def test_what_volumes_miss_in_cloudy_glass_is_said(tmp_path: Path) -> None:
    """If there are volumes, a warning says that light scattered in cloudy glass ignores them."""
    from usd_recorder import load, said

    volume = 'def Volume "V" { float3[] extent = [(-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)] }\n'
    what = "light scattered there ignores them"
    scene, loaded = load(tmp_path, LIQUID + volume)
    assert scene.volumes and f"{what}: /M" in said(loaded).replace(" at ", ": ")
    clear = LIQUID.replace("(0.1, 0.2, 0.3)", "(0, 0, 0)")
    for text in (LIQUID, clear + volume):
        assert what not in said(load(tmp_path, text)[1])


def stone_in_glass(layers: dict[str, Any], low: float = -1.5) -> Any:
    """Returns glass from z = -2 to 1 and an emissive block whose bottom is at z = ``low``."""
    builder = wavecomb.SceneBuilder()
    slab(builder, -2.0, 1.0, filled(builder, 1.5, **layers))
    glow = builder.add_material("emissive", emission=(1.0, 2.0, 3.0))
    box(builder, (-1.5, -1.5, low), (1.5, 1.5, low + 0.5), glow)
    return builder


def test_what_lies_in_absorbing_glass_is_dimmed() -> None:
    """Light from a block inside the glass is dimmed by exp(-sigma t) on its way to the surface."""
    clear = seen_from_above(stone_in_glass({}), spp=16)
    tinted = seen_from_above(stone_in_glass(absorbing(SIGMA)), spp=16)
    assert clear.mean() > 0.5
    assert np.allclose(tinted.mean(0) / clear.mean(0), np.exp(-2 * SIGMA), rtol=1e-3)


def lit_stone(seed: int, as_volume: bool) -> Any:
    """Renders a grey block in absorbing rough glass, or in clear glass filled with a volume."""
    builder = wavecomb.SceneBuilder()
    low, high = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
    box(builder, low, high, filled(builder, 1.5, 0.4, **({} if as_volume else absorbing(SIGMA))))
    if as_volume:
        sigma = tuple(float(s) for s in SIGMA)
        bounds = (tuple(0.9999 * x for x in low), tuple(0.9999 * x for x in high))
        builder.add_volume(np.eye(4), bounds=bounds, extinction=sigma, albedo=(0, 0, 0))
    grey = builder.add_material("diffuse", base_color=(0.8, 0.8, 0.8))
    box(builder, (-0.4, -0.4, -0.3), (0.4, 0.4, 0.4), grey)
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    return seen_from_above(builder, spp=64, size=16, seed=seed, roulette="off").mean(axis=0)


def test_a_stone_in_absorbing_glass_is_one_in_an_absorbing_volume() -> None:
    """Absorption also applies to ray segments that end at an object inside the glass."""
    mesh = np.array([lit_stone(seed, False) for seed in range(8)])
    volume = np.array([lit_stone(seed, True) for seed in range(8, 16)])
    error = np.sqrt(mesh.var(axis=0, ddof=1) / 8 + volume.var(axis=0, ddof=1) / 8)
    assert np.all(error < 0.01 * volume.mean(axis=0))
    assert np.all(np.abs(mesh.mean(axis=0) - volume.mean(axis=0)) < 4.0 * error)


def refuses_light_paths(builder: Any) -> bool:
    """Returns whether light paths are refused, because absorbing glass contains objects."""
    camera = np.eye(4)
    camera[3, 2] = 5.0
    builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
    scene = builder.build()
    wavecomb.render(scene, size=(4, 4), spp=1)
    try:
        wavecomb.render(scene, size=(4, 4), spp=1, transport="light")
    except _core.Error as error:
        assert "objects inside of absorbing glass" in str(error)
        return True
    return False


@pytest.mark.parametrize(("low", "refused"), [(-1.5, True), (-2.5, False), (-2.2, True)])
def test_light_paths_do_not_go_with_objects_in_absorbing_glass(low: float, refused: bool) -> None:
    """Light paths are refused if an object is inside the glass or reaches into the glass."""
    assert refuses_light_paths(stone_in_glass(absorbing(SIGMA), low)) == refused
    assert not refuses_light_paths(stone_in_glass({}, low))


def glass_ball(builder: Any, inwards: bool = False, radius: float = 1.0, **layers: Any) -> int:
    """Adds a ball of absorbing glass around the origin; ``inwards`` flips its faces."""
    mesh = ball(radius, 24)
    faces = mesh.faces.astype(np.uint32)
    material = filled(builder, 1.5, **{**absorbing(SIGMA), **layers})
    number = builder.add_mesh(mesh.points, faces[:, ::-1].copy() if inwards else faces,
                              material=material)  # fmt: skip
    return int(number)


def quad(builder: Any, z: float, half: float) -> None:
    corners = [(x * half, y * half, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    grey = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
    builder.add_to_group(0, builder.add_mesh(np.array(corners, np.float32), faces, material=grey))


@pytest.mark.parametrize(
    ("z", "refused"), [(-0.9, True), (-1.0, False), (-1.1, False), (0.3, True)]
)
def test_a_ball_that_is_sunk_into_a_floor_holds_a_part_of_it(z: float, refused: bool) -> None:
    """The floor intersects the glass, although none of its vertices is inside."""
    builder = wavecomb.SceneBuilder()
    builder.add_to_group(0, glass_ball(builder))
    quad(builder, z, 50.0)
    assert refuses_light_paths(builder) == refused


@pytest.mark.parametrize(("hollow", "refused"), [(False, True), (True, False)])
def test_what_is_in_a_hollow_is_not_in_the_glass(hollow: bool, refused: bool) -> None:
    builder = wavecomb.SceneBuilder()
    builder.add_to_group(0, glass_ball(builder))
    if hollow:
        builder.add_to_group(0, glass_ball(builder, True, 0.9))
    quad(builder, 0.0, 0.5)
    assert refuses_light_paths(builder) == refused


@pytest.mark.parametrize(
    ("kind", "refused"), [("dome", False), ("distant", False), ("sphere", True)]
)
def test_lights_in_absorbing_glass(kind: str, refused: bool) -> None:
    """Lights without a position are never inside glass."""
    builder = wavecomb.SceneBuilder()
    builder.add_to_group(0, glass_ball(builder))
    builder.add_light(kind, np.eye(4), color=(1, 1, 1), **({"radius": 0.1} if refused else {}))
    assert refuses_light_paths(builder) == refused


def test_placed_glass_holds_what_is_inside_of_it() -> None:
    """The glass is a moved, scaled and mirrored instance, and the floor is beside it or in it."""
    for z, refused in ((0.0, False), (2.2, True)):
        builder = wavecomb.SceneBuilder()
        group = builder.add_group()
        builder.add_to_group(group, glass_ball(builder))
        place = np.diag([-2.0, 1.0, 0.5, 1.0])
        place[3, :3] = (30.0, 0.0, 2.0)
        builder.add_instances(0, group, place[None].astype(np.float32))
        quad(builder, z, 50.0)
        assert refuses_light_paths(builder) == refused


@pytest.mark.slow
def test_a_search_in_many_meshes_takes_no_time() -> None:
    """The search is fast with thousands of glasses and objects on a large floor."""
    import time

    def seconds(layers: dict[str, Any]) -> float:
        builder = wavecomb.SceneBuilder()
        glass, stone = builder.add_group(), builder.add_group()
        mesh = ball(0.4, 48)
        faces = mesh.faces.astype(np.uint32)
        for group, material in (
            (glass, filled(builder, 1.5, **layers)),
            (stone, builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))),
        ):
            number = builder.add_mesh(mesh.points, faces, material=material)
            builder.add_to_group(group, number)
        places = np.tile(np.eye(4, dtype=np.float32), (20_000, 1, 1))
        places[:, 3, 0], places[:, 3, 1] = np.arange(20_000) % 200, np.arange(20_000) // 200
        builder.add_instances(0, glass, places[::2])
        builder.add_instances(0, stone, places[1::2])
        x, y = np.meshgrid(np.linspace(-5, 205, 300), np.linspace(-5, 205, 300), indexing="ij")
        points = np.stack([x, y, np.full_like(x, -0.5)], axis=-1).reshape(-1, 3)
        at = np.arange(300 * 300).reshape(300, 300)
        corners = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], -1).reshape(-1, 4)
        faces = np.concatenate([corners[:, :3], corners[:, [0, 2, 3]]]).astype(np.uint32)
        floor = builder.add_mesh(points.astype(np.float32), faces, material=0)
        builder.add_to_group(0, floor)
        begin = time.process_time()
        camera = np.eye(4)
        camera[3, 2] = 5.0
        builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
        scene = builder.build()
        spent = time.process_time() - begin
        wavecomb.render(scene, size=(4, 4), spp=1, transport="light")
        return spent

    seconds({})
    plain, searched = seconds({}), seconds(absorbing(SIGMA))
    print(f"{plain:.3f} s, {searched:.3f} s with absorbing glass")
    assert searched < plain + 1.0
