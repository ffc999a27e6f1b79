# SPDX-License-Identifier: Apache-2.0
"""The verdict on order: what each policy wins with all else equal, and of how much.

Roulette, lanes, waves and the order of rays are the same on both sides of every ratio here, so
what differs is the order of shading alone. Two orders bound what a policy can win: the placebo
(runs of one material in an order that means nothing) and an oracle: the order of these runs that
a trace with true costs says is best, or else cost-benefit with true costs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis_data import (
    BEST_FIRST,
    BOUNDS,
    PLACEBO,
    cells,
    in_order,
    label,
    rounds,
    varying,
)
from wavecomb.bench.analysis_interval import Array, bootstrap, holm, paired_p, verdict
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

STRATA = ("experiment", "renderer", "lanes", "roulette")
"""Settings in which pooled cells agree: an order acts otherwise at other lanes."""


def order_effects(runs: pd.DataFrame, metric: str = "shade_and_order_s") -> pd.DataFrame:
    """Each policy against arrival order, against the placebo, and its share of what can be won.

    Cells (stages, sizes, waves, orders of rays) of one stratum are pooled as geometric means:

        ratio(p) = exp(mean over cells of log(T_p / T_none))
        share(p) = log(T_placebo / T_p) / log(T_placebo / T_oracle), of the same means

    The share is 0 for the placebo and 1 for the oracle. It is given where the interval of the gap
    T_placebo / T_oracle leaves out 1; where it does not, there is nothing to have a share of.

    Returns:
        One row for each stratum and policy: ``stratum``, ``policy``, ``cells``, ``n``; ``ratio``,
        ``low``, ``high``, ``p`` (Holm's over the table), ``verdict``; ``placebo_ratio`` and
        ``share`` with ``_low`` and ``_high``; ``gap_shown``. The bounds themselves come last.
    """
    pandas = needed("pandas", "the analysis")
    strata: dict[tuple[Any, ...], list[pd.DataFrame]] = {}
    for cell, group in cells(runs.dropna(subset=[metric]), "policy"):
        if group["policy"].nunique() > 1 and "none" in set(group["policy"]):
            strata.setdefault(tuple(cell[name] for name in STRATA), []).append(group)
    rows: list[dict[str, Any]] = []
    for key, groups in strata.items():
        rows += _stratum(dict(zip(STRATA, key, strict=True)), groups, metric)
    told = [row for row in rows if row["policy"] not in BOUNDS]
    for row, p in zip(told, holm([row["p"] for row in told]), strict=True):
        row["p"] = p
    for row in rows:
        if row["policy"] not in BOUNDS:
            row["verdict"] = verdict(row.pop("estimate"), row["p"])
        else:
            row.pop("estimate")
            row["verdict"] = "bound"
    names = [name for name in varying(rows) if name in STRATA] if rows else []
    for row in rows:
        row["stratum"] = label(row, names) if names else "all"
    return pandas.DataFrame(rows)


def _stratum(key: dict[str, Any], groups: list[pd.DataFrame], metric: str) -> list[dict[str, Any]]:
    shared = set.intersection(*(set(group["policy"]) for group in groups))
    policies = in_order("policy", sorted(shared))
    blocks = []
    for group in groups:
        kept = group[group["policy"].isin(policies)]
        blocks.append(_aligned(*rounds(kept, "policy", metric), policies))
    n = max(len(block) for block in blocks)
    matrix = np.concatenate([_padded(block, n) for block in blocks], axis=1)
    count = len(policies)

    def pooled(means: Array) -> Array:
        """Mean logarithm over cells, (..., policies)."""
        return np.log(means.reshape(*means.shape[:-1], len(groups), count)).mean(axis=-2)

    none = policies.index("none")
    placebo = policies.index(PLACEBO) if PLACEBO in policies else None
    best = next((policies.index(name) for name in BEST_FIRST if name in policies), None)

    def statistic(means: Array) -> Array:
        logs = pooled(means)
        to_none = np.exp(logs - logs[..., none, None])
        if placebo is None:
            return np.concatenate([to_none, np.full_like(to_none, np.nan)], axis=-1)
        return np.concatenate([to_none, np.exp(logs - logs[..., placebo, None])], axis=-1)

    def shares(means: Array) -> Array:
        logs = pooled(means)
        if placebo is None or best is None:
            return np.full_like(logs, np.nan)
        gap = logs[..., placebo, None] - logs[..., best, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return (logs[..., placebo, None] - logs) / gap

    found = bootstrap(matrix, statistic, positive=True)
    won = bootstrap(matrix, shares)
    oracle = found[count + best] if placebo is not None and best is not None else None
    gap_shown = oracle is not None and oracle.known and oracle.high < 1.0
    per_round = pooled(matrix)
    rows = []
    for k, policy in enumerate(policies):
        share = won[k]
        rows.append(
            {
                **key,
                "policy": policy,
                "cells": len(groups),
                "n": n,
                "ratio": found[k].value,
                "low": found[k].low,
                "high": found[k].high,
                "p": 1.0
                if k == none
                else paired_p(np.exp(per_round[:, k]), np.exp(per_round[:, none])),
                "placebo_ratio": found[count + k].value,
                "placebo_low": found[count + k].low,
                "placebo_high": found[count + k].high,
                "gap_shown": gap_shown,
                "share": share.value if gap_shown else np.nan,
                "share_low": share.low if gap_shown else np.nan,
                "share_high": share.high if gap_shown else np.nan,
                "estimate": found[k],
            }
        )
    return sorted(rows, key=lambda row: row["policy"] in BOUNDS)


def regrets(runs: pd.DataFrame, metric: str = "render_s") -> pd.DataFrame:
    """What each policy loses to the best fixed one of its cell: mean time / least mean time - 1.

    The best is found anew in every resample, so the interval holds that it is not known. Being the
    least of noisy means, it looks a little better than it is; regret is then overstated, never
    hidden. The bounds and "adaptive" are no fixed policies.

    Returns:
        One row for each cell and policy: ``cell``, ``policy``, ``n``, ``regret``, ``low``,
        ``high``, ``best`` (name of the best fixed one).
    """
    pandas = needed("pandas", "the analysis")
    rows: list[dict[str, Any]] = []
    for cell, group in cells(runs.dropna(subset=[metric]), "policy"):
        policies, values = rounds(group, "policy", metric)
        fixed = [k for k, name in enumerate(policies) if name not in BOUNDS and name != "adaptive"]
        if len(fixed) < 2:
            continue

        def statistic(means: Array, fixed: list[int] = fixed) -> Array:
            return means / means[..., fixed].min(axis=-1, keepdims=True)

        found = bootstrap(values, statistic, positive=True)
        best = policies[fixed[int(np.nanmean(values[:, fixed], axis=0).argmin())]]
        for policy, estimate in zip(policies, found, strict=True):
            if policy in BOUNDS:
                continue
            rows.append(
                {
                    **cell,
                    "policy": policy,
                    "n": estimate.n,
                    "regret": estimate.value - 1.0,
                    # A fixed policy cannot be better than the best of them; adaptive can.
                    "low": np.maximum(estimate.low, 0.0 if policy == "adaptive" else 1.0) - 1.0,
                    "high": estimate.high - 1.0,
                    "best": best,
                }
            )
    names = varying(rows) if rows else []
    for row in rows:
        row["cell"] = label(row, [name for name in names if name != "policy"])
    return pandas.DataFrame(rows)


def _aligned(
    levels: list[Any], values: NDArray[np.float64], wanted: list[Any]
) -> NDArray[np.float64]:
    return values[:, [levels.index(name) for name in wanted]]


def _padded(block: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """More rounds, of missing runs."""
    return np.pad(block, ((0, n - len(block)), (0, 0)), constant_values=np.nan)
