# SPDX-License-Identifier: Apache-2.0
"""Tests that every user of the core's table of settings picks up new rows."""

from __future__ import annotations

import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import pytest
from added_rows import add_rows, made_again
from click.testing import CliRunner

from wavecomb import _core as core
from wavecomb.errors import WavecombError
from wavecomb.options import Setting, default_text, names, settings

ROOT = Path(__file__).parents[2]

ADDED = (
    Setting("tea_time", "Tea", "When tea is served.", "number", 4.5, 0.0, 24.0, "never", (), {},
            "work", True, True, False),
    Setting("biscuit", "Biscuit", "What goes with it.", "choice", "plain", None, None, "", (),
            {"plain": "Nothing on it.", "iced": "With sugar."}, "order", True, False, False),
    Setting("cups", "Cups", "How many.", "integer", 2, 1.0, 9.0, "", (), {}, "order", False, False,
            False),
    Setting("milk", "Milk", "Before the tea.", "flag", False, None, None, "", (), {}, "picture",
            True, True, True),
)  # fmt: skip

FOLLOW = (
    "wavecomb.bench.suite", "wavecomb.cli.setting_options", "wavecomb.gui.compare.same_picture",
    "wavecomb.gui.scheduling.choices", "wavecomb.gui.scheduling.run_log", "wavecomb.gui.setup",
    "wavecomb.run.checkpoint",
)  # fmt: skip
"""Modules that derive data from the table at import."""


@pytest.fixture
def with_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adds rows to the table, as if the core had them."""
    add_rows(monkeypatch, settings, ADDED, FOLLOW)


def test_rows_are_the_cores() -> None:
    made = core.Settings()
    for name, row in settings().items():
        value = getattr(made, name)
        if row.default is not None:
            assert value == pytest.approx(row.default), name
        for choice in row.choices:
            setattr(made, name, choice)
            assert getattr(made, name) == choice
            made.check()
        setattr(made, name, value)
        for step in row.steps:
            setattr(made, name, int(step))
            made.check()
        assert row.help.endswith("."), name
        assert row.label, name
    assert list(made.to_dict()) == [*settings(), "aovs", "region"]


def test_policies_are_those_there_are() -> None:
    assert list(settings()["policy"].choices) == core.policies()


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("spp", 1.5, "spp must be a whole number"),
        ("seed", -1, "seed is -1; it must be from 0 to 4294967295"),
        ("filter", "tent", "filter is 'tent'; it must be one of box, gaussian, blackman-harris"),
        ("sampler", 3, "sampler must be one of sobol, independent"),
        ("cosine_sampling", 1, "cosine_sampling must be True or False"),
        ("policy", 2, "policy must be a text"),
        ("noise", "low", "noise must be a number"),
        ("spp", None, "spp must not be None"),
        ("spp", [4], "spp cannot be a list"),
    ],
)
def test_values_of_another_kind_are_refused(name: str, value: Any, line: str) -> None:
    with pytest.raises(core.Error) as caught:
        core.Settings(**{name: value})
    assert str(caught.value) == line


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("noise", 1.5, "noise is 1.5; it must be from 0 to 1"),
        ("wave_size", 3, "wave_size is 3; it must be from 64 to 1048576"),
        ("lanes", 5, "lanes is 5; it must be 1, 4, 8, 16 or auto (0)"),
        ("filter_width", 99, "filter_width is 99; it must be from 0.01 to 32"),
    ],
)
def test_values_out_of_range_are_refused(name: str, value: Any, line: str) -> None:
    with pytest.raises(core.Error) as caught:
        core.Settings(**{name: value}).check()
    assert str(caught.value) == line


def test_the_stub_is_the_tables() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "update_stub"), "--check"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_every_setting_has_its_option() -> None:
    from wavecomb.cli.render import render_command
    from wavecomb.cli.setting_options import ASKED_FOR_ELSEWHERE

    context = click.Context(render_command)
    offered = {name for one in render_command.get_params(context) for name in one.opts}
    for name, row in settings().items():
        if name not in ("width", "height", "error", "progressive"):
            assert row.option in offered
    assert set(ASKED_FOR_ELSEWHERE) <= set(settings())


def test_an_added_row_is_an_option(with_rows: None) -> None:
    from wavecomb.cli.command import SettingCommand
    from wavecomb.cli.setting_options import setting_options

    got: dict[str, Any] = {}

    @click.command(cls=SettingCommand)
    @setting_options()
    def command(**chosen: Any) -> None:
        got.update({name: value for name, value in chosen.items() if value is not None})

    shown = CliRunner().invoke(command, ["--help-all"]).output
    for row in ADDED:
        assert row.option in shown
        assert row.help in shown
    asked = ["--tea-time", "5", "--biscuit", "iced", "--cups", "3", "--milk", "--lanes", "auto"]
    assert CliRunner().invoke(command, asked).exit_code == 0
    assert got == {"tea_time": 5.0, "biscuit": "iced", "cups": 3, "milk": True, "lanes": 0}
    assert CliRunner().invoke(command, ["--biscuit", "wet"]).exit_code == 2


def test_an_added_row_is_a_field_of_the_window(with_rows: None) -> None:
    setup = made_again("wavecomb.gui.setup").Setup()
    assert (setup.tea_time, setup.biscuit, setup.cups, setup.milk) == (4.5, "plain", 2, False)
    choices = made_again("wavecomb.gui.scheduling.choices")
    shown = {one.field: one for one in choices.fields_of("order")}
    assert list(shown["biscuit"].values) == ["plain", "iced"]
    assert (shown["cups"].least, shown["cups"].most) == (1, 9)
    assert "tea_time" in {one.field for one in choices.fields_of("work")}
    log = made_again("wavecomb.gui.scheduling.run_log")
    assert {"tea_time", "biscuit", "cups"} <= set(log.FIELDS)
    assert "tea_time" in log.WORK
    same = made_again("wavecomb.gui.compare.same_picture")
    assert {"tea_time", "milk"} <= set(same.BITS)
    assert not {"biscuit", "cups"} & set(same.BITS)


def test_an_added_row_is_kept_in_checkpoints_where_it_shows(with_rows: None) -> None:
    from wavecomb.run.checkpoint import image_settings

    values = {name: row.default for name, row in settings().items()}
    values |= {row.name: row.default for row in ADDED}
    kept = image_settings(values)
    assert {"tea_time", "biscuit", "milk"} <= kept.keys()
    assert "cups" not in kept


def test_an_added_row_is_a_key_of_suites(with_rows: None) -> None:
    from wavecomb.bench.suite import suite_settings

    suite_settings.cache_clear()
    try:
        kinds = suite_settings()
    finally:
        suite_settings.cache_clear()
    assert [kinds[row.name] for row in ADDED] == ["number", "text", "integer", "flag"]


def test_an_added_row_is_in_the_stub(with_rows: None) -> None:
    stub = runpy.run_path(str(ROOT / "tools" / "update_stub"))
    lines = stub["attribute"](ADDED[1])
    assert lines == (
        '    biscuit: Literal["plain", "iced"]\n    """What goes with it. Default: plain."""\n'
    )


def test_defaults_for_people() -> None:
    rows = settings()
    assert default_text(rows["filter_width"]) == "depends on other settings"
    assert default_text(rows["cost_weight"]) == "0.3"
    assert default_text(replace(rows["threads"], default=3)) == "3"
    assert set(names("order")) | set(names("work")) | set(names("picture")) == set(rows)


def test_unknown_settings_are_named() -> None:
    from wavecomb.gui.setup import Setup

    with pytest.raises(WavecombError, match="no setting 'teatime'"):
        Setup().changed(teatime=1)
