# SPDX-License-Identifier: Apache-2.0
"""Intervals for statistics of mean times: a bootstrap over rounds; corrections for many tests.

Repetition k of every configuration ran in one round, so what shook the machine then shook them all.
Rounds are therefore resampled whole: a ratio keeps what its two sides have in common.
"""

from __future__ import annotations

import math
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
LEAST_FOR_BOOTSTRAP = 8
"""Rounds. Resamples of n values never leave their range, which covers 1 - 2^(1 - n) at best."""


@dataclass(frozen=True)
class Estimate:
    """A figure with its interval.

    Attributes:
        value: Of the means over all rounds.
        low: Of the 95 % interval; NaN where there are fewer than two rounds.
        high: Likewise.
        n: Rounds.
    """

    value: float
    low: float
    high: float
    n: int

    @property
    def known(self) -> bool:
        """It has an interval."""
        return math.isfinite(self.low) and math.isfinite(self.high)


def bootstrap(
    rounds: Array, statistic: Statistic, *, positive: bool = False, level: float = LEVEL
) -> list[Estimate]:
    """Intervals of statistics of the columns' means, by resampling rows.

    With fewer than ``LEAST_FOR_BOOTSTRAP`` rounds: value +- t(n - 1) x the jackknife's standard
    error (Tukey 1958), of the logarithm if ``positive``, which is as wide as so few rounds deserve.
    With more: BCa (Efron 1987, "Better bootstrap confidence intervals") with the level widened for
    small n, that is with t(n - 1) sqrt(n / (n - 1)) in place of the normal quantile (Hesterberg
    2015, "What teachers should know about the bootstrap"), since resampling alone is too narrow by
    sqrt((n - 1) / n).
    The seed is fixed: the same figures give the same intervals.

    Args:
        rounds: (n, k): one row for each round, one column for each configuration; NaN where a run
            is missing, and then a mean is over the others.
        statistic: Means, (..., k), to statistics, (..., m).
        positive: The statistics are ratios or times.
        level: Of confidence.

    Returns:
        m estimates.
    """
    special = needed("scipy.special", "the analysis")
    n = len(rounds)
    value = np.atleast_1d(statistic(_means(np.ones((1, n)), rounds))[0])
    if n < 2:
        return [Estimate(float(v), math.nan, math.nan, n) for v in value]
    student = float(special.stdtrit(n - 1, 0.5 + 0.5 * level))
    widened = student * math.sqrt(n / (n - 1))
    weights = np.random.default_rng(SEED).multinomial(n, np.full(n, 1.0 / n), RESAMPLES)
    with np.errstate(invalid="ignore", divide="ignore"):
        left_out = statistic(_means(1.0 - np.eye(n), rounds))
        if n >= LEAST_FOR_BOOTSTRAP:
            resampled = statistic(_means(weights.astype(np.float64), rounds))
    found = []
    for k, v in enumerate(value):
        if n < LEAST_FOR_BOOTSTRAP:
            found.append(_jackknife(float(v), left_out[:, k], student, positive))
            continue
        low, high = _bca(float(v), resampled[:, k], left_out[:, k], widened)
        found.append(Estimate(float(v), low, high, n))
    return found


def _means(weights: Array, rounds: Array) -> Array:
    known = ~np.isnan(rounds)
    with np.errstate(invalid="ignore", divide="ignore"):
        means: Array = (weights @ np.where(known, rounds, 0.0)) / (weights @ known)
    return means


def _bca(value: float, resampled: Array, left_out: Array, z: float) -> tuple[float, float]:
    """The interval of one statistic; NaN where too few resamples have a value."""
    from scipy.special import ndtr, ndtri

    resampled = resampled[np.isfinite(resampled)]
    if not math.isfinite(value) or len(resampled) < RESAMPLES // 2:
        return math.nan, math.nan
    below = (resampled < value).mean() + 0.5 * (resampled == value).mean()
    edge = 1.0 / (len(resampled) + 1)
    bias = float(ndtri(np.clip(below, edge, 1.0 - edge)))
    squared = _spread(left_out, 2) ** 1.5
    acceleration = _spread(left_out, 3) / (6.0 * squared) if squared > 0.0 else 0.0
    ends = []
    for end in (-z, z):
        shifted = bias + end
        share = float(ndtr(bias + shifted / max(1.0 - acceleration * shifted, 1e-3)))
        ends.append(float(np.quantile(resampled, share)))
    return ends[0], ends[1]


def _jackknife(value: float, left_out: Array, student: float, positive: bool) -> Estimate:
    """Few rounds: value +- t x standard error, as factors where it must be positive."""
    n = len(left_out)
    if positive and value > 0.0:
        with np.errstate(invalid="ignore", divide="ignore"):
            left_out = np.log(left_out)
    half = student * math.sqrt((n - 1) / n * _spread(left_out, 2))
    if positive and value > 0.0:
        factor = math.exp(min(half, 700.0)) if math.isfinite(half) else math.nan
        return Estimate(value, value / factor, value * factor, n)
    return Estimate(value, value - half, value + half, n)


def _spread(left_out: Array, power: int) -> float:
    """Sum of powers of what each round does to the statistic; NaN where one is decisive."""
    return float(((left_out.mean() - left_out) ** power).sum())


def to_column(rounds: Array, denominator: int) -> list[Estimate]:
    """The ratio of each column's mean to one column's mean."""
    return bootstrap(rounds, lambda means: means / means[..., [denominator]], positive=True)


def paired_p(a: Array, b: Array) -> float:
    """Two-sided p-value of no difference: paired t-test of the logarithms, round by round.

    1 where there are fewer than two pairs; 0 or 1 where all pairs differ alike.
    """
    special = needed("scipy.special", "the analysis")
    both = np.isfinite(a) & np.isfinite(b) & (a > 0) & (b > 0)
    if both.sum() < 2:
        return 1.0
    difference = np.log(a[both]) - np.log(b[both])
    if np.ptp(difference) <= 1e-12:
        return 1.0 if abs(difference[0]) <= 1e-12 else 0.0
    n = len(difference)
    t = float(difference.mean()) * math.sqrt(n) / float(difference.std(ddof=1))
    return float(2.0 * special.stdtr(n - 1, -abs(t)))


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values corrected for their number (Holm 1979, "A simple sequentially rejective ...").

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    order = sorted(range(len(p_values)), key=lambda k: p_values[k])
    corrected = [1.0] * len(p_values)
    largest = 0.0
    for place, k in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - place) * p_values[k]))
        corrected[k] = largest
    return corrected


def verdict(estimate: Estimate, p: float, words: tuple[str, str] = ("faster", "slower")) -> str:
    """What may be said of a ratio: below 1, above 1, the same within 1 %, or nothing.

    Args:
        estimate: The ratio.
        p: Corrected for all that is said beside it.
        words: For below and above 1.
    """
    if estimate.n < 2:
        return "one run"
    if p < 1.0 - LEVEL and estimate.value != 1.0:
        return words[0] if estimate.value < 1.0 else words[1]
    if estimate.known and estimate.low >= 1 - SAME_WITHIN and estimate.high <= 1 + SAME_WITHIN:
        return "same (1 %)"
    return "not shown"
