# SPDX-License-Identifier: Apache-2.0
"""Main effects and interactions of a factorial experiment, as ratios of geometric means."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis_data import baseline_of, in_order, short_count
from wavecomb.bench.analysis_interval import (
    Array,
    bootstrap,
    holm,
    paired_p,
    verdict,
)
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

FACTORS = ("policy", "lanes", "wave_size", "roulette", "ray_order", "shadow_order")
_UNITS = ("stage", "renderer", "width", "height", "spp", "threads", "max_depth")


def factors_of(runs: pd.DataFrame) -> list[str]:
    """The factors that an experiment varies."""
    return [name for name in FACTORS if runs[name].nunique() > 1]


def effects(runs: pd.DataFrame, metric: str, *, interactions: bool = True) -> pd.DataFrame:
    """What each level of each factor does, over all combinations of the others.

    Main effect of level l of factor F against its baseline b, over the combinations c of all other
    factors (and stages) in which both were run:

        effect(F = l) = exp(mean over c of [log T(l, c) - log T(b, c)])

    and the interaction of F = l with G = m, the factor by which G = m changes it:

        effect(F = l, G = m) = effect(F = l | G = m) / effect(F = l | G = its baseline)

    over those combinations of the rest in which all four were run: in a suite that is no full
    factorial, what differs besides must not count as interaction.

    With T the mean over rounds; intervals by resampling rounds, p by the same figures of single
    rounds, corrected after Holm over all effects of the table.

    Returns:
        One row for each effect: ``kind`` ("main" or "interaction"), ``factor``, ``level``,
        ``baseline``, ``other``, ``other_level`` (interactions), ``name``, ``cells`` (pairs that it
        is a mean of), ``n``, ``ratio``, ``low``, ``high``, ``p``, ``verdict``.
    """
    pandas = needed("pandas", "the analysis")
    runs = runs.dropna(subset=[metric])
    factors = factors_of(runs)
    keys = [*FACTORS, *_UNITS]
    runs = runs.assign(**{key: runs[key].astype(object).fillna("") for key in keys})
    table = runs.pivot_table(index="repetition", columns=keys, values=metric, aggfunc="mean")
    if table.empty or not factors:
        return pandas.DataFrame()
    points = [dict(zip(keys, column, strict=True)) for column in table.columns]
    place = {tuple(point[key] for key in keys): k for k, point in enumerate(points)}
    levels = {f: in_order(f, sorted({point[f] for point in points})) for f in factors}
    base = {f: baseline_of(f, levels[f]) for f in factors}
    terms: list[dict[str, Any]] = []
    contrasts: list[NDArray[np.float64]] = []

    def contrast(of: dict[str, Any]) -> NDArray[np.float64]:
        """Weights of the points that give the mean contrast of log T over one or two factors.

        A difference for one factor, a difference of differences for two; all 0 where no
        combination of the others has all the points that it takes.
        """
        weights = np.zeros(len(points))
        count = 0
        for point in points:
            if any(point[factor] != level for factor, level in of.items()):
                continue
            corners = [
                ({**point, **{f: base[f] for f in at_base}}, (-1.0) ** len(at_base))
                for n in range(len(of) + 1)
                for at_base in itertools.combinations(of, n)
            ]
            found = [place.get(tuple(corner[key] for key in keys)) for corner, _ in corners]
            if None not in found:
                for where, (_, sign) in zip(found, corners, strict=True):
                    weights[where] += sign
                count += 1
        return weights / count if count else weights

    for factor in factors:
        for level in levels[factor]:
            if base[factor] is None or level == base[factor]:
                continue
            main = contrast({factor: level})
            if main.any():
                terms.append(_term("main", factor, level, base[factor]))
                contrasts.append(main)
    for factor, other in itertools.combinations(factors, 2) if interactions else ():
        for level, other_level in itertools.product(levels[factor], levels[other]):
            if None in (base[factor], base[other]):
                continue
            if level == base[factor] or other_level == base[other]:
                continue
            both = contrast({factor: level, other: other_level})
            if both.any():
                terms.append(_term("interaction", factor, level, base[factor], other, other_level))
                contrasts.append(both)
    return pandas.DataFrame(_rows(terms, np.array(contrasts), table.to_numpy(np.float64)))


def _term(
    kind: str, factor: str, level: Any, base: Any, other: str = "", other_level: Any = ""
) -> dict[str, Any]:
    name = f"{_words(factor)} {_level(level)}"
    if other:
        name += f" × {_words(other)} {_level(other_level)}"
    return {
        "kind": kind,
        "factor": factor,
        "level": level,
        "baseline": base,
        "other": other,
        "other_level": other_level,
        "name": name,
    }


def _rows(terms: list[dict[str, Any]], contrasts: Array, values: Array) -> list[dict[str, Any]]:
    """Figures of all effects at once: every one is a weighted sum of logarithms."""
    used = contrasts != 0

    def statistic(means: Array) -> Array:
        logs = np.log(means)
        if not np.isnan(logs).any():
            return np.exp(logs @ contrasts.T)
        known = np.where(np.isnan(logs), 0.0, logs) @ contrasts.T
        touched = np.isnan(logs).astype(float) @ used.T.astype(float) > 0
        return np.exp(np.where(touched, np.nan, known))

    found = bootstrap(values, statistic, positive=True)
    per_round = statistic(values)
    p_values = holm([paired_p(per_round[:, k], np.ones(len(values))) for k in range(len(terms))])
    return [
        {
            **term,
            "cells": int((weights > 0).sum()),
            "n": estimate.n,
            "ratio": estimate.value,
            "low": estimate.low,
            "high": estimate.high,
            "p": p,
            "verdict": verdict(estimate, p, ("less", "more")),
        }
        for term, weights, estimate, p in zip(terms, contrasts, found, p_values, strict=True)
    ]


def _words(factor: str) -> str:
    return {"wave_size": "waves", "ray_order": "rays", "shadow_order": "shadow rays"}.get(
        factor, factor
    )


def _level(level: Any) -> str:
    return level if isinstance(level, str) else short_count(float(level))
