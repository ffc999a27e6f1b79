# SPDX-License-Identifier: Apache-2.0
"""What a farm costs: a picture in tiles by N workers against one process with N threads.

python benchmarks/farm.py out/mixed.usdc --size 600 400 --spp 64 --workers 2 --rounds 3
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COMMAND = [sys.executable, "-m", "wavecomb"]


def cpu_s() -> float:
    """Processor time of all processes that this one started and that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(*words: object) -> tuple[float, float]:
    """Seconds that a command takes: of the wall, and of the processor."""
    start, before = time.perf_counter(), cpu_s()
    subprocess.run([*COMMAND, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start, cpu_s() - before


def small_tasks(stage: Path, count: int) -> tuple[float, float]:
    """Seconds, of wall and processor, of one worker for each of so many tasks of a few pixels."""
    from wavecomb import farm

    with tempfile.TemporaryDirectory() as place:
        columns = max(1, round(count**0.5))
        options = {"size": (columns * 2, columns * 2), "spp": 1, "threads": 1, "strict": False}
        job = farm.submit(stage, Path(place, "a.exr"), tiles=f"{columns}x{columns}", **options)
        wall, cpu = timed("farm", "worker", job.path, "--quiet")
        return wall / columns**2, cpu / columns**2


def main() -> None:
    """Prints JSON; pairs are of the wall and of the processor."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stage", type=Path)
    parser.add_argument("--size", nargs=2, type=int, default=(600, 400))
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--tiles", default="auto")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--tasks", type=int, default=0, help="small tasks to time, too")
    asked = parser.parse_args()
    picture = ["--size", *asked.size, "--spp", asked.spp, "--quiet"]
    rounds = []
    for _ in range(asked.rounds):
        with tempfile.TemporaryDirectory() as place:
            one = timed("render", asked.stage, "-o", Path(place, "a.exr"), *picture,
                        "--threads", asked.workers)  # fmt: skip
            many = timed("farm", "submit", asked.stage, "-o", Path(place, "b.exr"), *picture,
                         "--threads", 1, "--tiles", asked.tiles,
                         "--on", f"local:{asked.workers}")  # fmt: skip
            ratios = [b / a for a, b in zip(one, many, strict=True)]
            rounds.append({"one_s": one, "farm_s": many, "ratios": ratios})
    out = {
        "stage": asked.stage.name, "size": asked.size, "spp": asked.spp, "workers": asked.workers,
        "rounds": rounds,
        "ratios": [statistics.median(one["ratios"][i] for one in rounds) for i in range(2)],
    }  # fmt: skip
    if asked.tasks:
        out["small_task_s"] = small_tasks(asked.stage, asked.tasks)
    print(json.dumps(out, indent=2))


if __name__ == "__main__":
    main()
