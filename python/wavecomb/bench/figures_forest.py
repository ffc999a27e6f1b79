# SPDX-License-Identifier: Apache-2.0
"""Forest plots: a row for each thing that is compared, a point with its interval."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from wavecomb.bench.figures_style import FAINT, INK, Drawn, clipped, figure, plain_logarithm

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

ROW = 0.21
"""Height of a row in inches."""
LONGEST = 56
"""Letters of a panel's title that have room."""


@dataclass(frozen=True)
class Row:
    """One point.

    Attributes:
        name: At the left.
        value: Where the point is.
        low: Of the interval; NaN: none.
        high: Likewise.
        colour: Of point and whiskers.
        hollow: It is a bound or a baseline, not a contestant.
    """

    name: str
    value: float
    low: float
    high: float
    colour: str = INK
    hollow: bool = False


@dataclass(frozen=True)
class Panel:
    """Rows under one title."""

    title: str
    rows: Sequence[Row]


def panels_of(
    table: pd.DataFrame,
    by: str,
    name: str,
    value: str,
    prefix: str = "",
    *,
    colour: Callable[[Any], str],
    hollow: Callable[[Any], bool] = lambda row: False,
) -> list[Panel]:
    """Makes a panel for each value of the column ``by``, with a row for each row of the table.

    Args:
        table: Columns ``name``, ``value`` and the ends of intervals, ``low`` and ``high``.
        by: Column with the titles of panels.
        name: Column with the names of rows.
        value: Column with the points.
        prefix: Of the columns ``low`` and ``high``.
        colour: Colour of a row.
        hollow: Whether a row is a bound or a baseline.
    """

    def row_of(row: Any) -> Row:
        at, low, high = (getattr(row, key) for key in (value, f"{prefix}low", f"{prefix}high"))
        return Row(str(getattr(row, name)), at, low, high, colour(row), hollow(row))

    return [
        Panel(str(title), [row_of(row) for row in part.itertuples()])
        for title, part in table.groupby(by, sort=False)
    ]


def forest(
    name: str,
    title: str,
    caption: str,
    x_label: str,
    panels: Sequence[Panel],
    *,
    centre: float = 1.0,
    log: bool = True,
    percent: bool = False,
    columns: int = 2,
) -> Drawn:
    """Panels of rows on one scale, with a line at what means "no difference"."""
    columns = 1 if len(panels) == 1 else columns
    sizes = [len(panel.rows) for panel in panels]
    heights = [max(sizes[k : k + columns]) for k in range(0, len(panels), columns)]
    made, axes = figure(
        len(heights),
        columns,
        0.55 + 0.5 * len(heights) + ROW * sum(heights),
        heights=[size + 0.8 for size in heights],
        share_x=True,
    )
    for k, ax in enumerate(axes):
        if k >= len(panels):
            ax.set_visible(False)
            continue
        _panel(ax, panels[k], heights[k // columns], centre, log, percent)
    if log:
        low, high = clipped(
            *axes[0].get_xlim(), [centre, *(row.value for panel in panels for row in panel.rows)]
        )
        for ax in axes:  # room at both sides of what is compared with
            ax.set_xlim(min(low, centre * 0.95), max(high, centre * 1.05))
            plain_logarithm(ax.xaxis)
    for ax in axes[max(0, len(panels) - columns) : len(panels)]:
        ax.set_xlabel(x_label)
        ax.tick_params(labelbottom=True)
    return Drawn(name, title, caption, made)


def _panel(
    ax: Axes,
    panel: Panel,
    most: int,
    centre: float,
    log: bool,
    percent: bool,
) -> None:
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    if log:
        ax.set_xscale("log", base=2)
    ax.axvline(centre, color=FAINT, linewidth=0.8)
    for y, row in enumerate(panel.rows):
        if math.isfinite(row.low) and math.isfinite(row.high):
            left = max(row.low, row.value * 0.02) if log else row.low
            ax.plot([left, row.high], [y, y], color=row.colour, linewidth=1.6)
        ax.plot(
            row.value,
            y,
            "o",
            color=row.colour,
            markerfacecolor="none" if row.hollow else row.colour,
            markersize=4.5,
        )
        text = f"{100 * row.value:+.1f} %" if percent else f"{row.value:.3f}"
        ax.annotate(
            text,
            (1.0, y),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
            annotation_clip=False,
        )
    ax.set_yticks(range(len(panel.rows)), [row.name for row in panel.rows])
    ax.set_ylim(most - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    ax.grid(axis="x")
    title = panel.title if len(panel.title) <= LONGEST else f"{panel.title[: LONGEST - 1]}…"
    ax.set_title(title, fontsize=9 if len(title) < 40 else 7.5)
    if not log:
        ax.xaxis.set_major_locator(MaxNLocator(4))
        form = (lambda x, _: f"{100 * x:,.4g} %") if percent else (lambda x, _: f"{x:.3g}")
        ax.xaxis.set_major_formatter(FuncFormatter(form))
