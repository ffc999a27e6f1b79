# SPDX-License-Identifier: Apache-2.0
"""A farm of 10 to 1,000 workers on paper: makespan, lost work, and what the shared disk is asked.

    .venv/bin/python benchmarks/farm_simulation.py out/shot.farm --tasks 10000 --seconds 300

Task times are drawn from those of a job that was really rendered (its `results`), scaled so that
their mean is ``--seconds``. Workers take tasks as `wavecomb farm worker` does, the first that
waits; each fails now and then for good, and another takes its place. What it had goes on from its
last checkpoint once its lease is over, on whichever worker is free. Pictures are not assembled.
"""

from __future__ import annotations

import argparse
import heapq
import json
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wavecomb.farm.leases import look_s


@dataclass
class Farm:
    """How workers behave, in seconds.

    Attributes:
        start: From the start of a worker to its first task: imports, stage, hierarchy.
        lease: After which a task is taken from a worker that gives no sign of life.
        every: Between checkpoints.
        replace: Until a new worker stands in for one that failed.
        failures: Of a worker, in an hour.
    """

    start: float = 10.0
    lease: float = 60.0
    every: float = 120.0
    replace: float = 300.0
    failures: float = 0.01


@dataclass
class Outcome:
    """What a job came to.

    Attributes:
        makespan: Seconds until all is done.
        lost: Seconds of work that was done twice.
        deaths: Workers that failed.
        calls: Of the shared disk: kind -> how many.
    """

    makespan: float = 0.0
    lost: float = 0.0
    deaths: int = 0
    calls: dict[str, float] = field(default_factory=dict)


def simulate(times: np.ndarray, workers: int, farm: Farm, rng: np.random.Generator) -> Outcome:
    """Runs a job whose tasks take `times`."""
    waiting = deque(times.tolist())
    out = Outcome()
    rate = farm.failures / 3600
    # (when, number, kind, task): a worker is free, or a task of a dead one can be taken again.
    events = [
        (float(s), i, "free", 0.0) for i, s in enumerate(rng.uniform(0, 1, workers) + farm.start)
    ]
    heapq.heapify(events)
    number, left, idle, takes = workers, len(times), [], 0

    def put(when: float, kind: str, task: float = 0.0) -> None:
        nonlocal number
        heapq.heappush(events, (when, number, kind, task))
        number += 1

    while left > 0:
        now, _, kind, task = heapq.heappop(events)
        if kind == "done":
            left -= 1
            out.makespan = now
            kind = "free"
        elif kind == "again":
            waiting.appendleft(task)
            if not idle:
                continue
            idle.pop()
            kind = "free"
        if kind != "free":
            continue
        if not waiting:
            idle.append(now)
            continue
        takes += 1
        task = waiting.popleft()
        dies = rng.exponential(1 / rate) if rate > 0 else np.inf
        if dies >= task:
            put(now + task, "done")
            continue
        out.deaths += 1
        kept = dies // farm.every * farm.every
        out.lost += dies - kept
        # A lease ends between the last sign of life and one look later.
        put(now + dies + farm.lease * rng.uniform(1, 1 + 1 / 8), "again", task - kept)
        put(now + dies + farm.replace + farm.start, "free")
    look = look_s(farm.lease, workers)
    out.calls = {
        "renames": takes + len(times),
        "listings": takes + out.makespan / look * workers,
        # Each look reads what each worker says of itself, and when.
        "files read": out.makespan / look * workers**2,
    }
    return out


def recorded(job: Path) -> np.ndarray:
    """Wall seconds of the tasks of a job."""
    found = [json.loads(file.read_text()) for file in sorted((job / "results").glob("*.json"))]
    times = [float(one["wall_s"]) for one in found if "wall_s" in one]
    if not times:
        raise SystemExit(f"{job}: no task of it is done")
    return np.array(times)


def main() -> None:
    """Prints a table: medians over seeds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("job", type=Path)
    parser.add_argument("--tasks", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=300.0, help="mean of a task")
    parser.add_argument("--workers", type=int, nargs="+", default=[10, 30, 100, 300, 1000])
    parser.add_argument("--failures", type=float, default=0.01, help="of a worker in an hour")
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    times = recorded(options.job)
    spread = times.std() / times.mean()
    print(f"{len(times)} recorded tasks, standard deviation {spread:.2f} of the mean\n")
    heads = ["workers", "makespan, h", "of work / workers", "done twice", "failed"]
    heads += ["renames/s", "lists/s", "reads/s"]
    print("| " + " | ".join(heads) + " |")
    print("| " + " | ".join(["---"] * len(heads)) + " |")
    for workers in options.workers:
        rows = []
        for seed in range(options.seeds):
            rng = np.random.default_rng(seed)
            drawn = rng.choice(times, options.tasks) * (options.seconds / times.mean())
            out = simulate(drawn, workers, Farm(failures=options.failures), rng)
            work = float(drawn.sum())
            rows.append(
                [out.makespan / 3600, out.makespan / (work / workers), out.lost / work, out.deaths]
                + [out.calls[k] / out.makespan for k in ("renames", "listings", "files read")]
            )
        h, ratio, lost, deaths, renames, lists, reads = np.median(rows, axis=0)
        print(
            f"| {workers} | {h:.2f} | {ratio:.3f} | {100 * lost:.3f} % | {deaths:.0f} | "
            f"{renames:.2f} | {lists:.1f} | {reads:.0f} |"
        )


if __name__ == "__main__":
    main()
