# SPDX-License-Identifier: Apache-2.0
"""Tests that Russian roulette never changes the mean, even with absurd costs."""

from __future__ import annotations

from typing import Any

import pytest
from agreement import assert_agree, batches

import wavecomb


@pytest.fixture(scope="module")
def cornell(generated: Any) -> Any:
    return wavecomb.load(generated("cornell"))


def profile(scene: Any, cheap: float, dear: float, start: int = 0) -> dict[str, dict[str, float]]:
    """Costs that alternate between materials."""
    names = [name for name, _ in scene.materials]
    return {
        "materials": {name: dear if i % 2 == start else cheap for i, name in enumerate(names)},
        "textures": {},
    }


@pytest.mark.slow
@pytest.mark.parametrize("start", [0, 1])
def test_absurd_costs_do_not_bias(cornell: Any, beauty: Any, start: int, fewer: int) -> None:
    """Costs of 1e-3 ns and 1e6 ns: half of the materials are hardly ever shaded."""
    costs = profile(cornell.scene, 1e-3, 1e6, start)
    plain: dict[str, Any] = {"max_depth": 4, "roulette_depth": 1}
    spp = 64 // fewer
    aware = batches(
        lambda seed: beauty(
            cornell, 48, 4 * spp, seed=seed, **plain, roulette="cost-aware", costs=costs
        ),
        12,
    )
    thrown = batches(
        lambda seed: beauty(cornell, 48, spp, seed=seed, **plain, roulette="throughput"),
        12,
        first_seed=300,
    )
    off = batches(lambda seed: beauty(cornell, 48, spp, seed=seed, **plain), 12, first_seed=600)
    assert_agree(f"absurd costs {start}, against none", aware, off)
    assert_agree(f"absurd costs {start}, against throughput", aware, thrown)
    assert_agree("throughput against none", thrown, off)


def test_roulette_ends_paths(cornell: Any) -> None:
    """Roulette by throughput and cost-aware roulette reduce the number of shaded records."""

    def counts(**settings: Any) -> Any:
        picture = wavecomb.render(cornell, size=(48, 48), spp=16, max_depth=8, **settings)
        return picture.stats["counts"]

    off, throughput = counts(roulette="off"), counts(roulette="throughput")
    assert throughput["records"] < 0.9 * off["records"]
    cheap = counts(roulette="cost-aware", costs=profile(cornell.scene, 1.0, 1.0))
    absurd = counts(roulette="cost-aware", costs=profile(cornell.scene, 1e-3, 1e6))
    assert cheap["records"] < off["records"]
    assert absurd["records"] < off["records"]
