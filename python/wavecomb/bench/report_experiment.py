# SPDX-License-Identifier: Apache-2.0
"""What the report says of each experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavecomb.bench import figures_runs
from wavecomb.bench.analysis_data import BASELINES
from wavecomb.bench.analysis_ratios import means, ratios
from wavecomb.bench.columns import COUNTER_COLUMNS
from wavecomb.bench.report_html import key_of, paragraph
from wavecomb.bench.report_policies import policies
from wavecomb.bench.report_tables import mean_table, ratio_table
from wavecomb.bench.report_writer import Writer

if TYPE_CHECKING:
    import pandas as pd

SCHEDULING = ("lanes", "wave_size", "policy", "roulette", "ray_order", "shadow_order")


def experiment(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """All of one experiment."""
    out.begin(f"Experiment {name}")
    repetitions = runs.groupby("config").size()
    out.add(
        paragraph(
            f"{runs['config'].nunique()} configurations, {len(runs)} runs, "
            f"{figures_runs.count_words(repetitions)} of each, interleaved in random order."
        )
    )
    ours = runs[runs["renderer"] == "wavecomb"]
    if runs["renderer"].nunique() > 1:
        _renderers(out, name, runs)
    if ours["policy"].nunique() > 1:
        policies(out, name, ours)
    elif ours["ray_order"].nunique() > 1:
        _levels(out, name, ours, "ray_order", "order of rays")
    _cases(out, name, ours)
    _curves(out, name, runs)
    out.draw(figures_runs.error_over_time(runs, f"{key_of(name)}-error"))
    _errors(out, name, runs)
    _counters(out, name, ours)


def _levels(out: Writer, name: str, runs: pd.DataFrame, factor: str, words: str) -> None:
    metrics = {
        text: ratios(runs, factor, column)
        for text, column in (
            ("order of rays", "order_rays_s"),
            ("trace", "trace_s"),
            ("render", "render_s"),
        )
        if (runs[column] > 0).all()
    }
    main = metrics.get("render")
    if main is None or main.empty:
        return
    title = f"Times by {words}, ratio of means to {main.loc[main['is_baseline'], 'level'].iloc[0]}"
    out.rows(len(main), title, ratio_table(title, metrics, words))
    drawn = figures_runs.ratio_figure(
        main, f"{key_of(name)}-{key_of(factor)}", f"Render time by {words}", "render time", factor
    )
    out.draw(drawn)


def _cases(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Named settings that change together, each compared with those that are named "off"."""
    if BASELINES["case"] not in set(runs["case"]) or runs["case"].nunique() < 2:
        return
    metrics = {
        text: ratios(runs, "case", column, ignore=("roulette",))
        for text, column in (
            ("relMSE", "rel_mse"),
            ("render", "render_s"),
            ("efficiency", "efficiency"),
        )
        if runs[column].notna().any()
    }
    main = next(reversed(metrics.values()))
    title = f"Ratio of means to {BASELINES['case']}"
    out.rows(len(main), title, ratio_table(title, metrics, "with"))
    for text, table in metrics.items():
        key = f"{key_of(name)}-cases-{key_of(text)}"
        out.draw(figures_runs.ratio_figure(table, key, f"{name}: {text}", text, "case"))


def _renderers(out: Writer, name: str, runs: pd.DataFrame) -> None:
    metrics = {
        text: ratios(runs, "renderer", column, ignore=(*SCHEDULING, "max_depth"))
        for text, column in (
            ("relMSE", "rel_mse"),
            ("efficiency", "efficiency"),
            ("samples/s", "samples_per_s"),
        )
        if runs[column].notna().any()
    }
    title = "Renderers, ratio of means to Wavecomb"
    out.add(ratio_table(title, metrics, "renderer"))
    for text, column in (("samples/s", "samples per second"), ("efficiency", "efficiency")):
        if text in metrics:
            key = f"{key_of(name)}-renderers-{key_of(column)}"
            drawn = figures_runs.ratio_figure(
                metrics[text], key, f"Renderers: {column}", column, "renderer"
            )
            out.draw(drawn)


def _curves(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Over the factor of a scaling experiment, and over lanes and wave sizes where they vary."""
    key = key_of(name)
    times = (("shade_and_order_s", "shade + order, thread s"), ("render_s", "render, s"))
    series = next(
        (n for n in ("policy", "ray_order", "renderer", "roulette") if runs[n].nunique() > 1),
        "policy",
    )
    factor = str(runs["factor"].iloc[0])
    if factor and runs["factor_value"].notna().all():
        # A factor of the stage is part of the stage's name: what is before it is the stage.
        bases = runs["stage"].map(lambda stage: stage.partition(f"-{factor}-")[0])
        for base, part in runs.groupby(bases, sort=False):
            words = factor.replace("_", " ")
            drawn = figures_runs.curve(
                part,
                "factor_value",
                times,
                f"{key}-{key_of(str(base))}-curve",
                f"{base}: time over {words}",
                words,
                series,
            )
            out.draw(drawn)
        return
    for column, words in (("lanes", "SIMD lanes"), ("wave_size", "paths in a wave")):
        others = [n for n in ("stage", "width", "spp", *SCHEDULING) if n not in (column, series)]
        if runs[column].nunique() < 2 or any(runs[n].nunique() > 1 for n in others if n != "stage"):
            continue
        for stage, part in runs.groupby("stage", sort=False):
            drawn = figures_runs.curve(
                part,
                column,
                times,
                f"{key}-{key_of(str(stage))}-{key_of(column)}",
                f"{stage}: time over {words}",
                words,
                series,
            )
            out.draw(drawn)


def _errors(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Variance and efficiency, where pictures were compared with golden ones."""
    if runs["rel_mse"].isna().all():
        return
    factor = "renderer" if runs["renderer"].nunique() > 1 else "policy"
    ignore = SCHEDULING if factor == "renderer" else ()
    found = means(
        runs.dropna(subset=["rel_mse"]),
        factor,
        ("variance", "rel_mse", "render_s", "efficiency"),
        ignore,
    )
    columns = {
        "variance": "variance",
        "relMSE": "rel_mse",
        "render, s": "render_s",
        "efficiency, 1/s": "efficiency",
    }
    title = "Variance and efficiency"
    note = "Efficiency: 1 / (relMSE x render time). Variance: mean squared error to golden."
    out.rows(len(found), title, mean_table(found, title, factor, columns, note))


def _counters(out: Writer, name: str, runs: pd.DataFrame) -> None:
    if not runs[list(COUNTER_COLUMNS)].notna().any().any():
        return
    found = means(runs, "policy", COUNTER_COLUMNS)
    columns = {column.replace("_", " "): column for column in COUNTER_COLUMNS}
    title = "Hardware counters, events per record"
    out.rows(len(found), title, mean_table(found, title, "policy", columns))
