# SPDX-License-Identifier: Apache-2.0
"""Tests sample allocation: sample counts, schedules, budget, resuming, refused settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

SIZE = 32
WAYS = ("error", "efficiency")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Cornell box as a file."""
    path = tmp_path_factory.mktemp("allotment") / "cornell.usda"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def cornell(stage: Path) -> Any:
    return wavecomb.load(stage).scene


def render(scene: Any, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(scene, **{"size": (SIZE, SIZE), "spp": 64, **settings})


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_one_picture_whatever_the_schedule(cornell: Any, way: str) -> None:
    plain = render(cornell, allocate=way)
    assert plain.samples.sum() == 64 * SIZE**2
    assert plain.samples.min() >= plain.stats["allotment"]["pilot"] == 16
    assert len(np.unique(plain.samples)) > 3
    others: list[dict[str, Any]] = [
        {"lanes": 1, "threads": 1},
        {"wave_size": 64, "threads": 2},
        {"policy": "random-runs", "wave_size": 1000},
        {"policy": "material", "costs": "model", "ray_order": "morton", "materialize": "on"},
        {"integrator": "reference"},
        {"traversal": "single", "progressive": True},
    ]
    for other in others:
        same = render(cornell, allocate=way, **other)
        assert np.array_equal(plain.samples, same.samples), other
        assert np.array_equal(plain.beauty, same.beauty), other
        if way == "efficiency":
            assert np.array_equal(plain.aovs["cost"], same.aovs["cost"]), other


def test_a_pixel_is_that_of_an_even_render_of_its_count(cornell: Any) -> None:
    allotted = render(cornell, allocate="error")
    for count in np.unique(allotted.samples)[:3]:
        even = render(cornell, spp=int(count))
        same = allotted.samples == count
        assert np.array_equal(allotted.beauty[same], even.beauty[same])


def test_too_few_samples_are_even(cornell: Any) -> None:
    few = render(cornell, spp=12, allocate="error")
    assert np.array_equal(few.beauty, render(cornell, spp=12).beauty)
    assert few.stats["allotment"] is None


@pytest.mark.slow
def test_is_unbiased(cornell: Any) -> None:
    """The mean of many images with few samples equals the mean of uniformly sampled images."""

    def means(way: str, first: int) -> Any:
        return np.array(
            [
                render(cornell, size=(16, 16), spp=16, seed=seed, allocate=way).beauty.mean()
                for seed in range(first, first + 150)
            ]
        )

    even = means("even", 1000)
    for way in WAYS:
        allotted = means(way, 5000)
        variance = even.var() / len(even) + allotted.var() / len(allotted)
        assert abs(allotted.mean() - even.mean()) < 3.5 * variance**0.5


class _StopAfter:
    """Stops a render after a number of samples and keeps its state."""

    def __init__(self, samples: int) -> None:
        self._samples = samples
        self.state: dict[str, Any] = {}

    def progress(self, status: dict[str, Any]) -> str | None:
        return "stop" if status["samples_done"] >= self._samples else None

    def snapshot(self, snapshot: Any) -> None:
        self.state = {
            name: np.array(value) if isinstance(value, np.ndarray) else value
            for name, value in snapshot.state().items()
        }


def test_counts_that_cannot_be_are_refused(cornell: Any) -> None:
    settings = _core.Settings(width=64, height=64, spp=256, allocate="error", wave_size=256)
    watcher = _StopAfter(64 * 64 * 128)
    _core.render(cornell, settings, watcher=watcher)
    state = {**watcher.state, "pass.counts": np.zeros(4 * 64 * 64, np.uint8)}
    with pytest.raises(_core.Error, match="counts of samples"):
        _core.render(cornell, settings, state=state)


@pytest.mark.slow
def test_time_limit(cornell: Any) -> None:
    picture = render(cornell, spp=1 << 20, time_limit=1.0, allocate="error")
    assert picture.samples.min() > 0
    assert picture.stats["seconds"]["render"] < 2.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--noise", "0.1"], "set only one"),
        (["--region", "0", "0", "8", "8"], "whole image"),
        (["--film-memory", "0.1"], "--allocate error needs all of it"),
    ],
)
def test_refuses_in_one_line(stage: Path, tmp_path: Path, arguments: list[str], words: str) -> None:
    size = ["--size", "256", "256"] if "--film-memory" in arguments else ["--size", "32", "32"]
    command = ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--allocate", "error", *size]
    result = CliRunner().invoke(main, [*command, *arguments])
    assert result.exit_code == 2
    assert words in result.output
    assert not (tmp_path / "a.exr").exists()


def test_the_summary_says_what_was_allotted(stage: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.exr"
    command = ["render", str(stage), "-o", str(out), "--size", "32", "32", "--spp", "64"]
    result = CliRunner().invoke(main, [*command, "--allocate", "efficiency", "--verbose"])
    assert result.exit_code == 0, result.output
    assert "samples by efficiency: 16 to" in result.output
    assert "expected efficiency" in result.output
