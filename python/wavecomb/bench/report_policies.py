# SPDX-License-Identifier: Apache-2.0
"""What the report says of policies: times, the verdict on order, regret."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavecomb.bench import figures_runs, figures_verdicts
from wavecomb.bench.analysis_data import BOUNDS
from wavecomb.bench.analysis_order import order_effects, regrets
from wavecomb.bench.analysis_ratios import ratios
from wavecomb.bench.oracle import BEST, COSTS, WORST
from wavecomb.bench.report_html import interval, key_of
from wavecomb.bench.report_tables import order_table, ratio_table, regret_table
from wavecomb.bench.report_writer import Writer

if TYPE_CHECKING:
    import pandas as pd


def policies(out: Writer, name: str, runs: pd.DataFrame) -> None:
    """Times by policy; what order is worth; what a choice of policy costs."""
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
    for short, metric in (("shade", "shade"), ("policies", "shade + order")):
        title, table = f"{metric.capitalize()} time by policy", metrics[metric]
        out.draw(
            figures_runs.ratio_figure(table, f"{key}-{short}", title, f"{metric} time", "policy")
        )
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
                f"{interval(100 * worst.low, 100 * worst.high, 1)} ({worst.cell})."
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
        text += _bound_words(part)
        where = name if stratum == "all" else f"{name}, {stratum}"
        lines.append(f"{where}: {text}.")
    return lines


def _bound_words(part: pd.DataFrame) -> str:
    """What the oracles say of the order of runs; nothing without placebo and oracle."""
    told = {row.policy: row for row in part.itertuples() if row.placebo_ratio == row.placebo_ratio}
    words = {
        BEST: "The best order of runs that a trace with true costs gives",
        COSTS: "Cost-benefit with true costs",
        WORST: "The worst order of runs",
    }
    text = ""
    for policy, name in words.items():
        row = told.get(policy)
        if row is None:
            continue
        text += (
            f". {name} takes {row.placebo_ratio:.3f} "
            f"{interval(row.placebo_low, row.placebo_high)} of the placebo's time"
        )
        if policy != WORST and not row.placebo_high < 1.0:
            text += ": it is not shown to beat it"
    return text
