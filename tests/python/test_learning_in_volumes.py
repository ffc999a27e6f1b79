# SPDX-License-Identifier: Apache-2.0
"""Tests guiding, light calibration and learned roulette with scattering volumes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from parts import needs
from test_interiors import slab
from voxels import bricks

import wavecomb
from wavecomb import _core

pytestmark = needs("wavecomb._core")

SIZE, SPP, SEEDS = 48, 60, 5
"""Sample count for which an eighth of the samples suffices to train a guiding field."""

WAYS: list[dict[str, Any]] = [
    {"guiding": "on"},
    {"guiding": "on", "roulette": "efficient"},
    {"guiding": "off", "roulette": "efficient"},
]


def lamps(builder: Any) -> None:
    """Adds three lights in a row above the scene, one of them bright."""
    for number, strength in enumerate((20.0, 2.0, 0.5)):
        place = np.eye(4)
        place[3, :3] = (-2.0 + 2.0 * number, 0.5, 3.0)
        builder.add_light("sphere", place, color=(strength,) * 3, radius=0.2)


def fog(builder: Any) -> None:
    builder.add_volume(
        np.eye(4), bounds=((-3, -3, 0), (3, 3, 3.5)), extinction=(0.3, 0.2, 0.1),
        albedo=(0.9,) * 3, anisotropy=0.6,
    )  # fmt: skip


def smoke(builder: Any) -> None:
    values = np.random.default_rng(3).random((16, 16, 16)).astype(np.float32) * 3
    place = np.diag([2 / 15, 2 / 15, 2 / 15, 1.0])
    place[3, :3] = (-1.0, -1.0, 0.3)
    builder.add_volume(
        np.eye(4), density=_core.VolumeGrid(*bricks(values), place), albedo=(0.95, 0.9, 0.8)
    )


@pytest.fixture(scope="module")
def scene() -> Any:
    """Returns fog with smoke in it, over a floor, under lights."""
    builder = wavecomb.SceneBuilder()
    slab(builder, -1.0, 0.0, builder.add_material("diffuse", base_color=(0.6, 0.5, 0.4)))
    lamps(builder)
    fog(builder)
    smoke(builder)
    camera = np.eye(4)
    camera[3, 2] = 6
    builder.set_camera(camera, window=(-0.4, 0.4, -0.4, 0.4))
    return builder.build()


def render(scene: Any, **settings: Any) -> wavecomb.Picture:
    base: dict[str, Any] = {"size": (SIZE, SIZE), "spp": SPP, "max_depth": 4}
    return wavecomb.render(scene, **{**base, **settings})


def quarters(scene: Any, seed: int, **options: Any) -> Any:
    """Renders an image and returns the means of its quarters."""
    half = SIZE // 2
    seen = np.asarray(render(scene, seed=seed, **options).beauty, np.float64)
    return seen.reshape(2, half, 2, half, -1)[..., :3].mean(axis=(1, 3)).ravel()


@pytest.fixture(scope="module")
def plain(scene: Any) -> Any:
    """Means of image quarters for several seeds, without learning."""
    off: dict[str, Any] = {"guiding": "off", "roulette": "throughput", "light_selection": "power"}
    return np.array([quarters(scene, seed, **off) for seed in range(SEEDS)])


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS, ids=str)
def test_learning_changes_no_mean(scene: Any, plain: Any, way: dict[str, Any]) -> None:
    seeds = range(SEEDS, 2 * SEEDS)
    learned = np.array([quarters(scene, seed, **way) for seed in seeds])
    error = np.sqrt((plain.var(axis=0, ddof=1) + learned.var(axis=0, ddof=1)) / SEEDS)
    mean = plain.mean(axis=0)
    assert np.all(error < 0.03 * mean)
    assert np.all(np.abs(learned.mean(axis=0) - mean) < 6.0 * error + 0.002 * mean)


@pytest.mark.slow
def test_one_picture_whatever_the_schedule(scene: Any) -> None:
    way = WAYS[1]
    whole = render(scene, **way)
    assert whole.stats["guiding"]["paths"] >= 12000
    others: list[dict[str, Any]] = [
        {"wave_size": 64, "threads": 1, "policy": "material", "costs": "model"},
        {"integrator": "reference"},
    ]
    for other in others:
        assert np.array_equal(render(scene, **way, **other).beauty, whole.beauty), other
