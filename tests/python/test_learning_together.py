# SPDX-License-Identifier: Apache-2.0
"""Tests the setting ``allocate`` (sample allocation) combined with path guiding.

test_checkpoint.py tests resuming, and tests/statistics/test_learning.py tests that there is no
bias.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

SIZE = 48
SPP = 64
BOTH: dict[str, Any] = {"allocate": "efficiency", "guiding": "on", "roulette": "efficient"}
FACTS = ("paths", "bounces", "cells", "regions", "guided_regions", "guided_share", "survival")


@pytest.fixture(scope="module")
def cornell(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("together") / "cornell.usda"
    write_scene("cornell", path)
    return wavecomb.load(path).scene


def render(scene: Any, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(scene, **{"size": (SIZE, SIZE), "spp": SPP, **settings})


@pytest.fixture(scope="module")
def both(cornell: Any) -> wavecomb.Picture:
    return render(cornell, **BOTH)


def test_the_field_is_that_of_an_even_render(cornell: Any, both: wavecomb.Picture) -> None:
    """The number of training paths follows spp, which sample allocation does not change."""
    even = render(cornell, **{**BOTH, "allocate": "even"})
    for fact in FACTS:
        assert both.stats["guiding"][fact] == even.stats["guiding"][fact], fact
    assert both.samples.sum() == even.samples.sum() == SPP * SIZE**2
    assert both.samples.min() >= both.stats["allotment"]["pilot"]
    # The allotment follows the noise of guided pixels, which differs from that of unguided ones.
    plain = render(cornell, allocate="efficiency")
    assert not np.array_equal(both.samples, plain.samples)


@pytest.mark.slow
def test_one_picture_whatever_the_schedule(cornell: Any, both: wavecomb.Picture) -> None:
    others: list[dict[str, Any]] = [
        {"lanes": 1, "threads": 1},
        {"policy": "random-runs", "wave_size": 300},
        {"integrator": "reference"},
        {"progressive": True, "ray_order": "morton"},
    ]
    for other in others:
        same = render(cornell, **BOTH, **other)
        assert np.array_equal(both.samples, same.samples), other
        assert np.array_equal(both.beauty, same.beauty), other
        assert np.array_equal(both.aovs["cost"], same.aovs["cost"]), other
