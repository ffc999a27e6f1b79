# SPDX-License-Identifier: Apache-2.0
"""Tests firefly reweighting: removed and preserved light, and independence of schedules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import read_image, read_layers

pytest.importorskip("wavecomb._core")

SIZE = 32


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain: dict[str, Any] = {"size": (SIZE, SIZE), "spp": 4, "transport": "light"}
    return wavecomb.render(stage, **(plain | settings))


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["path", "light"])
def test_reweighting_takes_fireflies_and_keeps_the_unbiased_sum(
    caustics: Path, transport: str
) -> None:
    stage = wavecomb.load(caustics)
    keep = render(stage, transport=transport, spp=64)
    assert "unbiased" not in keep.aovs
    less = render(stage, transport=transport, spp=64, firefly="reweight")
    assert less.aovs["unbiased"].tobytes() == keep.beauty.tobytes()
    taken = keep.beauty - less.beauty
    assert taken.min() >= -1e-6
    if transport == "path":
        assert taken.max() > 0.1
    for way in ({"lanes": 1, "wave_size": 64}, {"integrator": "reference"}):
        other = render(stage, transport=transport, spp=64, firefly="reweight", **way)
        assert other.beauty.tobytes() == less.beauty.tobytes(), way


def test_a_reweighted_picture_is_resumed(caustics: Path, tmp_path: Path) -> None:
    def run(name: str, *arguments: str) -> Path:
        out = tmp_path / name
        asked = ["--size", str(SIZE), str(SIZE), "--spp", "24", "-o", str(out), *arguments]
        result = CliRunner().invoke(main, ["render", str(caustics), *asked])
        assert result.exit_code == 0, result.output
        return out

    options = ("--firefly", "reweight", "--transport", "light", "--aov", "techniques")
    state = str(tmp_path / "state.wcc")
    whole = run("whole.exr", *options)
    run("half.exr", *options, "--checkpoint", state)
    again = run("again.exr", "--resume", state)
    assert np.array_equal(read_image(whole), read_image(again))
    assert {"unbiased", "by_bounces", "by_light_samples", "by_light_paths"} <= {*read_layers(again)}


@pytest.mark.slow
def test_what_reweighting_does_not_go_with_is_one_line(caustics: Path, tmp_path: Path) -> None:
    asked = ["--firefly", "reweight", "--size", "64", "64", "--spp", "1"]
    out = str(tmp_path / "a.exr")
    told = CliRunner().invoke(
        main, ["render", str(caustics), *asked, "-o", out, "--film-memory", "0.1"]
    )
    assert told.exit_code == 2 and "--firefly reweight needs all of it at once" in told.output
    tiles = ["farm", "submit", str(caustics), *asked, "-o", out, "--tiles", "2x2"]
    told = CliRunner().invoke(main, tiles)
    assert told.exit_code == 2 and "--firefly reweight" in told.output
