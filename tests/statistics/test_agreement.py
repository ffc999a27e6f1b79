# SPDX-License-Identifier: Apache-2.0
"""Tests of the agreement test: it accepts skewed noise and detects small faults."""

from __future__ import annotations

import numpy as np
import pytest
from agreement import Agreement, agreement, assert_agree

SHAPE = (8, 64, 64, 3)


def noise(seed: int, spread: float = 0.3) -> np.ndarray:
    """Images of mean 1 with log-normal noise, which is skewed like a path tracer's."""
    rng = np.random.default_rng(seed)
    skewed = rng.lognormal(-(spread**2) / 2, spread, SHAPE)
    return skewed * np.linspace(0.1, 2.0, SHAPE[2])[None, None, :, None]


def passes(a: np.ndarray, b: np.ndarray, tolerance: float = 0.0) -> bool:
    try:
        assert_agree("referee", a, b, tolerance=tolerance)
    except AssertionError:
        return False
    return True


@pytest.mark.parametrize("spread", [0.05, 0.3, 0.8])
def test_accepts_noise(spread: float) -> None:
    """At most one of 20 equal pairs fails, although the noise differs as between two renderers."""
    bad = sum(not passes(noise(k, spread), noise(100 + k, 0.6 * spread)) for k in range(20))
    assert bad <= 1


def test_finds_one_percent_everywhere() -> None:
    """The noise of the mean image is 0.2 % in this test; in real tests it is 0.02 to 0.2 %."""
    assert passes(noise(0), noise(1))
    assert not passes(noise(0) * 1.01, noise(1))


def test_finds_a_dim_block() -> None:
    a = noise(2)
    a[:, 8:16, 24:32] *= 0.8
    found: Agreement = agreement(a, noise(3))
    assert found.blocks < 1.0
    assert not passes(a, noise(3))


def test_finds_a_few_wrong_pixels() -> None:
    a = noise(4, 0.1)
    a[:, 5:12, 3:10] *= 2.5
    assert agreement(a, noise(5, 0.1)).accepted < 0.9975


def test_finds_a_difference_without_noise() -> None:
    a, b = np.ones(SHAPE), np.ones(SHAPE)
    assert passes(a, b)
    a[:, 3, 3] = 1.01
    assert not passes(a, b)


def test_tolerance_allows_what_it_says() -> None:
    a, b = noise(6) * 1.02, noise(7)
    assert not passes(a, b)
    assert passes(a, b, tolerance=0.03)
