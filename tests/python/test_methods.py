# SPDX-License-Identifier: Apache-2.0
"""Tests that docs/methods.md lists every cited paper, with the files that cite the paper."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "methods.md"
SEARCHED = ("src", "bindings", "python", "tools", "tests", "benchmarks", "docs")
SUFFIXES = (".h", ".cpp", ".in", ".py", ".md", "")
LEFT_OUT = ("docs/methods.md", "docs/results", "benchmarks/results", "tests/python/test_methods.py")

NAME = r"(?:[A-Z]\. )?[A-Z][a-z]+(?:[-' ]?[A-Z][a-z]+)?"
YEAR = r"(?:19[5-9]\d|20[0-2]\d)"
TITLE = r'(?:"[^"]{8,140}"|\*[^*]{8,140}\*)'
CITED = re.compile(
    rf"\b({NAME})((?:,? and {NAME}|, {NAME}|,? et al\.?)*)'?s?,? "
    rf"(?:\(?({YEAR})\b|{TITLE}[^\"*;]{{0,45}}?\b({YEAR})\b)"
)
NO_AUTHORS = frozenset((
    "Foundation", "University", "Utah", "Talks", "Description", "Version", "Linux", "Debian",
    "Copyright", "Blender", "Houdini", "January", "February", "March", "April", "May", "June",
    "July", "August", "September", "October", "November", "December", "The", "At", "In", "Since",
    "Of", "Ubuntu", "Graphics", "Python", "Mitsuba", "Cycles", "Maya", "Arnold", "Karma",
))  # fmt: skip


def prose(path: Path) -> str:
    """Returns the prose of a file as one line: comments of C++ files, all text of others."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix in (".h", ".cpp", ".in"):
        lines = [line.partition("//")[2] or "\n;\n" for line in text.splitlines()]
        text = "\n".join(line.lstrip("/!< ") for line in lines)
    text = re.sub(r"^\s*#+ ?", "", text, flags=re.MULTILINE)
    return " ".join(text.split())


@cache
def citations() -> dict[tuple[str, str], list[str]]:
    """Returns cited papers as (last name of the first author, year), with the citing files."""
    found: dict[tuple[str, str], list[str]] = {}
    for folder in SEARCHED:
        for path in sorted((ROOT / folder).rglob("*")):
            name = path.relative_to(ROOT).as_posix()
            if not path.is_file() or path.suffix not in SUFFIXES or name.startswith(LEFT_OUT):
                continue
            for match in CITED.finditer(prose(path)):
                author = match[1].split()[-1]
                if author not in NO_AUTHORS:
                    year = match[3] or match[4]
                    found.setdefault((author, year), []).append(name)
    return found


def rows() -> list[tuple[str, list[str]]]:
    """Returns the papers of the page, with the files that each row names."""
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:2] == "| "]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    return [
        (paper, re.findall(r"`([\w./-]+\.\w+|tools/\w+)`", where))
        for paper, _, where in cells
        if re.search(rf"{YEAR}\b", paper)
    ]


def test_every_paper_that_is_named_is_on_the_page() -> None:
    papers = [paper for paper, _ in rows()]
    missing = [
        f"{author} {year} ({', '.join(sorted(set(files)))})"
        for (author, year), files in citations().items()
        if not any(author in paper and year in paper for paper in papers)
    ]
    assert not missing, "docs/methods.md lacks rows for: " + "; ".join(sorted(missing))


def test_citations_are_found() -> None:
    """The citation pattern finds single authors, pairs, lists, and titles between name and year."""
    there = citations()
    assert len(there) > 40
    for key in (("Walter", "2007"), ("Veach", "1997"), ("Dammertz", "2010"), ("Vose", "1991"),
                ("Efron", "1987"), ("Keller", "2017"), ("Tarjan", "1972")):  # fmt: skip
        assert key in there, key


@pytest.mark.parametrize(("paper", "files"), rows(), ids=lambda value: str(value)[:40])
def test_a_row_says_truly_where(paper: str, files: list[str]) -> None:
    assert files, f"{paper}: no file is named"
    names = [word for word in re.findall(r"[A-Z][a-zA-Z]+", paper.partition("*")[0]) if word]
    title = " ".join(re.findall(r"\*([^*]+)\*", paper))
    for file in files:
        path = next((p for p in (ROOT / file, ROOT / "src/wavecomb" / file) if p.is_file()), None)
        assert path is not None, f"{paper}: there is no {file}"
        text = prose(path)
        assert any(name in text for name in names) or title in text, f"{file} does not name {paper}"


def test_versions_agree() -> None:
    """The project, the citation file and the changelog have the same version."""
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.M)
    cff = (ROOT / "CITATION.cff").read_text()
    cited = re.search(r"^version: (.+)\ndate-released: (.+)$", cff, re.M)
    newest = re.search(r"^## (\d\S+), (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert version and cited and newest
    assert version[1] == cited[1] == newest[1] and cited[2] == newest[2]
