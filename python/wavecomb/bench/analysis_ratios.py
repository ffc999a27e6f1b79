# SPDX-License-Identifier: Apache-2.0
"""Ratios to a baseline, cell by cell: times, counts, error, efficiency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.bench.analysis_data import (
    baseline_of,
    cells,
    in_order,
    label,
    rounds,
    varying,
)
from wavecomb.bench.analysis_interval import holm, paired_p, to_column, verdict
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

TIMES = ("shade_s", "order_s", "shade_and_order_s", "render_s")
GAINS = ("efficiency", "samples_per_s", "rays_per_s")
"""Figures of which more is better."""


def ratios(
    runs: pd.DataFrame,
    factor: str,
    metric: str,
    *,
    baseline: Any = None,
    ignore: Sequence[str] = (),
) -> pd.DataFrame:
    """Ratio of means to the baseline, for each level of a factor in each cell.

    Args:
        runs: Of one experiment.
        factor: A setting.
        metric: A column.
        baseline: Level; None: the factor's own.
        ignore: Settings that may differ within a cell besides.

    Returns:
        One row for each cell and level: ``cell`` (a short name), ``level``, ``n`` (rounds),
        ``mean``, ``ratio``, ``low``, ``high``, ``p`` (Holm's over the whole table), ``verdict``;
        and the settings of the cell. Empty where nothing is varied or measured.
    """
    pandas = needed("pandas", "the analysis")
    rows: list[dict[str, Any]] = []
    estimates = []
    for cell, group in cells(runs.dropna(subset=[metric]), factor, ignore):
        levels, values = rounds(group, factor, metric)
        base = baseline_of(factor, levels) if baseline is None else baseline
        if base not in levels or len(levels) < 2:
            continue
        k0 = levels.index(base)
        found = to_column(values, k0)
        estimates += found
        for k, (level, estimate) in enumerate(zip(levels, found, strict=True)):
            rows.append(
                {
                    **cell,
                    "level": level,
                    "is_baseline": k == k0,
                    "n": int(np.isfinite(values[:, k]).sum()),
                    "mean": float(np.nanmean(values[:, k])),
                    "ratio": estimate.value,
                    "low": estimate.low,
                    "high": estimate.high,
                    "p": 1.0 if k == k0 else paired_p(values[:, k], values[:, k0]),
                }
            )
    if not rows:
        return pandas.DataFrame()
    told = [k for k, row in enumerate(rows) if not row["is_baseline"]]
    for k, p in zip(told, holm([rows[k]["p"] for k in told]), strict=True):
        rows[k]["p"] = p
    words = ("less", "more") if metric in GAINS else ("faster", "slower")
    names = varying(rows)
    for row, estimate in zip(rows, estimates, strict=True):
        row["verdict"] = "" if row["is_baseline"] else verdict(estimate, row["p"], words)
        row["cell"] = label(row, names)
    return pandas.DataFrame(rows)


def means(
    runs: pd.DataFrame, factor: str, metrics: Sequence[str], ignore: Sequence[str] = ()
) -> pd.DataFrame:
    """Means over repetitions, with their number ``n``, of each level in each cell."""
    pandas = needed("pandas", "the analysis")
    rows: list[dict[str, Any]] = []
    for cell, group in cells(runs, factor, ignore):
        for level in in_order(factor, list(group[factor].dropna().unique())):
            part = group[group[factor] == level]
            figures = {m: part[m].mean() for m in metrics}
            rows.append({**cell, "level": level, "n": len(part), **figures})
    names = varying(rows)
    for row in rows:
        row["cell"] = label(row, names)
    return pandas.DataFrame(rows)
