# SPDX-License-Identifier: Apache-2.0
"""Tables of the report, built from the tables of the analysis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavecomb.bench.analysis.data import BOUNDS
from wavecomb.bench.figures.style import count_words, fixed
from wavecomb.bench.reports.parts import Cell, Table, interval, number, table

if TYPE_CHECKING:
    import pandas as pd

_MARKS = {"faster": "better", "slower": "worse"}
HOLM = (
    "Verdicts at 5 %, by paired t-tests of log ratios, corrected after Holm over the table. Same "
    "(1 %): the interval lies within 1 % of 1. Not shown: neither is certain."
)


def ratio_table(
    caption: str, metrics: Mapping[str, pd.DataFrame], level_words: str, note: str = HOLM
) -> Table | None:
    """Shows ratios of several metrics side by side.

    Args:
        caption: Title of the table.
        metrics: Tables of ``ratios`` by title; the last table provides the verdict.
        level_words: Heading of the level column.
        note: Text below.
    """
    found = {words: entry for words, entry in metrics.items() if not entry.empty}
    if not found:
        return None
    keyed = {words: entry.set_index(["cell", "level"]) for words, entry in found.items()}
    rows = []
    for row in next(reversed(found.values())).itertuples():
        cells: list[Cell | str] = [row.cell, Cell(level_text(row.level), mark="word")]
        for entry in keyed.values():
            if (row.cell, row.level) not in entry.index:
                cells.append("–")
                continue
            other = entry.loc[(row.cell, row.level)]
            cells.append(
                Cell("1", f"= {number(other['mean'])}")
                if other.is_baseline
                else Cell(f"{other.ratio:.3f}", interval(other.low, other.high))
            )
        rows.append([*cells, str(row.n), _verdict(row.verdict, row.level)])
    return table(caption, ["", level_words, *found, "n", "verdict"], rows, note)


def order_table(found: pd.DataFrame, caption: str) -> Table:
    """Shows the verdict on the shading order of each policy."""
    rows = []
    for row in found.itertuples():
        none = row.policy == "none"
        share = placebo = Cell("–")
        if row.gap_shown and not none:
            share = Cell(f"{100 * row.share:.0f} %", _percents(row.share_low, row.share_high))
        if row.placebo_ratio == row.placebo_ratio:
            placebo = Cell(number(row.placebo_ratio), interval(row.placebo_low, row.placebo_high))
        rows.append(
            [
                row.stratum,
                Cell(row.policy, mark="word"),
                Cell("1") if none else Cell(f"{row.ratio:.3f}", interval(row.low, row.high)),
                placebo,
                share,
                str(row.cells),
                str(row.n),
                _verdict("" if none else row.verdict, row.policy),
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


def regret_table(found: pd.DataFrame, caption: str) -> Table:
    """Shows the mean and the largest regret of each policy over all groups of runs."""
    rows: list[list[Cell | str]] = []
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
    note = (
        "Render time relative to the best fixed policy of each cell. The smallest of noisy means "
        "is biased low, so regret is overstated rather than understated."
    )
    return table(caption, ["policy", "mean regret", "worst", "where", "cells", "n"], rows, note)


def effects_table(found: pd.DataFrame, caption: str) -> Table:
    """Shows all effects of a factorial experiment in a collapsed table."""
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
    note = "An interaction is the factor by which one changes the other."
    return table(caption, head, rows, note, f"{caption}: all {len(rows)}")


def mean_table(
    found: pd.DataFrame, caption: str, level_words: str, columns: Mapping[str, str], note: str = ""
) -> Table | None:
    """Makes a table of means with one column per metric; omits metrics without a value."""
    kept = {words: name for words, name in columns.items() if found[name].notna().any()}
    rows = [
        [
            row["cell"],
            Cell(level_text(row["level"]), mark="word"),
            *(number(float(row[name])) for name in kept.values()),
            str(row["n"]),
        ]
        for row in found.to_dict("records")
    ]
    return table(caption, ["", level_words, *kept, "n"], rows, note) if kept else None


def calibration_table(lines: Mapping[str, Mapping[str, Any]], words: Mapping[str, str]) -> Table:
    """Shows how well shading costs were predicted: r2, slope and mean error."""
    rows: list[list[Cell | str]] = [
        [
            words[column],
            *(
                Cell(fixed(line[k], 2), interval(line[f"{k}_low"], line[f"{k}_high"], 2))
                for k in ("r2", "slope", "mean_error")
            ),
            str(line["materials"]),
            str(line["runs"]),
        ]
        for column, line in lines.items()
        if line
    ]
    head = ["prediction", "r²", "slope", "mean relative error", "materials", "runs"]
    note = (
        "Materials weighted by their timed records; intervals resample materials. Perfect: 1, 1, 0."
    )
    return table("Predicted against measured cost of materials", head, rows, note)


def level_text(level: Any) -> str:
    """Formats a level of a factor."""
    return f"{level:g}" if isinstance(level, float) else str(level)


def _verdict(text: str, level: Any) -> Cell:
    if level in BOUNDS:
        return Cell("bound", mark="word")
    return Cell(text, mark=f"word {_MARKS.get(text, '')}".strip())


def _percents(low: float, high: float) -> str:
    if low != low or high != high:
        return ""
    return f"[{round(100 * low)}, {round(100 * high)}]"
