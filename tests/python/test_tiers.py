# SPDX-License-Identifier: Apache-2.0
"""Tests that every test that only `make test-long` runs has a counterpart in `make test`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import tiers

ROOT = Path(__file__).resolve().parents[2]
ROWS = tiers.read(tiers.FILE.read_text(encoding="utf-8"))


def test_patterns() -> None:
    assert tiers.matches("a.py::test_b", "a.py::test_b[c]")
    assert tiers.matches("a.py::test_b[c-*]", "a.py::test_b[c-d]")
    assert tiers.matches("a.py::test_b[c*-d]", "a.py::test_b[c\n-d]")
    assert not tiers.matches("a.py::test_b[c]", "a.py::test_b[cd]")
    assert not tiers.matches("a.py::test_b", "a.py::test_bc")


@pytest.mark.parametrize("line", ["a.py::test_b", "a.py::test_b <- test_c", "a.py <- a.py::b"])
def test_a_line_that_is_no_row(line: str) -> None:
    with pytest.raises(ValueError, match="line 2: no row"):
        tiers.read(f"# Text.\n{line}\n")


def test_no_representative_is_long() -> None:
    for row in ROWS:
        for other in ROWS:
            assert not tiers.matches(other.long, row.representative), row


def collected(request: pytest.FixtureRequest) -> list[str]:
    """Node ids of all tests, collected again if this run lacks files of tests/long_tests.txt."""
    sides = [side for row in ROWS for side in (row.long, row.representative)]
    files = sorted({side.partition("::")[0] for side in sides})
    files = [file for file in files if (ROOT / file).is_file()]
    nodes = [item.nodeid for item in request.session.items]
    option = request.config.option
    if {node.partition("::")[0] for node in nodes}.issuperset(files) and not option.keyword:
        return nodes
    words = ["-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout.splitlines()


@pytest.mark.slow
def test_every_row_names_tests(request: pytest.FixtureRequest) -> None:
    """Both sides of each row of tests/long_tests.txt name existing tests."""
    nodes = collected(request)
    sides = {side for row in ROWS for side in (row.long, row.representative)}
    lost = [side for side in sides if not any(tiers.matches(side, node) for node in nodes)]
    assert not lost, "tests/long_tests.txt names what is no test: " + ", ".join(lost)


@pytest.mark.slow
def test_a_row_is_skipped_unless_all_tests_run(monkeypatch: pytest.MonkeyPatch) -> None:
    row = next(row for row in ROWS if "*" not in row.long and "statistics" in row.long)
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", row.long]
    monkeypatch.delenv("WAVECOMB_LONG", raising=False)
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert "1 skipped" in done.stdout and "make test-long runs it" in done.stdout
    monkeypatch.setenv("WAVECOMB_LONG", "1")
    done = subprocess.run(
        [*words, "--collect-only"], cwd=ROOT, capture_output=True, text=True, timeout=100
    )
    assert row.long in done.stdout and "1 test collected" in done.stdout
