# SPDX-License-Identifier: Apache-2.0
"""Oracle policies of suites, which bound the gain of any order by using recorded true costs.

``oracle``        the policy ``cost-benefit`` with true costs instead of estimated costs.
``oracle-best``   the order of materials that is fastest according to the recordings.
``oracle-worst``  the order of materials that is slowest according to the recordings.

The oracles ``oracle-best`` and ``oracle-worst`` use the policy ``material`` with ranks in place of
costs. This policy shades the materials of a program in ascending cost, so a cost file with ranks
can produce any order. The cost of shading a hit depends on the material that was shaded just
before, and the order of materials affects the cost only through this preceding material. The costs
are therefore recorded in several renders with different orders of materials. The best order is the
path with the smallest expected cost through the materials of a program.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any

COSTS, BEST, WORST = "oracle", "oracle-best", "oracle-worst"
ORDERS = (BEST, WORST)
ORACLES = (COSTS, *ORDERS)
"""Policies that exist only in suites."""

EXACT = 10
"""Largest number of materials of one program for which the best path is found exactly. Programs
with more materials use a greedy search."""

Costs = dict[str, dict[str, float]]
Recording = dict[str, Any]


def policy_of(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the settings that replace an oracle's name: a real policy with fixed costs."""
    policy = settings.get("policy")
    if policy not in ORACLES:
        return {}
    return {"policy": "cost-benefit" if policy == COSTS else "material", "cost_weight": 0.0}


def pooled_costs(answers: list[dict[str, Any]]) -> Costs:
    """Returns true costs from recordings: measured ns over all timed records of a material.

    A material that was never timed gets its calibrated cost. Costs of textures are means over the
    recordings.

    >>> material = {"name": "M", "timed_records": 10, "ns_per_record": 50.0, "calibrated_ns": 9.0}
    >>> other = {**material, "timed_records": 30, "ns_per_record": 90.0}
    >>> costs = {"textures": {}}
    >>> found = [{"stats": {"materials": [m]}, "costs": costs} for m in (material, other)]
    >>> pooled_costs(found)
    {'materials': {'M': 80.0}, 'textures': {}}
    """
    spent: dict[str, float] = {}
    timed: dict[str, int] = {}
    fallback: dict[str, float] = {}
    textures: dict[str, list[float]] = {}
    for answer in answers:
        for material in answer["stats"]["materials"]:
            name, count = material["name"], int(material["timed_records"])
            spent[name] = spent.get(name, 0.0) + count * float(material["ns_per_record"])
            timed[name] = timed.get(name, 0) + count
            fallback[name] = float(material["calibrated_ns"])
        for name, ns in answer["costs"]["textures"].items():
            textures.setdefault(name, []).append(float(ns))
    return {
        "materials": {
            name: spent[name] / timed[name] if timed[name] else fallback[name] for name in spent
        },
        "textures": {name: sum(values) / len(values) for name, values in textures.items()},
    }


def ranks(order: Sequence[str]) -> Costs:
    """Returns costs that make the policy ``material`` shade each program's materials in this order.

    >>> ranks(["b", "a"])
    {'materials': {'b': 1.0, 'a': 2.0}, 'textures': {}}
    """
    return {"materials": {name: 1.0 + k for k, name in enumerate(order)}, "textures": {}}


def shuffled(names: Sequence[str], number: int) -> list[str]:
    """Returns the random order of materials for recording ``number``."""
    order = sorted(names)
    random.Random(number).shuffle(order)
    return order


def recorded(order: Sequence[str], answer: Mapping[str, Any]) -> Recording:
    """Returns the order of materials in a recording render, and their measured costs."""
    stats = answer["stats"]
    materials = {
        entry["name"]: {
            "program": entry["program"],
            "records": int(entry["records"]),
            "timed_records": int(entry["timed_records"]),
            "ns_per_record": float(entry["ns_per_record"]),
        }
        for entry in stats["materials"]
        if entry["records"]
    }
    return {
        "order": [name for name in order if name in materials],
        "trace_ns_per_ray": 1e9 * stats["phases_s"]["trace"] / max(1, stats["counts"]["rays"]),
        "materials": materials,
    }


def best_orders(trace: Sequence[Recording]) -> dict[str, Any]:
    """Computes the orders of materials that are fastest and slowest according to recordings.

    For materials a, b of one program, cost(b after a) is the mean of b's measured ns per record
    over the recordings in which b was shaded directly after a. This mean includes b's overall mean
    as one additional value, which reduces the effect of pairs that were measured only once. Each
    recording is scaled by its traversal time per ray, which removes drift of the machine. An order
    takes the following time:

        sum over b of records(b) * cost(b after its predecessor)

    Returns:
        The entries ``best`` and ``worst`` are the names of all materials in order. The entries
            ``best_ns``, ``worst_ns`` and ``mean_ns`` are expected nanoseconds for shading all hits,
            and ``mean_ns`` is the mean over the recorded orders.
    """
    scale = _scales(trace)
    names = sorted({name for recording in trace for name in recording["materials"]})
    programs: dict[str, list[str]] = {}
    records: dict[str, float] = {}
    for name in names:
        seen = [r["materials"][name] for r in trace if name in r["materials"]]
        programs.setdefault(seen[0]["program"], []).append(name)
        records[name] = sum(entry["records"] for entry in seen) / len(seen)
    alone, after = _costs(trace, scale)
    result: dict[str, Any] = {BEST: [], WORST: [], "best_ns": 0.0, "worst_ns": 0.0}
    for members in programs.values():
        step = {
            (a, b): records[b] * after.get((a, b), alone[b])
            for a in ("", *members)
            for b in members
            if a != b
        }
        for way, key, sign in ((BEST, "best_ns", 1.0), (WORST, "worst_ns", -1.0)):
            path = _path(members, {pair: sign * ns for pair, ns in step.items()})
            result[way] += path
            result[key] += sum(step[pair] for pair in zip(["", *path], path, strict=False))
    result["mean_ns"] = sum(records[name] * alone[name] for name in names)
    return result


def _scales(trace: Sequence[Recording]) -> list[float]:
    """Returns factors that remove drift of the machine.

    The factors come from traversal times, which do not depend on the order of materials.
    """
    times = [float(recording["trace_ns_per_ray"]) for recording in trace]
    overall = sum(times) / len(times)
    return [overall / time if time > 0.0 else 1.0 for time in times]


def _costs(
    trace: Sequence[Recording], scale: Sequence[float]
) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """Returns the mean ns per record of each material, overall and after each predecessor.

    The predecessor "" means that the material comes first in its program.
    """
    every: dict[str, list[float]] = {}
    pairs: dict[tuple[str, str], list[float]] = {}
    for recording, factor in zip(trace, scale, strict=True):
        last: dict[str, str] = {}
        for name in recording["order"]:
            entry = recording["materials"][name]
            before = last.get(entry["program"], "")
            last[entry["program"]] = name
            if entry["timed_records"]:
                ns = factor * entry["ns_per_record"]
                every.setdefault(name, []).append(ns)
                pairs.setdefault((before, name), []).append(ns)
    found = {name for recording in trace for name in recording["materials"]}
    alone = {name: sum(v) / len(v) if (v := every.get(name)) else 0.0 for name in found}
    after = {pair: (sum(v) + alone[pair[1]]) / (len(v) + 1) for pair, v in pairs.items()}
    return alone, after


def _path(members: Sequence[str], step: Mapping[tuple[str, str], float]) -> list[str]:
    """Returns the order of materials with the smallest total cost; the start has the name ""."""
    if len(members) > EXACT:
        return _greedy(members, step)
    best: dict[tuple[frozenset[str], str], tuple[float, list[str]]] = {
        (frozenset([b]), b): (step["", b], [b]) for b in members
    }
    for _ in members[1:]:
        longer: dict[tuple[frozenset[str], str], tuple[float, list[str]]] = {}
        for (used, last), (ns, path) in best.items():
            for b in members:
                key = (used | {b}, b)
                if b not in used and ns + step[last, b] < longer.get(key, (float("inf"), []))[0]:
                    longer[key] = (ns + step[last, b], [*path, b])
        best = longer
    return min(best.values(), key=lambda entry: entry[0])[1]


def _greedy(members: Sequence[str], step: Mapping[tuple[str, str], float]) -> list[str]:
    """Builds the order greedily, by appending the material with the largest gain.

    The gain of a material is relative to its mean over all predecessors.
    """
    mean = {b: sum(step[a, b] for a in members if a != b) / (len(members) - 1) for b in members}
    path, rest = [""], set(members)
    while rest:
        b = min(sorted(rest), key=lambda name: step[path[-1], name] - mean[name])
        path.append(b)
        rest.remove(b)
    return path[1:]
