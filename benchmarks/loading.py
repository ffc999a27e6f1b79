# SPDX-License-Identifier: Apache-2.0
"""Measure time and memory from process start to the first image.

    .venv/bin/python benchmarks/loading.py
    .venv/bin/python benchmarks/loading.py --rounds 9 --stages mixed --threads 2 --output my.json

Each measurement is a new process that reads a stage, renders it with 1 sample per pixel and writes
an EXR file, as ``wavecomb render`` does. Stages alternate in shuffled rounds. Times are measured
from just before the process starts. Files are in the page cache, because each stage is first read
once without measurement. Writes all measurements as JSON, and prints the median, minimum and
maximum.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from sitting import RESULTS, write_result

STAGES = ("cornell", "mixed", "dragon")
TIMES = ("python", "imports", "load", "build", "first_sample", "render", "first_picture", "process")
MEMORY = ("imports_mb", "peak_mb", "parts_mb", "ratio")

# Python program that measures the loading of a scene in a child process, once per round. Its time
# stamps come from CLOCK_MONOTONIC, so they are comparable with the parent process's time stamps.
CHILD = """
import time
start = time.monotonic()
import json, sys
def resident(key):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith(key))
import wavecomb.usd.stage.load
from wavecomb import _core, api
from wavecomb.run.settings import make_settings
from wavecomb.run.stats import make_stats
imports, imports_bytes = time.monotonic(), resident("VmRSS")
stage, output, size, threads = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
settings = make_settings((size, size), 1, threads=threads)
loaded = api.load(stage, threads=threads)  # as commands do
load = time.monotonic()
result = _core.render(loaded.scene, settings, None, None, None)
render = time.monotonic()
picture = api.picture_of(result, make_stats(result, stage=stage, loaded=loaded))
del loaded, result
picture.save(output)
end, stats = time.monotonic(), picture.stats
begun = render - stats["seconds"]["render"]
print(json.dumps({"start": start, "imports": imports, "load": load, "build": begun,
                  "first_sample": begun + stats["seconds"]["first_samples"], "render": render,
                  "first_picture": end, "imports_bytes": imports_bytes,
                  "peak_bytes": resident("VmHWM"), "render_peak_bytes": stats["peak_rss_bytes"],
                  "memory_bytes": stats["memory_bytes"]}))
"""


def turn(stage: Path, size: int, threads: int) -> dict[str, Any]:
    """Run one process; return the seconds from its start to each event, and its memory in MB."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", CHILD, str(stage), os.path.join(folder, "a.exr")]
        begin = time.monotonic()
        run = subprocess.run(
            [*command, str(size), str(threads)],
            check=True,
            capture_output=True,
            text=True,
            # The wavecomb command sets the same number of threads.
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        end = time.monotonic()
    got = json.loads(run.stdout)
    parts = sum(got["memory_bytes"].values())
    record: dict[str, Any] = {"python": got["start"] - begin}
    record |= {name: got[name] - begin for name in TIMES[1:-1]}
    record["process"] = end - begin
    record["imports_mb"] = got["imports_bytes"] / 1e6
    record["peak_mb"] = got["peak_bytes"] / 1e6
    record["parts_mb"] = parts / 1e6
    # Ratio of the peak memory of loading and rendering to the sum of the memory that the statistics
    # report. If the scene has no images, the peak does not include the library for image files,
    # which is then loaded only when the rendered image is saved.
    record["ratio"] = (got["render_peak_bytes"] - got["imports_bytes"]) / parts
    record["memory_bytes"] = got["memory_bytes"]
    return record


def summary(turns: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Median, minimum and maximum of each value."""
    out = {}
    for name in (*TIMES, *MEMORY):
        values = [entry[name] for entry in turns]
        out[name] = {
            "median": statistics.median(values),
            "least": min(values),
            "most": max(values),
        }
    return out


def make_stage(name: str, folder: Path) -> Path:
    """Return a stage of ``wavecomb scene``, or the file of that name."""
    if name not in STAGES:
        return Path(name)
    path = folder / f"{name}.usdc"
    if not path.exists():
        command = [sys.executable, "-m", "wavecomb", "scene", name, "-o", str(path)]
        subprocess.run(command, check=True)
    return path


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stages", nargs="+", default=list(STAGES), help="names or files")
    parser.add_argument(
        "--folder", type=Path, default=Path("out"), help="folder of generated stages"
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--size", type=int, default=600)
    parser.add_argument("--threads", type=int, default=0, help="number of threads; 0 means all")
    parser.add_argument("--output", type=Path, default=RESULTS / "loading.json")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    stages = {name: make_stage(name, options.folder) for name in options.stages}
    for path in stages.values():
        turn(path, options.size, options.threads)
    turns: dict[str, list[dict[str, Any]]] = {name: [] for name in stages}
    shuffle = random.Random(1)
    for _ in range(options.rounds):
        for name in shuffle.sample(list(stages), len(stages)):
            turns[name].append(turn(stages[name], options.size, options.threads))
    found = {n: {"summary": summary(t), "turns": t} for n, t in turns.items()}
    chosen = {name: getattr(options, name) for name in ("rounds", "size", "threads")}
    write_result(options.output, "wavecomb-loading/1", {**chosen, "stages": found})
    print("| stage | " + " | ".join((*TIMES, *MEMORY)) + " |")
    print("| --- |" + " --- |" * len((*TIMES, *MEMORY)))
    for name, entry in found.items():
        cells = []
        for key in (*TIMES, *MEMORY):
            f, form = entry["summary"][key], ".0f" if key.endswith("mb") else ".2f"
            cells.append(f"{f['median']:{form}} ({f['least']:{form}} to {f['most']:{form}})")
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
