# SPDX-License-Identifier: Apache-2.0
"""Intervals and verdicts for statistics of mean times, computed by SciPy.

Repetition k of every configuration ran in the same round, and a disturbance of the machine affects
all runs of a round. The analysis therefore resamples whole rounds, so that a disturbance cancels in
ratios.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wavecomb.extras import needed

Array = NDArray[np.float64]
Statistic = Callable[[Array], Array]

LEVEL = 0.95
RESAMPLES = 4000
SEED = 20260117
SAME_WITHIN = 0.01
MIN_ROUNDS_FOR_BOOTSTRAP = 8
"""Smallest number of rounds for a bootstrap. A bootstrap interval cannot exceed the range of its n
values, and this range covers the true mean with probability 1 - 2^(1 - n) at most."""


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval.

    Attributes:
        value: Statistic of the means over all rounds.
        low: Lower end of the interval; NaN if there are fewer than two rounds.
        high: Upper end of the interval; NaN if there are fewer than two rounds.
        n: Number of rounds.
    """

    value: float
    low: float
    high: float
    n: int

    @property
    def known(self) -> bool:
        """Whether the value has an interval."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    def columns(self, name: str, prefix: str = "") -> dict[str, float]:
        """Returns the columns ``name``, ``low`` and ``high`` of a table row."""
        return {name: self.value, f"{prefix}low": self.low, f"{prefix}high": self.high}


def bootstrap(rounds: Array, statistic: Statistic, *, positive: bool = False) -> list[Estimate]:
    """Computes statistics of the columns' means with intervals, by resampling rows.

    Below ``MIN_ROUNDS_FOR_BOOTSTRAP`` rows the interval is value +- t(n - 1) times the jackknife's
    standard error (Tukey 1958), of the logarithm if ``positive``. With more rows, the interval is
    SciPy's BCa bootstrap (Efron 1987) whose level is widened for small n: t(n - 1) sqrt(n / (n -
    1)) replaces the normal quantile (Hesterberg 2015), because resampling alone is too narrow by
    sqrt((n - 1) / n). The bootstrap uses a fixed seed.

    Args:
        rounds: (n, k): one row per round, one column per configuration; NaN marks a missing run,
            which is ignored.
        statistic: Maps means, (..., k), to statistics, (..., m).
        positive: Whether the statistics are ratios or times.

    Returns:
        m estimates. A statistic that is undefined in any resample has no interval.
    """
    n = len(rounds)

    def of_rows(index: NDArray[np.intp], axis: int = -1) -> Array:
        """Returns the statistics (m, ...) of resamples, given by row indices (..., rows)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.moveaxis(statistic(_nanmean(rounds[index])), -1, 0)

    value = of_rows(np.arange(n))
    if n < 2:
        low = high = np.full(value.shape, np.nan)
    elif n < MIN_ROUNDS_FOR_BOOTSTRAP:
        low, high = _jackknife(value, of_rows, n, positive)
    else:
        low, high = bca(of_rows, n, widened=True)
    return [
        Estimate(float(v), float(a), float(b), n) for v, a, b in zip(value, low, high, strict=True)
    ]


def bca(of_rows: Callable[..., Array], n: int, *, widened: bool) -> tuple[Array, Array]:
    """Returns both ends of SciPy's BCa bootstrap interval for each statistic.

    A statistic that does not change when any single row is left out gets the percentile interval.

    Args:
        of_rows: Maps row indices, (..., rows), to statistics, (m, ...).
        n: Number of rows.
        widened: Whether to widen the level for a small n (Hesterberg 2015).
    """
    stats = needed("scipy.stats", "the analysis")
    level = LEVEL
    if widened:
        quantile = stats.t.ppf(0.5 + 0.5 * LEVEL, n - 1) * math.sqrt(n / (n - 1))
        level = 2.0 * stats.norm.cdf(quantile) - 1.0
    options = {"vectorized": True, "axis": -1, "confidence_level": level}
    rows = (np.arange(n),)
    with warnings.catch_warnings(), np.errstate(invalid="ignore", divide="ignore"):
        warnings.simplefilter("ignore")  # SciPy warns if a statistic is the same for all resamples
        rng = np.random.default_rng(SEED)
        found = stats.bootstrap(rows, of_rows, n_resamples=RESAMPLES, rng=rng, **options)
        plain = stats.bootstrap(
            rows, of_rows, n_resamples=0, bootstrap_result=found, method="percentile", **options
        )
    ends, others = found.confidence_interval, plain.confidence_interval
    return (
        np.where(np.isnan(ends.low), others.low, ends.low),
        np.where(np.isnan(ends.high), others.high, ends.high),
    )


def _nanmean(values: Array) -> Array:
    """Returns the means over the second-last axis, ignoring NaN; NaN if all values are NaN."""
    known = ~np.isnan(values)
    means: Array = np.where(known, values, 0.0).sum(axis=-2) / known.sum(axis=-2)
    return means


def _jackknife(
    value: Array, of_rows: Callable[[NDArray[np.intp]], Array], n: int, positive: bool
) -> tuple[Array, Array]:
    """Returns both ends of t intervals, which use the jackknife's standard error."""
    stats = needed("scipy.stats", "the analysis")
    left_out = of_rows(np.array([np.delete(np.arange(n), k) for k in range(n)]))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        centre, left_out = (np.log(v) if positive else v for v in (value, left_out))
        half = stats.t.ppf(0.5 + 0.5 * LEVEL, n - 1) * math.sqrt(n - 1) * left_out.std(axis=-1)
        low, high = centre - half, centre + half
        return (np.exp(low), np.exp(high)) if positive else (low, high)


def to_column(rounds: Array, denominator: int) -> list[Estimate]:
    """Estimates the ratio of each column's mean to the mean of one column."""
    return bootstrap(rounds, lambda means: means / means[..., [denominator]], positive=True)


def paired_p(a: Array, b: Array) -> float:
    """Returns the two-sided p-value of a paired t-test of the logarithms, round by round.

    The p-value is 1 if there are fewer than two pairs or all pairs are equal.
    """
    stats = needed("scipy.stats", "the analysis")
    with np.errstate(divide="ignore", invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the t-test divides by zero if all differences are equal
        difference = np.round(np.log(a) - np.log(b), 12)
        found = stats.ttest_1samp(difference[np.isfinite(difference)], 0.0)
    return float(np.nan_to_num(found.pvalue, nan=1.0))


def holm(p_values: Sequence[float]) -> list[float]:
    """Corrects p-values for the number of tests (Holm 1979), since SciPy has no such function.

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    p = np.asarray(p_values, np.float64)
    order = np.argsort(p)
    corrected = np.empty_like(p)
    corrected[order] = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return [float(v) for v in np.minimum(corrected, 1.0)]


def verdict(estimate: Estimate, p: float, words: tuple[str, str] = ("faster", "slower")) -> str:
    """Returns whether a ratio is below 1, above 1, within 1 % of 1, or undecided, as a word.

    Args:
        estimate: The ratio.
        p: p-value, corrected for all verdicts of the table.
        words: Words for the verdicts below 1 and above 1, such as "faster" and "slower".
    """
    if estimate.n < 2:
        return "one run"
    if p < 1.0 - LEVEL and estimate.value != 1.0:
        return words[0] if estimate.value < 1.0 else words[1]
    if estimate.known and estimate.low >= 1 - SAME_WITHIN and estimate.high <= 1 + SAME_WITHIN:
        return "same (1 %)"
    return "not shown"
