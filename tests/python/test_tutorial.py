# SPDX-License-Identifier: Apache-2.0
"""Tests that the commands of the tutorial and of the gallery run as printed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from parts import needs

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "run_tutorial"
TUTORIAL, GALLERY = ROOT / "docs" / "tutorial.md", ROOT / "docs" / "gallery.md"

pytestmark = needs("wavecomb._core", "pyoidn", "bin:bash")


def run(page: Path, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), str(page), "-o", str(folder), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=6000)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def pictures_shown(page: Path) -> list[str]:
    return re.findall(r"!\[[^\]]*\]\((images/[^)]+)\)", page.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_the_tutorial_as_written(tmp_path: Path) -> None:
    done = run(TUTORIAL, tmp_path, "--quick")
    assert "error: " not in done.stderr
    there = {path.name for path in tmp_path.iterdir()}
    assert {"first.exr", "clean.png", "turn.html", "sheet.png", "evening.html", "wipe.png",
            "turn13.png"} <= there  # fmt: skip
    assert len(list((tmp_path / "out").iterdir())) == 2
    assert "<wavecomb.Picture" in done.stdout


@pytest.mark.long
@pytest.mark.parametrize("page", [TUTORIAL, GALLERY])
def test_a_page_at_its_sizes(page: Path, tmp_path: Path) -> None:
    run(page, tmp_path)
    for name in pictures_shown(page):
        assert (tmp_path / Path(name).with_suffix(".png").name).is_file(), name


@pytest.mark.parametrize("page", [TUTORIAL, GALLERY])
def test_pictures_of_a_page_are_there_and_small(page: Path) -> None:
    for name in pictures_shown(page):
        assert 2_000 < (page.parent / name).stat().st_size < 400_000, name


def test_a_block_that_fails_is_said(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\nfalse | true\necho not here\n```\n")
    command = [sys.executable, str(TOOL), str(page)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "false | true" in done.stderr
    assert "not here" not in done.stdout


def test_quick_changes_sizes_and_nothing_else(tmp_path: Path) -> None:
    code = (
        "import json, runpy, sys; tool = runpy.run_path(sys.argv[1]); "
        "print(json.dumps(tool['smaller'](json.loads(sys.argv[2]))))"
    )
    asked = ["render", "a.usda", "--size", "640", "360", "--spp", "32", "--denoise"]
    command = [sys.executable, "-c", code, str(TOOL), json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [
        "render", "a.usda", "--size", "32", "18", "--spp", "1", "--denoise"
    ]  # fmt: skip
