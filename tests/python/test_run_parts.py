# SPDX-License-Identifier: Apache-2.0
"""Tests tools/run_parts: order, lanes, times, budgets, closing lines and exit codes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAKE = """#!/bin/sh
case $1 in
  setup) echo ready ;;
  hot) python3 -c 'import time
end = time.process_time() + 0.5
while time.process_time() < end: pass' ;;
  bad) echo something is wrong; exit 3 ;;
  front) touch front; until [ -e back ]; do sleep 0.02; done
    echo '== 12 passed, 3 skipped in 4.50s ==' ;;
  back) nice; touch back; until [ -e front ]; do sleep 0.02; done
    echo '100% tests passed, 0 tests failed out of 8' ;;
  left) sleep 20 & echo left ;;
esac
"""


def run(folder: Path, rows: str, tier: str = "test") -> subprocess.CompletedProcess[str]:
    make, parts = folder / "make", folder / "parts.txt"
    make.write_text(MAKE.replace("touch ", f"touch {folder}/").replace("-e ", f"-e {folder}/"))
    make.chmod(0o755)
    parts.write_text(rows)
    words = [sys.executable, ROOT / "tools/run_parts", tier, "--parts", parts, "--make", make]
    return subprocess.run(words, capture_output=True, text=True, timeout=60)


@pytest.mark.slow
def test_times_budgets_and_closing_lines(tmp_path: Path) -> None:
    """Lanes run in parallel.

    The background lane has low priority and prints its output when it ends.
    """
    done = run(
        tmp_path,
        "test setup setup -     front wall 9\n"
        "test C++   back  setup back  cpu 9  # a comment\n"
        "test hot   hot   setup front cpu 0\n"
        "test py    front setup front cpu 9\n"
        "other py   bad   -     front cpu 9\n"
        "test total -     -     -     wall 50\n",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert lines[-3:] == [
        "100% tests passed, 0 tests failed out of 8",
        "12 passed, 3 skipped in 4.50s",
        "make test: passed",
    ]
    assert re.search(r"^hot +passed +\d+ +\d+  0 s CPU$", done.stdout, re.M)
    assert re.search(r"^total +passed +\d+ +\d+  50 s wall$", done.stdout, re.M)
    (warning,) = [line for line in lines if line.startswith("warning:")]
    assert "hot took" in warning and "more than its budget of 0 s and a quarter" in warning
    nice = next(int(line) for line in lines if line.isdigit())
    assert nice >= 15


def test_a_failure_stops_what_needs_it_only(tmp_path: Path) -> None:
    done = run(
        tmp_path,
        "test bad   bad   -     front cpu 9\n"
        "test after setup bad   front cpu 9\n"
        "test setup setup -     front cpu 9\n"
        "test total -     -     -     wall 50\n",
    )
    assert done.returncode == 1 and "something is wrong" in done.stdout
    states = dict(re.findall(r"^(bad|after|setup) +(passed|FAILED|not run) ", done.stdout, re.M))
    assert states == {"bad": "FAILED", "after": "not run", "setup": "passed"}
    assert done.stdout.splitlines()[-1] == "make test: FAILED: bad, after"


def test_a_process_that_is_left_does_not_hold_it(tmp_path: Path) -> None:
    done = run(tmp_path, "test a left - front cpu 9\ntest total - - - wall 50\n")
    assert done.returncode == 0 and "make test: passed" in done.stdout


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("test a setup - front cpu\n", "line 1: a row has"),
        ("test a setup - side cpu 9\n", "line 1: a row has"),
        ("test a setup - front cpu nine\n", "line 1: a budget is"),
        ("test a setup b front cpu 9\n", "line 1: needs 'b'"),
        ("test a setup - front cpu 9\n", "tier 'test' is missing, or does not end"),
    ],
)
def test_a_file_that_is_wrong_is_one_line(tmp_path: Path, rows: str, said: str) -> None:
    done = run(tmp_path, rows)
    assert done.returncode == 2 and not done.stdout
    (line,) = done.stderr.splitlines()
    assert said in line


@pytest.mark.parametrize("tier", ["test", "test-fast", "test-long"])
def test_the_targets_of_parts_are_there(tier: str) -> None:
    text = (ROOT / "Makefile").read_text()
    rows = [line.split() for line in (ROOT / "tests/parts.txt").read_text().splitlines()]
    targets = [row[2] for row in rows if row and row[0] == tier and row[1] != "total"]
    assert len(targets) >= 6
    for target in targets:
        assert re.search(rf"^{target}:", text, re.M), target
