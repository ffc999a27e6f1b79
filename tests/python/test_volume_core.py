# SPDX-License-Identifier: Apache-2.0
"""Tests the core's volumes, added by SceneBuilder: closed forms and argument checks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from voxels import bricks

from wavecomb import _core

IDENTITY = np.eye(4)
SIZE = 24


def grid_of(voxels: Any, lo: float, hi: float) -> Any:
    """Returns the voxels of a cube between lo and hi along each axis."""
    step = (hi - lo) / (voxels.shape[0] - 1)
    place = np.diag([step, step, step, 1.0])
    place[3, :3] = lo
    return _core.VolumeGrid(*bricks(voxels), place)


def picture(builder: Any, *, spp: int, depth: int = 1) -> Any:
    """Returns the mean colour along -z from (0, 0, 4) to a wall of radiance 1 at z = -2."""
    wall = builder.add_material("emissive", emission=(1.0, 1.0, 1.0))
    corners = np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], np.float32)
    mesh = builder.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), material=wall)
    builder.add_to_group(0, mesh)
    camera = np.eye(4)
    camera[3, 2] = 4
    builder.set_camera(camera, projection="orthographic", window=(-0.1, 0.1, -0.1, 0.1))
    settings = _core.Settings(
        width=SIZE, height=SIZE, spp=spp, max_depth=depth, filter="box", filter_width=1.0
    )
    result = _core.render(builder.build(), settings, None, None, None)
    return result.beauty.reshape(-1, 3).astype(np.float64)


def test_an_absorbing_box_lets_through_the_exponential() -> None:
    """The transmittance is exp(-sigma x) for each channel, within 0.1 % and the measured noise."""
    builder = _core.SceneBuilder()
    builder.add_volume(
        IDENTITY, bounds=((-1, -1, -0.5), (1, 1, 0.5)), extinction=(0.2, 0.7, 1.4), albedo=(0, 0, 0)
    )
    seen = picture(builder, spp=256)
    for channel, sigma in enumerate((0.2, 0.7, 1.4)):
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / SIZE
        assert abs(mean - math.exp(-sigma)) < 1e-3 * math.exp(-sigma) + 4 * error
        assert error < 2e-3


@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_a_grid_that_grows_along_the_ray(kind: Any) -> None:
    """The transmittance is exp(-optical depth) for a density of 2 z between z = 0 and 1."""
    voxels = np.zeros((16, 16, 16), kind)
    voxels[:] = np.linspace(0.0, 2.0, 16).astype(kind)
    builder = _core.SceneBuilder()
    place = np.eye(4)
    place[3, :3] = (-0.5, -0.5, 0.0)
    builder.add_volume(place, density=grid_of(voxels, 0.0, 1.0), albedo=(0, 0, 0))
    seen = picture(builder, spp=256)
    expected = math.exp(-(1.0 + 2.0 * 0.5 / 15.0))
    mean, error = seen.mean(), seen[:, 0].std() / SIZE
    assert abs(mean - expected) < 1e-3 * expected + 4 * error


def test_emission_and_absorption() -> None:
    """Emission eps per unit adds eps / sigma (1 - exp(-sigma x)) to the attenuated wall."""
    builder = _core.SceneBuilder()
    builder.add_volume(
        IDENTITY,
        bounds=((-1, -1, -1), (1, 1, 0)),
        extinction=(0.5, 1.0, 2.0),
        albedo=(0, 0, 0),
        emission=(0.3, 0.2, 4.0),
    )
    seen = picture(builder, spp=256)
    for channel, (sigma, eps) in enumerate(((0.5, 0.3), (1.0, 0.2), (2.0, 4.0))):
        through = math.exp(-sigma)
        expected = through + eps / sigma * (1.0 - through)
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / SIZE
        assert abs(mean - expected) < 1e-3 * expected + 4 * error


def h_function(albedo: float, mu: float) -> float:
    """Chandrasekhar's H for isotropic scattering (Radiative Transfer, 1950, chapter V)."""
    nodes, weights = leggauss(64)
    x, w = 0.5 * (nodes + 1), 0.5 * weights

    def of(values: Any, h: Any) -> Any:
        inner = (w * x * h)[None, :] / (values[:, None] + x[None, :])
        return 1 / (math.sqrt(1 - albedo) + 0.5 * albedo * inner.sum(axis=1))

    h = np.ones_like(x)
    for _ in range(2000):
        h = of(x, h)
    return float(of(np.array([mu]), h)[0])


def test_an_isotropic_half_space() -> None:
    """Under uniform light, the radiance at normal exit is 1 - sqrt(1 - a) H(1), within 0.1 %."""
    albedos = (0.3, 0.6, 0.9)
    builder = _core.SceneBuilder()
    builder.add_volume(
        IDENTITY, bounds=((-500, -500, -2), (500, 500, 0)), extinction=(30,) * 3, albedo=albedos
    )
    builder.add_light("dome", np.eye(4), color=(1.0, 1.0, 1.0))
    camera = np.eye(4)
    camera[3, 2] = 4
    builder.set_camera(camera, projection="orthographic", window=(-0.1, 0.1, -0.1, 0.1))
    settings = _core.Settings(
        width=SIZE, height=SIZE, spp=512, max_depth=160, filter="box", filter_width=1.0
    )
    result = _core.render(builder.build(), settings, None, None, None)
    seen = result.beauty.reshape(-1, 3).astype(np.float64)
    for channel, albedo in enumerate(albedos):
        exact = 1 - math.sqrt(1 - albedo) * h_function(albedo, 1.0)
        mean, error = seen[:, channel].mean(), seen[:, channel].std() / SIZE
        assert abs(mean - exact) < 1e-3 * exact + 4 * error
        assert error < 1e-3


def test_one_picture_whatever_renders_it() -> None:
    """All integrators, lanes, threads, waves, regions and guiding modes give the same bits."""
    rng = np.random.default_rng(7)
    voxels = np.where(rng.random((16, 16, 16)) < 0.5, 0.0, rng.random((16, 16, 16))) * 4.0
    builder = _core.SceneBuilder()
    place = np.eye(4)
    place[3, :3] = (-0.5, -0.5, -0.5)
    builder.add_volume(
        place, density=grid_of(voxels.astype(np.float16), 0.0, 1.0), albedo=(0.9, 0.8, 0.7),
        extinction=(2.0, 1.0, 0.5), anisotropy=0.4, emission=(0.1, 0.0, 0.2),
    )  # fmt: skip
    builder.add_light("dome", np.eye(4), color=(0.5, 0.6, 0.7))
    camera = np.eye(4)
    camera[3, 2] = 3
    builder.set_camera(camera, window=(-0.25, 0.25, -0.25, 0.25))
    scene = builder.build()

    def beauty(**changes: Any) -> Any:
        base = {"width": 20, "height": 14, "spp": 8, "max_depth": 6, "costs": "model"}
        settings = _core.Settings(**{**base, **changes})
        return _core.render(scene, settings, None, None, None).beauty

    whole = beauty()
    assert whole.max() > 0.3
    for changes in (
        {"integrator": "reference"},
        {"lanes": 1, "threads": 1},
        {"wave_size": 64, "policy": "material"},
        {"roulette": "cost-aware", "integrator": "reference"},
    ):
        expected = beauty(roulette=changes["roulette"]) if "roulette" in changes else whole
        np.testing.assert_array_equal(beauty(**changes), expected)
    part = beauty(region=(5, 3, 15, 11), crop=True)
    np.testing.assert_array_equal(part, whole[3:11, 5:15])


def test_bad_volumes_are_named() -> None:
    """The error is one line that names the volume or the grid."""
    builder = _core.SceneBuilder()
    box = ((-1, -1, -1), (1, 1, 1))
    for bad in (
        {"bounds": box, "extinction": (1.0, -1.0, 1.0)},
        {"bounds": box, "albedo": (1.5, 0.0, 0.0)},
        {"bounds": box, "anisotropy": 1.0},
        {"bounds": box, "emission": (math.nan, 0.0, 0.0)},
        {},
    ):
        with pytest.raises(_core.Error, match="volume '/fog'") as caught:
            builder.add_volume(IDENTITY, name="/fog", **bad)
        assert "\n" not in str(caught.value)
    origins, values = bricks(np.full((8, 8, 8), math.inf, np.float32))
    with pytest.raises(_core.Error, match=r"grid 'density'.*not finite"):
        _core.VolumeGrid(origins, values, IDENTITY, 0.0, "density")
    with pytest.raises(_core.Error, match="float16 or float32"):
        _core.VolumeGrid(origins, values.astype(np.float64), IDENTITY)
    with pytest.raises(_core.Error, match=r"\(n, 8, 8, 8\)"):
        _core.VolumeGrid(origins, values[:, :7], IDENTITY)
    with pytest.raises(_core.Error, match="program 'volume'"):
        builder.add_material("volume")


def test_volumes_are_in_the_fingerprint() -> None:
    """Another density changes the fingerprint of the scene."""

    def scene(value: float) -> Any:
        builder = _core.SceneBuilder()
        voxels = np.full((8, 8, 8), value, np.float32)
        builder.add_volume(IDENTITY, density=grid_of(voxels, 0.0, 1.0), name="/smoke")
        return builder.build()

    one, other = scene(1.0), scene(2.0)
    assert one.volumes == ["/smoke"]
    assert one.fingerprint() == scene(1.0).fingerprint()
    assert one.fingerprint()["geometry"] != other.fingerprint()["geometry"]
