# SPDX-License-Identifier: Apache-2.0
"""Tests transport "auto": its choices, and their independence of schedules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.scenes import write_scene

pytest.importorskip("wavecomb._core")

SIZE, SPP = 32, 4
ENOUGH = {"size": (160, 160), "spp": 128}
"""Just enough samples for a pilot render."""


def chosen(stage: Any, **settings: Any) -> dict[str, Any]:
    """Returns the choice of a render that is stopped as soon as it starts."""
    picture = wavecomb.render(
        stage, transport="auto", progress=lambda *_: False, **(ENOUGH | settings)
    )
    return dict(picture.stats["transport"])


@pytest.mark.slow
def test_auto_uses_light_paths_for_caustics_alike_for_all_schedules(caustics: Path) -> None:
    stage = wavecomb.load(caustics)
    choice = chosen(stage)
    assert choice["chosen"] == "light" and choice["gain"] > 1.3
    assert choice["light_paths"] in (0.125, 1)
    for way in (
        {"threads": 1, "wave_size": 100, "policy": "material"},
        {"lanes": 1, "seed": 7, "region": (3, 3, 9, 9), "crop": True},
    ):
        other = chosen(stage, **way)
        assert {**other, "seconds": 0} == {**choice, "seconds": 0}
    # Merging does not go with noise targets.
    limited, forced = chosen(stage, noise=0.1), chosen(stage, auto_merge="off")
    assert {**limited, "seconds": 0} == {**forced, "seconds": 0}
    assert not forced["merges"]


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"size": (32, 32), "spp": 16}, "too few samples"),
        ({"aovs": ("lpe:a=C.{10}D.*[LO]",)}, "no room for so many light path expressions"),
        ({"clamp_indirect": 1.0}, "do not go with clamp_indirect"),
    ],
    ids=lambda x: str(x)[:30],
)
def test_auto_is_path_where_light_paths_do_not_go(
    caustics: Path, settings: dict[str, Any], why: str
) -> None:
    choice = chosen(wavecomb.load(caustics), **settings)
    assert choice["chosen"] == "path" and choice["gain"] is None
    assert why in choice["why"] and "\n" not in choice["why"]


@pytest.mark.slow
def test_guiding_does_not_change_the_choice(caustics: Path) -> None:
    """The transport is chosen without guiding, which is then trained for what light paths leave."""
    stage = wavecomb.load(caustics)
    choice, guided = chosen(stage), chosen(stage, guiding="on")
    assert choice["chosen"] == "light"
    assert {**guided, "seconds": 0} == {**choice, "seconds": 0}


def test_auto_is_path_where_there_are_holdouts(caustics: Path) -> None:
    choice = chosen(wavecomb.load(caustics, holdouts=("/World/Objects/Ball",)))
    assert choice["chosen"] == "path" and "holdouts" in choice["why"]


def test_auto_is_path_to_the_bit_in_a_matt_stage(tmp_path: Path) -> None:
    path = tmp_path / "cornell.usda"
    write_scene("cornell", path)
    size = {"size": (SIZE, SIZE), "spp": SPP}
    auto = wavecomb.render(path, transport="auto", **size)
    assert auto.stats["transport"]["why"] == "nothing in the stage is clear or glossy"
    assert auto.beauty.tobytes() == wavecomb.render(path, **size).beauty.tobytes()


def test_the_summary_says_what_was_chosen(caustics: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "a.exr")
    asked = ["--size", "16", "16", "--spp", "1", "--transport", "auto", "-o", out, "--verbose"]
    result = CliRunner().invoke(main, ["render", str(caustics), *asked])
    assert result.exit_code == 0, result.output
    assert "transport path: too few samples to find out whether light paths pay" in result.output
