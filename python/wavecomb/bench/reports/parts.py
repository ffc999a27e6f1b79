# SPDX-License-Identifier: Apache-2.0
"""Parts of a report, which the templates ``report.html.j2`` and ``report.md.j2`` render."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from wavecomb.bench.figures.style import CaptionedFigure, fixed, lay_out, save, svg

MAX_ROWS = 60
"""Largest number of rows of a table that is shown expanded."""


@dataclass(frozen=True)
class Part:
    """Base class of the elements of a report, such as paragraphs, tables and figures.

    Attributes:
        kind: Name of the template macro that renders the part.
    """

    kind: ClassVar[str]
    summary: str = field(default="", kw_only=True)


@dataclass(frozen=True)
class Text(Part):
    """A paragraph, or a heading if ``mark`` is "heading". Other marks are CSS classes."""

    kind = "text"
    text: str
    mark: str = ""


@dataclass(frozen=True)
class Lines(Part):
    """A list of findings."""

    kind = "lines"
    lines: Sequence[str]


@dataclass(frozen=True)
class Code(Part):
    """Preformatted text."""

    kind = "code"
    text: str


@dataclass(frozen=True)
class Facts(Part):
    """Table of names and values. A value may be another such table. Omits empty values."""

    kind = "facts"
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: The value.
        note: Smaller text after the value, such as an interval.
        mark: Names of CSS classes: "word" for cells with text, "better" or "worse" for ratios.
    """

    text: str
    note: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Table(Part):
    """A table whose first column has the row headings; equal adjacent headings are merged.

    Attributes:
        caption: Title.
        head: Titles of the columns.
        rows: Cells.
        note: Small text below the table.
    """

    kind = "table"
    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""

    def groups(self) -> Iterator[tuple[str, list[Sequence[Cell]]]]:
        """Yields each row heading with the remaining cells of all rows that have this heading."""
        for head, rows in itertools.groupby(self.rows, key=lambda row: row[0].text):
            yield head, [row[1:] for row in rows]

    def is_word(self, column: int) -> bool:
        """Whether a column holds text."""
        return any("word" in row[column].mark for row in self.rows)


def table(
    caption: str,
    head: Sequence[str],
    rows: Sequence[Sequence[Cell | str]],
    note: str = "",
    summary: str = "",
) -> Table:
    """Makes a table of cells and plain texts. Tables with many rows are shown collapsed."""
    filled = [[c if isinstance(c, Cell) else Cell(c) for c in row] for row in rows]
    if not summary and len(rows) > MAX_ROWS:
        summary = f"{caption} ({len(rows)} rows)"
    return Table(caption, head, filled, note, summary=summary)


@dataclass(frozen=True)
class Figure(Part):
    """A figure; its files are figures/NAME.svg and figures/NAME.png.

    Attributes:
        name: Name of the figure's files, unique in a report.
        title: Short title.
        caption: Caption with content, unit, meaning of whiskers and number of runs.
        drawing: <svg> element.
    """

    kind = "figure"
    name: str
    title: str
    caption: str
    drawing: str


@dataclass(frozen=True)
class Viewer(Part):
    """Viewer that flips and subtracts images; the Markdown page has no viewer.

    Attributes:
        title: Name of the stage, and the frame.
        images: Names and file addresses of the images.
    """

    kind = "viewer"
    title: str
    images: Sequence[tuple[str, str]]


@dataclass
class Section:
    """Parts under a heading."""

    title: str
    parts: list[Part] = field(default_factory=list)

    @property
    def key(self) -> str:
        """Anchor of the section in the page."""
        return key_of(self.title)


class Writer:
    """Collects sections and findings, and saves figures as they are made."""

    def __init__(self, figures: Path) -> None:
        self.figures = figures
        self.sections: list[Section] = []
        self.findings: list[str] = []

    def begin(self, title: str) -> None:
        """Starts a section."""
        self.sections.append(Section(title))

    def add(self, *parts: Part | None) -> None:
        """Adds parts to the current section of the report, skipping None."""
        self.sections[-1].parts += [part for part in parts if part is not None]

    def draw(self, drawn: CaptionedFigure | None) -> None:
        """Adds a figure to the current section, unless it is None."""
        if drawn is not None:
            lay_out(drawn)
            drawing = svg(drawn)
            save(drawn, drawing, self.figures)
            self.add(Figure(drawn.name, drawn.title, drawn.caption, drawing))


def key_of(text: str) -> str:
    """Converts text to an anchor of the page.

    >>> key_of("Wave size, 4 K")
    'wave-size-4-k'
    """
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "part"


def number(value: float, digits: int = 3) -> str:
    """Formats a number with a few significant digits, or as an en dash if it is unknown.

    >>> number(0.00123456), number(1234567.0), number(12.0), number(float("nan"))
    ('0.00123', '1,230,000', '12.0', '–')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size < -4:
        return f"{value:.{digits - 1}e}"
    rounded = round(value, digits - 1 - size)
    return f"{rounded:,.{max(0, digits - 1 - size)}f}"


def interval(low: float, high: float, digits: int = 3) -> str:
    """Formats an interval as [low, high], or as "" if it is unknown."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f"[{fixed(low, digits)}, {fixed(high, digits)}]"
