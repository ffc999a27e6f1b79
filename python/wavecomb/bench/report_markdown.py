# SPDX-License-Identifier: Apache-2.0
"""The report as Markdown for a docs page: text, tables and figures, without what must be clicked.

It is made from the sections of the HTML page, so the two cannot tell different things. What is
folded there and the picture viewers are left out.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path

from wavecomb.bench.report_html import part_html
from wavecomb.bench.report_parts import Report
from wavecomb.picture.files import replacing

LARGEST_SVG = 150_000
LARGEST_PNG = 120_000
"""Bytes of a figure beside the page; a repository keeps every version of them."""

_LEFT_OUT = ("details", "div.viewer", "script", "style", "svg")
_BLOCKS = ("p", "h3", "li", "pre", "caption", "figcaption")


def write_page(target: Path, report: Report) -> None:
    """Writes the page, and beside it a folder of its name with the figures that it shows.

    Args:
        target: The .md file.
        report: Its figures are files of the folder ``figures`` of the results.
    """
    body = [f"# {report.title}", markdown(report.lead)]
    if report.warnings:
        body.append("Read the figures with care:")
        body.append("\n".join(f"- {line}" for line in report.warnings))
    for section in report.sections:
        text = markdown("".join(map(part_html, section.parts)), target.stem)
        if text:
            body += [f"## {section.title}", text]
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as part:
        part.write_text("\n\n".join(body) + "\n", encoding="utf-8")


def copy_figures(figures: Path, target: Path) -> None:
    """Copies those that the page shows: SVG, or where that is too large PNG, made smaller.

    Names in the page end in .svg; those of PNG files are put right in it.
    """
    text = target.read_text(encoding="utf-8")
    folder = target.with_suffix("")
    folder.mkdir(exist_ok=True)
    for name in sorted(set(re.findall(rf"\({re.escape(target.stem)}/([^)]+)\.svg\)", text))):
        drawing = figures / f"{name}.svg"
        if drawing.stat().st_size <= LARGEST_SVG:
            shutil.copyfile(drawing, folder / drawing.name)
            continue
        _small_png(figures / f"{name}.png", folder / f"{name}.png")
        text = text.replace(f"({target.stem}/{name}.svg)", f"({target.stem}/{name}.png)")
    with replacing(target) as part:
        part.write_text(text, encoding="utf-8")


def markdown(html: str, folder: str = "") -> str:
    r"""Markdown of the report's own HTML.

    >>> markdown("<p>a &lt; b</p><table><caption>T</caption><tr><th>x</th><th>y</th></tr></table>")
    'a &lt; b\n\n**T**\n\n| x | y |\n| --- | --- |'
    """
    reader = _Reader(folder)
    reader.feed(html)
    reader.close()
    return "\n\n".join(reader.blocks)


class _Reader(HTMLParser):
    """Collects blocks of Markdown."""

    def __init__(self, folder: str) -> None:
        super().__init__(convert_charrefs=True)
        self.blocks: list[str] = []
        self._folder = folder
        self._text = ""
        self._left_out: list[str] = []
        self._rows: list[list[str]] = []
        self._over = ("", 0)  # a head of several rows: its text, and in how many more it stands
        self._span = 1
        self._figure = ""
        self._title = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Begins a block, a row or a cell."""
        given = dict(attrs)
        key = f"{tag}.{given.get('class')}"
        if self._left_out or tag in _LEFT_OUT or key in _LEFT_OUT:
            self._left_out += [tag] if not self._left_out or tag == self._left_out[0] else []
        elif tag == "figure":
            self._figure = (given.get("id") or "").removeprefix("figure-")
        elif tag == "tr":
            self._rows.append([])
            text, more = self._over
            if more:
                self._rows[-1].append(text)
                self._over = (text, more - 1)
        elif tag in ("th", "td", *_BLOCKS):
            self._text = ""
            self._title = given.get("class") == "title"
            self._span = int(given.get("rowspan") or 1)

    def handle_endtag(self, tag: str) -> None:
        """Ends it."""
        if self._left_out:
            if tag == self._left_out[-1]:
                self._left_out.pop()
        elif tag in ("th", "td"):
            self._rows[-1].append(self._said().replace("|", "\\|"))
            if self._span > 1:
                self._over = (self._said(), self._span - 1)
        elif tag == "table":
            self.blocks.append(_table(self._rows))
            self._rows = []
        elif tag == "figure":
            self._figure = ""
        elif tag == "pre":
            self.blocks.append(f"```sh\n{self._text.strip()}\n```")
        elif tag in _BLOCKS and self._said():
            self._block(tag, self._said())

    def handle_data(self, data: str) -> None:
        """Text, of what is shown."""
        if not self._left_out:
            self._text += data

    def _said(self) -> str:
        text = " ".join(self._text.replace("\u00a0", " ").split())
        return text.replace("<", "&lt;")

    def _block(self, tag: str, text: str) -> None:
        if self._figure and self._title:
            self.blocks.append(f"![{text}]({self._folder}/{self._figure}.svg)")
        elif tag == "li" and self.blocks and self.blocks[-1].startswith("- "):
            self.blocks[-1] += f"\n- {text}"
        else:
            form = {"h3": "### {}", "li": "- {}", "caption": "**{}**", "figcaption": "*{}*"}
            self.blocks.append(form.get(tag, "{}").format(text))


def _table(rows: Sequence[Sequence[str]]) -> str:
    width = max(len(row) for row in rows)
    lines = ["| " + " | ".join([*row, *[""] * (width - len(row))]) + " |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * width, *lines[1:]])


def _small_png(source: Path, target: Path) -> None:
    """The picture with 256 colours, and smaller until its file is small enough."""
    from PIL import Image

    with Image.open(source) as opened:
        picture = opened.convert("RGB")
    scale = 1.0
    while True:
        size = (round(picture.width * scale), round(picture.height * scale))
        small = picture.resize(size, Image.Resampling.LANCZOS).quantize(256)
        with replacing(target) as part:
            small.save(part, format="PNG", optimize=True)
        if os.path.getsize(target) <= LARGEST_PNG or min(size) < 200:
            return
        scale *= 0.85
