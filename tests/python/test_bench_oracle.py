# SPDX-License-Identifier: Apache-2.0
"""Tests the oracles of the best and the worst order of materials, found from measured runs."""

from __future__ import annotations

import itertools
import json
import random
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from wavecomb.bench import results as tables
from wavecomb.bench.oracle import BEST, EXACT, WORST, best_orders, ranks, recorded, shuffled
from wavecomb.cli import main

RECORDS = 1000


def trace_of(
    names: dict[str, str], cost: Any, orders: list[list[str]], drift: bool = False
) -> list[dict[str, Any]]:
    """Returns recordings in which shading a material takes the time cost(predecessor, material)."""
    rng = random.Random(3)
    recordings = []
    for order in orders:
        slow = rng.uniform(0.5, 2.0) if drift else 1.0
        last: dict[str, str] = {}
        materials = []
        for name in order:
            ns = slow * cost(last.get(names[name], ""), name)
            last[names[name]] = name
            entry = {"name": name, "program": names[name], "records": RECORDS}
            materials.append({**entry, "timed_records": 100, "ns_per_record": ns})
        phases, counts = {"trace": slow}, {"rays": 1_000_000}
        stats = {"materials": materials, "phases_s": phases, "counts": counts}
        recordings.append(recorded(order, {"stats": stats}))
    return recordings


def of_program(order: list[str], names: dict[str, str], program: str) -> list[str]:
    return [name for name in order if names[name] == program]


@pytest.mark.parametrize("drift", [False, True])
def test_best_order_is_found(drift: bool) -> None:
    """A material costs half as much if it follows its alphabetical predecessor.

    The speed of the machine may drift.
    """
    names = {"a": "p", "b": "p", "c": "p", "d": "p", "x": "q", "y": "q"}

    def cost(before: str, name: str) -> float:
        return 10.0 if before and ord(name) == ord(before) + 1 else 20.0

    orders = [list(order) for order in itertools.permutations(names)][::3]
    found = best_orders(trace_of(names, cost, orders, drift))
    assert of_program(found[BEST], names, "p") == ["a", "b", "c", "d"]
    assert of_program(found[BEST], names, "q") == ["x", "y"]
    assert found["best_ns"] < found["mean_ns"] < found["worst_ns"]
    worst = of_program(found[WORST], names, "p")
    assert all(ord(b) != ord(a) + 1 for a, b in itertools.pairwise(worst))
    if not drift:
        assert found["best_ns"] == pytest.approx((3 * 10 + 20 + 10 + 20) * RECORDS, rel=0.05)


def test_many_materials_go_by_the_greedy_way() -> None:
    names = {f"m{k:02}": "p" for k in range(EXACT + 5)}

    def cost(before: str, name: str) -> float:
        return 10.0 if before and int(name[1:]) == int(before[1:]) + 1 else 20.0

    orders = [shuffled(list(names), k) for k in range(300)]
    found = best_orders(trace_of(names, cost, orders))
    assert sorted(found[BEST]) == sorted(names) == sorted(found[WORST])
    steps = [int(b[1:]) - int(a[1:]) for a, b in itertools.pairwise(found[BEST])]
    assert steps.count(1) >= len(names) - 3


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
def test_ranks_are_what_material_shades_by(tmp_path: Path) -> None:
    """A suite with the best and the worst material order gives equal images and valid traces."""
    suite = tmp_path / "orders.toml"
    suite.write_text(
        'name = "orders"\nrepetitions = 1\nwarm_up = 0\n[stage.box]\nscene = "cornell"\n'
        '[[experiment]]\nname = "order"\nsettings = { size = [24, 24], spp = 4 }\n'
        '[experiment.vary]\npolicy = ["none", "oracle-best", "oracle-worst"]\n'
    )
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["bench", "run", str(suite), "-o", str(out)])
    assert done.exit_code == 0, done.stderr
    rows = tables.read_rows(out / "runs.csv")
    assert {row["policy"] for row in rows} == {"none", BEST, WORST}
    assert len({row["picture_sha256"] for row in rows}) == 1
    assert all(row["cost_prediction_r2"] is None for row in rows if row["policy"] != "none")
    (trace,) = (json.loads(p.read_text()) for p in (out / "trace").glob("*-orders.json"))
    assert len(trace["recordings"]) == 12
    assert len({tuple(recording["order"]) for recording in trace["recordings"]}) > 1
    assert trace["best_ns"] <= trace["mean_ns"] <= trace["worst_ns"]
    for policy in (BEST, WORST):
        (profile,) = (out / "trace").glob(f"*-{policy}.json")
        told = json.loads(profile.read_text())["materials"]
        assert told == ranks(trace[policy])["materials"]
        entry = next(
            e
            for e in map(json.loads, (out / "runs.jsonl").read_text().splitlines())
            if e["row"]["policy"] == policy
        )
        # The ranks do not change during the render.
        for name, rank in told.items():
            assert entry["costs"]["materials"][name] == pytest.approx(rank)
