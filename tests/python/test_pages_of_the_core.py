# SPDX-License-Identifier: Apache-2.0
"""Tests that all files and names of the core in documentation pages exist."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "src" / "wavecomb"
PAGES = (
    *("how-a-wave-works", "writing-a-material", "writing-a-light", "writing-an-aov"),
    *("writing-a-policy", "writing-a-transport"),
)
MADE_UP = {
    *("Minnaert", "minnaert", "Ring", "RingKind", "kRoughness", "ExpensiveFirst", "kMinnaert"),
    *("VertexCounts", "expensive_first.cpp"),
    *("ring.h", "ring.cpp", "minnaert.h", "NAME.h"),
}
"""Names that only the examples in pages define."""


@cache
def sources() -> str:
    """The text of all sources of the core, its tests and the bindings."""
    files = (
        path
        for folder in (CORE, ROOT / "bindings", ROOT / "tests" / "cpp")
        for path in sorted(folder.rglob("*"))
        if path.suffix in (".h", ".cpp", ".inl", ".in")
    )
    return "\n".join(path.read_text("utf-8") for path in files)


@cache
def python_sources() -> str:
    """The text of the Python package, of tests in Python and of benchmarks."""
    folders = (ROOT / "python" / "wavecomb", ROOT / "tests", ROOT / "benchmarks")
    files = (path for folder in folders for path in sorted(folder.rglob("*.py*")))
    return "\n".join(path.read_text("utf-8") for path in files if path.suffix in (".py", ".pyi"))


def code(page: str) -> set[str]:
    """Words in backticks, outside of blocks of code."""
    text = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    return set(re.findall(r"`([^`\n]+)`", text))


@pytest.mark.parametrize("page", PAGES)
def test_files_exist(page: str) -> None:
    for word in code(page):
        name = word.rpartition("/")[2]
        if re.fullmatch(r"[\w./-]+\.(h|inl|cpp|in|py|toml|txt)", word) and name not in MADE_UP:
            places = (CORE / word, ROOT / word, ROOT / "tests" / "cpp" / word)
            is_name = "/" not in word and any(
                any(folder.rglob(word)) for folder in (CORE, ROOT / "tests")
            )
            assert is_name or any(path.exists() for path in places), f"{page}: {word}"


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.slow
def test_names_exist(page: str) -> None:
    """Each identifier in a code span of a page exists in the sources."""
    text = sources() + python_sources()
    for word in code(page):
        name = word.removesuffix("()")
        if re.fullmatch(r"[A-Za-z_]\w*(::\w+)*", name) and name not in MADE_UP:
            for part in name.split("::"):
                assert re.search(rf"\b{part}\b", text), f"{page}: {word}"
