# SPDX-License-Identifier: Apache-2.0
"""Tests aimed light paths: equal images for all schedules, and less noise."""

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

SIZE, SPP = 32, 2


@pytest.fixture(scope="module")
def landscape(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wide sunlit hills with a small ring of glass."""
    path = tmp_path_factory.mktemp("aim") / "landscape.usdc"
    write_scene("landscape", path, teapot_level=6, texture_size=64)
    return path


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain: dict[str, Any] = {"size": (SIZE, SIZE), "spp": SPP, "transport": "light"}
    return wavecomb.render(stage, **(plain | settings))


@pytest.mark.slow
def test_one_aim_whatever_the_schedule(landscape: Path) -> None:
    stage = wavecomb.load(landscape)
    plain = render(stage)
    assert plain.stats["light_aiming"]["targets"] > 0
    assert plain.stats["light_aiming"]["paths"] == 4 * 8192
    assert not np.array_equal(plain.beauty, render(stage, light_aim="off").beauty)
    ways: list[dict[str, Any]] = [{"lanes": lanes} for lanes in _core.lane_widths()]
    ways += [
        {"threads": 1, "wave_size": 64, "policy": "random-runs"},
        {"policy": "material", "ray_order": "morton", "wave_size": 1000, "roulette": "cost-aware"},
        {"integrator": "reference"},
        {"traversal": "single", "progressive": True, "aovs": ("crypto_object", "techniques")},
    ]
    for way in ways:
        same = {key: way[key] for key in ("roulette",) if key in way}
        other, first = render(stage, **way), render(stage, **same) if same else plain
        assert np.array_equal(first.beauty, other.beauty), way
        assert other.stats["light_aiming"]["targets"] == plain.stats["light_aiming"]["targets"]


def test_parts_and_seeds_have_the_aim_of_the_whole(landscape: Path) -> None:
    stage = wavecomb.load(landscape)
    x0, y0, x1, y1 = region = (7, 9, 23, 29)
    crop = render(stage, region=region, crop=True)
    assert np.array_equal(crop.beauty, render(stage).beauty[y0:y1, x0:x1])
    targets = {render(stage, seed=seed, spp=1).stats["light_aiming"]["targets"] for seed in (1, 2)}
    assert targets == {crop.stats["light_aiming"]["targets"]}


def test_nobody_aims_where_nobody_asks(landscape: Path) -> None:
    stage = wavecomb.load(landscape)
    for way in ({"light_aim": "off"}, {"transport": "path"}):
        assert render(stage, **way).stats["light_aiming"] is None
    plain = render(stage, transport="path")
    other = render(stage, transport="path", light_aim="off")
    assert plain.beauty.tobytes() == other.beauty.tobytes()


def test_aimed_paths_find_a_small_ring(landscape: Path) -> None:
    """Aimed paths also find the caustic on the ground, which other paths hardly ever hit."""
    stage = wavecomb.load(landscape)
    truth = render(stage, seed=99, spp=96, aovs=("by_light_paths",))
    caustic = truth.aovs["by_light_paths"].sum(axis=2) > 0.5 * truth.beauty.sum(axis=2)
    assert caustic.sum() > 20
    errors = {}
    for aim in ("on", "off"):
        beauty = render(stage, spp=16, light_aim=aim).beauty
        errors[aim] = float(((beauty - truth.beauty)[caustic] ** 2).mean())
    assert errors["on"] < 0.3 * errors["off"]


def test_the_summary_says_where_they_go(landscape: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "a.exr")
    asked = ["--size", "24", "16", "--spp", "1", "--transport", "light", "--verbose", "-o", out]
    result = CliRunner().invoke(main, ["render", str(landscape), *asked])
    assert result.exit_code == 0, result.output
    assert "light paths aim at" in result.output and "learned from" in result.output
