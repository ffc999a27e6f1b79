# SPDX-License-Identifier: Apache-2.0
"""CPU time of tests and of the processes that they started and waited for."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

FILE = "WAVECOMB_CPU_TIMES"
"""Environment variable that names the JSON file to write, which maps tests to CPU seconds."""
PROPERTY = "cpu_s"
"""Name of the test report property that holds the CPU seconds of a test."""
_LEAST_S = 60.0
"""Minimum total CPU time in seconds for which a table is printed."""
_FILES, _TESTS = 30, 40
_last: float = 0.0
_by_test: dict[str, float] = {}
# Remove the variable from the environment, so that nested pytest runs do not write to the file.
_file = os.environ.pop(FILE, None)


def since_last() -> float:
    """Return the CPU seconds since the last call in this process; the first call returns 0."""
    global _last
    times = os.times()
    now = times.user + times.system + times.children_user + times.children_system
    # Only tests that fork processes import the module `forks`.
    if forks := sys.modules.get("forks"):
        now += forks.cpu_s
    out = now - _last if _last else 0.0
    _last = now
    return out


def add(test: str, seconds: float) -> None:
    """Add the CPU time of one phase of a test."""
    _by_test[test] = _by_test.get(test, 0.0) + seconds


def save() -> None:
    """Write the seconds of all tests to the file that the environment variable names, if any."""
    if _file:
        Path(_file).write_text(json.dumps(_by_test, indent=1), encoding="utf-8")


def table() -> list[str]:
    """Format the files and the tests that took the most CPU time; empty after a short run."""
    total = sum(_by_test.values())
    if total < _LEAST_S:
        return []
    by_file: dict[str, float] = {}
    for test, seconds in _by_test.items():
        file = test.partition("::")[0]
        by_file[file] = by_file.get(file, 0.0) + seconds
    lines = [f"{total:8.1f} s in all"]
    for times, most in ((by_file, _FILES), (_by_test, _TESTS)):
        longest = sorted(times.items(), key=lambda row: -row[1])[:most]
        lines += ["", *(f"{seconds:8.1f} s {name}" for name, seconds in longest)]
    return lines
