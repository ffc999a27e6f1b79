# SPDX-License-Identifier: Apache-2.0
"""Sections about a suite as a whole: roulette, effects, costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavecomb.bench import figures_runs, figures_verdicts
from wavecomb.bench.analysis_costs import PREDICTIONS, calibration, material_costs
from wavecomb.bench.analysis_factorial import effects, factors_of
from wavecomb.bench.figures_style import fixed
from wavecomb.bench.report_experiment import compared
from wavecomb.bench.report_parts import Text, Writer, key_of
from wavecomb.bench.report_tables import calibration_table, effects_table, ratio_table

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis_data import Results


def suite(out: Writer, results: Results) -> None:
    """Writes the sections that go across experiments."""
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
        out.draw(figures_verdicts.cost_figure(costs, lines, "costs"))
        first = lines["calibrated_ns"] or lines["predicted_ns"]
        out.findings.append(
            f"Calibration predicts what materials cost with r² = {fixed(first['r2'], 2)} and "
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
            "Roulette changes how much is shaded, and with it the noise; order does not. So it is "
            "judged by efficiency, with the policy the same on both sides."
        ),
        ratio_table(
            "Roulette at the same policy, ratio of means to throughput", metrics, "roulette"
        ),
    )
    if "efficiency" in metrics:
        name, title = "roulette-efficiency", "Roulette: efficiency"
        table = metrics["efficiency"]
        out.draw(figures_runs.ratio_figure(table, name, title, "efficiency", "roulette"))


def _effects(out: Writer, runs: pd.DataFrame) -> None:
    out.begin("Effects of the factors")
    for metric, words in (
        ("render_s", "render time"),
        ("shade_and_order_s", "shade + order time"),
        ("efficiency", "efficiency"),
    ):
        table = effects(runs, metric)
        if not table.empty:
            out.draw(figures_verdicts.effects_figure(table, f"effects-{key_of(words)}", words))
            out.add(effects_table(table, f"Effects on {words}"))
