# SPDX-License-Identifier: Apache-2.0
"""Costs of materials out of statistics, sorted and with short names; no Qt."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

ORDERS = {
    "time": "By shading time: records x nanoseconds.",
    "ns per record": "By what a record costs.",
    "records": "By number of records.",
}


@dataclass(frozen=True)
class MaterialCost:
    """One material of a run."""

    name: str
    short: str
    program: str
    records: int
    measured_ns: float
    """A record, over timed batches; 0 where none was timed."""
    predicted_ns: float
    """A record, as the next pass is scheduled by."""
    calibrated_ns: float
    """A record, before the first pass."""
    share: float
    """Its share of the shading time of all materials, 0 to 1."""

    @property
    def ns(self) -> float:
        """Measured, else predicted."""
        return self.measured_ns or self.predicted_ns


def material_costs(stats: Mapping[str, Any], order: str = "time") -> list[MaterialCost]:
    """Materials that were shaded, the greatest first.

    ``order``: one of ``ORDERS``.
    """
    used = [one for one in stats.get("materials", ()) if one.get("records")]
    times = [one["records"] * (one["ns_per_record"] or one["predicted_ns"]) for one in used]
    total = sum(times)
    rows = [
        MaterialCost(
            one["name"],
            short,
            one["program"],
            int(one["records"]),
            float(one["ns_per_record"]),
            float(one["predicted_ns"]),
            float(one.get("calibrated_ns", 0.0)),
            time / total if total > 0.0 else 0.0,
        )
        for one, short, time in zip(
            used, short_names([one["name"] for one in used]), times, strict=True
        )
    ]
    keys = {
        "time": lambda row: row.share,
        "ns per record": lambda row: row.ns,
        "records": lambda row: row.records,
    }
    return sorted(rows, key=keys[order], reverse=True)


def short_names(paths: Sequence[str]) -> list[str]:
    """The last part of each path; more parts where that is not enough to tell them apart.

    >>> short_names(["/A/Looks/Gold", "/A/Looks/Wood", "/B/Looks/Gold", ""])
    ['A/Looks/Gold', 'Wood', 'B/Looks/Gold', '(no name)']
    """
    parts = [path.strip("/").split("/") for path in paths]
    depth = max((len(one) for one in parts), default=0)
    names = ["/".join(one[-1:]) for one in parts]
    for count in range(2, depth + 1):
        often = Counter(names)
        if max(often.values()) == 1:
            break
        names = [
            "/".join(one[-count:]) if often[name] > 1 else name
            for one, name in zip(parts, names, strict=True)
        ]
    return [name or "(no name)" for name in names]
