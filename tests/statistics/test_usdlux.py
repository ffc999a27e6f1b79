# SPDX-License-Identifier: Apache-2.0
"""Tests the UsdLux suite against its public reference images, and tests that comparison."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from parts import needs, needs_asset

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

pytest.importorskip("OpenImageIO")
import usdlux
from usdlux_judge import Verdict, judge

FEW = ("sphere:18", "rect:28", "cylinder:1", "disk:1", "iesTest:5")
"""Stages with a colour temperature, a soft cone, shapes, and a profile scaled by -0.5."""


def files(pictures: tuple[str, ...]) -> list[str]:
    """Stages and reference images of the UsdLux suite for images "stage:frame"."""
    found = []
    for stage, _, frame in (picture.partition(":") for picture in pictures):
        found += [
            f"usd/usdlux/{stage}.usda",
            f"reference/usdlux/{stage}-embree.{int(frame):04d}.exr",
        ]
    return found


@pytest.mark.slow
@needs("wavecomb._core")
@needs_asset(*files(FEW))
def test_a_few_pictures(tmp_path: Path) -> None:
    """Images 64 pixels wide pass; a block of 16 pixels corresponds to 64 reference pixels."""
    options = ["--size", "64", "--spp", "64", "-o", str(tmp_path)]
    assert usdlux.main([*FEW, *options]) == 0


@pytest.mark.long
@needs("wavecomb._core")
@needs_asset(*files(("sphere:1", "dome:1", "visibleRect:1")))
@pytest.mark.parametrize("size", ["256", "512"])
def test_the_whole_suite(size: str, tmp_path: Path) -> None:
    """Renders the whole suite with 256 samples: means agree within 0.5 %, blocks within noise."""
    assert usdlux.main(["--size", size, "--spp", "256", "-o", str(tmp_path)]) == 0


def fake(rng: np.random.Generator, noise: float) -> np.ndarray:
    """A gradient with skewed noise, (64, 64, 3)."""
    slope = np.linspace(0.2, 1.0, 64)[None, :, None] * np.ones((64, 64, 3))
    return np.asarray(slope * rng.gamma(1 / noise**2, noise**2, slope.shape))


def test_the_referee_accepts_noise() -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        ours = np.stack([fake(rng, 0.2) for _ in range(8)])
        verdict = judge(ours, fake(rng, 0.1))
        assert verdict.agrees, verdict
        assert verdict.noise < 0.005


def test_a_mean_near_its_limit_is_open() -> None:
    """0.6 % off with a standard error of about 0.1 % is undecided; 2 % off is a fault, 0.1 % is
    not.
    """
    rng = np.random.default_rng(4)
    ours = np.stack([fake(rng, 0.2) for _ in range(8)])
    reference = fake(rng, 0.1)
    exact = float(ours.mean() / reference.mean())

    def off_by(difference: float) -> Verdict:
        return judge(ours, reference * exact / (1 + difference))

    assert 0.0003 < off_by(0).noise < 0.003
    assert off_by(0.006).mean_is_open and not off_by(0.006).mean_agrees
    assert not off_by(0.02).mean_is_open and not off_by(0.02).mean_agrees
    assert not off_by(0.001).mean_is_open and off_by(0.001).mean_agrees


@pytest.mark.parametrize("fault", ["mean", "block", "colour"])
def test_the_referee_finds_faults(fault: str) -> None:
    """Detects a mean that is 1 % off, a block that is 6 % off, and one channel of one block."""
    rng = np.random.default_rng(3)
    ours = np.stack([fake(rng, 0.2) for _ in range(8)])
    reference = fake(rng, 0.1)
    if fault == "mean":
        reference *= 1.01
    elif fault == "block":
        reference[16:32, 32:48] *= 1.06
    else:
        reference[16:32, 32:48, 2] *= 1.08
    verdict = judge(ours, reference)
    assert not verdict.agrees
    if fault == "mean":
        assert not verdict.mean_agrees
    else:
        assert verdict.place == (2, 1) and verdict.outside <= 3
