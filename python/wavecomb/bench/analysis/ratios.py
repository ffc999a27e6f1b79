# SPDX-License-Identifier: Apache-2.0
"""Ratios of times, counts, errors and efficiencies to a baseline, in groups of comparable runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.bench.analysis.data import (
    BEST_FIRST,
    BOUNDS,
    PLACEBO,
    baseline_of,
    cells,
    in_order,
    labelled,
    rounds,
)
from wavecomb.bench.analysis.interval import Array, bootstrap, holm, paired_p, to_column, verdict
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

GAINS = ("efficiency", "samples_per_s", "rays_per_s")
"""Metrics for which a larger value is better."""


def ratios(
    runs: pd.DataFrame, factor: str, metric: str, *, ignore: Sequence[str] = ()
) -> pd.DataFrame:
    """Computes the ratio of means to the baseline, for each level of a factor in each cell.

    Args:
        runs: Runs of one experiment.
        factor: Name of the setting that varies.
        metric: Name of a column.
        ignore: Further settings that may differ within a group of comparable runs.

    Returns:
        One row per cell and level: ``cell`` (a short name), ``level``, ``n`` (rounds),
            ``mean``, ``ratio``, ``low``, ``high``, ``p`` (Holm's over the whole table),
            ``verdict``; and the settings of the cell. The table is empty if no setting varies or
            the metric was not measured.
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
    """Computes the mean over repetitions, and their number ``n``, for each level in each cell."""
    pandas = needed("pandas", "the analysis")
    found = []
    for cell, group in cells(runs, factor, ignore):
        by_level = group.groupby(factor)
        table = by_level[list(metrics)].mean().assign(n=by_level.size())
        table = table.loc[in_order(factor, list(table.index))].rename_axis("level").reset_index()
        found.append(table.assign(**cell))
    return labelled(pandas.concat(found).to_dict("records") if found else [])


# ---- The verdict on order: the gain of each policy, and its share of the possible gain -----------


STRATA = ("experiment", "renderer", "lanes", "roulette")
"""Settings that define a stratum; cells with different values of these are not pooled."""


def order_effects(runs: pd.DataFrame, metric: str = "shade_and_order_s") -> pd.DataFrame:
    """Compares each policy with arrival order and the placebo, and computes its share of the gain.

    Cells (stages, sizes, waves, ray orders) of one stratum are pooled as geometric means:

        ratio(p) = exp(mean over cells of log(T_p / T_none))
        share(p) = log(T_placebo / T_p) / log(T_placebo / T_oracle), of the same means

    The share of the possible gain is 0 for the placebo policy and 1 for the oracle. Shares are
    computed only if the interval of the gap T_placebo / T_oracle excludes 1, because otherwise no
    gain is shown.

    Returns:
        One row per stratum and policy: ``stratum``, ``policy``, ``cells``, ``n``; ``ratio``,
            ``low``, ``high``, ``p`` (Holm's over the table), ``verdict``; ``placebo_ratio`` and
            ``share`` with ``_low`` and ``_high``; ``gap_shown``. Rows of policies without practical
            use (``BOUNDS``) come last.
    """
    strata: dict[tuple[Any, ...], list[pd.DataFrame]] = {}
    for cell, group in cells(runs.dropna(subset=[metric]), "policy"):
        if group["policy"].nunique() > 1 and "none" in set(group["policy"]):
            strata.setdefault(tuple(cell[name] for name in STRATA), []).append(group)
    rows: list[dict[str, Any]] = []
    for key, groups in strata.items():
        rows += _stratum(dict(zip(STRATA, key, strict=True)), groups, metric)
    compared = [row for row in rows if row["policy"] not in BOUNDS]
    for row, p in zip(compared, holm([row["p"] for row in compared]), strict=True):
        row |= {"p": p, "verdict": verdict(row["estimate"], p)}
    table = labelled(rows, STRATA, "stratum", "all")
    return table.drop(columns="estimate") if rows else table


def _stratum(key: dict[str, Any], groups: list[pd.DataFrame], metric: str) -> list[dict[str, Any]]:
    """Returns the rows of one stratum. Policies in ``BOUNDS`` come last."""
    shared = set.intersection(*(set(group["policy"]) for group in groups))
    policies = in_order("policy", sorted(shared))
    wide = needed("pandas", "the analysis").concat(
        [
            group.pivot_table(index="repetition", columns="policy", values=metric)[policies]
            for group in groups
        ],
        axis=1,
    )
    matrix = wide.sort_index().to_numpy(np.float64)
    none = policies.index("none")
    placebo = policies.index(PLACEBO) if PLACEBO in policies else None
    best = next((policies.index(name) for name in BEST_FIRST if name in policies), None)

    def pooled(means: Array) -> Array:
        """Returns the mean over cells of the logarithm of each policy's time, (..., policies)."""
        shape = (*means.shape[:-1], len(groups), len(policies))
        return np.log(means.reshape(shape)).mean(axis=-2)

    def to_policy(base: int | None) -> list[Any]:
        def statistic(means: Array) -> Array:
            logs = pooled(means)
            return np.exp(logs - (np.nan if base is None else logs[..., [base]]))

        return bootstrap(matrix, statistic, positive=True)

    to_none, to_placebo = to_policy(none), to_policy(placebo)
    won = None
    if placebo is not None and best is not None:

        def shares(means: Array, placebo: int = placebo, best: int = best) -> Array:
            logs = pooled(means)
            gains = logs[..., [placebo]] - logs
            return gains / gains[..., [best]]

        oracle = to_placebo[best]
        if oracle.known and oracle.high < 1.0:
            won = bootstrap(matrix, shares)
    per_round = np.exp(pooled(matrix))
    rows = []
    for k, policy in enumerate(policies):
        share = won[k].columns("share", "share_") if won is not None else {}
        rows.append(
            {
                **key,
                "policy": policy,
                "cells": len(groups),
                "n": len(matrix),
                **to_none[k].columns("ratio"),
                "p": 1.0 if k == none else paired_p(per_round[:, k], per_round[:, none]),
                "verdict": "bound",
                **to_placebo[k].columns("placebo_ratio", "placebo_"),
                "gap_shown": won is not None,
                **{"share": np.nan, "share_low": np.nan, "share_high": np.nan, **share},
                "estimate": to_none[k],
            }
        )
    return sorted(rows, key=lambda row: row["policy"] in BOUNDS)


def regrets(runs: pd.DataFrame, metric: str = "render_s") -> pd.DataFrame:
    """Computes the regret of each policy: mean time / smallest mean time of its cell - 1.

    The smallest mean is taken over the fixed policies, without the bounds and "adaptive". Every
    bootstrap resample selects the best policy again, so the interval accounts for the uncertainty
    about the best policy. The smallest of several noisy means is biased low, so the regret is
    overstated rather than understated.

    Returns:
        One row per cell and policy: ``cell``, ``policy``, ``n``, ``regret``, ``low``, ``high``,
            ``best`` (name of the best fixed policy).
    """
    rows: list[dict[str, Any]] = []
    for cell, group in cells(runs.dropna(subset=[metric]), "policy"):
        policies, values = rounds(group, "policy", metric)
        fixed = [k for k, name in enumerate(policies) if name not in (*BOUNDS, "adaptive")]
        if len(fixed) < 2:
            continue

        def statistic(means: Array, fixed: list[int] = fixed) -> Array:
            return means / means[..., fixed].min(axis=-1, keepdims=True)

        best = policies[fixed[int(np.nanmean(values[:, fixed], axis=0).argmin())]]
        found = zip(policies, bootstrap(values, statistic, positive=True), strict=True)
        rows += [
            {
                **cell,
                "policy": policy,
                "n": estimate.n,
                "regret": estimate.value - 1.0,
                # The regret of a fixed policy relative to the best fixed policy is never negative.
                # The policy "adaptive" can be better than every fixed policy, so its regret can be
                # negative.
                "low": np.maximum(estimate.low, 0.0 if policy == "adaptive" else 1.0) - 1.0,
                "high": estimate.high - 1.0,
                "best": best,
            }
            for policy, estimate in found
            if policy not in BOUNDS
        ]
    return labelled(rows, leave_out=("policy",))
