# SPDX-License-Identifier: Apache-2.0
"""Tests subsurface random walks: colours of walls, closed forms, furnaces and schedules."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss, legval

import wavecomb
from wavecomb import _core
from wavecomb.scenes.caustics import ball

FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
    np.uint32,
)


def box(builder: Any, low: Any, high: Any, material: int, name: str = "") -> None:
    """Adds a closed box."""
    ends = np.array([low, high], np.float32)
    corners = [[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    mesh = builder.add_mesh(np.array(corners, np.float32), FACES, material=material, name=name)
    builder.add_to_group(0, mesh)


def skin(builder: Any, **values: Any) -> int:
    """Returns a material with subsurface weight 1 that all light enters."""
    layers = {"subsurface_weight": 1.0, "specular_weight": 0.0, "subsurface_radius": (1, 1, 1)}
    return int(builder.add_material("openpbr", openpbr={**layers, **values}))


def slab(depth: float, spp: int = 64, size: int = 24, **values: Any) -> Any:
    """Returns the pixels of a wide slab seen from above, under uniform light of radiance 1."""
    builder = wavecomb.SceneBuilder()
    half = 400.0
    box(builder, (-half, -half, -depth), (half, half, 0.0), skin(builder, **values))
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    camera = np.eye(4)
    camera[3, 2] = 5.0
    builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
    settings = _core.Settings(
        width=size, height=size, spp=spp, max_depth=2, filter="box", filter_width=1.0
    )
    result = _core.render(builder.build(), settings, None, None, None)
    return result.beauty.reshape(-1, 3).astype(np.float64)


def chandrasekhar(albedo: float) -> float:
    """Returns 1 - 2 sqrt(1 - a) int mu H(mu) dmu, the albedo of an isotropic half-space."""
    nodes, weights = leggauss(64)
    mu, w = 0.5 * (nodes + 1), 0.5 * weights
    h = np.ones_like(mu)
    for _ in range(2000):
        inner = (w * mu * h)[None, :] / (mu[:, None] + mu[None, :])
        h = 1 / (np.sqrt(1 - albedo) + 0.5 * albedo * inner.sum(axis=1))
    return float(1 - 2 * np.sqrt(1 - albedo) * (w * mu * h).sum())


def color_of(albedo: float, anisotropy: float, n: int = 20) -> float:
    """Returns the albedo of a half-space by adding and doubling (van de Hulst 1980).

    Uses intensities at Gaussian cosines, averaged over azimuths, and the Henyey-Greenstein phase
    function as a Legendre series.
    """
    nodes, weights = leggauss(n)
    mu, w = 0.5 * (nodes + 1), 0.5 * weights
    orders = np.arange(2 * n - 1)
    up, down = (np.array([legval(x, [0.0] * k + [1.0]) for k in orders]) for x in (mu, -mu))
    moments = ((2 * orders + 1) * anisotropy**orders)[:, None]
    thin = 1e-5
    once = 0.5 * albedo * thin * w[None] / mu[:, None]
    back = once * ((moments * up).T @ down)
    through = np.diag(1 - thin / mu) + once * ((moments * up).T @ up)
    for _ in range(40):
        between = through @ np.linalg.inv(np.eye(n) - back @ back)
        back, through = back + between @ back @ through, between @ through
    return float(2 * (w * mu * back.sum(axis=1)).sum())


def test_a_half_space_is_chandrasekhars() -> None:
    """The albedo of a half-space with isotropic scattering is exact within 0.5 % and noise."""
    colors = (0.3, 0.6, 0.9)
    seen = slab(200.0, spp=256, subsurface_color=colors)
    for channel, color in enumerate(colors):
        exact = chandrasekhar(_core.walk_albedo(color, 0.0))
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / np.sqrt(len(seen))
        assert abs(mean - exact) < 0.005 * exact + 3.5 * error
        assert error < 0.005


@pytest.mark.parametrize("anisotropy", [-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9])
def test_the_albedo_of_a_collision_gives_the_colour(anisotropy: float) -> None:
    """The colour is within 0.5 % of adding and doubling for a half-space."""
    for color in (0.02, 0.1, 0.3, 0.6, 0.85, 0.97):
        found = color_of(_core.walk_albedo(color, anisotropy), anisotropy)
        assert abs(found - color) < 0.005 * color


def test_adding_and_doubling_is_chandrasekhars() -> None:
    """Adding-doubling and Chandrasekhar's formula agree for isotropic scattering."""
    for albedo in (0.3, 0.9, 0.99):
        assert abs(color_of(albedo, 0.0) - chandrasekhar(albedo)) < 1e-4


@pytest.mark.parametrize("anisotropy", [0.0, 0.3, 0.6, -0.3, -0.6])
def test_a_flat_wall_has_the_colour_asked_for(anisotropy: float) -> None:
    """The colour of a flat wall is the requested one within 1 % and noise."""
    colors = (0.2, 0.5, 0.85)
    seen = slab(300.0, spp=192, subsurface_color=colors, subsurface_anisotropy=anisotropy)
    for channel, color in enumerate(colors):
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / np.sqrt(len(seen))
        assert abs(mean - color) < 0.01 * color + 3.5 * error


@pytest.mark.parametrize("depth", [0.5, 3.0])
def test_white_walks_lose_nothing(depth: float) -> None:
    """A furnace test of colour 1, with mean free paths that differ by channel, within 0.5 %."""
    seen = slab(
        depth, spp=256, subsurface_color=(1, 1, 1), subsurface_radius=(2.0, 1.0, 0.25),
        subsurface_anisotropy=0.3,
    )  # fmt: skip
    for channel in range(3):
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / np.sqrt(len(seen))
        assert abs(mean - 1.0) < 0.005 + 3.5 * error
        assert error < 0.01


def test_a_clear_slab_shows_what_lies_below() -> None:
    """All light of a clear slab comes from the floor below it."""
    builder = wavecomb.SceneBuilder()
    thin = skin(builder, subsurface_color=(0.5, 0.5, 0.5), subsurface_radius=(1e4, 1e4, 1e4))
    box(builder, (-40, -40, -0.01), (40, 40, 0.0), thin)
    floor = builder.add_material("emissive", emission=(1.0, 2.0, 3.0))
    box(builder, (-400, -400, -2.0), (400, 400, -1.0), floor)
    camera = np.eye(4)
    camera[3, 2] = 5.0
    builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
    settings = _core.Settings(width=16, height=16, spp=64, max_depth=3, filter="box")
    seen = _core.render(builder.build(), settings, None, None, None).beauty.reshape(-1, 3)
    # The exit point is a white Lambertian surface above a floor of uniform radiance, so it has the
    # floor's radiance.
    assert np.allclose(seen.mean(axis=0), (1.0, 2.0, 3.0), rtol=0.01)


def third_exponential_integral(x: float) -> float:
    """Returns the exponential integral E_3(x) = int_0^1 mu exp(-x / mu) dmu."""
    nodes, weights = leggauss(96)
    mu, w = 0.5 * (nodes + 1), 0.5 * weights
    return float((w * mu * np.exp(-x / mu)).sum())


def test_a_black_slab_lets_through_what_misses_all_collisions() -> None:
    """The transmittance for uniform light is 2 E_3(optical depth), within 0.5 % and noise."""
    radius = (1.0, 0.6, 0.3)
    depth = 0.5
    seen = slab(depth, spp=512, subsurface_color=(0, 0, 0), subsurface_radius=radius)
    for channel, free_path in enumerate(radius):
        exact = 2.0 * third_exponential_integral(depth / free_path)
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / np.sqrt(len(seen))
        assert abs(mean - exact) < 0.005 * exact + 3.5 * error
        assert error < 0.01


def add_ball(builder: Any, radius: float, material: int) -> None:
    """Adds a finely tessellated sphere."""
    mesh = ball(radius, 48)
    number = builder.add_mesh(mesh.points, mesh.faces.astype(np.uint32), material=material)
    builder.add_to_group(0, number)


@pytest.mark.slow
def test_a_black_sphere_lets_through_what_misses_all_collisions() -> None:
    """Chords of a sphere in uniform light have the density l / (2 R^2)."""
    radius, free_paths = 1.0, (2.0, 1.0, 0.5)
    builder = wavecomb.SceneBuilder()
    material = skin(builder, subsurface_color=(0, 0, 0), subsurface_radius=free_paths)
    add_ball(builder, radius, material)
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    camera = np.eye(4)
    camera[3, 2] = 5.0
    builder.set_camera(camera, projection="orthographic", window=(-0.5, 0.5, -0.5, 0.5))
    settings = _core.Settings(width=24, height=24, spp=256, max_depth=2, filter="box")
    pixels = _core.render(builder.build(), settings, None, None, None).beauty.reshape(-1, 3)
    for channel, free_path in enumerate(free_paths):
        x = 2.0 * radius / free_path
        exact = 2.0 * (1.0 - (1.0 + x) * np.exp(-x)) / x**2
        seen = pixels[:, channel].astype(np.float64)
        mean, error = seen.mean(), seen.std() / np.sqrt(len(seen))
        assert abs(mean - exact) < 0.005 * exact + 3.5 * error


def scene(bounces_see_all: bool = True) -> Any:
    """Returns a box of coated skin with a second box inside, a floor, a light and a sky."""
    builder = wavecomb.SceneBuilder()
    values = {
        "subsurface_color": (0.9, 0.5, 0.3),
        "subsurface_radius": (0.3, 0.1, 0.05),
        "subsurface_weight": 0.8,
        "specular_weight": 1.0,
        "subsurface_anisotropy": 0.4,
    }
    box(builder, (-1, -1, -6), (1, 0.5, -4.5), skin(builder, **values))
    inner = builder.add_material("diffuse", base_color=(0.1, 0.8, 0.1))
    box(builder, (-0.2, -0.4, -5.4), (0.2, 0.0, -5.0), inner, "/Inner")
    wax = skin(builder, subsurface_color=(0.95, 0.9, 0.7), subsurface_radius=(0.5, 0.4, 0.2))
    box(builder, (1.2, -1, -6), (1.5, 1.0, -5.5), wax)
    if not bounces_see_all:
        builder.add_visibility("/Inner", {"bounces": False})
    grey = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
    box(builder, (-5, -1.2, -9), (5, -1.0, -2), grey)
    lamp = np.eye(4)
    lamp[3, :3] = (1.5, 2.5, -4.0)
    builder.add_light("sphere", lamp, color=(30, 28, 25), radius=0.4)
    builder.add_light("dome", np.eye(4), color=(0.2, 0.25, 0.3))
    builder.set_camera(np.eye(4), window=(-0.45, 0.45, -0.3, 0.3))
    return builder.build()


def test_one_picture_for_all_schedules() -> None:
    """Lanes, waves, threads, policies, packets and the reference integrator give the same bits."""
    made = scene()

    def render(**settings: Any) -> Any:
        return wavecomb.render(made, size=(45, 30), spp=4, max_depth=6, **settings)

    first = render()
    counts = first.stats["counts"]
    assert counts["walks"] > 100 and counts["walk_steps"] > 2 * counts["walks"]
    for other in (
        {"integrator": "reference"},
        {"lanes": 1},
        {"wave_size": 256},
        {"wave_size": 1024, "threads": 2},
        {"policy": "material"},
        {"ray_order": "morton-octant"},
    ):
        assert np.array_equal(render(**other).beauty, first.beauty), other


def test_walks_see_what_bounces_see() -> None:
    """Objects that are invisible to bounces are invisible to random walks, in both integrators."""
    made = scene(bounces_see_all=False)
    waves = wavecomb.render(made, size=(45, 30), spp=4, max_depth=6)
    alone = wavecomb.render(made, size=(45, 30), spp=4, max_depth=6, integrator="reference")
    assert np.array_equal(waves.beauty, alone.beauty)
    steps = waves.stats["counts"]["walk_steps"]
    assert steps == alone.stats["counts"]["walk_steps"] > 0


def test_guided_bounces_keep_the_mean() -> None:
    """Guiding is trained on exits of random walks as on other diffuse vertices."""
    made = scene()

    def mean(guiding: str, seed: int) -> Any:
        picture = wavecomb.render(
            made, size=(30, 20), spp=64, max_depth=5, seed=seed, guiding=guiding, filter="box"
        )
        return np.asarray(picture.beauty, np.float64).mean(axis=(0, 1))

    off = np.array([mean("off", seed) for seed in range(6)])
    on = np.array([mean("on", seed) for seed in range(6, 12)])
    error = np.sqrt(off.var(axis=0, ddof=1) / 6 + on.var(axis=0, ddof=1) / 6)
    assert np.all(np.abs(off.mean(axis=0) - on.mean(axis=0)) < 4.5 * error)


def test_lanes_stay_full() -> None:
    """When a random walk ends, another walk takes its SIMD lane."""
    counts = wavecomb.render(scene(), size=(160, 120), spp=4).stats["counts"]
    assert counts["walk_steps"] > 0.9 * counts["walk_lanes"]


def test_a_radius_that_is_not_finite_is_told() -> None:
    """The error is one line that names the material."""
    builder = wavecomb.SceneBuilder()
    with pytest.raises(ValueError, match=r"skin.*finite"):
        builder.add_material(
            "openpbr", name="skin", openpbr={"subsurface_radius": (float("nan"), 1.0, 1.0)}
        )


def test_what_comes_from_below_has_a_layer() -> None:
    """Subsurface light has a layer, to which diffuse walls do not contribute."""
    seen = []
    for radius in ((1, 1, 1), (0, 0, 0)):
        builder = wavecomb.SceneBuilder()
        material = skin(builder, subsurface_color=(0.8, 0.5, 0.3), subsurface_radius=radius)
        box(builder, (-9, -9, -9), (9, 9, 0), material)
        builder.add_light("dome", np.eye(4), color=(1, 1, 1))
        camera = np.eye(4)
        camera[3, 2] = 5.0
        builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
        layers = {"below": "CW.*", "direct": "CW<RD>L", "rest": "C([^W].*)?L"}
        aovs = [f"lpe:{name}={text}" for name, text in layers.items()]
        settings = _core.Settings(width=16, height=16, spp=16, max_depth=4, aovs=aovs)
        result = _core.render(builder.build(), settings, None, None, None)
        seen.append((result.beauty, {name: result.aovs[f"lpe_{name}"] for name in layers}))
    (wax, walked), (matte, reflected) = seen
    np.testing.assert_allclose(walked["below"], wax, rtol=1e-5)
    assert 0.9 < walked["direct"].mean() / wax.mean() <= 1
    assert not walked["rest"].any()
    np.testing.assert_allclose(reflected["rest"], matte, rtol=1e-5)
    assert not reflected["below"].any()


@pytest.mark.parametrize("instanced", [False, True])
def test_what_lies_within_is_not_met(instanced: bool) -> None:
    """Strands and a mesh inside a subsurface body do not change the image."""

    def picture(filled: bool) -> Any:
        builder = wavecomb.SceneBuilder()
        wax = skin(builder, subsurface_color=(0.8, 0.6, 0.4), subsurface_radius=(0.3, 0.2, 0.1))
        box(builder, (-1, -1, -2), (1, 1, 0), wax)
        if filled:
            dark = builder.add_material("diffuse", base_color=(0.1, 0.1, 0.1))
            group = builder.add_group("inside") if instanced else 0
            ends = np.array([[-0.9, 0, -0.01], [0.9, 0, -0.01]], np.float32)
            strand = builder.add_curves(
                "linear-tube", ends, np.zeros(1, np.uint32), np.full(2, 0.005, np.float32),
                material=dark,
            )  # fmt: skip
            builder.add_to_group(group, strand)
            mesh = builder.add_mesh(
                np.array([[-0.5, -0.5, -0.02], [0.5, -0.5, -0.02], [0, 0.5, -0.02]], np.float32),
                np.array([[0, 1, 2]], np.uint32), material=wax,
            )  # fmt: skip
            builder.add_to_group(group, mesh)
            if instanced:
                builder.add_instances(0, group, np.eye(4)[None])
        place = np.eye(4)
        place[3, 2] = 3.0
        builder.add_light("rect", place, width=2.0, height=2.0, color=(3, 3, 3))
        camera = np.eye(4)
        camera[3, 2] = 5.0
        builder.set_camera(camera, projection="orthographic", window=(-0.5, 0.5, -0.5, 0.5))
        settings = _core.Settings(width=16, height=16, spp=16, max_depth=3)
        return _core.render(builder.build(), settings, None, None, None).beauty

    np.testing.assert_array_equal(picture(True), picture(False))


def lit_ball(builder: Any) -> None:
    """Adds a light beside the object at the origin, and sets a camera."""
    lamp = np.eye(4)
    lamp[3, :3] = (3.0, 2.0, 2.0)
    builder.add_light("sphere", lamp, color=(40, 40, 40), radius=0.5)
    camera = np.eye(4)
    camera[3, 2] = 5.0
    builder.set_camera(camera, projection="orthographic", window=(-1.1, 1.1, -1.1, 1.1))


@pytest.mark.slow
@pytest.mark.parametrize("anisotropy", [0.0, 0.5])
def test_walks_are_a_medium_in_the_same_mesh(anisotropy: float) -> None:
    """Subsurface scattering equals the same medium in a mesh with a diffuse transmission."""
    colors, radii = np.array([0.8, 0.5, 0.3]), np.array([0.5, 0.25, 0.1])

    def walk(builder: Any) -> None:
        material = skin(
            builder, subsurface_color=tuple(colors), subsurface_radius=tuple(radii),
            subsurface_anisotropy=anisotropy,
        )  # fmt: skip
        add_ball(builder, 1.0, material)

    def medium(builder: Any) -> None:
        depth = 0.05
        albedo = np.array([_core.walk_albedo(c, anisotropy) for c in colors])
        layers = {
            "transmission_weight": 1.0,
            "transmission_depth": depth,
            "transmission_color": tuple(np.exp(-depth / radii)),
            "transmission_scatter": tuple(depth * albedo / radii),
            "transmission_scatter_anisotropy": anisotropy,
        }
        fog = builder.add_material(
            "openpbr", ior=1.0, roughness=0.0, metallic=0.0, specular_color=(1, 1, 1),
            openpbr=layers,
        )  # fmt: skip
        sheet = skin(
            builder, subsurface_color=(1, 1, 1), subsurface_anisotropy=1.0,
            thin_walled=True,
        )  # fmt: skip
        add_ball(builder, 1.0, sheet)
        add_ball(builder, 0.999, fog)

    def pictures(add: Any, first_seed: int, depth: int) -> Any:
        builder = wavecomb.SceneBuilder()
        lit_ball(builder)
        add(builder)
        made = builder.build()
        found = []
        for seed in range(6):
            settings = _core.Settings(
                width=12, height=12, spp=128, max_depth=depth, filter="box", filter_width=1.0,
                seed=first_seed + seed,
            )  # fmt: skip
            beauty = _core.render(made, settings, None, None, None).beauty.astype(np.float64)
            found.append(beauty.reshape(3, 4, 3, 4, 3).mean(axis=(1, 3)))
        return np.array(found)

    a, b = pictures(walk, 0, 2), pictures(medium, 100, 400)
    error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 6)
    off = np.abs(a.mean(axis=0) - b.mean(axis=0))
    scale = a.mean()
    # Student's t with ten degrees of freedom, Sidak over 27 means at 1 %: 4.9.
    assert np.all(off < 4.9 * error + 0.005 * scale)
    assert np.median(error) < 0.03 * scale
