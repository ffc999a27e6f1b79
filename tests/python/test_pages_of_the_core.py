# SPDX-License-Identifier: Apache-2.0
"""Files and names of the core that pages about its code mention."""

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
def test_names_exist(page: str) -> None:
    """Types, constants, macros and functions with an underscore or parentheses."""
    for word in code(page):
        name = word.removesuffix("()")
        is_type = re.fullmatch(r"[A-Z][a-z]+([A-Z]\w*)+|k[A-Z]\w+|WAVECOMB_\w+", name)
        is_called = word.endswith("()") and re.fullmatch(r"[a-z]\w+", name)
        if (is_type or is_called) and name not in MADE_UP:
            python = "\n".join(
                path.read_text("utf-8") for path in (ROOT / "python" / "wavecomb").glob("*.py*")
            )
            assert re.search(rf"\b{name}\b", sources() + python), f"{page}: {word}"
