# SPDX-License-Identifier: Apache-2.0
"""The parts of the report as HTML: text, tables, figures, the page around them."""

from __future__ import annotations

import html
import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb.bench.figures_style import fixed
from wavecomb.bench.report_parts import Figure, Part, Report

_WORD = ' class="word"'
_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: Shown.
        note: Smaller, after it: an interval.
        mark: Class of CSS: "better", "worse" or "".
    """

    text: str
    note: str = ""
    mark: str = ""


def escape(text: Any) -> str:
    """Text that cannot be taken for markup."""
    return html.escape(str(text), quote=True)


def key_of(text: str) -> str:
    """An address in the page from any text.

    >>> key_of("Wave size, 4 K")
    'wave-size-4-k'
    """
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "part"


def prose(text: str) -> str:
    """Escaped, and numbers keep their unit beside them."""
    return escape(text).replace(" %", "\u00a0%").replace("n = ", "n\u00a0=\u00a0")


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text."""
    attribute = f' class="{kind}"' if kind else ""
    return f"<p{attribute}>{prose(text)}</p>"


def table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[Cell | str]], note: str = ""
) -> str:
    """A table; the first column heads the rows, and one head is over all rows that have it."""
    filled = [[c if isinstance(c, Cell) else Cell(c) for c in row] for row in rows]
    words = {k for row in filled for k, cell in enumerate(row) if "word" in cell.mark}
    columns = "".join(
        f'<th scope="col"{_WORD if k in words else ""}>{escape(title)}</th>'
        for k, title in enumerate(head)
    )
    body = []
    for first, group in itertools.groupby(filled, key=lambda row: row[0].text):
        members = list(group)
        body.append("<tbody>")
        for k, row in enumerate(members):
            many = len(members) > 1
            over = f'rowspan="{len(members)}" scope="rowgroup"' if many else 'scope="row"'
            named = f"<th {over}>{escape(first)}</th>" if k == 0 else ""
            body.append(f"<tr>{named}{''.join(map(_cell, row[1:]))}</tr>")
        body.append("</tbody>")
    below = f'<p class="note">{prose(note)}</p>' if note else ""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">'
        f"<table><caption>{escape(caption)}</caption><thead><tr>{columns}</tr></thead>"
        f"{''.join(body)}</table></div>{below}"
    )


def _cell(cell: Cell) -> str:
    mark = f' class="{cell.mark}"' if cell.mark else ""
    note = f' <span class="interval">{escape(cell.note)}</span>' if cell.note else ""
    return f"<td{mark}>{escape(cell.text)}{note}</td>"


def part_html(part: Part) -> str:
    """A part of a page that needs nothing else."""
    return _figure(part) if isinstance(part, Figure) else part.html


def _figure(part: Figure) -> str:
    """A figure with title and caption, drawn in the page as SVG."""
    name = f"figure-{key_of(part.name)}"
    picture = part.drawing.replace(
        "<svg", f'<svg role="img" aria-labelledby="{name}-title {name}-text"', 1
    )
    return (
        f'<figure id="{name}"><p class="title" id="{name}-title">{escape(part.title)}</p>'
        f'{picture}<figcaption id="{name}-text">{prose(part.caption)}</figcaption></figure>'
    )


def folded(summary: str, inside: str) -> str:
    """Something that opens when it is asked for."""
    return f"<details><summary>{escape(summary)}</summary>{inside}</details>"


def nested(values: Mapping[str, Any]) -> str:
    """Names and values, tables of tables; nothing for what is empty."""
    entries = []
    for name, value in values.items():
        if value is None or value == {} or value == []:
            continue
        if isinstance(value, Mapping):
            shown = nested(value)
        elif isinstance(value, (list, tuple)):
            shown = _listed(value)
        else:
            shown = escape(value)
        entries.append(f"<div><dt>{escape(name.replace('_', ' '))}</dt><dd>{shown}</dd></div>")
    return f"<dl>{''.join(entries)}</dl>"


def _listed(values: Sequence[Any]) -> str:
    if any(isinstance(value, Mapping) for value in values):
        return "".join(nested(value) for value in values if isinstance(value, Mapping))
    if len(values) > 12 and all(isinstance(value, (int, float)) for value in values):
        return escape(f"{len(values)} values, {min(values):.4g} to {max(values):.4g}")
    return escape(", ".join(str(value) for value in values))


def number(value: float, digits: int = 3) -> str:
    """A figure with so many digits that count; an en dash where there is none.

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
    """[low, high]; nothing where it is not known."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f"[{fixed(low, digits)}, {fixed(high, digits)}]"


def page(report: Report) -> str:
    """The whole document; styles and scripts are inside, nothing is fetched."""
    style = (_HERE / "report.css").read_text(encoding="utf-8")
    script = (_HERE / "report.js").read_text(encoding="utf-8")
    title, sections = report.title, report.sections
    links = "".join(f'<li><a href="#{s.key}">{escape(s.title)}</a></li>' for s in sections)
    body = "".join(
        f'<section id="{s.key}" aria-labelledby="{s.key}-title">'
        f'<h2 id="{s.key}-title">{escape(s.title)}</h2>{"".join(map(part_html, s.parts))}</section>'
        for s in sections
    )
    alert = ""
    if report.warnings:
        lines = "".join(f"<li>{escape(line)}</li>" for line in report.warnings)
        alert = (
            '<aside class="warning" aria-labelledby="warning-title">'
            f'<h2 id="warning-title">Read the figures with care</h2><ul>{lines}</ul></aside>'
        )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{escape(title)}</title><style>{style}</style></head><body>"
        f'<a class="skip" href="#content">To the content</a><header><h1>{escape(title)}</h1>'
        f'{report.lead}</header><nav aria-label="Contents"><ol>{links}</ol></nav>'
        f'<main id="content">{alert}{body}</main><script>{script}</script></body></html>\n'
    )
