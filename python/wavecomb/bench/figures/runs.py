# SPDX-License-Identifier: Apache-2.0
"""Figures of an experiment: policies, phases, coherence, lanes, scaling, error over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wavecomb.bench.analysis.data import (
    BOUNDS,
    cells,
    in_order,
    label,
    rounds,
    short_count,
    varying,
)
from wavecomb.bench.analysis.interval import bootstrap
from wavecomb.bench.figures.forest import forest, panels_of
from wavecomb.bench.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INTERVALS,
    MAX_PANELS,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    CaptionedFigure,
    clipped,
    colour,
    count_words,
    figure,
    label_ends,
    marker,
    plain_logarithm,
    policy_colour,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

STACK = (
    ("camera, film", ("generate_s", "collect_s", "resolve_s"), GREEN),
    ("order of rays", ("order_rays_s",), PURPLE),
    ("trace", ("trace_s",), BLUE),
    ("keys, sort, move", ("keys_s", "sort_s", "materialize_s"), RED),
    ("shade", ("shade_s",), ORANGE),
    ("shadow rays", ("shadow_s",), SKY),
    ("metrics, waiting", ("metrics_s", "other_s"), FAINT),
)
COHERENCE = (
    ("run_length_coherence", "run length, records", True),
    ("cache_line_homogeneity", "same material", False),
    ("texture_homogeneity", "same texture position", False),
    ("lane_utilisation", "lanes full", False),
)


def ratio_figure(
    table: pd.DataFrame, name: str, title: str, x_label: str, factor: str
) -> CaptionedFigure | None:
    """Draws a table of ``ratios``, one panel per cell; returns None for too many cells."""
    if table.empty or table["cell"].nunique() > MAX_PANELS:
        return None
    panels = panels_of(
        table, "cell", "level", "ratio",
        colour=lambda row: policy_colour(row.level) if factor == "policy" else BLUE,
        hollow=lambda row: row.is_baseline or row.level in BOUNDS,
    )  # fmt: skip
    base = table.loc[table["is_baseline"], "level"].iloc[0]
    caption = (
        f"{x_label[:1].upper()}{x_label[1:]}: ratio of means to {base}, 1 is no difference. "
        f"{INTERVALS}, n = {count_words(table['n'])} rounds. Hollow: the baseline, and bounds."
    )
    return forest(name, title, caption, x_label, panels)


def pipeline(runs: pd.DataFrame, name: str) -> CaptionedFigure | None:
    """Draws the phase times of each policy as stacked bars, one panel per group of runs."""
    groups = list(cells(runs.dropna(subset=["shade_s"]), "policy"))
    if not groups or len(groups) > MAX_PANELS:
        return None
    names = varying([cell for cell, _ in groups])
    columns = 1 if len(groups) == 1 else 2
    lines = math.ceil(len(groups) / columns)
    most = max(group["policy"].nunique() for _, group in groups)
    made, axes = figure(lines, columns, 0.9 + lines * (0.45 + 0.21 * most))
    for ax, (cell, group) in zip(axes, groups, strict=False):
        means = group.groupby("policy").mean(numeric_only=True)
        policies = in_order("policy", list(means.index))
        left = np.zeros(len(policies))
        for text, phases, shade in STACK:
            width = means.loc[policies, list(phases)].fillna(0.0).sum(axis=1).to_numpy()
            width = np.maximum(width, 0.0)
            ax.barh(range(len(policies)), width, left=left, color=shade, height=0.72, label=text)
            left += width
        ax.set_yticks(range(len(policies)), policies)
        ax.set_ylim(most - 0.4, -0.6)
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
        ax.grid(axis="x")
        title = label(cell, names)
        ax.set_title(title, fontsize=9 if len(title) < 40 else 7.5)
    for ax in axes[len(groups) :]:
        ax.set_visible(False)
    for ax in axes[max(0, len(groups) - columns) : len(groups)]:
        ax.set_xlabel("thread seconds")
    handles, texts = axes[0].get_legend_handles_labels()
    made.legend(handles, texts, loc="outside upper left", ncols=7, handlelength=1, columnspacing=1)
    caption = (
        "Exclusive phases, which add up to threads x render time; means over "
        f"{count_words(runs.groupby('config').size())} runs."
    )
    return CaptionedFigure(name, "Where the time goes", caption, made)


def coherence(runs: pd.DataFrame, name: str) -> CaptionedFigure | None:
    """Draws four measures of coherence for each policy, one series per group of runs."""
    groups = list(cells(runs.dropna(subset=["run_length_coherence"]), "policy"))
    if not groups or len(groups) > 6:
        return None
    names = varying([cell for cell, _ in groups])
    policies = in_order("policy", sorted(runs["policy"].unique()))
    made, axes = figure(1, len(COHERENCE), 1.0 + 0.24 * len(policies), share_y=True)
    for ax, (column, text, log) in zip(axes, COHERENCE, strict=True):
        if log:
            ax.set_xscale("log")
        for k, (cell, group) in enumerate(groups):
            means = group.groupby("policy")[column].mean().reindex(policies)
            offset = 0.16 * (k - 0.5 * (len(groups) - 1))
            ax.plot(
                means,
                np.arange(len(policies)) + offset,
                marker(k),
                color=colour(k),
                markersize=4,
                label=label(cell, names),
            )
        if log:
            plain_logarithm(ax.xaxis)
        else:
            ax.set_xlim(-0.04, 1.04)
        ax.set_xlabel(text, fontsize=7.5)
        ax.grid(axis="both")
        ax.tick_params(axis="y", length=0)
    axes[0].set_yticks(range(len(policies)), policies)
    axes[0].set_ylim(len(policies) - 0.4, -0.6)
    handles, texts = axes[0].get_legend_handles_labels()
    made.legend(handles, texts, loc="outside upper left", ncols=3, handletextpad=0.1)
    caption = (
        "Means over runs. Run length is logarithmic; all other values are fractions of neighbours."
    )
    return CaptionedFigure(name, "Effect of an order on coherence", caption, made)


def curve(
    runs: pd.DataFrame,
    x: str,
    metrics: Sequence[tuple[str, str]],
    name: str,
    title: str,
    x_label: str,
    series: str = "policy",
) -> CaptionedFigure | None:
    """Draws metrics over a numeric column on logarithmic axes, with a line for each series.

    Args:
        runs: Runs that differ only in x and the series.
        x: Column with numbers.
        metrics: Column and axis label of each panel.
        name: Name of the figure.
        title: Title of the figure.
        x_label: Label of the x axis, with its unit.
        series: Column that distinguishes the lines.
    """
    kept = [(metric, text) for metric, text in metrics if runs[metric].notna().any()]
    if runs[x].nunique() < 2 or not kept:
        return None
    made, axes = figure(1, len(kept), 2.7)
    for ax, (metric, text) in zip(axes, kept, strict=True):
        ends, means = [], []
        names = in_order(series, sorted(runs[series].dropna().unique()))
        for k, level in enumerate(names):
            points = intervals(runs[runs[series] == level], x, metric)
            means += [mean for _, mean, _, _ in points]
            shade = policy_colour(level) if series == "policy" else colour(k)
            _line(ax, points, shade, marker(k))
            ends.append((points[-1][0], points[-1][1], str(level), shade))
        ax.set_xscale("log", base=2)
        ax.set_yscale("log")
        _measured_ticks(ax, sorted(runs[x].unique()))
        ax.set_ylim(*clipped(*ax.get_ylim(), means))
        plain_logarithm(ax.yaxis)
        ax.set_xlabel(x_label)
        ax.set_title(text)
        ax.grid(axis="y")
        made.draw_without_rendering()
        label_ends(ax, ends)
    caption = (
        f"Means over {count_words(runs.groupby('config').size())} runs. {INTERVALS}. "
        "Both axes are logarithmic."
    )
    return CaptionedFigure(name, title, caption, made)


def error_over_time(runs: pd.DataFrame, name: str) -> CaptionedFigure | None:
    """Draws relMSE over render time.

    A line for each policy or renderer connects its sample counts.
    """
    runs = runs[runs["rel_mse"].fillna(0.0) > 0.0]
    if runs.empty or runs["spp"].nunique() < 2:
        return None
    series = "renderer" if runs["renderer"].nunique() > 1 else "policy"
    stages = list(runs.groupby("stage", sort=False))[:4]
    made, axes = figure(1, len(stages), 3.0)
    for ax, (stage, of_stage) in zip(axes, stages, strict=True):
        ends = []
        ax.set_xscale("log")
        ax.set_yscale("log")
        names = in_order(series, sorted(of_stage[series].unique()))
        for k, level in enumerate(names):
            means = of_stage[of_stage[series] == level].groupby("spp")[["render_s", "rel_mse"]]
            points = means.mean().sort_index()
            spread = means.sem().reindex(points.index).fillna(0.0)
            shade = policy_colour(level) if series == "policy" else colour(k)
            ax.errorbar(
                points["render_s"],
                points["rel_mse"],
                xerr=2 * spread["render_s"],
                yerr=2 * spread["rel_mse"],
                color=shade,
                marker=marker(k),
                markersize=4,
            )
            ends.append((points["render_s"].iloc[-1], points["rel_mse"].iloc[-1], level, shade))
        x = np.array(ax.get_xlim())
        first = of_stage.loc[of_stage["spp"].idxmin()]
        guide = 1.6 * first["rel_mse"] * first["render_s"] / x
        ax.plot(x, guide, color=FAINT, linewidth=0.8, linestyle=(0, (4, 3)), scalex=False)
        ax.annotate(
            "slope −1",
            (x[1], guide[1]),
            xytext=(-4, 9),
            textcoords="offset points",
            ha="right",
            color=FAINT,
        )
        plain_logarithm(ax.xaxis)
        plain_logarithm(ax.yaxis)
        ax.set_xlabel("render time, s")
        ax.set_title(f"{stage}: relMSE" if len(stages) > 1 else "relMSE")
        ax.grid(axis="both")
        made.draw_without_rendering()
        label_ends(ax, ends)
    counts = ", ".join(f"{value:.0f}" for value in sorted(runs["spp"].unique()))
    caption = (
        f"Each point is a sample count ({counts} per pixel), mean over "
        f"{count_words(runs.groupby('config').size())} runs, bars: two standard errors. Along the "
        "dashed line error x time is constant; lower and to the left is better."
    )
    return CaptionedFigure(name, "Error against time", caption, made)


def intervals(runs: pd.DataFrame, x: str, metric: str) -> list[tuple[float, float, float, float]]:
    """Returns, for each value of column `x`, the value, the mean metric and its interval."""
    levels, values = rounds(runs.dropna(subset=[metric]), x, metric)
    order = np.argsort(levels)
    found = bootstrap(values, lambda means: means, positive=True)
    return [(float(levels[k]), found[k].value, found[k].low, found[k].high) for k in order]


def _line(
    ax: Axes, points: Sequence[tuple[float, float, float, float]], shade: str, shape: str
) -> None:
    x, y, low, high = np.array(points).T
    bars = np.nan_to_num(np.maximum(np.stack([y - low, high - y]), 0.0))
    ax.errorbar(x, y, yerr=bars, color=shade, marker=shape, markersize=4, capsize=0)


def _measured_ticks(ax: Axes, values: Sequence[float]) -> None:
    """Puts ticks at the measured values, at most eight, with short labels."""
    from matplotlib.ticker import NullLocator

    step = math.ceil(len(values) / 8)
    ax.set_xticks(list(values)[::step], [short_count(float(v)) for v in list(values)[::step]])
    ax.xaxis.set_minor_locator(NullLocator())
