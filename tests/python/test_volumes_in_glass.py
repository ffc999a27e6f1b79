# SPDX-License-Identifier: Apache-2.0
"""Tests volumes inside glass: closed forms, and equal images for all schedules."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from parts import needs
from test_interiors import LIGHT, SIGMA, absorbing, filled, seen_from_above, shining_floor, slab

import wavecomb
from wavecomb import _core
from wavecomb.scenes.caustics import ball

pytestmark = needs("wavecomb._core")

DENSE = np.array([0.4, 0.8, 1.2])


def smoke(builder: Any, low: float, high: float, **more: Any) -> None:
    """Adds a homogeneous volume between two depths, across the whole image."""
    builder.add_volume(np.eye(4), bounds=((-3, -3, low), (3, 3, high)), **more)


@pytest.mark.parametrize("layers", [{}, absorbing(SIGMA), {"nested_priority": 1.0}], ids=str)
def test_smoke_in_glass_dims_what_passes(layers: Any) -> None:
    """A glass slab with smoke of transmittance a transmits (1 - R)^2 a / (1 - R^2 a^2).

    Stokes 1862.
    """
    builder = wavecomb.SceneBuilder()
    ior = 1.5
    slab(builder, -2.0, 0.0, filled(builder, ior, **layers))
    smoke(builder, -1.5, -0.5, extinction=tuple(DENSE), albedo=(0, 0, 0))
    shining_floor(builder)
    seen = seen_from_above(builder, spp=256, size=32, depth=40)
    reflected = ((ior - 1) / (ior + 1)) ** 2
    once = np.exp(-DENSE - (2.0 * SIGMA if "transmission_depth" in layers else 0.0))
    exact = LIGHT * (1 - reflected) ** 2 * once / (1 - (reflected * once) ** 2)
    error = seen.std(axis=0) / np.sqrt(len(seen))
    assert np.all(error < 0.01 * exact)
    assert np.all(np.abs(seen.mean(axis=0) - exact) < 0.001 * exact + 3.5 * error)


def test_glass_dims_all_of_a_way_that_smoke_bends() -> None:
    """Absorption of glass applies to the whole path of light that smoke inside scatters.

    The smoke is white and scatters forwards only, and the surface hardly reflects or refracts.
    """
    builder = wavecomb.SceneBuilder()
    slab(builder, -2.0, 0.0, filled(builder, 1.001, **absorbing(SIGMA)))
    smoke(builder, -1.9, -0.1, extinction=(1.5,) * 3, albedo=(1, 1, 1), anisotropy=0.9995)
    builder.add_light("dome", np.eye(4), color=tuple(LIGHT))
    seen = seen_from_above(builder, spp=64, size=32, depth=60)
    exact = LIGHT * np.exp(-2.0 * SIGMA)
    error = seen.std(axis=0) / np.sqrt(len(seen))
    assert np.all(np.abs(seen.mean(axis=0) - exact) < 0.004 * exact + 3.5 * error)


def smoke_in_a_ball(**layers: Any) -> Any:
    """Returns white smoke in a ball of clear glass under a white sky."""
    builder = wavecomb.SceneBuilder()
    mesh = ball(1.0, 16)
    number = builder.add_mesh(
        mesh.points, mesh.faces.astype(np.uint32), material=filled(builder, 1.5, **layers)
    )
    builder.add_to_group(0, number)
    bounds = ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    builder.add_volume(
        np.eye(4), bounds=bounds, extinction=(1, 2, 3), albedo=(1, 1, 1), anisotropy=0.3
    )
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    return builder


@pytest.mark.parametrize("layers", [{}, {"nested_priority": 2.0}], ids=str)
def test_white_smoke_in_clear_glass_loses_nothing(layers: Any) -> None:
    seen = seen_from_above(smoke_in_a_ball(**layers), spp=64, size=24, depth=200, roulette="off")
    error = seen.std(axis=0) / np.sqrt(len(seen))
    assert np.all(error < 0.006)
    assert np.all(np.abs(seen.mean(axis=0) - 1.0) < 0.001 + 3.5 * error)


def test_one_picture_of_smoke_in_coloured_glass() -> None:
    builder = smoke_in_a_ball(**absorbing(SIGMA))
    camera = np.eye(4)
    camera[3, 2] = 5
    builder.set_camera(camera, window=(-0.25, 0.25, -0.25, 0.25))
    scene = builder.build()

    def beauty(**changes: Any) -> Any:
        base = {"width": 16, "height": 12, "spp": 8, "max_depth": 12, "costs": "model"}
        settings = _core.Settings(**{**base, **changes})
        return _core.render(scene, settings, None, None, None).beauty

    whole = beauty()
    for changes in (
        {"integrator": "reference"},
        {"lanes": 1, "threads": 1},
        {"wave_size": 64, "policy": "material"},
    ):
        np.testing.assert_array_equal(beauty(**changes), whole)
