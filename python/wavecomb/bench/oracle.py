# SPDX-License-Identifier: Apache-2.0
"""Bounds on order that only a suite can run, since they know the future: true costs, recorded.

``oracle``        ``cost-benefit`` with true costs in place of learned ones.
``oracle-best``   the order of material runs that a trace with true costs says is quickest.
``oracle-worst``  likewise the slowest.

The last two are ``material`` with ranks for costs: it shades the materials of a program in
ascending cost, so a cost file with ranks makes it shade in any order that is wanted. What a record
costs depends on what was shaded just before, which is all that the order of runs can change: the
trace holds recordings of the same render under different orders of materials, and the best order
is the path through the materials of a program with the least expected cost.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any

COSTS, BEST, WORST = "oracle", "oracle-best", "oracle-worst"
ORDERS = (BEST, WORST)
ORACLES = (COSTS, *ORDERS)
"""Policies of suites only."""

EXACT = 10
"""Materials of one program up to which the best path is found exactly; above, greedily."""

Costs = dict[str, dict[str, float]]
Recording = dict[str, Any]


def policy_of(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What a render is told in place of an oracle's name: a real policy, costs that stay."""
    policy = settings.get("policy")
    if policy not in ORACLES:
        return {}
    return {"policy": "cost-benefit" if policy == COSTS else "material", "cost_weight": 0.0}


def pooled_costs(answers: list[dict[str, Any]]) -> Costs:
    """True costs from recordings: measured ns over all timed records of a material.

    A material that was never timed has its calibrated cost. Textures: mean over the recordings.

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
    """Costs that make ``material`` shade in this order, program by program.

    >>> ranks(["b", "a"])
    {'materials': {'b': 1.0, 'a': 2.0}, 'textures': {}}
    """
    return {"materials": {name: 1.0 + k for k, name in enumerate(order)}, "textures": {}}


def shuffled(names: Sequence[str], number: int) -> list[str]:
    """The order of recording ``number``."""
    order = sorted(names)
    random.Random(number).shuffle(order)
    return order


def recorded(order: Sequence[str], answer: Mapping[str, Any]) -> Recording:
    """A recording of the trace: the order of materials, and of each what was measured."""
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
    """The orders of material runs that the trace says are quickest and slowest.

    For materials a, b of one program, cost(b after a) is the mean of b's measured ns a record over
    the recordings in which b's run came next after a's (each recording scaled by its time of
    traversal a ray, since machines drift), and one more measurement at b's mean over all
    recordings: a pair that was seen once is not believed at its word. The time of an order is

        sum over b of records(b) * cost(b after its predecessor)

    Returns:
        ``best``, ``worst``: all names in order; ``best_ns``, ``worst_ns``, ``mean_ns``: expected
        ns of all records, the mean over the orders of the trace last.
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
    """Factors that take out the machine's drift, by traversal, which no order changes."""
    times = [float(recording["trace_ns_per_ray"]) for recording in trace]
    overall = sum(times) / len(times)
    return [overall / time if time > 0.0 else 1.0 for time in times]


def _costs(
    trace: Sequence[Recording], scale: Sequence[float]
) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """Mean ns a record of each material, and after each predecessor; "" is the program's start."""
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
    """The order of members with the least sum of steps, the first from "" ."""
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
    """Always the material that gains most by coming next, beside its mean over predecessors."""
    mean = {b: sum(step[a, b] for a in members if a != b) / (len(members) - 1) for b in members}
    path, rest = [""], set(members)
    while rest:
        b = min(sorted(rest), key=lambda name: step[path[-1], name] - mean[name])
        path.append(b)
        rest.remove(b)
    return path[1:]
