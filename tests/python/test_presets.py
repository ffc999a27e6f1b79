# SPDX-License-Identifier: Apache-2.0
"""Tests that CMakePresets.json is valid, and that docs/ide.md lists its presets."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

from parts import needs

ROOT = Path(__file__).resolve().parents[2]


def on_page() -> set[str]:
    text = (ROOT / "docs" / "ide.md").read_text(encoding="utf-8")
    table = text.partition("| preset |")[2].partition("\n\n")[0]
    return set(re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE))


def test_the_page_lists_every_preset() -> None:
    presets = json.loads((ROOT / "CMakePresets.json").read_text(encoding="utf-8"))
    shown = {one["name"] for one in presets["configurePresets"] if not one.get("hidden")}
    assert shown == on_page() == {one["name"] for one in presets["buildPresets"]}


@needs("bin:cmake")
def test_cmake_reads_the_presets() -> None:
    done = subprocess.run(
        ["cmake", "--list-presets=all"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert set(re.findall(r'^  "(\w+)"', done.stdout, flags=re.MULTILINE)) == on_page()
