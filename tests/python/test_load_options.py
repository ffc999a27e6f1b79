# SPDX-License-Identifier: Apache-2.0
"""Tests that every user of the table of load options picks up new rows."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import click
import pytest
from click.testing import CliRunner

from wavecomb import load_options
from wavecomb.cli.options import StageOptions, stage_options
from wavecomb.errors import WavecombError
from wavecomb.load_options import LoadOptions, Row, given, row_of, rows, split


def command_of(got: dict[str, Any]) -> click.Command:
    """Returns a command with all loading options, which stores their values in ``got``."""

    @click.command()
    @stage_options
    def command(stage: str, **options: Any) -> None:
        source = StageOptions.take(options)
        assert not options
        got.update(values=source.as_dict(), load=given(source.as_dict()))

    return command


def run(*arguments: str) -> dict[str, Any]:
    """Returns a function that parses arguments and returns the options."""
    got: dict[str, Any] = {}
    result = CliRunner().invoke(command_of(got), ["shot.usd", *arguments])
    assert result.exit_code == 0, result.output
    return got


def test_nothing_given_is_nothing() -> None:
    assert run()["load"] == {}
    assert LoadOptions.of(None, {}) == LoadOptions()


def test_every_option_comes_to_its_field() -> None:
    got = run(
        *("--camera", "/Cam", "--frame", "3", "--purpose", "guide", "--variant", "/A{s}=x"),
        *("--variant", "t=y", "--lights", "hidden", "--shutter", "-1", "1", "--no-motion-blur"),
        *("--motion-steps", "3", "--render-settings", "/R", "--product", "P"),
        *("--camera-projection", "latlong", "--camera-exposure", "off", "--depth-of-field", "on"),
        *("--mask", "/A", "--mask", "/B", "--session-layer", "over.usda", "--texture-limit", "5"),
        *("--working-space", "acescg", "--subdivision", "2", "--holdout", "/H"),
        *("--strand-pixels", "0.5"),
        *("--lens-setting", "lens_k1=-0.1", "--st-map", "st.exr", "--catcher", "/C"),
        *("--payloads", "/A/*"),
    )["load"]
    assert got.keys() == rows().keys()
    assert got == {
        "camera": "/Cam", "frame": 3.0, "purposes": ("default", "guide"),
        "variants": {"/A{s}": "x", "t": "y"}, "lights": "hidden", "shutter": (-1.0, 1.0),
        "motion_blur": False, "motion_steps": 3, "render_settings": "/R", "product": "P",
        "projection": "latlong", "exposure": False, "depth_of_field": True, "mask": ("/A", "/B"),
        "session_layer": "over.usda", "texture_limit": 5.0, "working_space": "acescg",
        "strand_pixels": 0.5,
        "subdivision": "2", "holdouts": ("/H",), "lens_settings": {"lens_k1": "-0.1"},
        "st_map": "st.exr", "catchers": ("/C",),
        "payloads": ("/A/*",),
    }  # fmt: skip
    LoadOptions.of(None, got).check()


def test_what_was_chosen_before_is_kept() -> None:
    before = run("--camera", "/Cam", "--mask", "/A", "--shutter", "0", "1")["values"]
    plain = {
        key: list(value) if isinstance(value, tuple) else value for key, value in before.items()
    }
    now = StageOptions(run("--camera", "/Other")["values"]).completed(plain)
    assert (now["camera"], now["mask"], now["shutter"]) == ("/Other", ("/A",), (0.0, 1.0))


@pytest.mark.parametrize(
    ("key", "value"),
    [("camera", 3), ("frame", "x"), ("mask", "/A"), ("shutter", [1.0]), ("no_motion_blur", 1.5),
     ("frame", float("nan"))],
)  # fmt: skip
def test_damaged_files_are_refused(key: str, value: Any) -> None:
    with pytest.raises(WavecombError, match=f"the checkpoint's {key} is invalid"):
        StageOptions(run()["values"]).completed({key: value})


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"texture_limit": 0}, "texture limit 0 MB: must be a number above 0"),
        ({"working_space": "xyz"}, "no working space 'xyz'; there are rec709, acescg"),
        ({"frame": float("inf")}, "frame inf: must be a number"),
        ({"frame": "one"}, "frame one: must be a number"),
        ({"lights": "dim"}, "no lights 'dim'; there are visible, hidden"),
        ({"size": (0, 4)}, "size (0, 4): must be two numbers of at least 1"),
        ({"size": (4,)}, "size (4,): must be two numbers of at least 1"),
        ({"shutter": (0, float("nan"))}, "shutter (0, nan): must be two numbers"),
        ({"motion_steps": 65}, "motion steps 65: must be a whole number from 2 to 64"),
        ({"threads": -1}, "threads -1: must be a whole number of at least 0"),
        ({"purposes": ["all"]}, "no purpose 'all'; there are default, render, proxy, guide"),
        ({"projection": "fish"},
         "no camera projection 'fish'; there are perspective, orthographic, latlong"),
    ],
)  # fmt: skip
def test_what_no_stage_can_have_is_refused(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(WavecombError) as caught:
        LoadOptions.of(None, changes).check()
    assert str(caught.value) == line


def test_unknown_options_are_named() -> None:
    with pytest.raises(TypeError, match="no option 'tea' of loading; there are camera, "):
        LoadOptions.of(None, {"tea": 1})


def test_options_and_settings_share_no_name() -> None:
    from wavecomb.options import settings

    shared = {one.name for one in fields(LoadOptions)} & set(settings())
    assert shared == {"threads"}
    assert split({"camera": "/C", "seed": 3}) == ({"camera": "/C"}, {"seed": 3})


def test_an_added_row_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class More(LoadOptions):
        tea: str = load_options._row(
            "black", "What is served.", "choice", "--tea", choices=("black", "green"),
            unset="black",
        )  # fmt: skip

    monkeypatch.setattr(load_options, "LoadOptions", More)
    assert isinstance(row_of(fields(More)[-1]), Row)
    shown = CliRunner().invoke(command_of({}), ["--help"]).output
    assert "--tea [black|green]" in shown
    assert "What is served." in shown
    got = run("--tea", "green")
    assert got["load"] == {"tea": "green"}
    assert got["values"]["tea"] == "green"
    assert split({"tea": "green", "seed": 1}) == ({"tea": "green"}, {"seed": 1})
    assert More.of(None, got["load"]).as_dict()["tea"] == "green"
