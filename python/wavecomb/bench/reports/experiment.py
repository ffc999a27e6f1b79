# SPDX-License-Identifier: Apache-2.0
"""Sections of the report: one for each experiment, and those about the whole suite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from wavecomb.bench.analysis.data import BASELINES, BOUNDS
from wavecomb.bench.analysis.factorial import (
    PREDICTIONS,
    calibration,
    effects,
    factors_of,
    material_costs,
)
from wavecomb.bench.analysis.ratios import means, order_effects, ratios, regrets
from wavecomb.bench.figures import forest
from wavecomb.bench.figures import runs as run_figures
from wavecomb.bench.figures.style import count_words, fixed
from wavecomb.bench.oracle import BEST, COSTS, WORST
from wavecomb.bench.reports.parts import Text, Writer, interval, key_of
from wavecomb.bench.reports.tables import (
    calibration_table,
    effects_table,
    mean_table,
    order_table,
    ratio_table,
    regret_table,
)
from wavecomb.bench.results import COUNTER_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis.data import Results

_LABELS = {
    **{"shade": "shade time", "shade + order": "shade + order time", "render": "render time"},
    "samples/s": "samples per second",
}
SCHEDULING = ("lanes", "wave_size", "policy", "roulette", "ray_order", "shadow_order")


def experiment(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Writes the section of the report about one experiment."""
    out.begin(f"Experiment {name}")
    repetitions = count_words(runs.groupby("config").size())
    out.add(
        Text(
            f"{runs['config'].nunique()} configurations, {len(runs)} runs, {repetitions} of each, "
            "interleaved in random order."
        )
    )
    key = key_of(name)
    ours = runs[runs["renderer"] == "wavecomb"]
    if runs["renderer"].nunique() > 1:
        _renderers(out, key, runs)
    if ours["policy"].nunique() > 1:
        _policies(out, name, ours)
    elif ours["ray_order"].nunique() > 1:
        _ray_orders(out, key, ours)
    _cases(out, name, ours)
    _curves(out, key, runs)
    out.draw(run_figures.error_over_time(runs, f"{key}-error"))
    _errors(out, runs)
    _counters(out, ours)


def compared(
    runs: pd.DataFrame, factor: str, columns: Mapping[str, str], ignore: Sequence[str] = ()
) -> dict[str, pd.DataFrame]:
    """Returns tables of ``ratios`` by title, for the columns whose values are all positive."""
    measured = {words: runs[column].dropna() for words, column in columns.items()}
    tables = {
        words: ratios(runs, factor, columns[words], ignore=ignore)
        for words, values in measured.items()
        if len(values) and (values > 0).all()
    }
    return {words: table for words, table in tables.items() if not table.empty}


def _ratio_figure(
    out: Writer, metrics: Mapping[str, pd.DataFrame], words: str, factor: str, name: str, title: str
) -> None:
    """Draws the ratios of one metric, if the experiment has such ratios."""
    if words in metrics:
        x_label = _LABELS.get(words, words)
        out.draw(run_figures.ratio_figure(metrics[words], name, title, x_label, factor))


def _ray_orders(out: Writer, key: str, runs: pd.DataFrame) -> None:
    columns = {"order of rays": "order_rays_s", "trace": "trace_s", "render": "render_s"}
    metrics = compared(runs, "ray_order", columns)
    title = f"Times by order of rays, ratio of means to {BASELINES['ray_order']}"
    out.add(ratio_table(title, metrics, "order of rays"))
    name, title = f"{key}-ray-order", "Render time by order of rays"
    _ratio_figure(out, metrics, "render", "ray_order", name, title)


def _cases(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Compares each named case of settings with the case "off"."""
    if BASELINES["case"] not in set(runs["case"]) or runs["case"].nunique() < 2:
        return
    columns = {"relMSE": "rel_mse", "render": "render_s", "efficiency": "efficiency"}
    metrics = compared(runs, "case", columns, ("roulette",))
    out.add(ratio_table(f"Ratio of means to {BASELINES['case']}", metrics, "with"))
    for words, table in metrics.items():
        key = f"{key_of(name)}-cases-{key_of(words)}"
        out.draw(run_figures.ratio_figure(table, key, f"{name}: {words}", words, "case"))


def _renderers(out: Writer, key: str, runs: pd.DataFrame) -> None:
    columns = {"relMSE": "rel_mse", "efficiency": "efficiency", "samples/s": "samples_per_s"}
    metrics = compared(runs, "renderer", columns, (*SCHEDULING, "max_depth"))
    out.add(ratio_table("Renderers, ratio of means to Wavecomb", metrics, "renderer"))
    for words, name in (("samples/s", "samples per second"), ("efficiency", "efficiency")):
        file = f"{key}-renderers-{key_of(name)}"
        _ratio_figure(out, metrics, words, "renderer", file, f"Renderers: {name}")


def _curves(out: Writer, key: str, runs: pd.DataFrame) -> None:
    """Draws times over the factor of a scaling experiment, or over lane count and wave size."""
    times = (("shade_and_order_s", "shade + order, thread s"), ("render_s", "render, s"))
    series = next(
        (n for n in ("policy", "ray_order", "renderer", "roulette") if runs[n].nunique() > 1),
        "policy",
    )

    def curves(by: pd.Series, column: str, words: str, end: str) -> None:
        for stage, part in runs.groupby(by, sort=False):
            name, title = f"{key}-{key_of(str(stage))}-{end}", f"{stage}: time over {words}"
            out.draw(run_figures.curve(part, column, times, name, title, words, series))

    factor = str(runs["factor"].iloc[0])
    if factor and runs["factor_value"].notna().all():
        # The suite varies an option of a generated stage. The name of each generated stage ends
        # with the name and value of that option.
        bases = runs["stage"].map(lambda stage: stage.partition(f"-{factor}-")[0])
        curves(bases, "factor_value", factor.replace("_", " "), "curve")
        return
    for column, words in (("lanes", "SIMD lanes"), ("wave_size", "paths in a wave")):
        others = [n for n in ("width", "spp", *SCHEDULING) if n not in (column, series)]
        if runs[column].nunique() > 1 and all(runs[n].nunique() <= 1 for n in others):
            curves(runs["stage"], column, words, key_of(column))


def _errors(out: Writer, runs: pd.DataFrame) -> None:
    """Shows variance and efficiency of images that were compared with golden images."""
    if runs["rel_mse"].isna().all():
        return
    factor = "renderer" if runs["renderer"].nunique() > 1 else "policy"
    columns = {
        **{"variance": "variance", "relMSE": "rel_mse", "render, s": "render_s"},
        "efficiency, 1/s": "efficiency",
    }
    known = runs.dropna(subset=["rel_mse"])
    found = means(known, factor, list(columns.values()), SCHEDULING if factor == "renderer" else ())
    note = "Efficiency: 1 / (relMSE x render time). Variance: mean squared error to golden."
    out.add(mean_table(found, "Variance and efficiency", factor, columns, note))


def _counters(out: Writer, runs: pd.DataFrame) -> None:
    if runs[list(COUNTER_COLUMNS)].notna().any().any():
        columns = {column.replace("_", " "): column for column in COUNTER_COLUMNS}
        found = means(runs, "policy", COUNTER_COLUMNS)
        out.add(mean_table(found, "Hardware counters, events per record", "policy", columns))


# ---- policies ------------------------------------------------------------------------------------


def _policies(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Shows the times, the gain and the regret of each policy."""
    columns = {"shade": "shade_s", "render": "render_s", "shade + order": "shade_and_order_s"}
    metrics = compared(runs, "policy", columns)
    note = (
        "Brackets: 95 % intervals, rounds resampled whole. At none: seconds, summed over "
        "threads except for render. The verdict is on shade + order, which includes the cost of an "
        "order."
    )
    title = "Times by policy, ratio of means to none"
    out.add(ratio_table(title, metrics, "policy", note))
    if (runs["factor"] != "").any():
        return  # curves of a scaling experiment already show these ratios
    key = key_of(name)
    for words, end in (("shade", "shade"), ("shade + order", "policies")):
        title = f"{words.capitalize()} time by policy"
        _ratio_figure(out, metrics, words, "policy", f"{key}-{end}", title)
    out.draw(run_figures.pipeline(runs, f"{key}-pipeline"))
    out.draw(run_figures.coherence(runs, f"{key}-coherence"))
    order = order_effects(runs)
    if not order.empty:
        out.add(Text("The verdict on order", "heading"))
        out.add(order_table(order, "Each order apart from roulette: shade + order time"))
        out.draw(forest.order_figure(order, f"{key}-order", "shade + order time"))
        out.findings += _order_findings(name, order)
    regret = regrets(runs)
    if not regret.empty:
        out.add(Text("Regret", "heading"))
        out.add(regret_table(regret, "Regret of a policy for all cells: render time"))
        out.draw(forest.regret_figure(regret, f"{key}-regret"))
        adaptive = regret[regret["policy"] == "adaptive"]
        if not adaptive.empty:
            worst = adaptive.loc[adaptive["regret"].idxmax()]
            out.findings.append(
                f"{name}: adaptive takes {100 * adaptive['regret'].mean():+.1f} % on average "
                f"relative to the best fixed policy of each cell, at worst "
                f"{100 * worst.regret:+.1f} % "
                f"{interval(100 * worst.low, 100 * worst.high, 1)} ({worst.cell})."
            )


def _order_findings(name: str, order: pd.DataFrame) -> list[str]:
    lines = []
    for stratum, part in order.groupby("stratum", sort=False):
        real = part[~part["policy"].isin([*BOUNDS, "none"])]
        faster = real[real["verdict"] == "faster"].sort_values("ratio")
        if faster.empty:
            text = "no order is shown to be quicker than arrival order"
        else:
            best = faster.iloc[0]
            text = (
                f"{len(faster)} of {len(real)} orders are quicker than arrival order; "
                f"{best.policy} takes {best.ratio:.3f} of its shade + order time "
                f"[{best.low:.3f}, {best.high:.3f}]"
            )
        slower = list(real[real["verdict"] == "slower"]["policy"])
        text += f"; slower: {', '.join(slower)}" if slower else ""
        text += _bound_words(part)
        lines.append(f"{name if stratum == 'all' else f'{name}, {stratum}'}: {text}.")
    return lines


def _bound_words(part: pd.DataFrame) -> str:
    """Returns a sentence about the gain of the oracle policies, or "" if they were not run."""
    known = part.dropna(subset=["placebo_ratio"]).set_index("policy")
    words = {
        BEST: "The best order of runs by recorded true costs",
        COSTS: "Cost-benefit with true costs",
        WORST: "The worst order of runs",
    }
    text = ""
    for policy, name in words.items():
        if policy not in known.index:
            continue
        row = known.loc[policy]
        text += (
            f". {name} takes {row.placebo_ratio:.3f} "
            f"{interval(row.placebo_low, row.placebo_high)} of the placebo's time"
        )
        if policy != WORST and not row.placebo_high < 1.0:
            text += ": it is not shown to beat it"
    return text


# ---- Sections about a whole suite: roulette, effects, costs


def suite(out: Writer, results: Results) -> None:
    """Writes the sections that cover all experiments."""
    ours = results.runs[results.runs["renderer"] == "wavecomb"]
    flat = ours[ours["factor"] == ""]
    if flat["roulette"].nunique() > 1:
        _roulette(out, flat)
    if len(factors_of(flat)) > 1:
        _effects(out, flat)
    costs = material_costs(results)
    lines = {column: calibration(costs, column) for column in PREDICTIONS}
    if any(lines.values()):
        out.begin("Predicted cost")
        out.add(calibration_table(lines, PREDICTIONS))
        out.draw(forest.cost_figure(costs, lines, "costs"))
        first = lines["calibrated_ns"] or lines["predicted_ns"]
        out.findings.append(
            f"Calibration predicts the cost of materials with r² = {fixed(first['r2'], 2)} and "
            f"slope {first['slope']:.2f} [{first['slope_low']:.2f}, {first['slope_high']:.2f}]."
        )


def _roulette(out: Writer, runs: pd.DataFrame) -> None:
    columns = {
        **{"rays": "rays", "records": "records", "relMSE": "rel_mse", "efficiency": "efficiency"},
        **{"shade + order": "shade_and_order_s", "render": "render_s"},
    }
    across = ("experiment", "factor", "factor_value")
    metrics = compared(runs, "roulette", columns, across)
    if "render" not in metrics:
        return
    title = "Roulette at the same policy, ratio of means to throughput"
    out.begin("Roulette apart from order")
    out.add(
        Text(
            "Roulette changes the amount of shading, and thus the noise; order does not. So it is "
            "judged by efficiency, with the same policy on both sides."
        ),
        ratio_table(
            "Roulette at the same policy, ratio of means to throughput", metrics, "roulette"
        ),
    )
    if "efficiency" in metrics:
        name, title = "roulette-efficiency", "Roulette: efficiency"
        table = metrics["efficiency"]
        out.draw(run_figures.ratio_figure(table, name, title, "efficiency", "roulette"))


def _effects(out: Writer, runs: pd.DataFrame) -> None:
    out.begin("Effects of the factors")
    for metric, words in (
        ("render_s", "render time"),
        ("shade_and_order_s", "shade + order time"),
        ("efficiency", "efficiency"),
    ):
        table = effects(runs, metric)
        if not table.empty:
            out.draw(forest.effects_figure(table, f"effects-{key_of(words)}", words))
            out.add(effects_table(table, f"Effects on {words}"))
