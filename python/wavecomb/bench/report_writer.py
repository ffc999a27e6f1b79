# SPDX-License-Identifier: Apache-2.0
"""What the report is made of, as it is written: sections, findings, figure files."""

from __future__ import annotations

from pathlib import Path

from wavecomb.bench.figures_style import Drawn, lay_out, save, svg
from wavecomb.bench.report_html import folded, key_of
from wavecomb.bench.report_parts import Figure, Markup, Part, Section

MOST_ROWS = 60
"""Longer tables are folded."""


class Writer:
    """Collects sections and findings, and saves figures as they are made."""

    def __init__(self, figures: Path) -> None:
        self.figures = figures
        self.sections: list[Section] = []
        self.findings: list[str] = []

    def begin(self, title: str) -> None:
        """A new section."""
        self.sections.append(Section(key_of(title), title))

    def add(self, *parts: str | Part) -> None:
        """HTML, or other parts, to the section; empty HTML is left out."""
        self.sections[-1].parts += [
            Markup(part) if isinstance(part, str) else part for part in parts if part
        ]

    def draw(self, drawn: Drawn | None) -> None:
        """A figure to the section, if there is one."""
        if drawn is not None:
            lay_out(drawn)
            drawing = svg(drawn)
            save(drawn, drawing, self.figures)
            self.add(Figure(drawn.name, drawn.title, drawn.caption, drawing))

    def rows(self, count: int, summary: str, text: str) -> None:
        """A table, folded if it is long."""
        self.add(folded(f"{summary} ({count} rows)", text) if text and count > MOST_ROWS else text)
