# SPDX-License-Identifier: Apache-2.0
"""Figures quoted by README and docs come from result files with commit, rounds and command."""

from __future__ import annotations

import json
import re
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from parts import not_here

ROOT = Path(__file__).resolve().parents[2]
RESULTS = sorted((ROOT / "benchmarks" / "results").glob("*.json"))
RECENT = 40
"""Number of commits to src/ after which a result must be measured again."""


def git(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)


def document(path: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return read


def of(path: Path) -> str:
    return path.stem


def test_there_are_results() -> None:
    assert RESULTS


@pytest.mark.parametrize("path", RESULTS, ids=of)
def test_commits_are_in_this_repository(path: Path) -> None:
    shallow = git("rev-parse", "--is-shallow-repository")
    if shallow.returncode != 0 or shallow.stdout.strip() != "false":
        not_here("the history of this repository")
    commit = document(path)["commit"]
    assert git("merge-base", "--is-ancestor", commit, "HEAD").returncode == 0, (
        f"{path.name} is of {commit}, which is no commit of this history"
    )


@pytest.mark.parametrize("path", RESULTS, ids=of)
def test_pages_quote_the_command(path: Path) -> None:
    read = document(path)
    assert read["rounds"] >= 5 and not read.get("changed")
    script, *words = read["command"].split()
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    quoted = [
        line.split(script, 1)[1].split("`")[0]
        for page in pages
        for line in page.read_text(encoding="utf-8").splitlines()
        if f"python {script}" in line
    ]
    assert any(all(word in said.split() for word in words) for said in quoted), (
        f"no page says `{read['command']}`: {quoted}"
    )


@cache
def sections() -> list[str]:
    """Returns the sections of all pages, split at second-level headings."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    texts = (page.read_text(encoding="utf-8") for page in pages)
    return [part for text in texts for part in re.split(r"^## ", text, flags=re.MULTILINE)]


@pytest.mark.parametrize("path", RESULTS, ids=of)
def test_pages_mark_old_results(path: Path) -> None:
    """A page that quotes an outdated result says that the result must be measured again."""
    shallow = git("rev-parse", "--is-shallow-repository")
    if shallow.returncode != 0 or shallow.stdout.strip() != "false":
        not_here("the history of this repository")
    naming = [part for part in sections() if re.search(rf"\b{re.escape(path.name)}", part)]
    assert naming, f"no page names {path.name}"
    since = git("rev-list", "--count", f"{document(path)['commit']}..HEAD", "--", "src")
    if int(since.stdout) <= RECENT:
        return
    for part in naming:
        assert "measured again" in " ".join(part.lower().split()), (
            f"{path.name} is {since.stdout.strip()} commits of src/ old: mark it in {part[:40]!r}"
        )
