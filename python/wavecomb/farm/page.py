# SPDX-License-Identifier: Apache-2.0
"""The state of a job as a page that needs nothing else."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping
from typing import Any

from wavecomb.picture.files import replacing
from wavecomb.run.frame_names import frame_text
from wavecomb.run.progress import time_text

_STYLE = """
:root { color-scheme: light dark; --todo: #8886; --busy: #d90; --done: #2a7; --failed: #d33; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
.tiles { display: inline-grid; gap: 1px; vertical-align: middle; }
.tiles i { width: 12px; height: 12px; display: block; }
.todo { background: var(--todo); } .busy { background: var(--busy); }
.done { background: var(--done); } .failed { background: var(--failed); }
table { border-collapse: collapse; } td, th { padding: .2rem .8rem .2rem 0; text-align: left; }
progress { width: 100%; height: 1.2rem; }
"""
_REFRESH_S = 5


def page(state: Mapping[str, Any], columns: int = 16) -> str:
    """HTML of what ``status`` gave; it loads itself anew while the job is not over.

    Args:
        state: With all pictures.
        columns: Of tiles in a row.
    """
    tasks, pictures = state["tasks"], state["pictures"]
    over = state["state"] in ("done", "failed")
    again = "" if over else f'<meta http-equiv="refresh" content="{_REFRESH_S}">'
    left = state["seconds_left"]
    title = html.escape(f"{os.path.basename(state['stage'])}: {state['state']}")
    return "\n".join(
        [
            f'<!doctype html><html lang="en"><meta charset="utf-8">{again}',
            f"<title>{title}</title><style>{_STYLE}</style><h1>{title}</h1>",
            f"<p>{pictures['done']} of {pictures['all']} pictures; "
            + ", ".join(f"{count} tasks {html.escape(name)}" for name, count in tasks.items())
            + (f"; about {time_text(left)} left" if left else "")
            + "</p>",
            f'<progress max="{sum(tasks.values())}" value="{tasks["done"]}"></progress>',
            _table("Failed", ("task", "what", "why"), [
                (one["task"], one["title"], one["error"]) for one in state["failed"]
            ]),
            _table("Workers", ("worker", "task", "done"), [
                (one["name"], one["title"] or "idle", _percent(one["share"]))
                for one in state["workers"]
            ]),
            "<h2>Pictures</h2><table>",
            *(_row(picture, columns) for picture in state["all_pictures"]),
            "</table></html>",
        ]
    )  # fmt: skip


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.0f} %"


def _table(title: str, heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(one)}</th>" for one in heads)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(str(one))}</td>" for one in row) + "</tr>"
        for row in rows
    )
    return f"<h2>{html.escape(title)}</h2><table><tr>{head}</tr>{body}</table>"


def _row(picture: Mapping[str, Any], columns: int) -> str:
    frame, tiles = picture["frame"], picture["tiles"]
    name = "" if frame is None else f"frame {frame_text(frame)}"
    blocks = "".join(
        f'<i class="{html.escape(state)}" title="{html.escape(task)}"></i>'
        for task, state in tiles.items()
    )
    grid = f'<span class="tiles" style="grid-template-columns:repeat({columns},12px)">'
    return (
        f"<tr><td>{name}</td><td>{html.escape(picture['output'])}</td>"
        f"<td>{grid}{blocks}</span></td></tr>"
    )


def write_page(path: str, state: Mapping[str, Any]) -> None:
    """Writes ``page``, whole or not at all."""
    columns = int(state.get("tiles", (16, 1))[0])
    with replacing(path) as part:
        part.write_text(page(state, columns), encoding="utf-8")
