# SPDX-License-Identifier: Apache-2.0
"""Computes effects in a factorial experiment, and compares predicted with measured costs."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis.data import baseline_of, in_order, short_count
from wavecomb.bench.analysis.interval import Array, bca, bootstrap, holm, paired_p, verdict
from wavecomb.bench.oracle import ORACLES
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis.data import Results

FACTORS = ("policy", "lanes", "wave_size", "roulette", "ray_order", "shadow_order")
_UNITS = ("stage", "renderer", "width", "height", "spp", "threads", "max_depth")
_WORDS = {"wave_size": "waves", "ray_order": "rays", "shadow_order": "shadow rays"}


def factors_of(runs: pd.DataFrame) -> list[str]:
    """Returns the factors that an experiment varies."""
    return [name for name in FACTORS if runs[name].nunique() > 1]


def effects(runs: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Computes the effect of each level of each factor, over all combinations of the other factors.

    The main effect compares level l of factor F with its baseline b, over the combinations c of all
    other factors (and stages) in which both levels were run:

        effect(F = l) = exp(mean over c of [log T(l, c) - log T(b, c)])

    The interaction of F = l with G = m is the factor by which G = m changes the effect of F = l:

        effect(F = l, G = m) = effect(F = l | G = m) / effect(F = l | G = its baseline)

    An interaction is averaged over the combinations of all other factors in which all four pairs of
    levels were run. This restriction keeps other differences from counting as interaction if the
    suite is not a full factorial.

    The metric T is the mean over rounds. Intervals come from resampling rounds. p-values come from
    tests over the effects of single rounds, with Holm's correction over all effects of the table.

    Returns:
        One row per effect: ``kind`` ("main" or "interaction"), ``factor``, ``level``, ``baseline``,
            ``other``, ``other_level`` (interactions), ``name``, ``cells`` (number of pairs), ``n``,
            ``ratio``, ``low``, ``high``, ``p``, ``verdict``.
    """
    pandas = needed("pandas", "the analysis")
    runs = runs.dropna(subset=[metric])
    keys = [*FACTORS, *_UNITS]
    runs = runs.assign(**{key: runs[key].astype(object).fillna("") for key in keys})
    table = runs.pivot_table(index="repetition", columns=keys, values=metric, aggfunc="mean")
    levels = {f: in_order(f, sorted(runs[f].unique())) for f in factors_of(runs)}
    base = {f: baseline_of(f, known) for f, known in levels.items()}
    others = [
        (f, level) for f, known in levels.items() if base[f] is not None
        for level in known if level != base[f]
    ]  # fmt: skip
    pairs = [pair for pair in itertools.combinations(others, 2) if pair[0][0] != pair[1][0]]
    # An effect is a linear function of the logarithms of run times, so evaluating the effect for
    # unit vectors gives the weight of each run time.
    unit = pandas.DataFrame(np.eye(table.shape[1]), columns=table.columns)
    terms, weights = [], []
    for term in ((one,) for one in others), pairs:
        for of in term:
            found = unit
            for factor, level in of:
                found = _difference(found, factor, level, base[factor])
            if found.shape[1]:
                weights.append(found.mean(axis=1).to_numpy())
                terms.append(_term(of, base, found.shape[1] * len(of)))
    return pandas.DataFrame(_rows(terms, weights, table.to_numpy(np.float64)))


def _difference(table: pd.DataFrame, factor: str, level: Any, base: Any) -> pd.DataFrame:
    """Returns the differences between two levels of a factor, over combinations that have both."""
    columns = table.columns.names
    if level not in table.columns.unique(factor) or base not in table.columns.unique(factor):
        return table.iloc[:, :0].droplevel(columns.index(factor), axis=1)
    found = table.xs(level, axis=1, level=factor) - table.xs(base, axis=1, level=factor)
    return found.dropna(axis=1)


def _term(of: tuple[tuple[str, Any], ...], base: dict[str, Any], cells: int) -> dict[str, Any]:
    (factor, level), (other, other_level) = of[0], of[1] if len(of) > 1 else ("", "")
    return {
        "kind": "interaction" if other else "main",
        "factor": factor,
        "level": level,
        "baseline": base[factor],
        "other": other,
        "other_level": other_level,
        "name": " × ".join(
            f"{_WORDS.get(f, f)} {value if isinstance(value, str) else short_count(float(value))}"
            for f, value in of
        ),
        "cells": cells,
    }


def _rows(terms: list[dict[str, Any]], weights: list[Array], values: Array) -> list[dict[str, Any]]:
    """Estimates all effects together. An effect uses the combinations with nonzero weight."""

    def statistic(means: Array) -> Array:
        logs = np.log(means)
        return np.exp(np.stack([logs[..., w != 0] @ w[w != 0] for w in weights], axis=-1))

    if not terms:
        return []
    per_round = statistic(values)
    p_values = holm([paired_p(effect, np.ones(len(values))) for effect in per_round.T])
    return [
        {
            **term,
            "n": estimate.n,
            **estimate.columns("ratio"),
            "p": p,
            "verdict": verdict(estimate, p, ("less", "more")),
        }
        for term, estimate, p in zip(
            terms, bootstrap(values, statistic, positive=True), p_values, strict=True
        )
    ]


PREDICTIONS = {
    "calibrated_ns": "calibration, before the first pass",
    "predicted_ns": "moving average, after the last pass",
}
MIN_RECORDS = 256
"""Smallest number of timed records of a material that is included in the comparison."""


def material_costs(results: Results) -> pd.DataFrame:
    """Returns one row per run and material with enough timed records.

    Columns: ``run_id``, ``stage``, ``policy``, ``lanes``, ``repetition``, ``material``,
    ``program``, ``timed_records``, ``measured_ns``, ``calibrated_ns``, ``predicted_ns``; times in
    ns per record. Oracles are left out, because their costs are not predictions.
    """
    pandas = needed("pandas", "the analysis")
    found = pandas.DataFrame(
        {"run_id": record["row"]["run_id"], **entry}
        for record in results.records()
        for entry in (record.get("stats") or {}).get("materials", ())
    )
    renamed = {"name": "material", "ns_per_record": "measured_ns"}
    columns = ["material", "program", "timed_records", "measured_ns", *PREDICTIONS]
    found = found.rename(columns=renamed).reindex(columns=["run_id", *columns])
    settings = results.runs[["run_id", "stage", "policy", "lanes", "repetition"]]
    settings = settings[~settings["policy"].isin(ORACLES)]
    found = settings.merge(found, on="run_id")
    numbers = ["timed_records", "measured_ns", *PREDICTIONS]
    found[numbers] = found[numbers].astype(np.float64)
    found[[*PREDICTIONS]] = found[[*PREDICTIONS]].replace(0.0, np.nan)
    timed = (found["timed_records"] >= MIN_RECORDS) & (found["measured_ns"] > 0)
    return found[timed].reset_index(drop=True)


def calibration(costs: pd.DataFrame, prediction: str) -> dict[str, Any]:
    """Computes the quality of predictions, with materials weighted by their timed records.

        r2 = 1 - sum w (measured - predicted)^2 / sum w (measured - mean)^2
        slope, intercept: of the weighted least squares line measured = intercept + slope predicted

    A perfect prediction has r2 = 1, slope 1, intercept 0. r2 is negative if the mean would have
    predicted better. Intervals come from resampling materials, each with all its runs, because the
    predictions should hold for other materials.

    Returns:
        ``r2``, ``slope``, ``intercept`` (ns), ``mean_error`` (relative, weighted), each with
            ``_low`` and ``_high``; ``materials``, ``runs``. The dictionary is empty with fewer than
            three materials.
    """
    kept = costs.dropna(subset=[prediction])
    if kept.empty:
        return {}
    x, y, w = (kept[name] for name in (prediction, "measured_ns", "timed_records"))
    moments = needed("pandas", "the analysis").concat(
        [w, w * x, w * y, w * x * x, w * x * y, w * y * y, w * (x - y).abs() / y], axis=1
    )
    sums = moments.groupby([kept["stage"], kept["material"]]).sum().to_numpy(np.float64)
    if len(sums) < 3:
        return {}

    def of_materials(index: NDArray[np.intp], axis: int = -1) -> NDArray[np.float64]:
        return _line(np.moveaxis(sums[index].sum(axis=-2), -1, 0))

    value = of_materials(np.arange(len(sums)))
    low, high = bca(of_materials, len(sums), widened=False)
    result: dict[str, Any] = {"materials": len(sums), "runs": int(kept["run_id"].nunique())}
    for k, name in enumerate(("r2", "slope", "intercept", "mean_error")):
        result |= {name: float(value[k])}
        result |= {f"{name}_low": float(low[k]), f"{name}_high": float(high[k])}
    return result


def _line(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Computes r2, slope, intercept and mean error, (4, ...), from weighted sums, (7, ...)."""
    w, wx, wy, wxx, wxy, wyy, we = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        total = wyy - wy**2 / w
        slope = (wxy - wx * wy / w) / (wxx - wx**2 / w)
        r2 = 1.0 - (wyy - 2 * wxy + wxx) / total
        return np.stack([r2, slope, (wy - slope * wx) / w, we / w])
