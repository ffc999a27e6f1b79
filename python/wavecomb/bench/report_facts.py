# SPDX-License-Identifier: Apache-2.0
"""What a report says of its runs and their machine before anything is analysed.

It needs nothing but runs.csv and machine.json, so the window says the same of folders that have no
report yet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from wavecomb.bench.analysis_data import SETTINGS
from wavecomb.bench.report_html import nested, paragraph

FEW_ROUNDS = 5
_CHANGES_NOTHING = ("policy", "threads", "lanes", "wave_size", "ray_order", "shadow_order")
_EQUAL_IN = (
    *(n for n in SETTINGS if n not in (*_CHANGES_NOTHING, "experiment") and n[:6] != "factor"),
    "seed",
)

Row = Mapping[str, Any]


def warnings_of(machine: Mapping[str, Any], rows: Sequence[Row]) -> list[str]:
    """Why the figures deserve care, most serious first.

    Args:
        machine: machine.json.
        rows: Of runs.csv, typed, those that failed too.
    """
    ended = [row for row in rows if row["status"] == "ok"]
    failed = [row for row in rows if row["status"] != "ok"]
    lines: list[str] = []
    _, different = equality(ended)
    if different:
        lines.append(
            f"Pictures that must be equal differ, in {len(different)} groups: times of unequal "
            f"work are compared. {different[0]}."
        )
    noise = machine.get("noise")
    told = noise.get("lines", ()) if isinstance(noise, Mapping) else ()
    lines += [f"Noisy machine: {line}." for line in told]
    noisy = sum(bool(row["noisy"]) for row in ended)
    if noisy and not told:
        lines.append(f"{noisy} of {len(ended)} runs were disturbed by other work on the machine.")
    repetitions: dict[str, int] = {}
    for row in ended:
        repetitions[row["config"]] = repetitions.get(row["config"], 0) + 1
    least = min(repetitions.values(), default=FEW_ROUNDS)
    if least < FEW_ROUNDS:
        some = "once" if least == 1 else f"{least} times"
        lines.append(
            f"Some configurations ran only {some}: their intervals are wide, or there is none."
        )
    if failed:
        first = failed[0]
        lines.append(f"{len(failed)} runs failed; the first: {first['run_id']}: {first['error']}")
    if not ended:
        lines.append("No run has come to an end yet.")
    if machine.get("dirty"):
        lines.append("The source was changed after the commit that is named.")
    return lines


def equality(rows: Sequence[Row]) -> tuple[int, list[str]]:
    """Runs that must have equal pictures: how many groups there are, and those that differ.

    A group agrees in all settings but those that only order or spread the work, and in the seed.
    """
    groups: dict[tuple[Any, ...], list[str]] = {}
    for row in rows:
        known = row["status"] == "ok" and row["renderer"] == "wavecomb" and row["picture_sha256"]
        if known and not row["time_limit"]:  # which no two pictures reach alike
            settings = tuple(row[name] for name in _EQUAL_IN)
            groups.setdefault(settings, []).append(row["picture_sha256"])
    repeated = {key: pictures for key, pictures in groups.items() if len(pictures) > 1}
    different = []
    for key, pictures in repeated.items():
        count = len(set(pictures))
        if count > 1:
            place = dict(zip(_EQUAL_IN, key, strict=True))
            different.append(
                f"{place['stage']}, roulette {place['roulette']}, {place['spp']:g} spp, seed "
                f"{place['seed']:g}: {count} different pictures"
            )
    return len(repeated), different


def machine_parts(machine: Mapping[str, Any]) -> list[str]:
    """HTML: which hardware counters there are not, and why; what the figures were made on."""
    counters = machine.get("counters")
    missing = (counters.get("missing") if isinstance(counters, Mapping) else None) or {}
    reasons: dict[str, list[str]] = {}
    for name, why in missing.items():
        reasons.setdefault(str(why), []).append(name.replace("_", " "))
    text = "; ".join(f"{', '.join(names)}: {why}" for why, names in reasons.items())
    known = {key: value for key, value in machine.items() if key not in ("schema", "noise")}
    parts = [paragraph(f"Hardware counters that are not available here: {text}.")] if text else []
    return [*parts, nested(known)]
