# SPDX-License-Identifier: Apache-2.0
"""Figures of the verdicts: order, regret, the factorial, predicted costs, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis_data import BOUNDS
from wavecomb.bench.figures_forest import Panel, Row, forest, panels_of
from wavecomb.bench.figures_runs import INTERVALS, MOST_PANELS, count_words
from wavecomb.bench.figures_style import (
    BLUE,
    FAINT,
    INK,
    WIDTH,
    Drawn,
    colour,
    figure,
    fixed,
    marker,
    plain_logarithm,
    policy_colour,
)

if TYPE_CHECKING:
    import pandas as pd

MOST_INTERACTIONS = 14
_FACTORS = {
    **{"policy": "policy", "lanes": "lanes", "wave_size": "wave size", "roulette": "roulette"},
    **{"ray_order": "order of rays", "shadow_order": "order of shadow rays"},
}


def order_figure(table: pd.DataFrame, name: str, metric_words: str) -> Drawn | None:
    """Ratio of each policy to the placebo, with the oracle, a panel for each stratum."""
    if table.empty or table["placebo_ratio"].isna().all():
        return None
    panels = panels_of(
        table, "stratum", "policy", "placebo_ratio", "placebo_",
        colour=lambda row: policy_colour(row.policy), hollow=lambda row: row.policy in BOUNDS,
    )  # fmt: skip
    if len(panels) > MOST_PANELS:
        return None
    caption = (
        f"{metric_words.capitalize()}: ratio to random-runs, which has the runs of a material in "
        f"an order that means nothing. Geometric mean over stages and settings. {INTERVALS}, "
        f"n = {count_words(table['n'])} rounds. Hollow: the bounds."
    )
    return forest(name, "What an order is worth beyond grouping", caption, "to placebo", panels)


def regret_figure(table: pd.DataFrame, name: str) -> Drawn | None:
    """Regret of each policy, a panel for each cell."""
    if table.empty or table["cell"].nunique() > MOST_PANELS:
        return None
    panels = panels_of(
        table, "cell", "policy", "regret", colour=lambda row: policy_colour(row.policy)
    )
    caption = (
        "Render time above that of the best fixed policy of the cell. "
        f"{INTERVALS}, n = {count_words(table['n'])} rounds."
    )
    title = "Regret: what a choice costs"
    return forest(name, title, caption, "regret", panels, centre=0.0, log=False, percent=True)


def effects_figure(table: pd.DataFrame, name: str, metric_words: str) -> Drawn | None:
    """Main effects by factor, and the interactions that are furthest from 1."""
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
            for row in mixed.head(MOST_INTERACTIONS).itertuples(index=False)
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
) -> Drawn | None:
    """Measured over predicted cost of each material, a panel for each prediction."""
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
        ax.set_xlabel(f"predicted, ns a record: {'calibrated' if 'calib' in column else 'average'}")
        ax.grid()
        ax.set_aspect("equal", adjustable="datalim")
        for axis in (ax.xaxis, ax.yaxis):
            plain_logarithm(axis, (1.0, 3.0))
    axes[0].set_ylabel("measured, ns a record")
    handles, texts = axes[0].get_legend_handles_labels()
    made.legend(handles, texts, loc="outside upper left", ncols=6, handletextpad=0.1)
    caption = (
        f"A point is a material ({kept[0][1]['materials']} of them), mean over "
        f"{kept[0][1]['runs']} runs. Dashed: measured = predicted. Line: weighted least squares."
    )
    return Drawn(name, "Predicted and measured cost", caption, made)


def difference_figure(
    pictures: Sequence[tuple[str, NDArray[Any]]], golden: NDArray[Any], name: str, title: str
) -> Drawn:
    """Relative luminance differences to a golden picture, on one scale."""
    from wavecomb.picture.compare import luminance

    reference = luminance(golden)
    maps = [
        (text, (luminance(pixels) - reference) / (np.abs(reference) + 0.01))
        for text, pixels in pictures
    ]
    limit = float(np.quantile(np.abs([values for _, values in maps]), 0.99)) or 1e-6
    columns = min(3, max(2, len(maps)))  # one map alone would fill a page
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
        f"Scale to ±{limit:.2g}, the 99th percentile of all maps shown. What is the same in all of "
        "them is noise of the same random numbers."
    )
    return Drawn(name, title, caption, made)
