# SPDX-License-Identifier: Apache-2.0
"""Ratios to a baseline, cell by cell: times, counts, error, efficiency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.bench.analysis_data import baseline_of, cells, in_order, labelled, rounds
from wavecomb.bench.analysis_interval import holm, paired_p, to_column, verdict
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

GAINS = ("efficiency", "samples_per_s", "rays_per_s")
"""Metrics of which more is better."""


def ratios(
    runs: pd.DataFrame, factor: str, metric: str, *, ignore: Sequence[str] = ()
) -> pd.DataFrame:
    """Computes the ratio of means to the baseline, for each level of a factor in each cell.

    Args:
        runs: Runs of one experiment.
        factor: Name of the setting that varies.
        metric: Name of a column.
        ignore: Further settings that may differ within a cell.

    Returns:
        One row per cell and level: ``cell`` (a short name), ``level``, ``n`` (rounds),
        ``mean``, ``ratio``, ``low``, ``high``, ``p`` (Holm's over the whole table), ``verdict``;
        and the settings of the cell. Empty if nothing is varied or measured.
    """
    rows: list[dict[str, Any]] = []
    estimates = []
    for cell, group in cells(runs.dropna(subset=[metric]), factor, ignore):
        levels, values = rounds(group, factor, metric)
        base = baseline_of(factor, levels)
        if base not in levels or len(levels) < 2:
            continue
        k0 = levels.index(base)
        found = to_column(values, k0)
        estimates += found
        rows += [
            {
                **cell,
                "level": level,
                "is_baseline": k == k0,
                "n": int(np.isfinite(values[:, k]).sum()),
                "mean": float(np.nanmean(values[:, k])),
                **found[k].columns("ratio"),
                "p": 1.0 if k == k0 else paired_p(values[:, k], values[:, k0]),
            }
            for k, level in enumerate(levels)
        ]
    table = labelled(rows)
    if not table.empty:
        compared = ~table["is_baseline"]
        table.loc[compared, "p"] = holm(table.loc[compared, "p"])
        words = ("less", "more") if metric in GAINS else ("faster", "slower")
        table["verdict"] = [
            "" if row.is_baseline else verdict(estimate, row.p, words)
            for row, estimate in zip(table.itertuples(), estimates, strict=True)
        ]
    return table


def means(
    runs: pd.DataFrame, factor: str, metrics: Sequence[str], ignore: Sequence[str] = ()
) -> pd.DataFrame:
    """Computes means over repetitions, with their number ``n``, of each level in each cell."""
    pandas = needed("pandas", "the analysis")
    found = []
    for cell, group in cells(runs, factor, ignore):
        by_level = group.groupby(factor)
        table = by_level[list(metrics)].mean().assign(n=by_level.size())
        table = table.loc[in_order(factor, list(table.index))].rename_axis("level").reset_index()
        found.append(table.assign(**cell))
    return labelled(pandas.concat(found).to_dict("records") if found else [])
