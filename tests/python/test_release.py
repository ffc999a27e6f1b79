# SPDX-License-Identifier: Apache-2.0
"""Tests that tools/release refuses invalid files and changelogs."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
SDIST = "wavecomb-0.2.0.tar.gz"
WHEEL = "wavecomb-0.2.0-cp310-abi3-manylinux_2_35_x86_64.whl"


@pytest.fixture(scope="module")
def release() -> ModuleType:
    loader = importlib.machinery.SourceFileLoader("release", str(ROOT / "tools" / "release"))
    spec = importlib.util.spec_from_loader("release", loader)
    assert spec
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def test_version(release: ModuleType) -> None:
    assert release.version_of(ROOT).count(".") == 2


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ([SDIST, WHEEL], ""),
        ([WHEEL], "make sdist"),
        ([SDIST], "make wheels"),
        ([SDIST, WHEEL, "wavecomb-0.1.0.tar.gz"], "another version"),
        ([SDIST, WHEEL, "wavecomb-0.2.0-cp310-abi3-linux_x86_64.whl"], "this machine only"),
    ],
)
def test_files(release: ModuleType, names: list[str], message: str) -> None:
    assert message in "; ".join(release.file_problems(names, "0.2.0"))
    assert bool(release.file_problems(names, "0.2.0")) == bool(message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# C\n\n## Unreleased\n\n## 0.2.0, 2026-11-30\n\n- A.\n", ""),
        ("# C\n\n## 0.2.0, 2026-11-30\n\n- A.\n", ""),
        ("# C\n\n## Unreleased\n\n- B.\n\n## 0.2.0, 2026-11-30\n", "under Unreleased"),
        ("# C\n\n## 0.1.0, 2026-11-01\n", "not 0.2.0"),
        ("# C\n\n## 0.2.0\n", "with a date"),
    ],
)
def test_changelog(release: ModuleType, text: str, message: str) -> None:
    assert message in "; ".join(release.changelog_problems(text, "0.2.0"))
    assert bool(release.changelog_problems(text, "0.2.0")) == bool(message)


def test_other_files_name_the_release(release: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "blender").mkdir()
    (tmp_path / "CHANGELOG.md").write_text("# C\n\n## 0.2.0, 2026-11-30\n\n- A.\n")
    (tmp_path / "CITATION.cff").write_text("version: 0.2.0\ndate-released: 2026-11-30\n")
    (tmp_path / "blender" / "blender_manifest.toml").write_text('version = "0.2.0"\n')
    assert release.version_problems(tmp_path, "0.2.0") == []
    (tmp_path / "CITATION.cff").write_text("version: 0.1.0\ndate-released: 2026-11-01\n")
    assert release.version_problems(tmp_path, "0.2.0") == [
        "CITATION.cff: no line is version: 0.2.0",
        "CITATION.cff: no line is date-released: 2026-11-30",
    ]


def test_the_source_is_checked_without_files() -> None:
    """`make release` reports a changelog without the version before it builds wheels."""
    command = [sys.executable, str(ROOT / "tools" / "release"), "--source"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "make wheels" not in done.stderr and done.returncode == bool(done.stderr)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "release: check-release test-wheel test-sdist" in makefile


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "tools" / "release"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and done.stdout == ""
    assert all(line.startswith("release: ") for line in done.stderr.splitlines())
    assert "make sdist" in done.stderr and "make wheels" in done.stderr
