# SPDX-License-Identifier: Apache-2.0
"""Compare rendering an image in tiles on N workers with rendering it on N threads of one process.

    python benchmarks/farm.py out/mixed.usdc --size 600 400 --spp 64 --workers 2 --rounds 3

With --frames N the camera moves, and N frames are rendered in both ways and compared bit for bit:

    python benchmarks/farm.py out/mixed.usdc --size 1200 800 --workers 4 --rounds 1 --frames 48

--way selects the mode: all AOVs, adaptive sampling to a pixel error, or a trained guiding field.
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
AOVS = (
    *("albedo", "normal", "depth", "position", "uv", "material_id", "instance_id", "crypto"),
    *("emission", "direct", "indirect", "light_groups", "guide_albedo", "guide_normal"),
    *("samples", "error", "variance"),
)
"""All AOVs except cost, which depends on the clock."""
WAYS = {
    "plain": [],
    "aovs": [word for name in AOVS for word in ("--aov", name)],
    "adaptive": ["--adaptive", "0.05"],
    "learned": ["--guiding", "on"],
}


def cpu_s() -> float:
    """CPU time of all finished child processes."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(*words: object) -> tuple[float, float]:
    """Run a command; return wall seconds and CPU seconds."""
    start, before = time.perf_counter(), cpu_s()
    subprocess.run([*COMMAND, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start, cpu_s() - before


def small_tasks(stage: Path, workers: int, count: int) -> dict[str, float]:
    """Measure the farm's overhead per tile, in milliseconds, for ``count`` tiles of 8 x 8 pixels.

    Tiles are rendered once by one process, without a scheduler, and once by the farm, whose workers
    have opened the stage before the clock starts. Both renders write the same files.
    """
    from wavecomb import farm
    from wavecomb.farm import assembly, client
    from wavecomb.farm.machine_class import machine_class
    from wavecomb.farm.rendering import Renderer

    found = {}
    with tempfile.TemporaryDirectory() as place:
        options = {"size": (400, 8 * count // 50), "spp": 1, "threads": 1}
        jobs = [
            farm.submit(stage, Path(place, f"{name}.exr"), tiles=f"50x{count // 50}", **options)
            for name in "ab"
        ]
        renderer, tasks = Renderer(jobs[0].job, threads=1), list(jobs[0].job.tasks())
        for task in tasks[:workers]:
            renderer.render(task, jobs[0].part(task), machine_class())
        start = time.perf_counter()
        for task in tasks[workers:]:
            renderer.render(task, jobs[0].part(task), machine_class())
        found["rendering_ms"] = 1e3 * (time.perf_counter() - start) / (len(tasks) - workers)
        started: list[tuple[float, int]] = []

        def show(at: assembly.Outcome) -> None:
            done = at.tasks_done
            if (done >= workers and not started) or (done == len(tasks) and len(started) == 1):
                started.append((time.perf_counter(), done))

        where = client.ClusterSpec("local", workers)
        client.run(jobs[1], where, threads=1, show=show)
        (begin, first), (end, last) = started
        found["wall_ms"] = 1e3 * (end - begin) / (last - first)
    found["overhead_ms"] = found["wall_ms"] - found["rendering_ms"] / workers
    return found


def moving(stage: Path, place: Path, frames: int) -> Path:
    """Return the stage with a camera that moves sideways from frame to frame."""
    from pxr import Gf, Sdf, Usd, UsdGeom

    file = place / "moving.usda"
    layer = Sdf.Layer.CreateNew(str(file))
    layer.subLayerPaths.append(str(stage.resolve()))
    layer.defaultPrim = Sdf.Layer.FindOrOpen(str(stage)).defaultPrim
    animated = Usd.Stage.Open(layer)
    camera = next(prim for prim in animated.Traverse() if prim.IsA(UsdGeom.Camera))
    step = UsdGeom.Xformable(camera).AddTranslateOp(opSuffix="sideways")
    for frame in range(1, frames + 1):
        step.Set(Gf.Vec3d(0.01 * (frame - 1), 0, 0), frame)
    layer.Save()
    return file


def differing(place: Path, frames: int) -> int:
    """Return the number of frames in which any layer differs between the two renders."""
    from wavecomb.image.files.image import read_layers

    found = 0
    for frame in range(1, frames + 1):
        one, many = (
            {layer: values.tobytes() for layer, values in read_layers(file).items()}
            for file in (place / f"{name}.{frame:04d}.exr" for name in "ab")
        )
        found += one != many
    return found


def main() -> None:
    """Print the results as JSON; pairs of numbers are wall seconds and CPU seconds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stage", type=Path)
    parser.add_argument("--size", nargs=2, type=int, default=(600, 400))
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--tiles", default="auto")
    parser.add_argument("--way", choices=WAYS, default="plain")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument(
        "--tasks", type=int, default=0, help="tiles of 8 x 8 pixels to time, a multiple of 50"
    )
    parser.add_argument(
        "--frames", type=int, default=0, help="number of frames with a moving camera"
    )
    asked = parser.parse_args()
    picture = ["--size", *asked.size, "--spp", asked.spp, "--quiet", *WAYS[asked.way]]
    rounds = []
    for _ in range(asked.rounds):
        with tempfile.TemporaryDirectory() as place:
            stage, name, words = asked.stage, "", list(picture)
            if asked.frames:
                stage, name = moving(asked.stage, Path(place), asked.frames), ".####"
                words += ["--frames", f"1-{asked.frames}"]
            one = timed("render", stage, "-o", Path(place, f"a{name}.exr"), *words,
                        "--threads", asked.workers)  # fmt: skip
            many = timed("farm", "submit", stage, "-o", Path(place, f"b{name}.exr"), *words,
                         "--threads", 1, "--tiles", asked.tiles,
                         "--on", f"local:{asked.workers}")  # fmt: skip
            ratios = [b / a for a, b in zip(one, many, strict=True)]
            rounds.append({"one_s": one, "farm_s": many, "ratios": ratios})
            if asked.frames:
                rounds[-1]["frames_that_differ"] = differing(Path(place), asked.frames)
    out = {
        "stage": asked.stage.name, "size": asked.size, "spp": asked.spp, "workers": asked.workers,
        "frames": asked.frames, "way": asked.way, "rounds": rounds,
        "ratios": [statistics.median(one["ratios"][i] for one in rounds) for i in range(2)],
    }  # fmt: skip
    if asked.tasks:
        out["small_tasks"] = small_tasks(asked.stage, asked.workers, asked.tasks)
    print(json.dumps(out, indent=2))


if __name__ == "__main__":
    main()
