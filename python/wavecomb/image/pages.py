# SPDX-License-Identifier: Apache-2.0
"""Self-contained HTML pages of images: a playable sequence, or image pairs under a wipe line."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.thumbnails import DisplayOptions, Kind, data_uri, fit_image

MAX_FRAMES = 1000
"""Maximum number of images on a page."""
SPEEDS = (6, 12, 24, 25, 30, 60)
"""Playback speeds in frames per second that the page offers in addition to the requested one."""
_HERE = Path(__file__).parent
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""Content security policy that prevents the page from loading anything from the network."""


def escape(text: object) -> str:
    """Escapes text for HTML."""
    return html.escape(str(text), quote=True)


def document(title: str, facts: str, body: str) -> str:
    """Returns a complete HTML page with embedded styles and scripts.

    Args:
        title: Plain text.
        facts: Line of plain text that is shown below the title.
        body: HTML markup.
    """
    style = (_HERE / "pages.css").read_text(encoding="utf-8")
    script = (_HERE / "pages.js").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f"<title>{escape(title)}</title><style>{style}</style></head><body>"
        f'<header><h1>{escape(title)}</h1><p class="facts">{escape(facts)}</p></header>'
        f"<main>{body}</main><script>{script}</script></body></html>\n"
    )


def sequence_page(
    pictures: Mapping[str, str], look: DisplayOptions, *, title: str, fps: float = 24.0,
    width: int = 960, kind: Kind = "jpeg",
) -> str:  # fmt: skip
    """Returns a page that plays a sequence of images, with a contact sheet of all images below.

    Without JavaScript, the page shows only the contact sheet.

    Args:
        pictures: File of each image by name, in playing order.
        look: Display options.
        title: Title of the page.
        fps: Initial playback speed in frames per second.
        width: Largest width, in pixels, of images on the page.
        kind: Image encoding on the page, "jpeg", or "png" for close inspection.

    Raises:
        WavecombError: A file does not contain the layer.
        OSError: A file cannot be read.
    """
    cells, size = [], ""
    for name, file in pictures.items():
        codes = look.codes(file)
        size = size or f"{codes.shape[1]} x {codes.shape[0]}"
        shown = fit_image(codes, width, 4 * width)
        cells.append(f"<li>{_image(shown, name, kind)}{escape(name)}</li>")
    speeds = "".join(
        f"<option{' selected' if one == fps else ''}>{one:g}</option>"
        for one in sorted({*SPEEDS, fps})
    )
    player = (
        '<section class="player" hidden><img alt=""><div class="controls"><button>Play</button>'
        f'<input type="range" min="0" max="{len(cells) - 1}" value="0" aria-label="Frame">'
        f"<output></output><label><select>{speeds}</select> frames a second</label></div>"
        '<p class="facts">Space plays, the arrow keys step, Home and End lead to the ends.</p>'
        "</section>"
    )
    facts = f"{len(cells)} pictures, {size}"
    return document(title, facts, player + f'<ol class="sheet">{"".join(cells)}</ol>')


@dataclass(frozen=True)
class Pair:
    """Pair of images on a page, with lines of description.

    Attributes:
        name: Name of both images; "" if the title of the page already contains the name.
        facts: Lines of plain text that describe the pair.
        a: Image A as 8-bit sRGB values (height, width, 3).
        b: Reference image B, with the same size as A.
        difference: Difference map of the images, of any size, or None.
    """

    name: str
    facts: Sequence[str]
    a: NDArray[np.uint8]
    b: NDArray[np.uint8]
    difference: NDArray[np.uint8] | None = None


def pair_section(pair: Pair, key: str, names: tuple[str, str]) -> str:
    """Returns HTML that shows a pair under a wipe line, or side by side without JavaScript.

    Args:
        pair: The images.
        key: Anchor of the pair in the page.
        names: Names of images A and B.
    """
    shown = [(names[0], pair.a), (names[1], pair.b)]
    if pair.difference is not None:
        shown.append(("difference", pair.difference))
    figures = "".join(
        f"<figure>{_image(codes, f'{pair.name}: {name}' if pair.name else name, 'png')}"
        f"<figcaption>{escape(name)}</figcaption></figure>"
        for name, codes in shown
    )
    facts = "".join(f'<p class="facts">{escape(line)}</p>' for line in pair.facts)
    head = f"<h2>{escape(pair.name)}</h2>" if pair.name else ""
    return (
        f'<section id="{key}">{head}{facts}'
        f'<div class="views" id="{key}-views">{figures}</div></section>'
    )


@dataclass(frozen=True)
class Cell:
    """A table cell: its text, the anchor that it links to, and a mark for good or bad values."""

    text: str
    link: str = ""
    mark: str = ""


def table(head: Sequence[str], rows: Iterable[Sequence[Cell | str]]) -> str:
    """Returns an HTML table. The cells of the first column are row headers."""
    heads = "".join(f'<th scope="col">{escape(one)}</th>' for one in head)
    body = []
    for row in rows:
        first, *others = (one if isinstance(one, Cell) else Cell(one) for one in row)
        cells = "".join(f'<td class="{one.mark}">{_linked(one)}</td>' for one in others)
        body.append(f'<tr><th scope="row">{_linked(first)}</th>{cells}</tr>')
    return (
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def figure_text(value: float | None) -> str:
    """Formats a number for a table. A missing number becomes an en dash.

    >>> figure_text(0.001234), figure_text(None)
    ('0.001234', '–')
    """
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


def _linked(cell: Cell) -> str:
    text = escape(cell.text)
    return f'<a href="#{escape(cell.link)}">{text}</a>' if cell.link else text


def _image(codes: NDArray[np.uint8], name: str, kind: Kind) -> str:
    high, wide = codes.shape[:2]
    return (
        f'<img src="{data_uri(codes, kind)}" width="{wide}" height="{high}" alt="{escape(name)}">'
    )
