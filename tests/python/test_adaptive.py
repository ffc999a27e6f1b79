# SPDX-License-Identifier: Apache-2.0
"""Tests adaptive and timed renders: exact sample counts, no excess samples, and time limits."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb.errors import ArgumentError

_core = pytest.importorskip("wavecomb._core")

LAYERS = ("beauty", "albedo", "normal", "depth", "samples", "error", "variance")


@pytest.fixture(scope="module")
def cornell(tmp_path_factory: pytest.TempPathFactory) -> Any:
    from wavecomb.scenes import write_scene

    path: Path = tmp_path_factory.mktemp("stages") / "cornell.usdc"
    write_scene("cornell", path)
    return wavecomb.load(path)


def render(stage: Any, size: int = 32, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(stage, size=(size, size), **{"spp": 256, "seed": 5, **settings})


def expect_equal(a: wavecomb.Picture, b: wavecomb.Picture, what: Any) -> None:
    for layer in LAYERS:
        assert getattr(a, layer).tobytes() == getattr(b, layer).tobytes(), f"{layer}: {what}"


@pytest.mark.slow
@pytest.mark.parametrize("ending", [{"adaptive": 0.05}, {"noise": 0.06}])
def test_one_picture_whatever_the_schedule(cornell: Any, ending: dict[str, float]) -> None:
    size = 24
    plain = render(cornell, size, policy="none", threads=1, wave_size=64, lanes=1, **ending)
    counts = np.unique(plain.samples)
    assert len(counts) > 2, "or it would show nothing"
    assert counts[0] >= 16
    names = itertools.cycle(_core.policies())
    for wave_size, threads, lanes in itertools.product(
        (64, 1000, 4096, 65536), (1, 2), _core.lane_widths()
    ):
        settings = {
            "policy": next(names), "wave_size": wave_size, "threads": threads, "lanes": lanes
        }  # fmt: skip
        expect_equal(render(cornell, size, **settings, **ending), plain, settings)
    reference = render(cornell, size, integrator="reference", **ending)
    expect_equal(reference, plain, "reference")


@pytest.mark.slow
def test_samples_of_a_pixel_are_those_of_a_plain_render(cornell: Any) -> None:
    """A pixel with n samples equals the pixel of a render with n samples per pixel."""
    picture = render(cornell, noise=0.06)
    for count in np.unique(picture.samples):
        plain = render(cornell, spp=int(count), error=True)
        here = picture.samples == count
        np.testing.assert_array_equal(picture.beauty[here], plain.beauty[here])
        np.testing.assert_array_equal(picture.variance[here], plain.variance[here])


@pytest.mark.slow
def test_errors_end_below_the_threshold(cornell: Any) -> None:
    picture = render(cornell, spp=4096, adaptive=0.04)
    assert (picture.error <= 0.04).all()
    assert 16 <= picture.samples.min() < picture.samples.max() < 4096
    dearer = render(cornell, spp=4096, adaptive=0.02)
    assert dearer.samples.sum() > 2 * picture.samples.sum()
    most = render(cornell, spp=48, adaptive=0.001)
    assert (most.samples == 48).all()


@pytest.mark.slow
def test_noise_target_is_met(cornell: Any) -> None:
    reference = render(cornell, spp=2048).beauty.astype(float)
    for target in (0.1, 0.03):
        picture = render(cornell, spp=4096, noise=target, seed=6)
        assert picture.stats["error"] <= target
        true = np.abs(picture.beauty - reference).sum() / reference.sum()
        # The half buffers count as independent and overestimate the error of Sobol samples.
        assert 0.4 * target < true < 1.1 * target


def test_fewest_samples_are_kept(cornell: Any) -> None:
    picture = render(cornell, noise=0.5, min_spp=40)
    assert (picture.samples == 48).all()


@pytest.mark.slow
def test_error_and_variance_of_a_plain_render(cornell: Any) -> None:
    plain = render(cornell, spp=64)
    assert plain.error is None
    assert plain.variance is None
    assert plain.stats["error"] is None
    picture = render(cornell, spp=64, error=True)
    np.testing.assert_array_equal(picture.beauty, plain.beauty)
    assert picture.stats["error"] > 0
    few = render(cornell, spp=8, error=True)
    assert np.isinf(few.error).all()
    independent = [
        render(cornell, spp=64, sampler="independent", seed=k, error=True) for k in range(24)
    ]
    # Exclude the edge of the light, where few samples determine the variance.
    here = plain.beauty.max(axis=2) < 1.0
    measured = np.var([p.beauty[here] for p in independent], axis=0, ddof=1).mean()
    told = np.mean([p.variance[here] for p in independent])
    assert told == pytest.approx(measured, rel=0.1), "independent samples: Welford is right"


@pytest.mark.parametrize(
    ("settings", "kind"),
    [({"adaptive": -1.0}, ArgumentError), ({"noise": 2.0}, ArgumentError),
     ({"adaptive": 0.1, "noise": 0.1}, _core.Error), ({"adaptive": 0.1, "spp": 8}, _core.Error),
     ({"time_limit": -1.0}, ArgumentError)],
)  # fmt: skip
def test_refuses_what_cannot_be(
    cornell: Any, settings: dict[str, Any], kind: type[Exception]
) -> None:
    with pytest.raises(kind, match=next(iter(settings)) + "|min_spp"):
        render(cornell, **settings)


@pytest.mark.slow
def test_time_limit(cornell: Any) -> None:
    start = time.perf_counter()
    picture = render(cornell, size=64, spp=1 << 20, time_limit=1.5)
    seconds = time.perf_counter() - start
    assert picture.stats["seconds"]["render"] == pytest.approx(1.5, rel=0.05, abs=0.1)
    assert seconds < 2.5
    assert not picture.cancelled
    assert picture.samples.min() >= 1
    assert picture.samples.max() <= picture.samples.min() + 16
    assert np.isfinite(picture.beauty).all()
    picture = render(cornell, size=64, spp=1 << 20, time_limit=1.5, noise=0.001, threads=1)
    assert picture.stats["seconds"]["render"] == pytest.approx(1.5, rel=0.05, abs=0.1)


def test_time_limit_with_little_time(cornell: Any) -> None:
    """Each pixel gets one sample even if the time limit is too short for one sample per pixel."""
    picture = render(cornell, size=128, time_limit=1e-4)
    assert (picture.samples == 1).all()


def test_time_limit_is_no_reason_to_go_on(cornell: Any) -> None:
    picture = render(cornell, spp=8, time_limit=60.0)
    assert (picture.samples == 8).all()
    adaptive = render(cornell, noise=0.3, time_limit=60.0)
    expect_equal(adaptive, render(cornell, noise=0.3), "with time enough")


@pytest.mark.long
@pytest.mark.parametrize("limit", [5.0, 12.0])
def test_time_limit_is_kept_within_five_percent(cornell: Any, limit: float) -> None:
    """Long limits. ``test_time_limit`` checks a short one."""
    for settings in ({}, {"noise": 0.001}):
        picture = render(cornell, size=256, spp=1 << 20, time_limit=limit, **settings)
        assert picture.stats["seconds"]["render"] == pytest.approx(limit, rel=0.05)
