# SPDX-License-Identifier: Apache-2.0
"""Whether a machine was quiet enough for its times to be believed."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

MAX_OTHERS = 0.05
"""Share of all cores' time that other processes may take during a run."""
MAX_SPIN = 1.10
"""How much longer than at its best the spin may take."""
MAX_NOISY_RUNS = 0.2
MAX_VARIATION = 0.10


def spin_reference(spins: Sequence[float]) -> float:
    """What the spin takes on the quiet machine: the lower quartile, since noise only adds."""
    ordered = sorted(spins)
    return ordered[len(ordered) // 4] if ordered else 0.0


def is_noisy(others_share: float | None, spin_s: float, reference_s: float) -> bool:
    """Whether a run was disturbed.

    >>> is_noisy(0.01, 0.0102, 0.0100), is_noisy(0.20, 0.0100, 0.0100), is_noisy(0.0, 0.02, 0.01)
    (False, True, True)
    """
    if others_share is not None and others_share > MAX_OTHERS:
        return True
    return reference_s > 0.0 and spin_s > MAX_SPIN * reference_s


@dataclass(frozen=True)
class Noise:
    """The verdict on a sitting.

    Attributes:
        runs: How many there are.
        noisy_runs: How many were disturbed.
        variation: Median over configurations of the coefficient of variation of render_s, over
            those with at least three runs; None without any.
        noisy: The figures deserve a warning.
        lines: Why, for a reader.
    """

    runs: int
    noisy_runs: int
    variation: float | None
    noisy: bool
    lines: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """For machine.json."""
        return {
            "noisy": self.noisy,
            "runs": self.runs,
            "noisy_runs": self.noisy_runs,
            "variation": self.variation,
            "lines": list(self.lines),
        }


def judge(rows: Iterable[Mapping[str, Any]]) -> Noise:
    """Judges the runs that went well: rows with "config", "status", "render_s" and "noisy"."""
    good = [row for row in rows if row["status"] == "ok"]
    disturbed = sum(bool(row["noisy"]) for row in good)
    times: dict[str, list[float]] = defaultdict(list)
    for row in good:
        if row["render_s"] is not None:
            times[row["config"]].append(float(row["render_s"]))
    each = [
        statistics.stdev(values) / statistics.fmean(values)
        for values in times.values()
        if len(values) >= 3 and statistics.fmean(values) > 0.0
    ]
    variation = statistics.median(each) if each else None
    lines = []
    if good and disturbed > MAX_NOISY_RUNS * len(good):
        lines.append(
            f"{disturbed} of {len(good)} runs were disturbed: others took over "
            f"{MAX_OTHERS:.0%} of the cores, or the calibration spin was over "
            f"{MAX_SPIN - 1:.0%} slower than at its best"
        )
    if variation is not None and variation > MAX_VARIATION:
        lines.append(
            f"equal runs vary by {variation:.0%} (coefficient of variation of the render time, "
            f"median over configurations; {MAX_VARIATION:.0%} is the limit)"
        )
    return Noise(len(good), disturbed, variation, bool(lines), tuple(lines))
