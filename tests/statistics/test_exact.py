# SPDX-License-Identifier: Apache-2.0
"""Tests reproducibility: schedules do not change a bit of the image.

The reference is the scalar reference integrator: depth first, one ray at a time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb import _core

LAYERS = ("beauty", "albedo", "normal", "depth", "samples")
SCENES = ("cornell", "cornell-dragon", "mixed", "dragon")
POLICIES = tuple(_core.policies())

WAYS = [
    {"threads": 1, "wave_size": 64, "policy": "none", "materialize": "off"},
    {"threads": 2, "wave_size": 1000, "policy": "program", "materialize": "on"},
    {"threads": 2, "wave_size": 0, "policy": "program", "materialize": "off"},
    {"threads": 1, "wave_size": 16384, "policy": "none", "materialize": "on"},
    {"threads": 2, "wave_size": 0, "policy": "program", "materialize": "auto"},
]


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain = {"size": (80, 60), "spp": 4, "seed": 3, "max_depth": 8}
    return wavecomb.render(stage, **(plain | settings))


def differences(a: wavecomb.Picture, b: wavecomb.Picture) -> list[str]:
    """Describe differing layers, with some pixels; NaNs are equal to themselves."""
    out = []
    for layer in LAYERS:
        x, y = getattr(a, layer), getattr(b, layer)
        if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f"):
            other = (x != y) & ~((x != x) & (y != y))
            places = np.argwhere(other.reshape(*other.shape[:2], -1).any(axis=2))
            some = ", ".join(f"({px}, {py})" for py, px in places[:6])
            out.append(f"{layer}: {len(places)} pixels differ, such as {some}")
    return out


@pytest.fixture(scope="module")
def references(generated: Any) -> Any:
    """A loaded stage and its image by the reference integrator."""
    made: dict[str, tuple[Any, wavecomb.Picture]] = {}

    def get(name: str) -> tuple[Any, wavecomb.Picture]:
        if name not in made:
            stage = wavecomb.load(generated(name))
            made[name] = (stage, render(stage, integrator="reference", threads=2))
        return made[name]

    return get


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("lanes", _core.lane_widths())
def test_wave_is_the_reference(references: Any, name: str, lanes: int) -> None:
    stage, reference = references(name)
    for way in WAYS:
        found = differences(render(stage, lanes=lanes, **way), reference)
        assert not found, f"{name}, lanes {lanes}, {way}: {'; '.join(found)}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell", "mixed"])
@pytest.mark.parametrize(
    "settings",
    [
        {"sampler": "independent", "filter": "box", "filter_width": 1.0},
        {"roulette": "off", "max_depth": 3, "filter": "gaussian"},
        {"fresnel": "schlick", "clamp_indirect": 2.0},
        {"cosine_sampling": True},
        {"roulette": "cost-aware", "costs": "model"},
        {"max_depth": 0},
        {"size": (33, 7), "spp": 5},
    ],
    ids=lambda s: next(iter(s)),
)
def test_with_other_settings(references: Any, name: str, settings: dict[str, Any]) -> None:
    stage, _ = references(name)
    reference = render(stage, integrator="reference", **settings)
    for policy in POLICIES:
        found = differences(render(stage, policy=policy, wave_size=512, **settings), reference)
        assert not found, f"{name}, {settings}: {'; '.join(found)}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell-dragon", "mixed"])
@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy(references: Any, name: str, policy: str) -> None:
    """Costs are measured and so vary between passes and runs; every ray order is covered."""
    stage, reference = references(name)
    for way in (
        {"wave_size": 512, "ray_order": "slot", "materialize": "on"},
        {"wave_size": 3000, "ray_order": "morton", "materialize": "off"},
        {"wave_size": 0, "ray_order": "morton-octant", "threads": 1},
        {"wave_size": 0, "ray_order": "auto"},
    ):
        found = differences(render(stage, policy=policy, costs="measured", **way), reference)
        assert not found, f"{name}, {policy}, {way}: {'; '.join(found)}"


def test_again_is_the_same(references: Any) -> None:
    stage, _ = references("cornell")
    assert not differences(render(stage, spp=2), render(stage, spp=2))


def test_another_seed_is_another_picture(references: Any) -> None:
    """Ensures that the tests above do not pass because seeds have no effect."""
    stage, reference = references("cornell")
    assert differences(render(stage, seed=4), reference)
    assert differences(render(stage, spp=5), reference)
