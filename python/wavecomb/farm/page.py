# SPDX-License-Identifier: Apache-2.0
"""The state of a job as a page that needs nothing else."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence
from typing import Any

from wavecomb.picture.files import replacing
from wavecomb.run.frame_names import frame_text
from wavecomb.run.progress import count_text, time_text

_STYLE = """
:root { color-scheme: light dark; --todo: #8886; --busy: #d90; --done: #2a7; --failed: #d33; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
.tiles { display: inline-grid; gap: 1px; vertical-align: middle;
  grid-template-columns: repeat(var(--columns), 12px); }
.tiles i, .tiles a { width: 12px; height: 12px; display: block; }
.todo { background: var(--todo); } .busy { background: var(--busy); }
.done { background: var(--done); } .failed { background: var(--failed); }
table { border-collapse: collapse; } td, th { padding: .2rem .8rem .2rem 0; text-align: left; }
progress { width: 100%; height: 1.2rem; } img { max-width: 100%; image-rendering: pixelated; }
"""
_REFRESH_S = 5
_MOST_ROWS = 200
"""Pictures that a page lists."""
_SCRIPT = """
"use strict";
const place = document.getElementById("state"), said = document.getElementById("said");
const picture = document.getElementById("picture");
let shown = "";
async function look() {
  try {
    const answer = await fetch("state", {cache: "no-store"});
    if (!answer.ok) throw new Error(answer.status);
    place.innerHTML = await answer.text();
    const wanted = place.firstElementChild.dataset.picture;
    if (wanted && wanted !== shown) picture.src = shown = wanted;
    picture.hidden = !shown;
    document.title = place.querySelector("h1").textContent;
    said.textContent = "";
  } catch (error) {
    said.textContent = "The command that serves this page does not answer: it has ended.";
  }
  setTimeout(look, 1000);
}
look();
"""


def page(state: Mapping[str, Any], columns: int = 16) -> str:
    """HTML of what ``status`` gave; it loads itself anew while the job is not over.

    Args:
        state: With all pictures.
        columns: Of tiles in a row.
    """
    over = state["state"] in ("done", "failed")
    again = "" if over else f'<meta http-equiv="refresh" content="{_REFRESH_S}">'
    return "\n".join(
        [
            f'<!doctype html><html lang="en"><meta charset="utf-8">{again}',
            f"<title>{_title(state)}</title><style>{_STYLE}</style>",
            body(state, columns),
            "</html>",
        ]
    )


def live_page(state: Mapping[str, Any], nonce: str) -> str:
    """HTML that asks ``server`` for what is new, each second: `state` and `picture/N`.

    Args:
        state: What ``status`` gave.
        nonce: That its script may run by.
    """
    return "\n".join(
        [
            '<!doctype html><html lang="en"><meta charset="utf-8">',
            f"<title>{_title(state)}</title><style>{_STYLE}</style>",
            '<p id="said"></p><div id="state"></div>',
            '<img id="picture" alt="the picture so far" hidden>',
            f'<script nonce="{nonce}">{_SCRIPT}</script></html>',
        ]
    )


def live_state(state: Mapping[str, Any], columns: int) -> str:
    """What a live page puts in its middle: the state, with logs to be asked for."""
    shown = picture_of_interest(state["all_pictures"])
    name = "" if shown is None else f"picture/{shown['picture']}?{_version(shown)}"
    return f'<div data-picture="{name}">{body(state, columns, live=True)}</div>'


def picture_of_interest(pictures: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The one to be shown: where tiles arrive, or else the last that is done; None: there is none.

    >>> picture_of_interest([{"state": "done", "tiles": {"a": "done"}}])["state"]
    'done'
    """
    begun = [one for one in pictures if "done" in one["tiles"].values()]
    arriving = [one for one in begun if one["state"] != "done"]
    return arriving[0] if arriving else begun[-1] if begun else None


def _version(picture: Mapping[str, Any]) -> str:
    """Changes when there is more of a picture."""
    there = sum(state == "done" for state in picture["tiles"].values())
    return f"{there}-{html.escape(picture['state'])}"


def _title(state: Mapping[str, Any]) -> str:
    return html.escape(f"{os.path.basename(state['stage'])}: {state['state']}")


def body(state: Mapping[str, Any], columns: int, *, live: bool = False) -> str:
    """The state in words, tables and squares.

    Args:
        state: With all pictures.
        columns: Of tiles in a row.
        live: Whether logs can be asked for.
    """
    tasks, pictures = state["tasks"], state["pictures"]
    left, rate = state["seconds_left"], state["samples_per_s"]
    rows = state["all_pictures"]
    # What is at work or failed comes first where not all can be shown.
    if len(rows) > _MOST_ROWS:
        order = {"failed": 0, "busy": 1, "todo": 2, "done": 3}
        chosen = sorted(rows, key=lambda one: order[one["state"]])[:_MOST_ROWS]
        rows = sorted(chosen, key=lambda one: one["picture"])
    more = len(state["all_pictures"]) - len(rows)
    return "\n".join(
        [
            f"<h1>{_title(state)}</h1>",
            f"<p>{pictures['done']} of {pictures['all']} pictures; "
            + ", ".join(f"{count} tasks {html.escape(name)}" for name, count in tasks.items())
            + (f"; {count_text(rate)} samples/s" if rate else "")
            + (f"; about {time_text(left)} left" if left else "")
            + "</p>",
            f'<progress max="{sum(tasks.values())}" value="{tasks["done"]}"></progress>',
            _table("Failed", ("task", "what", "why"), [
                (_log(one["task"], live), one["title"], one["error"]) for one in state["failed"]
            ]),
            _table("Workers", ("worker", "task", "done", "samples/s"), [
                (_log(one["name"], live), one["title"] or "idle", _percent(one["share"]),
                 count_text(one["samples_per_s"]) if one["samples_per_s"] else "")
                for one in state["workers"]
            ]),
            "<h2>Pictures</h2><table>",
            *(_row(picture, columns, live) for picture in rows),
            "</table>",
            f"<p>and {more} more</p>" if more else "",
        ]
    )  # fmt: skip


class _Markup(str):
    """HTML already."""


def _log(name: str, live: bool) -> str:
    """A name, and a way to its log."""
    text = html.escape(name)
    return _Markup(f'<a href="log/{text}">{text}</a>') if live else name


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.0f} %"


def _table(title: str, heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(one)}</th>" for one in heads)
    filled = "".join(
        "<tr>"
        + "".join(f"<td>{v if isinstance(v, _Markup) else html.escape(str(v))}</td>" for v in row)
        + "</tr>"
        for row in rows
    )
    return f"<h2>{html.escape(title)}</h2><table><tr>{head}</tr>{filled}</table>"


def _row(picture: Mapping[str, Any], columns: int, live: bool) -> str:
    frame, tiles = picture["frame"], picture["tiles"]
    name = "" if frame is None else f"frame {frame_text(frame)}"
    blocks = "".join(_block(task, state, live) for task, state in tiles.items())
    grid = f'<span class="tiles" style="--columns:{columns}">'
    output = html.escape(picture["output"])
    if live:
        output = f'<a href="picture/{picture["picture"]}">{output}</a>'
    return f"<tr><td>{name}</td><td>{output}</td><td>{grid}{blocks}</span></td></tr>"


def _block(task: str, state: str, live: bool) -> str:
    what = f'class="{html.escape(state)}" title="{html.escape(task)}"'
    return f'<a {what} href="log/{html.escape(task)}"></a>' if live else f"<i {what}></i>"


def write_page(path: str, state: Mapping[str, Any]) -> None:
    """Writes ``page``, whole or not at all."""
    columns = int(state.get("tiles", (16, 1))[0])
    with replacing(path) as part:
        part.write_text(page(state, columns), encoding="utf-8")
