# SPDX-License-Identifier: Apache-2.0
"""Tests that only `make test-long` runs: the rows of long_tests.txt."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from pathlib import Path

FILE = Path(__file__).with_name("long_tests.txt")


@dataclass(frozen=True)
class Row:
    """A row of long_tests.txt: pattern of long tests, and a similar short test."""

    long: str
    representative: str


def matches(pattern: str, node: str) -> bool:
    """Whether a pattern matches a test or one of its cases; * stands for any text."""
    return _compiled(pattern).fullmatch(node) is not None


@functools.cache
def _compiled(pattern: str) -> re.Pattern[str]:
    wanted = re.escape(pattern).replace(r"\*", ".*")
    return re.compile(rf"{wanted}(\[.*\])?", re.DOTALL)


def read(text: str) -> list[Row]:
    """Read the rows of a file.

    Raises:
        ValueError: A line is not a row.
    """
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("# "):
            continue
        long, arrow, representative = (word.strip() for word in line.partition(" <- "))
        if not arrow or "::" not in long or "::" not in representative:
            raise ValueError(f"{FILE.name}, line {number}: no row of LONG <- REPRESENTATIVE")
        rows.append(Row(long, representative))
    return rows
