# SPDX-License-Identifier: Apache-2.0
"""Compares two result folders by the ratios of configurations that both contain."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis.data import load
from wavecomb.bench.analysis.interval import LEVEL, Estimate, holm, verdict
from wavecomb.bench.analysis.ratios import GAINS
from wavecomb.bench.machine import MAX_SPIN, spin_reference
from wavecomb.errors import WavecombError
from wavecomb.extras import needed

if TYPE_CHECKING:
    from wavecomb.bench.analysis.data import Results

METRICS = (
    *("render_s", "shade_and_order_s", "shade_s", "load_s", "build_s"),
    *("samples_per_s", "peak_rss_mb", "rel_mse", "efficiency"),
)
"""Columns that ``wavecomb bench compare`` offers."""
_LESS = ("rel_mse", "peak_rss_mb")
_MACHINE = {"cpu": "CPU", "isa": "instruction set", "cores": "number of cores", "kernel": "kernel"}


@dataclass(frozen=True)
class Change:
    """Change of one configuration that is in both folders.

    Attributes:
        config: Name of the configuration.
        before: Mean of the metric in BEFORE.
        after: Mean of the metric in AFTER.
        ratio: Ratio of geometric means, AFTER / BEFORE.
        low: Lower end of the 95 % interval of the ratio; None with too few runs.
        high: Upper end of the 95 % interval of the ratio; None with too few runs.
        runs: Number of runs in BEFORE and AFTER.
        p: p-value of the hypothesis "no change", corrected for the number of configurations.
        verdict: Verdict on the change, such as "faster".
    """

    config: str
    before: float
    after: float
    ratio: float
    low: float | None
    high: float | None
    runs: tuple[int, int]
    p: float
    verdict: str


@dataclass(frozen=True)
class FolderComparison:
    """Comparison of two folders.

    Attributes:
        metric: Column of runs.csv.
        changes: Change of each configuration, in the order of BEFORE.
        mean_ratio: Geometric mean of all ratios.
        only_before: Configurations that are missing in AFTER.
        only_after: Configurations that are missing in BEFORE.
        pictures: Number of pairs of runs with equal configuration, seed and size that have an image
            in both folders.
        pictures_different: Number of pairs of runs whose images are not bit-identical.
        warnings: Warnings that the ratios may not be reliable.
    """

    metric: str
    changes: tuple[Change, ...]
    mean_ratio: float
    only_before: tuple[str, ...]
    only_after: tuple[str, ...]
    pictures: int
    pictures_different: int
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Returns the fields as a dictionary for JSON."""
        return dataclasses.asdict(self)


def compare_folders(before: Path, after: Path, metric: str = "render_s") -> FolderComparison:
    """Compares two result folders.

    Ratios are ratios of geometric means; intervals and p-values come from Welch's test (unequal
    variances) of the logarithms. Runs are not paired, because the folders have no rounds in
    common.

    Raises:
        WavecombError: A folder holds no results, or no configuration has this metric in both.
    """
    a, b = load(before), load(after)
    groups_a, groups_b = (_values(results, metric) for results in (a, b))
    common = [config for config in groups_a if config in groups_b]
    if not common:
        raise WavecombError(
            f"{before} and {after}: no configuration has {metric} in both; "
            "compare folders of one suite, or choose another --metric"
        )
    tested = [_welch(groups_a[config], groups_b[config]) for config in common]
    changes = [
        Change(
            config=config,
            before=float(groups_a[config].mean()),
            after=float(groups_b[config].mean()),
            ratio=estimate.value,
            low=estimate.low if estimate.known else None,
            high=estimate.high if estimate.known else None,
            runs=(len(groups_a[config]), len(groups_b[config])),
            p=p,
            verdict=verdict(estimate, p, _words(metric)),
        )
        for config, (estimate, _), p in zip(
            common, tested, holm([p for _, p in tested]), strict=True
        )
    ]
    pictures, different = _pictures(a, b)
    return FolderComparison(
        metric=metric,
        changes=tuple(changes),
        mean_ratio=math.exp(float(np.mean([math.log(c.ratio) for c in changes]))),
        only_before=tuple(config for config in groups_a if config not in groups_b),
        only_after=tuple(config for config in groups_b if config not in groups_a),
        pictures=pictures,
        pictures_different=different,
        warnings=tuple(_warnings(a, b)),
    )


def lines_of(found: FolderComparison) -> list[str]:
    """Formats the comparison as lines of text."""
    lines = [f"warning: {line}" for line in found.warnings]
    width = max(len(change.config) for change in found.changes)
    lines.append(f"{found.metric}: AFTER / BEFORE")
    for change in found.changes:
        known = change.low is not None and change.high is not None
        interval = f"[{change.low:.3f}, {change.high:.3f}]" if known else "[one run]"
        lines.append(
            f"  {change.config:{width}}  {change.before:.4g} -> {change.after:.4g}  "
            f"{change.ratio:.3f} {interval}  {change.verdict}"
        )
    lines.append(f"geometric mean of {len(found.changes)} ratios: {found.mean_ratio:.3f}")
    lines.append(images_line(found))
    for name, configs in (("BEFORE", found.only_before), ("AFTER", found.only_after)):
        if configs:
            lines.append(f"only in {name}: {', '.join(configs)}")
    return lines


def images_line(found: FolderComparison) -> str:
    """Returns a line that states whether both folders hold the same images."""
    if not found.pictures:
        return "pictures: none to compare"
    if not found.pictures_different:
        return f"pictures: all {found.pictures} the same, bit for bit"
    return f"pictures: {found.pictures_different} of {found.pictures} differ"


def _values(results: Results, metric: str) -> dict[str, NDArray[np.float64]]:
    """Returns the positive values of each configuration, in the order of the file."""
    runs = results.runs[results.runs[metric] > 0]
    return {
        str(config): group[metric].to_numpy(np.float64)
        for config, group in runs.groupby("config", sort=False)
    }


def _welch(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[Estimate, float]:
    """Returns the ratio of geometric means, b over a, and the p-value of equal means."""
    stats = needed("scipy.stats", "comparing result folders")
    log_a, log_b = np.log(a), np.log(b)
    value = math.exp(float(log_b.mean() - log_a.mean()))
    n = min(len(a), len(b))
    if n < 2:
        return Estimate(value, math.nan, math.nan, n), 1.0
    if max(np.ptp(log_a), np.ptp(log_b)) == 0.0:  # if no run times vary, the ratio is exact
        return Estimate(value, value, value, n), 1.0 if value == 1.0 else 0.0
    test = stats.ttest_ind(log_b, log_a, equal_var=False)
    interval = test.confidence_interval(LEVEL)
    low, high = math.exp(float(interval.low)), math.exp(float(interval.high))
    return Estimate(value, low, high, n), float(test.pvalue)


def _words(metric: str) -> tuple[str, str]:
    return ("less", "more") if metric in (*GAINS, *_LESS) else ("faster", "slower")


def _pictures(a: Results, b: Results) -> tuple[int, int]:
    key = ["config", "repetition", "seed", "width", "height", "spp"]
    one, two = (r.runs[r.runs["picture_sha256"] != ""][[*key, "picture_sha256"]] for r in (a, b))
    both = one.merge(two, on=key, suffixes=("_a", "_b"))
    return len(both), int((both["picture_sha256_a"] != both["picture_sha256_b"]).sum())


def _warnings(a: Results, b: Results) -> list[str]:
    lines = []
    for key, what in _MACHINE.items():
        one, two = a.machine.get(key), b.machine.get(key)
        if one != two:
            lines.append(f"another {what}: {one or 'unknown'}, then {two or 'unknown'}")
    spins = [spin_reference(results.machine.get("spins_s", ())) for results in (a, b)]
    if min(spins) > 0.0 and max(spins) > MAX_SPIN * min(spins):
        lines.append(
            f"a fixed piece of work took {spins[1] / spins[0]:.2f} times as long on the machine"
        )
    for name, results in (("BEFORE", a), ("AFTER", b)):
        noise = results.machine.get("noise")
        told = noise.get("lines", ()) if isinstance(noise, dict) else ()
        lines += [f"noisy machine in {name}: {line}" for line in told]
        if len(results.failed):
            lines.append(f"{len(results.failed)} runs failed in {name}")
    if a.suite_text != b.suite_text:
        lines.append(
            "the suites differ: configurations with equal names may have different settings"
        )
    return lines
