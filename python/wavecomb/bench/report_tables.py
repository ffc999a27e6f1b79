# SPDX-License-Identifier: Apache-2.0
"""The tables of the report, from the tables of the analysis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from wavecomb.bench.analysis_data import BOUNDS
from wavecomb.bench.figures_runs import count_words
from wavecomb.bench.figures_style import fixed
from wavecomb.bench.report_html import Cell, interval, number, table

if TYPE_CHECKING:
    import pandas as pd

_MARKS = {"faster": "better", "slower": "worse"}
HOLM = (
    "Verdicts at 5 %, by paired t-tests of log ratios, corrected after Holm over the table. Same "
    "(1 %): the interval lies within 1 % of 1. Not shown: neither can be said."
)


def ratio_table(
    caption: str, metrics: Mapping[str, pd.DataFrame], level_words: str, note: str = HOLM
) -> str:
    """Ratios of several metrics side by side.

    Args:
        caption: Of the table.
        metrics: Words -> table of ``ratios``; the last one's verdict is shown.
        level_words: Heading of the level column.
        note: Below.
    """
    found = {words: entry for words, entry in metrics.items() if not entry.empty}
    if not found:
        return ""
    main = next(reversed(found.values()))
    by_place = {
        words: {(row.cell, row.level): row for row in entry.itertuples()}
        for words, entry in found.items()
    }
    rows = []
    for row in main.itertuples():
        cells: list[Cell | str] = [row.cell, Cell(level_text(row.level), mark="word")]
        for words in found:
            other = by_place[words].get((row.cell, row.level))
            if other is None:
                cells.append("–")
            elif other.is_baseline:
                cells.append(Cell("1", f"= {number(other.mean)}"))
            else:
                cells.append(Cell(f"{other.ratio:.3f}", interval(other.low, other.high)))
        cells += [str(row.n), _verdict(row.verdict, row.level)]
        rows.append(cells)
    head = ["", level_words, *found, "n", "verdict"]
    return table(caption, head, rows, note)


def order_table(found: pd.DataFrame, caption: str) -> str:
    """The verdict on order."""
    rows = []
    for row in found.itertuples():
        share = (
            Cell(f"{100 * row.share:.0f} %", _percents(row.share_low, row.share_high))
            if row.gap_shown and row.policy != "none"
            else Cell("–")
        )
        placebo = Cell(number(row.placebo_ratio), interval(row.placebo_low, row.placebo_high))
        to_none = (
            Cell("1")
            if row.policy == "none"
            else Cell(f"{row.ratio:.3f}", interval(row.low, row.high))
        )
        rows.append(
            [
                row.stratum,
                Cell(row.policy, mark="word"),
                to_none,
                placebo if row.placebo_ratio == row.placebo_ratio else Cell("–"),
                share,
                str(row.cells),
                str(row.n),
                _verdict("" if row.policy == "none" else row.verdict, row.policy),
            ]
        )
    head = ["", "policy", "to none", "to placebo", "share won", "cells", "n", "verdict"]
    note = (
        "Geometric means over cells (stages, sizes, waves, orders of rays). Placebo: random-runs. "
        "Share won: of the way from placebo to oracle; – where the oracle is not shown to be "
        "quicker than the placebo, so that there is nothing to win, and for none, which "
        "groups nothing. " + HOLM
    )
    return table(caption, head, rows, note)


def regret_table(found: pd.DataFrame, caption: str) -> str:
    """Worst and mean regret of each policy over cells, then the cells of adaptive."""
    rows: list[Sequence[Cell | str]] = []
    for policy, part in found.groupby("policy", sort=False):
        worst = part.loc[part["regret"].idxmax()]
        rows.append(
            [
                str(policy),
                f"{100 * part['regret'].mean():+.1f} %",
                Cell(f"{100 * worst.regret:+.1f} %", _percents(worst.low, worst.high)),
                Cell(worst.cell, mark="word"),
                str(len(part)),
                count_words(part["n"]),
            ]
        )
    head = ["policy", "mean regret", "worst", "where", "cells", "n"]
    note = (
        "Render time above that of the best fixed policy of each cell. The best of noisy means "
        "looks a little better than it is, so regret is rather over- than understated."
    )
    return table(caption, head, rows, note)


def effects_table(found: pd.DataFrame, caption: str) -> str:
    """All effects of a factorial."""
    rows: list[list[Cell | str]] = [
        [
            str(row.kind),
            Cell(str(row.name), mark="word"),
            Cell(f"{row.ratio:.3f}", interval(row.low, row.high)),
            number(row.p, 2),
            str(row.cells),
            str(row.n),
            Cell(str(row.verdict), mark="word"),
        ]
        for row in found.itertuples(index=False)
    ]
    head = ["", "effect", "ratio", "p (Holm)", "pairs", "n", "verdict"]
    return table(
        caption, head, rows, "An interaction is the factor by which one changes the other."
    )


def mean_table(
    found: pd.DataFrame, caption: str, level_words: str, columns: Mapping[str, str], note: str = ""
) -> str:
    """Plain means: words -> column; columns without a figure are left out."""
    kept = {words: name for words, name in columns.items() if found[name].notna().any()}
    rows = [
        [
            row["cell"],
            Cell(level_text(row["level"]), mark="word"),
            *(number(float(row[name])) for name in kept.values()),
            str(row["n"]),
        ]
        for _, row in found.iterrows()
    ]
    return table(caption, ["", level_words, *kept, "n"], rows, note) if kept else ""


def calibration_table(lines: Mapping[str, Mapping[str, Any]], words: Mapping[str, str]) -> str:
    """r2, slope and mean error of the predictions."""
    rows: list[list[Cell | str]] = []
    for column, line in lines.items():
        if line:
            rows.append(
                [
                    words[column],
                    *(
                        Cell(fixed(line[k], 2), interval(line[f"{k}_low"], line[f"{k}_high"], 2))
                        for k in ("r2", "slope", "mean_error")
                    ),
                    str(line["materials"]),
                    str(line["runs"]),
                ]
            )
    if not rows:
        return ""
    head = ["prediction", "r²", "slope", "mean relative error", "materials", "runs"]
    note = (
        "Materials weighted by their timed records; intervals resample materials. Perfect: 1, 1, 0."
    )
    return table("Predicted against measured cost of materials", head, rows, note)


def level_text(level: Any) -> str:
    """A level of a factor for people."""
    return f"{level:g}" if isinstance(level, float) else str(level)


def _verdict(text: str, level: Any) -> Cell:
    if level in BOUNDS:
        return Cell("bound", mark="word")
    return Cell(text, mark=f"word {_MARKS.get(text, '')}".strip())


def _percents(low: float, high: float) -> str:
    if low != low or high != high:
        return ""
    return f"[{round(100 * low)}, {round(100 * high)}]"
