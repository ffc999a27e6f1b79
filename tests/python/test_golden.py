# SPDX-License-Identifier: Apache-2.0
"""Tests renders of tests/scenes by the wavefront integrator against reference images."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scenes"))

from golden import TEST_BATCHES, golden_names, read_golden, verdict

MAX_BYTES = 100_000


@pytest.mark.parametrize("name", golden_names())
@pytest.mark.slow
def test_wave_equals_reference(name: str) -> None:
    scene = read_golden(name)
    made = scene.batches(TEST_BATCHES, 0, scene.spp, threads=2)
    mean, variance = scene.reference()
    found = verdict(made, mean, variance)
    assert found.good, f"{name}: {found}"


@pytest.mark.parametrize("name", golden_names())
def test_reference_is_whole_and_small(name: str) -> None:
    scene = read_golden(name)
    mean, variance = scene.reference()
    width, height = scene.size
    assert mean.shape == variance.shape == (height, width, 3)
    assert np.isfinite(mean).all() and (variance >= 0).all()
    for file in scene.folder.iterdir():
        assert file.stat().st_size < MAX_BYTES, file


@pytest.mark.slow
def test_a_small_bias_is_found() -> None:
    """One per cent more light, or a shift by one pixel, fails the comparison."""
    scene = read_golden("Lights")
    made = scene.batches(TEST_BATCHES, 0, scene.spp, threads=2)
    mean, variance = scene.reference()
    assert not verdict(made * 1.01, mean, variance).good
    assert not verdict(np.roll(made, 1, axis=2), mean, variance).good
