# SPDX-License-Identifier: Apache-2.0
"""The parts of a report: made once, shown as HTML, as Markdown and in the window.

A result folder keeps them as report.json beside report.html. What is drawn is in figures/, so that
the file holds words and tables only.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.picture.files import reason, replacing

FILE = "report.json"
SCHEMA = "wavecomb-report/1"


@dataclass(frozen=True)
class Markup:
    """Text, a table, something folded: HTML as ``report_html`` makes it."""

    html: str


@dataclass(frozen=True)
class Figure:
    """A drawing with its words; its files are figures/NAME.svg and figures/NAME.png.

    Attributes:
        name: Unique in a report.
        title: Short.
        caption: What is shown, in which unit, what whiskers are, how many runs.
        drawing: SVG for a page that needs nothing else; "" where it was read from a folder.
    """

    name: str
    title: str
    caption: str
    drawing: str = field(default="", repr=False, compare=False)


@dataclass(frozen=True)
class Viewer:
    """Pictures that can be flipped and subtracted in a browser; the window compares for itself."""

    html: str


Part = Markup | Figure | Viewer


@dataclass
class Section:
    """Parts under a heading.

    Attributes:
        key: Of its address in the page; letters, digits and hyphens.
        title: In words.
        parts: In order.
    """

    key: str
    title: str
    parts: list[Part] = field(default_factory=list)


@dataclass
class Report:
    """All of it.

    Attributes:
        title: Of the page.
        lead: HTML below the title.
        warnings: Why the figures deserve care, lines of text.
        sections: Those without parts are left out.
    """

    title: str
    lead: str
    warnings: list[str]
    sections: list[Section]

    def __post_init__(self) -> None:
        self.sections = [section for section in self.sections if section.parts]

    def figures(self) -> list[Figure]:
        """In the order of the page."""
        return [
            part for section in self.sections for part in section.parts if isinstance(part, Figure)
        ]

    def write(self, folder: Path) -> None:
        """Keeps it in a result folder, whole or not at all; without drawings and viewers.

        Raises:
            OSError: It cannot be written.
        """
        document = {
            "schema": SCHEMA,
            "title": self.title,
            "lead": self.lead,
            "warnings": self.warnings,
            "sections": [
                {
                    "key": section.key,
                    "title": section.title,
                    "parts": [_kept(one) for one in section.parts if not isinstance(one, Viewer)],
                }
                for section in self.sections
            ],
        }
        with replacing(folder / FILE) as part:
            part.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _kept(part: Part) -> dict[str, str]:
    if isinstance(part, Figure):
        return {"figure": part.name, "title": part.title, "caption": part.caption}
    return {"html": part.html}


def read_report(folder: Path) -> Report | None:
    """The report that a folder keeps; None where there is none.

    Raises:
        WavecombError: It is damaged, or of another version; one line that says what to do.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise ValueError(f"its schema is {document['schema']!r}, not {SCHEMA!r}")
        sections = [
            Section(str(one["key"]), str(one["title"]), [_read(part) for part in one["parts"]])
            for one in document["sections"]
        ]
        warnings = [str(line) for line in document["warnings"]]
        return Report(str(document["title"]), str(document["lead"]), warnings, sections)
    except (OSError, ValueError, KeyError, TypeError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise WavecombError(
            f"{path}: cannot be read: {why}; `wavecomb bench report {folder}` makes it anew"
        ) from error


def _read(part: dict[str, Any]) -> Part:
    if "figure" in part:
        name = str(part["figure"])
        if Path(name).name != name:
            raise ValueError(f"a figure is called {name!r}")
        return Figure(name, str(part["title"]), str(part["caption"]))
    return Markup(str(part["html"]))
