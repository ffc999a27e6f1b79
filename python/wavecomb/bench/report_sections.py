# SPDX-License-Identifier: Apache-2.0
"""What the report says of each experiment, and of the suite as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from wavecomb.bench import figures_runs, figures_verdicts
from wavecomb.bench.analysis_costs import PREDICTIONS, calibration, material_costs
from wavecomb.bench.analysis_data import BOUNDS
from wavecomb.bench.analysis_factorial import effects, factors_of
from wavecomb.bench.analysis_order import order_effects, regrets
from wavecomb.bench.analysis_ratios import means, ratios
from wavecomb.bench.columns import COUNTER_COLUMNS
from wavecomb.bench.figures_style import Drawn, fixed, lay_out, save, svg
from wavecomb.bench.report_html import Section, figure, folded, key_of, paragraph
from wavecomb.bench.report_tables import (
    calibration_table,
    effects_table,
    mean_table,
    order_table,
    ratio_table,
    regret_table,
)

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from wavecomb.bench.analysis_data import Results

SCHEDULING = ("lanes", "wave_size", "policy", "roulette", "ray_order", "shadow_order")
MOST_ROWS = 60
"""Longer tables are folded."""


class Writer:
    """Collects sections and findings, and saves figures as they are made."""

    def __init__(self, figures: Path) -> None:
        self.figures = figures
        self.sections: list[Section] = []
        self.findings: list[str] = []

    def begin(self, title: str) -> None:
        """A new section."""
        self.sections.append(Section(key_of(title), title))

    def add(self, *parts: str) -> None:
        """HTML to the section."""
        self.sections[-1].parts += [part for part in parts if part]

    def draw(self, drawn: Drawn | None) -> None:
        """A figure to the section, if there is one."""
        if drawn is not None:
            lay_out(drawn)
            drawing = svg(drawn)
            save(drawn, drawing, self.figures)
            self.add(figure(drawn, drawing))

    def rows(self, count: int, summary: str, text: str) -> None:
        """A table, folded if it is long."""
        self.add(folded(f"{summary} ({count} rows)", text) if text and count > MOST_ROWS else text)


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
        _policies(out, name, ours)
    elif ours["ray_order"].nunique() > 1:
        _levels(out, name, ours, "ray_order", "order of rays")
    _curves(out, name, runs)
    out.draw(figures_runs.error_over_time(runs, f"{key_of(name)}-error"))
    _errors(out, name, runs)
    _counters(out, name, ours)


def suite(out: Writer, results: Results) -> None:
    """What goes across experiments: roulette, effects, costs."""
    ours = results.runs[results.runs["renderer"] == "wavecomb"]
    flat = ours[ours["factor"] == ""]
    if flat["roulette"].nunique() > 1:
        _roulette(out, flat)
    if len(factors_of(flat)) > 1:
        _effects(out, flat)
    costs = material_costs(results)
    if not costs.empty:
        lines = {column: calibration(costs, column) for column in PREDICTIONS}
        if any(lines.values()):
            out.begin("Predicted cost")
            out.add(calibration_table(lines, PREDICTIONS))
            out.draw(figures_verdicts.cost_figure(costs, lines, "costs"))
            first = lines["calibrated_ns"] or lines["predicted_ns"]
            out.findings.append(
                f"Calibration predicts what materials cost with r² = {fixed(first['r2'], 2)} and "
                f"slope {first['slope']:.2f} [{first['slope_low']:.2f}, {first['slope_high']:.2f}]."
            )


def _policies(out: Writer, name: str, runs: pd.DataFrame) -> None:
    metrics = {
        "shade": ratios(runs, "policy", "shade_s"),
        "render": ratios(runs, "policy", "render_s"),
        "shade + order": ratios(runs, "policy", "shade_and_order_s"),
    }
    main = metrics["shade + order"]
    if not main.empty:
        text = ratio_table(
            "Times by policy, ratio of means to none",
            metrics,
            "policy",
            "Brackets: 95 % intervals, rounds resampled whole. At none: seconds, threads together "
            "but for render. The verdict is on shade + order, which holds what an order costs.",
        )
        out.rows(len(main), "Times by policy, ratio of means to none", text)
    if (runs["factor"] != "").any():
        return  # curves over the factor say more
    key = key_of(name)
    words = "shade + order time"
    title = "Shade + order time by policy"
    out.draw(figures_runs.ratio_figure(main, f"{key}-policies", title, words, "policy"))
    out.draw(figures_runs.pipeline(runs, f"{key}-pipeline"))
    out.draw(figures_runs.coherence(runs, f"{key}-coherence"))
    order = order_effects(runs)
    if not order.empty:
        out.add("<h3>The verdict on order</h3>")
        out.add(order_table(order, "Each order apart from roulette: shade + order time"))
        out.draw(figures_verdicts.order_figure(order, f"{key}-order", words))
        out.findings += _order_findings(name, order)
    regret = regrets(runs)
    if not regret.empty:
        out.add("<h3>Regret</h3>")
        out.add(regret_table(regret, "Regret of a policy for all cells: render time"))
        out.draw(figures_verdicts.regret_figure(regret, f"{key}-regret"))
        of_adaptive = regret[regret["policy"] == "adaptive"]
        if not of_adaptive.empty:
            worst = of_adaptive.loc[of_adaptive["regret"].idxmax()]
            out.findings.append(
                f"{name}: adaptive takes {100 * of_adaptive['regret'].mean():+.1f} % on average "
                f"beside the best fixed policy of each cell, at worst {100 * worst.regret:+.1f} % "
                f"[{100 * worst.low:.1f}, {100 * worst.high:.1f}] ({worst.cell})."
            )


def _order_findings(name: str, order: pd.DataFrame) -> list[str]:
    lines = []
    for stratum, part in order.groupby("stratum", sort=False):
        real = part[~part["policy"].isin([*BOUNDS, "none"])]
        quicker = real[real["verdict"] == "faster"].sort_values("ratio")
        if quicker.empty:
            text = "no order is shown to be quicker than arrival order"
        else:
            best = quicker.iloc[0]
            text = (
                f"{len(quicker)} of {len(real)} orders are quicker than arrival order; "
                f"{best.policy} takes {best.ratio:.3f} of its shade + order time "
                f"[{best.low:.3f}, {best.high:.3f}]"
            )
        slower = list(real[real["verdict"] == "slower"]["policy"])
        text += f"; slower: {', '.join(slower)}" if slower else ""
        gained = part[part["gap_shown"]]
        if not gained.empty and "oracle" in set(gained["policy"]):
            oracle = gained[gained["policy"] == "oracle"].iloc[0]
            text += (
                f". The oracle takes {oracle.placebo_ratio:.3f} of the placebo's time: more than "
                "that better costs cannot win"
            )
        elif part["placebo_ratio"].notna().any() and set(part["policy"]) & {
            "oracle",
            "oracle-best",
        }:
            text += ". The oracle is not shown to beat the placebo"
        where = name if stratum == "all" else f"{name}, {stratum}"
        lines.append(f"{where}: {text}.")
    return lines


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


def _roulette(out: Writer, runs: pd.DataFrame) -> None:
    across = ("experiment", "factor", "factor_value")
    metrics: dict[str, Any] = {
        text: ratios(runs, "roulette", column, ignore=across)
        for text, column in (
            ("rays", "rays"),
            ("records", "records"),
            ("relMSE", "rel_mse"),
            ("efficiency", "efficiency"),
            ("shade + order", "shade_and_order_s"),
            ("render", "render_s"),
        )
        if runs[column].notna().any()
    }
    main = metrics.get("render")
    if main is None or main.empty:
        return
    out.begin("Roulette apart from order")
    out.add(
        paragraph(
            "Roulette changes how much is shaded, and with it the noise; order does not. So it is "
            "judged by efficiency, with the policy the same on both sides."
        )
    )
    title = "Roulette at the same policy, ratio of means to throughput"
    out.rows(len(main), title, ratio_table(title, metrics, "roulette"))
    if "efficiency" in metrics:
        words = "efficiency"
        drawn = figures_runs.ratio_figure(
            metrics["efficiency"], "roulette-efficiency", "Roulette: efficiency", words, "roulette"
        )
        out.draw(drawn)


def _effects(out: Writer, runs: pd.DataFrame) -> None:
    out.begin("Effects of the factors")
    for metric, words in (
        ("render_s", "render time"),
        ("shade_and_order_s", "shade + order time"),
        ("efficiency", "efficiency"),
    ):
        if runs[metric].isna().all():
            continue
        table = effects(runs, metric)
        if table.empty:
            continue
        key = f"effects-{key_of(words)}"
        out.draw(figures_verdicts.effects_figure(table, key, words))
        title = f"Effects on {words}"
        out.add(folded(f"{title}: all {len(table)}", effects_table(table, title)))
