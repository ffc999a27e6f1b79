# SPDX-License-Identifier: Apache-2.0
"""Figures that README and docs quote are of this repository: commit, rounds, command."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest
from parts import not_here

ROOT = Path(__file__).resolve().parents[2]
RESULTS = sorted((ROOT / "benchmarks" / "results").glob("*.json"))
OLD = {"claims", "noise_target", "peers", "peers-dragon"}
"""Of fewer than five rounds, or from before their commands were kept; README says so."""


def git(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)


def document(path: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return read


def of(path: Path) -> str:
    return path.stem


def test_there_are_results() -> None:
    assert {of(path) for path in RESULTS} >= OLD


@pytest.mark.parametrize("path", RESULTS, ids=of)
def test_commits_are_in_this_repository(path: Path) -> None:
    shallow = git("rev-parse", "--is-shallow-repository")
    if shallow.returncode != 0 or shallow.stdout.strip() != "false":
        not_here("the history of this repository")
    commit = document(path)["commit"]
    assert git("merge-base", "--is-ancestor", commit, "HEAD").returncode == 0, (
        f"{path.name} is of {commit}, which is no commit of this history"
    )


@pytest.mark.parametrize("path", [p for p in RESULTS if of(p) not in OLD], ids=of)
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


def test_readme_says_which_figures_are_old() -> None:
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (said,) = (line for line in page.splitlines() if line.startswith("Rows of "))
    for name in ("peers", "claims"):
        assert name in said
