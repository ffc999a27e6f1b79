# SPDX-License-Identifier: Apache-2.0
"""Measure the speedup by threads, and predict it beyond the number of cores.

    .venv/bin/python benchmarks/threads.py
    .venv/bin/python benchmarks/threads.py --files shot.usd --size 800 --spp 32

Stages are rendered with 1, 2, 4, 8, 16 and more threads up to the number of cores, in rounds of
shuffled order, in one process. ``measured`` is the ratio of render times within a round. ``by
groups`` is predicted from the times of groups of waves (``sharing`` in docs/statistics.md), by list
scheduling of each pass. Time outside these groups is assumed not to change. Prints a table and
writes ``results/threads.json``.
"""

from __future__ import annotations

import argparse
import os
import random
from pathlib import Path
from typing import Any

import numpy as np
from sitting import RESULTS, ROOT, head, log, row, show, stage_file, summary, write_result

import wavecomb

STAGES: dict[str, dict[str, Any]] = {
    "cornell": {"plain": True},
    "room": {},
    "mixed": {"plain": True},
    "dragon": {"plain": True},
}
TOLD = (2, 4, 8, 16, 32, 64)


def main() -> None:
    """Render, print the table, write the JSON."""
    args = _arguments()
    files = [stage_file(args.folder / f"{n}.usdc", n, **STAGES[n]) for n in args.stages]
    found: dict[str, Any] = {}
    for path in [*files, *args.files]:
        found[path.stem] = _measure(path, args)
    measured = [n for n in _counts() if n > 1]
    heads = [*(f"measured, {n}" for n in measured), *(f"by groups, {n}" for n in TOLD)]
    table = head("stage", "groups", "longest group", *heads)
    for name, one in found.items():
        cells = [str(one["groups"]), f"{1e3 * one['longest_s']:.1f} ms"]
        cells += [show(one["measured"][str(n)]) for n in measured]
        cells += [f"{one['told'][str(n)]:.1f}" for n in TOLD]
        table.append(row(name, *cells))
    content = {"size": args.size, "spp": args.spp, "rounds": args.rounds, "stages": found}
    write_result(args.output, "wavecomb-threads/1", content)
    for line in table:
        print(line)


def _measure(path: Path, args: argparse.Namespace) -> dict[str, Any]:
    loaded = wavecomb.load(path)
    times: dict[int, list[float]] = {n: [] for n in _counts()}
    last: dict[str, Any] = {}
    for turn in range(args.rounds):
        for n in random.Random(turn).sample(_counts(), len(times)):
            log(f"{path.stem}: round {turn + 1}, {n} threads")
            picture = wavecomb.render(loaded, size=(args.size, args.size), spp=args.spp, threads=n)
            times[n].append(picture.stats["seconds"]["render"])
            if n == 1:
                last = picture.stats
    sharing = last["sharing"]
    rest = last["seconds"]["render"] - sharing["passes_s"]["1"]
    one = np.asarray(times[1])
    return {
        "groups": sharing["groups"],
        "longest_s": sharing["longest_s"],
        "outside_passes_s": rest,
        "measured": {str(n): summary(list(one / np.asarray(times[n]))) for n in times},
        "told": {
            str(n): last["seconds"]["render"] / (rest + sharing["passes_s"][str(n)]) for n in TOLD
        },
    }


def _counts() -> list[int]:
    """Return the thread counts to measure, up to the number of cores."""
    cores = len(os.sched_getaffinity(0))
    return [n for n in (1, *TOLD) if n <= cores]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--stages", nargs="*", default=list(STAGES), choices=list(STAGES))
    parser.add_argument("--files", nargs="*", type=Path, default=[])
    parser.add_argument("--size", type=int, default=600)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "threads", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "threads.json")
    return parser.parse_args()


if __name__ == "__main__":
    main()
