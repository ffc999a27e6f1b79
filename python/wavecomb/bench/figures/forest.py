# SPDX-License-Identifier: Apache-2.0
"""Forest plots: one row for each compared item, showing a point with its interval."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis.data import BOUNDS
from wavecomb.bench.figures.style import (
    BLUE,
    FAINT,
    INK,
    INTERVALS,
    MAX_PANELS,
    WIDTH,
    CaptionedFigure,
    clipped,
    colour,
    count_words,
    figure,
    fixed,
    marker,
    plain_logarithm,
    policy_colour,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

ROW = 0.21
"""Height of a row in inches."""
LONGEST = 56
"""Largest number of characters in the title of a panel."""


@dataclass(frozen=True)
class Row:
    """A row of a forest plot.

    Attributes:
        name: Label at the left of the row.
        value: Position of the point.
        low: Lower end of the interval; NaN if there is no interval.
        high: Upper end of the interval; NaN if there is no interval.
        colour: Colour of the point and its whiskers.
        hollow: Whether the point is hollow, which marks a bound or a baseline.
    """

    name: str
    value: float
    low: float
    high: float
    colour: str = INK
    hollow: bool = False


@dataclass(frozen=True)
class Panel:
    """A panel of a forest plot: rows under one title."""

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
    """Makes a panel for each value in the column ``by``, with a row for each row of the table.

    Args:
        table: Table with the columns ``name``, ``value``, ``low`` and ``high``.
        by: Column with the titles of panels.
        name: Column with the names of rows.
        value: Column with the positions of points.
        prefix: Prefix of the columns ``low`` and ``high``.
        colour: Returns the colour of a row.
        hollow: Returns whether a row is a bound or a baseline.
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
) -> CaptionedFigure:
    """Draws panels of rows on one scale, with a line at the value that means "no difference"."""
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
        for ax in axes:  # keep some space on both sides of the centre line
            ax.set_xlim(min(low, centre * 0.95), max(high, centre * 1.05))
            plain_logarithm(ax.xaxis)
    for ax in axes[max(0, len(panels) - columns) : len(panels)]:
        ax.set_xlabel(x_label)
        ax.tick_params(labelbottom=True)
    return CaptionedFigure(name, title, caption, made)


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


# ---- Figures of the verdicts: order, regret, the factorial, predicted costs, images


MAX_INTERACTIONS = 14
_FACTORS = {
    **{"policy": "policy", "lanes": "lanes", "wave_size": "wave size", "roulette": "roulette"},
    **{"ray_order": "order of rays", "shadow_order": "order of shadow rays"},
}


def order_figure(table: pd.DataFrame, name: str, metric_words: str) -> CaptionedFigure | None:
    """Draws the time of each policy relative to the placebo, with one panel per stratum."""
    if table.empty or table["placebo_ratio"].isna().all():
        return None
    panels = panels_of(
        table, "stratum", "policy", "placebo_ratio", "placebo_",
        colour=lambda row: policy_colour(row.policy), hollow=lambda row: row.policy in BOUNDS,
    )  # fmt: skip
    if len(panels) > MAX_PANELS:
        return None
    caption = (
        f"{metric_words.capitalize()}: ratio to random-runs, which has the runs of a material in "
        f"an order that means nothing. Geometric mean over stages and settings. {INTERVALS}, "
        f"n = {count_words(table['n'])} rounds. Hollow: the bounds."
    )
    return forest(name, "Gain of an order beyond grouping", caption, "to placebo", panels)


def regret_figure(table: pd.DataFrame, name: str) -> CaptionedFigure | None:
    """Draws the regret of each policy, with one panel for each group of comparable runs."""
    if table.empty or table["cell"].nunique() > MAX_PANELS:
        return None
    panels = panels_of(
        table, "cell", "policy", "regret", colour=lambda row: policy_colour(row.policy)
    )
    caption = (
        "Render time relative to the best fixed policy of the cell. "
        f"{INTERVALS}, n = {count_words(table['n'])} rounds."
    )
    title = "Regret: cost of a choice"
    return forest(name, title, caption, "regret", panels, centre=0.0, log=False, percent=True)


def effects_figure(table: pd.DataFrame, name: str, metric_words: str) -> CaptionedFigure | None:
    """Draws the main effects by factor, and the interactions that are furthest from 1."""
    if table.empty:
        return None
    panels = []
    for factor, part in table[table["kind"] == "main"].groupby("factor", sort=False):
        rows = [_effect_row(row, row.name_short) for row in _named(part).itertuples()]
        base = part["baseline"].iloc[0]
        shown = base if isinstance(base, str) else f"{base:g}"
        panels.append(Panel(f"{_FACTORS.get(factor, factor)}, to {shown}", rows))
    mixed = table[table["kind"] == "interaction"]
    mixed = mixed.reindex(np.log(mixed["ratio"]).abs().sort_values(ascending=False).index)
    if not mixed.empty:
        rows = [
            _effect_row(row, row.name)
            for row in mixed.head(MAX_INTERACTIONS).itertuples(index=False)
        ]
        panels.append(Panel("strongest interactions", rows))
    caption = (
        f"{metric_words.capitalize()}: factor by which a level changes it, geometric mean over all "
        f"combinations of the others. {INTERVALS}, n = {count_words(table['n'])} rounds. Grey: no "
        "difference shown."
    )
    return forest(name, f"Effects on {metric_words}", caption, "factor", panels, columns=1)


def _named(part: pd.DataFrame) -> pd.DataFrame:
    return part.assign(name_short=[text.partition(" ")[2] for text in part["name"]])


def _effect_row(row: Any, name: str) -> Row:
    told = row.verdict in ("less", "more")
    return Row(name, row.ratio, row.low, row.high, BLUE if told else FAINT)


def cost_figure(
    costs: pd.DataFrame, lines: Mapping[str, Mapping[str, Any]], name: str
) -> CaptionedFigure | None:
    """Draws the ratio of measured to predicted cost of each material, for each prediction."""
    kept = [(column, line) for column, line in lines.items() if line]
    if costs.empty or not kept:
        return None
    made, axes = figure(1, len(kept), 3.3, share_y=True)
    programs = sorted(costs["program"].unique())
    for ax, (column, line) in zip(axes, kept, strict=True):
        for k, program in enumerate(programs):
            part = costs[costs["program"] == program].groupby(["stage", "material"])
            means = part[[column, "measured_ns"]].mean()
            ax.plot(
                means[column],
                means["measured_ns"],
                marker(k),
                color=colour(k),
                markersize=4,
                alpha=0.8,
                label=program,
            )
        ax.set_xscale("log")
        ax.set_yscale("log")
        of_materials = costs.groupby(["stage", "material"])[[column, "measured_ns"]].mean()
        both = of_materials.to_numpy(np.float64)
        ends = np.array([np.nanmin(both), np.nanmax(both)])
        ax.plot(ends, ends, color=FAINT, linewidth=0.8, linestyle=(0, (4, 3)))
        x = np.geomspace(ends[0], ends[1], 50)
        fit = line["intercept"] + line["slope"] * x
        shown = fit > 0.5 * ends[0]
        ax.plot(x[shown], fit[shown], color=INK, linewidth=1.0)
        ax.set_title(
            f"r² = {fixed(line['r2'], 2)}, slope {line['slope']:.2f} "
            f"[{line['slope_low']:.2f}, {line['slope_high']:.2f}]"
        )
        ax.set_xlabel(
            f"predicted, ns per record: {'calibrated' if 'calib' in column else 'average'}"
        )
        ax.grid()
        ax.set_aspect("equal", adjustable="datalim")
        for axis in (ax.xaxis, ax.yaxis):
            plain_logarithm(axis, (1.0, 3.0))
    axes[0].set_ylabel("measured, ns per record")
    handles, texts = axes[0].get_legend_handles_labels()
    made.legend(handles, texts, loc="outside upper left", ncols=6, handletextpad=0.1)
    caption = (
        f"A point is a material ({kept[0][1]['materials']} of them), mean over "
        f"{kept[0][1]['runs']} runs. Dashed: measured = predicted. Line: weighted least squares."
    )
    return CaptionedFigure(name, "Predicted and measured cost", caption, made)


def difference_figure(
    pictures: Sequence[tuple[str, NDArray[Any]]], golden: NDArray[Any], name: str, title: str
) -> CaptionedFigure:
    """Draws the relative luminance differences of images to a golden image, on one scale."""
    from wavecomb.image.compare.comparison import luminance

    reference = luminance(golden)
    maps = [
        (text, (luminance(pixels) - reference) / (np.abs(reference) + 0.01))
        for text, pixels in pictures
    ]
    limit = float(np.quantile(np.abs([values for _, values in maps]), 0.99)) or 1e-6
    # Lay out at least two columns of maps, since a single map would fill the page width.
    columns = min(3, max(2, len(maps)))
    lines = -(-len(maps) // columns)
    height, width = reference.shape
    made, axes = figure(
        lines, columns, 0.95 + lines * (0.3 + WIDTH * 0.96 / columns * height / width)
    )
    for ax, (text, values) in zip(axes, maps, strict=False):
        shown = ax.imshow(values, cmap="PuOr_r", vmin=-limit, vmax=limit, interpolation="nearest")
        ax.set_title(text)
        ax.set_axis_off()
    for ax in axes[len(maps) :]:
        ax.set_visible(False)
    bar = made.colorbar(shown, ax=axes, location="bottom", fraction=0.06, aspect=50, pad=0.02)
    bar.set_label("(picture − golden) / (golden + 0.01), luminance; orange is brighter")
    bar.outline.set_visible(False)
    caption = (
        f"Scale to ±{limit:.2g}, the 99th percentile of all maps shown. Equal patterns in all "
        "maps are noise of the same random numbers."
    )
    return CaptionedFigure(name, title, caption, made)
