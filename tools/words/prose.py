# SPDX-License-Identifier: Apache-2.0
"""Extracts prose from files: comments, docstrings, paragraphs of pages and help texts."""

from __future__ import annotations

import ast
import functools
import inspect
import pathlib
import re
from collections.abc import Iterator
from typing import NamedTuple

CPP = {".h", ".cpp", ".inl", ".in"}


class Text(NamedTuple):
    """A piece of prose: a block of comment lines, a docstring, a paragraph, a help text."""

    line: int
    kind: str  # comment, docstring, page, help
    text: str


COMMENT_CPP = re.compile(r"^\s*//[/!<]*(.*)$")
TRAILING_CPP = re.compile(r"^(?!\s*//)(.*?)(?<!:)//[/!<]*\s(.*)$")
COMMENT_HASH = re.compile(r"^\s*#(?!!)[#:]*(.*)$")
TRAILING_HASH = re.compile(r"^(.*?\S)\s{2,}# (.*)$")
STRINGS = r'(?:[fr]?"(?:[^"\\\n]|\\.)*"\s*)+'
HELP_POSITIONS = {"option": 2, "_row": 1, "Row": 0}
"""Maps names of Python functions to the position of the help text in their arguments."""
LITERALS = re.compile(STRINGS)
NO_PROSE = re.compile(
    r"SPDX-License|^\s*(?:noqa|fmt:|type:|clang-format|pragma|namespace )|^[-=\s]*$|^-{3,} "
)
SECTION = re.compile(r"[A-Z]\w+:")
CODE_FENCE = re.compile(r"^\s*(?:```|~~~)")
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
LINKS_IN_BRACKETS = re.compile(rf"\s*\({LINK.pattern}(?:,\s+{LINK.pattern})*\)")


@functools.lru_cache(maxsize=1)
def nodes_of(text: str) -> list[ast.AST]:
    """Returns the nodes of the syntax tree of Python code. Raises SyntaxError."""
    return list(ast.walk(ast.parse(text)))


def comments(text: str, whole: re.Pattern[str], trailing: re.Pattern[str]) -> Iterator[Text]:
    """Yields blocks of comment lines, and comments behind code with their continuation lines."""
    block: list[str] = []
    start, behind_at = 0, -1
    for number, line in enumerate([*text.splitlines(), ""], start=1):
        match = whole.match(line)
        said = match[1].strip() if match else ""
        is_prose = bool(said) and not NO_PROSE.search(said)
        continues = behind_at in (-1, len(line) - len(line.lstrip()))
        if block and (not is_prose or not continues or said.startswith("- ")):
            yield Text(start, "comment", " ".join(block))
            block = []
        if is_prose:
            start, behind_at = (start, behind_at) if block else (number, -1)
            block.append(said.removeprefix("- "))
            continue
        behind = None if match else trailing.match(line)
        if behind and behind[1].count('"') % 2 == 0 and not NO_PROSE.search(behind[2]):
            rest = line[behind.end(1) :]
            start, behind_at = number, len(line) - len(rest.lstrip())
            block = [behind[2].strip()]


def joined(literals: str) -> str:
    """Returns the text of adjacent C++ string literals."""
    return "".join(re.findall(r'"((?:[^"\\\n]|\\.)*)"', literals)).replace('\\"', '"')


def python_helps(text: str) -> Iterator[tuple[int, str]]:
    """Yields line and text of each help text in calls, by keyword or by HELP_POSITIONS."""
    try:
        calls = nodes_of(text)
    except SyntaxError:
        return
    for call in calls:
        if isinstance(call, ast.Call):
            called = getattr(call.func, "attr", getattr(call.func, "id", ""))
            at = HELP_POSITIONS.get(called, len(call.args))
            given = [one.value for one in call.keywords if one.arg in ("help", "short_help")]
            for value in [*call.args[at : at + 1], *given]:
                parts = value.values if isinstance(value, ast.JoinedStr) else [value]
                yield value.lineno, "".join(str(getattr(one, "value", "N")) for one in parts
                                            if not isinstance(one, ast.FormattedValue))  # fmt: skip


def helps(name: str, text: str) -> Iterator[Text]:
    """Yields help texts of Python options, and string literals of tables in the core."""
    if name.startswith("python/wavecomb/") and name.endswith(".py"):
        found = list(python_helps(text))
    elif name.startswith("src/") and name.endswith("_table.cpp"):
        code = re.sub(r"//.*|#include.*", "", text)
        found = [(code.count("\n", 0, m.start()) + 1, joined(m[0]))
                 for m in LITERALS.finditer(code)]  # fmt: skip
    else:
        return
    for line, said in found:
        if " " in said and said[0].isupper():
            yield Text(line, "help", " ".join(said.split()))


def plain(markdown: str) -> str:
    """Returns a paragraph without link targets, brackets that hold only links, and HTML tags."""
    said = LINKS_IN_BRACKETS.sub("", re.sub(r"(`[^`]*`)|<[^>]+>", r"\1", markdown))
    return " ".join(LINK.sub(r"\1", said).split())


def prose_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yields the lines of a page, with empty text in place of code."""
    fenced = indented = False
    before = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if CODE_FENCE.match(line):
            fenced = not fenced
        elif not fenced:
            is_code = line.startswith("    ") and (indented or not before)
            indented = is_code or (indented and not line)
            yield number, "" if is_code else line
        before = line.strip()


def paragraphs(text: str) -> Iterator[Text]:
    """Yields paragraphs, list items, headings and table cells of a page."""
    block: list[str] = []
    start = 0
    for number, line in [*prose_lines(text), (0, "")]:
        said = line.strip()
        starts = re.match(r"(?:[-*]|\d+\.|#+|\|)\s", said) or said.startswith("|")
        if block and (not said or starts):
            yield Text(start, "page", plain(" ".join(block)))
            block = []
        if said.startswith("|"):
            if not re.fullmatch(r"[|\s:-]+", said):
                cells = [plain(cell) for cell in re.split(r"(?<!\\)\|", said.strip("|"))]
                yield from (Text(number, "page", cell) for cell in cells if cell)
        elif said:
            start = start if block else number
            block.append(re.sub(r"^(?:[-*]|\d+\.|#+)\s+", "", said))


def texts(name: str, text: str) -> list[Text]:
    """Returns all prose of a file."""
    suffix = pathlib.PurePath(name).suffix
    if suffix == ".md":
        return list(paragraphs(text))
    found = list(helps(name, text))
    if suffix in CPP:
        return found + list(comments(text, COMMENT_CPP, TRAILING_CPP))
    if suffix in (".py", ".pyi"):
        strings, text = docstrings(text)
        found += [Text(line + at, "docstring", said) for line, string in strings
                  for at, said in docstring_blocks(string)]  # fmt: skip
    return found + list(comments(text, COMMENT_HASH, TRAILING_HASH))


def docstring_blocks(string: str) -> Iterator[tuple[int, str]]:
    """Yields line number (from 0) and text of paragraphs and list items of a docstring.

    Examples are left out. Each entry of a section such as `Args:` is a list item, but the texts of
    `Returns:` and `Yields:` are paragraphs.
    """
    block: list[str] = []
    start, in_section, has_entries, is_code = 0, False, False, False
    for number, line in enumerate([*inspect.cleandoc(string).split("\n"), ""]):
        said = line.strip()
        indent = len(line) - len(line.lstrip())
        is_head = SECTION.fullmatch(line) is not None
        in_section = is_head or (in_section and (indent > 0 or not said))
        if is_head:
            has_entries = said not in ("Returns:", "Yields:")
        is_entry = in_section and has_entries and indent == 4
        starts = not said or is_head or is_entry or said.startswith("- ")
        if block and starts:
            yield start, " ".join(block)
            block = []
        is_code = bool(said) and (is_code or said.startswith(">>>"))
        if said and not is_head and not is_code and (block or in_section or indent < 4):
            start = start if block else number
            block.append(said.removeprefix("- "))


def docstrings(text: str) -> tuple[list[tuple[int, str]], str]:
    """Returns docstrings with their first line numbers, and the code without multi-line strings.

    Other multi-line strings, such as stages in tests, are not prose.
    """
    try:
        nodes = nodes_of(text)
    except SyntaxError:
        return [], text
    lines = text.split("\n")
    found = []
    for node in nodes:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            if isinstance(node.value.value, str):
                found.append((node.lineno, node.value.value))
                lines[node.lineno - 1 : node.end_lineno] = [""] * (
                    node.end_lineno - node.lineno + 1
                )
        elif isinstance(node, (ast.Constant, ast.JoinedStr)) and node.end_lineno > node.lineno:
            lines[node.lineno : node.end_lineno] = [""] * (node.end_lineno - node.lineno)
    return sorted(found), "\n".join(lines)
