# SPDX-License-Identifier: Apache-2.0
"""Computes the speed of runs and its uncertainty, and compares runs. Independent of Qt.

A rate is measured over a whole run with constant settings, not at one moment. The spread of a rate
is computed over the intervals between consecutive counter readings. Two runs of the same image are
compared interval by interval, at equal numbers of samples. At equal numbers of samples, two runs
have traced the same paths, because paths do not depend on the order of shading. Expensive parts of
the image therefore have the same weight in both runs. A single pair of runs cannot reveal errors
that affect a whole run, such as a change in the speed of the machine. A speed difference therefore
*holds* only if several pairs of runs agree.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from wavecomb.gui.scheduling.run_log import Look, Run, Series, ratio

MIN_STRETCHES = 4
MIN_SECONDS = 1.0
MIN_REPEATS = 3
_MAX_STRETCHES = 20

# 97.5 % quantiles of Student's t distribution for 1 to 30 degrees of freedom. For more than 30
# degrees of freedom, the quantile of the normal distribution is used.
_T975 = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
    2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
)  # fmt: skip


@dataclass(frozen=True)
class Rate:
    """A rate, in events per second."""

    value: float
    spread: float
    """Standard deviation over intervals divided by the mean; 0 for fewer than two intervals."""
    stretches: int
    """Number of intervals or runs over which the spread is computed."""
    seconds: float

    least: int = MIN_STRETCHES

    @property
    def is_short(self) -> bool:
        """Whether the measurement is too short to be meaningful."""
        return self.stretches < self.least or self.seconds < MIN_SECONDS


@dataclass(frozen=True)
class Ratio:
    """Speed of one series divided by the speed of another series that does the same work."""

    value: float
    low: float
    high: float
    """Upper end of the 95 % interval; its lower end is ``low``. The interval is 0 to infinity if it
    is unknown."""
    repeats: int
    """Number of pairs of runs. With one pair of runs, the interval ignores changes in the speed of
    the machine."""
    short: bool = False

    @property
    def differs(self) -> bool:
        """Whether the 95 % interval excludes the ratio 1."""
        return not self.short and (self.low > 1.0 or self.high < 1.0)

    @property
    def holds(self) -> bool:
        """Whether the ratio differs from 1 and enough pairs of runs confirm it."""
        return self.differs and self.repeats >= MIN_REPEATS

    def verdict(self) -> str:
        """Returns the result of the comparison in words, for a table."""
        if self.short:
            return "too short"
        if self.repeats < MIN_REPEATS:
            return f"{self.repeats} of {MIN_REPEATS} repeats"
        if not self.differs:
            return "not shown"
        return "faster" if self.value > 1.0 else "slower"


def stretches(run: Run, least_s: float = 0.0) -> list[tuple[Look, Look]]:
    """Returns pairs of consecutive counter readings. Joins intervals shorter than ``least_s``."""
    pairs = []
    start = run.looks[0]
    for look in run.looks[1:]:
        if look.seconds - start.seconds >= least_s and look.samples > start.samples:
            pairs.append((start, look))
            start = look
    return pairs


def rate(run: Run, counter: str) -> Rate:
    """Returns the rate of "samples", "rays" or "records" over the whole run."""
    last = run.last
    value = ratio(getattr(last, counter), last.seconds)
    pairs = stretches(run, least_s=0.05)
    n = len(pairs)
    if n < 2 or value <= 0.0:
        return Rate(value, 0.0, n, last.seconds)
    total = sum(b.seconds - a.seconds for a, b in pairs)
    # The variance weights each time interval in proportion to its duration.
    squares = sum(
        (getattr(b, counter) - getattr(a, counter) - value * (b.seconds - a.seconds)) ** 2
        / (b.seconds - a.seconds)
        for a, b in pairs
    )
    deviation = math.sqrt(squares / total * n / (n - 1))
    return Rate(value, deviation / value, n, last.seconds)


def rate_of(series: Series, counter: str) -> Rate:
    """Returns the mean rate over all finished runs of a series.

    If there are several runs, the spread is computed between runs.
    """
    runs = _whole(series.runs)
    if len(runs) == 1:
        return rate(runs[0], counter)
    seconds = sum(run.last.seconds for run in runs)
    value = ratio(sum(getattr(run.last, counter) for run in runs), seconds)
    rates = [ratio(getattr(run.last, counter), run.last.seconds) for run in runs]
    mean = sum(rates) / len(rates)
    deviation = math.sqrt(sum((one - mean) ** 2 for one in rates) / (len(rates) - 1))
    return Rate(value, ratio(deviation, mean), len(runs), seconds, 2)


def moments(run: Run, counter: str) -> tuple[list[float], list[float]]:
    """Returns two arrays for a curve: the middle of each interval, in seconds, and its rate."""
    pairs = stretches(run)
    times = [(a.seconds + b.seconds) / 2 for a, b in pairs]
    values = [
        ratio(getattr(b, counter) - getattr(a, counter), b.seconds - a.seconds) for a, b in pairs
    ]
    return times, values


def compare_runs(run: Run, base: Run) -> Ratio:
    """Returns the speed of ``run`` divided by that of ``base``, at equal sample counts."""
    samples = min(run.last.samples, base.last.samples)
    seconds = min(time_of(run, samples), time_of(base, samples))
    if samples <= 0 or seconds <= 0.0:
        return Ratio(math.nan, 0.0, math.inf, 1, short=True)
    value = time_of(base, samples) / time_of(run, samples)
    n = min(
        _MAX_STRETCHES,
        sum(look.samples <= samples for look in run.looks[1:]),
        sum(look.samples <= samples for look in base.looks[1:]),
    )
    if n < MIN_STRETCHES or seconds < MIN_SECONDS:
        return Ratio(value, 0.0, math.inf, 1, short=True)
    ends = [samples * k / n for k in range(n + 1)]
    mine = [time_of(run, b) - time_of(run, a) for a, b in pairwise(ends)]
    theirs = [time_of(base, b) - time_of(base, a) for a, b in pairwise(ends)]
    # The ratio of the times is estimated as value = sum(theirs) / sum(mine). The variance of this
    # estimate is computed from the variance of theirs - value * mine.
    rest = [b - value * a for a, b in zip(mine, theirs, strict=True)]
    error = math.sqrt(sum(r * r for r in rest) * n / (n - 1)) / sum(mine)
    half = t975(n - 1) * error / value
    return Ratio(value, value * math.exp(-half), value * math.exp(half), 1)


def compare(series: Series, base: Series) -> Ratio | None:
    """Returns the speed of ``series`` divided by that of ``base``, or None if their work differs.

    The i-th runs of both series form a pair. If the series alternate, these runs are close in time.
    """
    if not series.does_the_work_of(base):
        return None
    pairs = [
        compare_runs(a, b) for a, b in zip(_whole(series.runs), _whole(base.runs), strict=False)
    ]
    known = [one for one in pairs if math.isfinite(one.value)]
    if len(known) < 2:
        return known[0] if known else Ratio(math.nan, 0.0, math.inf, 1, short=True)
    logs = [math.log(one.value) for one in known]
    n = len(logs)
    mean = sum(logs) / n
    error = math.sqrt(sum((x - mean) ** 2 for x in logs) / (n - 1) / n)
    half = t975(n - 1) * error
    short = sum(one.short for one in known) > n // 2
    return Ratio(math.exp(mean), math.exp(mean - half), math.exp(mean + half), n, short)


def time_of(run: Run, samples: float) -> float:
    """Returns the seconds that a run took for a number of samples.

    Interpolates between counter readings.
    """
    looks = run.looks
    i = bisect_left([look.samples for look in looks], samples)
    if i == 0:
        return 0.0
    if i == len(looks):
        return looks[-1].seconds
    a, b = looks[i - 1], looks[i]
    share = ratio(samples - a.samples, b.samples - a.samples)
    return a.seconds + share * (b.seconds - a.seconds)


def t975(degrees: int) -> float:
    """Returns the 97.5 % quantile of Student's t distribution.

    >>> t975(2), t975(1000)
    (4.303, 1.96)
    """
    return _T975[degrees - 1] if degrees <= len(_T975) else 1.96


def _whole(runs: Sequence[Run]) -> list[Run]:
    """Returns the finished runs, or all runs if none is finished."""
    return [run for run in runs if run.finished] or list(runs)
