# SPDX-License-Identifier: Apache-2.0
"""Warnings of a report, and facts about its machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavecomb.bench.analysis_data import SETTINGS
from wavecomb.bench.report_parts import Facts, Part, Text

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis_data import Results

FEW_ROUNDS = 5
_CHANGES_NOTHING = ("policy", "threads", "lanes", "wave_size", "ray_order", "shadow_order")
_EQUAL_IN = [
    *(n for n in SETTINGS if n not in (*_CHANGES_NOTHING, "experiment") and n[:6] != "factor"),
    "seed",
]


def warnings_of(results: Results) -> list[str]:
    """Returns reasons to read the figures with care, most serious first."""
    lines: list[str] = []
    machine, runs, failed = results.machine, results.runs, results.failed
    _, different = equality(runs)
    if different:
        lines.append(
            f"Pictures that must be equal differ, in {len(different)} groups: times of unequal "
            f"work are compared. {different[0]}."
        )
    noise = machine.get("noise")
    reasons = noise.get("lines", ()) if isinstance(noise, Mapping) else ()
    lines += [f"Noisy machine: {line}." for line in reasons]
    noisy = int((runs["noisy"] == True).sum())  # noqa: E712 (None is no noise)
    if noisy and not reasons:
        lines.append(f"{noisy} of {len(runs)} runs were disturbed by other work on the machine.")
    least = int(runs["config"].value_counts().min())
    if least < FEW_ROUNDS:
        some = "once" if least == 1 else f"{least} times"
        lines.append(
            f"Some configurations ran only {some}: their intervals are wide, or there is none."
        )
    if len(failed):
        first = failed.iloc[0]
        lines.append(f"{len(failed)} runs failed; the first: {first['run_id']}: {first['error']}")
    if machine.get("dirty"):
        lines.append("The source was changed after the commit that is named.")
    return lines


def equality(runs: pd.DataFrame) -> tuple[int, list[str]]:
    """Counts groups of runs that must have equal images, and names those that have not.

    A group agrees in the seed and all settings except those that only order or distribute the
    work. Runs with a time limit are left out, since no two of them take the same samples.
    """
    ours = runs[(runs["renderer"] == "wavecomb") & (runs["picture_sha256"] != "")]
    ours = ours[ours["time_limit"].fillna(0) == 0]
    groups = ours.groupby(_EQUAL_IN, dropna=False, sort=False)["picture_sha256"]
    found = groups.agg(["size", "nunique"]).reset_index()
    repeated = found[found["size"] > 1]
    different = [
        f"{row.stage}, roulette {row.roulette}, {row.spp:g} spp, seed {row.seed:g}: "
        f"{row.nunique} different pictures"
        for row in repeated[repeated["nunique"] > 1].itertuples()
    ]
    return len(repeated), different


def machine_parts(machine: Mapping[str, Any]) -> list[Part]:
    """Describes the machine, and which hardware counters it lacks for which reason."""
    counters = machine.get("counters")
    missing = (counters.get("missing") if isinstance(counters, Mapping) else None) or {}
    reasons: dict[str, list[str]] = {}
    for name, why in missing.items():
        reasons.setdefault(str(why), []).append(name.replace("_", " "))
    text = "; ".join(f"{', '.join(names)}: {why}" for why, names in reasons.items())
    known = {key: value for key, value in machine.items() if key not in ("schema", "noise")}
    parts: list[Part] = []
    if text:
        parts.append(Text(f"Hardware counters that are not available here: {text}."))
    return [*parts, Facts(known)]
