# SPDX-License-Identifier: Apache-2.0
"""Renders scenes by Cycles and by the extension, and compares them (docs/blender-parity.md)."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import OUTPUT

HERE = Path(__file__).resolve().parent
NAMES = [
    name
    for file in sorted(HERE.glob("scenes_*.py"))
    for name in re.findall(r"^@scene\(.*?\)\ndef (\w+)\(", file.read_text(), re.M | re.S)
]
Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_there_are_at_least_sixty_scenes() -> None:
    """The table in docs/blender-parity.md has at least 60 scenes."""
    assert len(NAMES) >= 60


@pytest.mark.parametrize("name", NAMES)
def test_scene(blender: Run, name: str, request: pytest.FixtureRequest) -> None:
    """Both renderers' image means and block means agree within noise or the stated difference."""
    output = OUTPUT / request.node.callspec.id.split("-")[1]
    done = blender(str(HERE / "run.py"), str(output), name)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    row = json.loads((output / f"{name}.json").read_text())
    check(row)


def check(row: dict[str, object]) -> None:
    """Asserts that a row of the comparison is within its bounds."""
    expected = row["expected"]
    assert isinstance(expected, dict)
    noise = 3.0 * float(str(row["noise"]))
    assert expected["low"] - noise <= float(str(row["ratio"])) <= expected["high"] + noise, row
    assert float(str(row["outside"])) <= expected["outside"], row
    assert float(str(row["alpha"])) < 0.02, row
    messages = row["messages"]
    assert isinstance(messages, list)
    assert not [line for line in messages if line.startswith("not supported")], messages
    wanted = row["expected_messages"]
    assert isinstance(wanted, list)
    assert all(any(words in line for line in messages) for words in wanted), messages
