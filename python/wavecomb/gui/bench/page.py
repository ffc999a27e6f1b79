# SPDX-License-Identifier: Apache-2.0
"""Pages and parts of a report as a text browser can show them. No Qt.

A report draws its figures as SVG within the page and has scripts; a text browser knows neither, so
figures become those of figures/, and what only a script fills is left out.
"""

from __future__ import annotations

import html
from html.parser import HTMLParser
from pathlib import Path

from wavecomb.bench.report_parts import Figure, Part, Section

_DROPPED = ("script", "style", "svg", "canvas", "select", "nav", "fieldset", "head", "output")
_VOID = ("br", "hr", "img", "input", "meta", "link", "col")
_RENAMED = {
    **{"section": "div", "main": "div", "header": "div", "aside": "div", "figure": "div"},
    **{"figcaption": "p", "details": "div", "summary": "b", "dl": "table", "dt": "td"},
    **{"dd": "td", "caption": "b"},
}


def page_html(path: Path) -> str:
    """An HTML file without what a text browser cannot show.

    Raises:
        OSError: It cannot be read.
    """
    return plain_html(path.read_text(encoding="utf-8", errors="replace"), path.parent / "figures")


def plain_html(text: str, figures: Path) -> str:
    """HTML without what a text browser cannot show; ``figures`` holds those of SVG in it."""
    filtered = _Filter(figures)
    filtered.feed(text)
    filtered.close()
    return "".join(filtered.out)


def section_html(section: Section, folder: Path) -> str:
    """A section of the report that a folder keeps."""
    parts = (_part(part, folder / "figures") for part in section.parts)
    return f"<h2>{html.escape(section.title)}</h2>{''.join(parts)}"


def _part(part: Part, figures: Path) -> str:
    if not isinstance(part, Figure):
        return plain_html(part.html, figures)
    name = f"{part.name}.png"
    shown = f'<p><img src="figures/{html.escape(name)}"></p>' if (figures / name).is_file() else ""
    title, caption = html.escape(part.title), html.escape(part.caption)
    return f"<p><b>{title}</b></p>{shown}<p>{caption}</p>"


class _Filter(HTMLParser):
    """Copies what is kept."""

    def __init__(self, figures: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.out: list[str] = []
        self._figures = figures
        self._dropping: list[str] = []
        self._figure = ""
        self._lists: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Drops, renames or copies."""
        values = {key: value or "" for key, value in attrs}
        if self._dropping:
            if tag == self._dropping[0]:
                self._dropping.append(tag)
            return
        if tag in _DROPPED:
            self._dropping.append(tag)
            if tag == "svg":
                self._put_figure()
            return
        if tag == "a" and values.get("class") == "skip":
            self._dropping.append(tag)
            return
        if tag in ("input", "label", "button", "meta", "link"):
            return
        if tag == "figure":
            self._figure = values.get("id", "").removeprefix("figure-")
        if tag == "div" and self._lists:
            self.out.append("<tr>")
            return
        if tag == "dl":
            self._lists.append(tag)
        if tag == "img":
            if values.get("src", "").startswith("data:"):
                self.out.append(f"<i>{html.escape(values.get('alt', 'a picture'))}</i>")
                return
            values = {"src": values.get("src", ""), "width": "100%"}
        names = ("id", "href", "src", "rowspan", "width")
        kept = {key: value for key, value in values.items() if key in names}
        if tag == "table":
            kept |= {"border": "1", "cellpadding": "4", "cellspacing": "0"}
        written = "".join(f' {key}="{html.escape(value)}"' for key, value in kept.items())
        self.out.append(f"<{_RENAMED.get(tag, tag)}{written}>")

    def handle_endtag(self, tag: str) -> None:
        """Closes what was opened."""
        if self._dropping:
            if tag == self._dropping[-1]:
                self._dropping.pop()
            return
        if tag in ("input", "label", "button", *_VOID):
            return
        if tag == "div" and self._lists:
            self.out.append("</tr>")
            return
        if tag == "dl" and self._lists:
            self._lists.pop()
        self.out.append(f"</{_RENAMED.get(tag, tag)}>")

    def handle_data(self, data: str) -> None:
        """Text."""
        if not self._dropping:
            self.out.append(html.escape(data))

    def _put_figure(self) -> None:
        path = self._figures / f"{self._figure}.png"
        if self._figure and path.is_file():
            self.out.append(f'<p><img src="figures/{html.escape(path.name)}"></p>')
