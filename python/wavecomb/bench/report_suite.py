# SPDX-License-Identifier: Apache-2.0
"""What the report says of a suite as a whole: roulette, effects, costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from wavecomb.bench import figures_runs, figures_verdicts
from wavecomb.bench.analysis_costs import PREDICTIONS, calibration, material_costs
from wavecomb.bench.analysis_factorial import effects, factors_of
from wavecomb.bench.analysis_ratios import ratios
from wavecomb.bench.figures_style import fixed
from wavecomb.bench.report_html import folded, key_of, paragraph
from wavecomb.bench.report_tables import calibration_table, effects_table, ratio_table
from wavecomb.bench.report_writer import Writer

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis_data import Results


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
