# SPDX-License-Identifier: Apache-2.0
"""Measure the cost of isolating commands in a child process (docs/decisions/sandbox.md).

    .venv/bin/python benchmarks/isolation.py out/mixed.usdc --prims 100000

Runs ``wavecomb info`` on each stage with --isolate off and on (with the sandbox where the system
supports it), and with --sandbox off and on. Configurations alternate, so that other work on the
machine affects them equally. Results are medians. CPU seconds include child processes; memory is
that of the largest process.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

NOTHING = "import sys; from wavecomb.run.isolation import supervisor; "
WAYS = {
    "nothing": lambda stage, how: [
        "-c",
        NOTHING + ("supervisor.supervise()" if how == "on" else ""),
    ],
    "info": lambda stage, how: ["-m", "wavecomb", "info", stage, "--isolate", how],
    "sandbox": lambda stage, how: ["-m", "wavecomb", "info", stage, "--sandbox", how],
}


def many_prims(path: Path, count: int) -> None:
    """Write a stage with ``count`` prims, half of them meshes."""
    from pxr import Sdf, Usd, UsdGeom, Vt

    layer = Sdf.Layer.CreateNew(str(path))
    stage = Usd.Stage.Open(layer)
    with Sdf.ChangeBlock():
        for i in range(count // 2):
            parent = Sdf.CreatePrimInLayer(layer, f"/World/Set{i // 1000}/Part{i}")
            parent.specifier, parent.typeName = Sdf.SpecifierDef, "Xform"
            prim = Sdf.PrimSpec(parent, "Mesh", Sdf.SpecifierDef, "Mesh")
            values = (
                ("points", "point3f[]", Vt.Vec3fArray([(i, 0, 0), (i + 1, 0, 0), (i, 1, 0)])),
                ("faceVertexCounts", "int[]", Vt.IntArray([3])),
                ("faceVertexIndices", "int[]", Vt.IntArray([0, 1, 2])),
            )
            for name, kind, value in values:
                Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind)).default = value
    UsdGeom.SetStageUpAxis(stage, "Y")
    layer.Save()


def seconds(arguments: list[str]) -> tuple[float, float, float]:
    """Run Python with these arguments; return wall seconds, CPU seconds and peak MB."""
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{arguments} failed")
    wall = time.perf_counter() - start
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="*")
    parser.add_argument(
        "--prims", type=int, default=0, help="also measure a stage of this many prims"
    )
    parser.add_argument("--turns", type=int, default=9, help="at least 5")
    options = parser.parse_args()
    if options.turns < 5:
        parser.error("--turns: at least 5")
    with tempfile.TemporaryDirectory() as folder:
        stages = list(options.stages)
        if options.prims:
            path = Path(folder, f"{options.prims}-prims.usdc")
            # Write the file in a separate process, because this process's peak memory would be
            # inherited by processes started later.
            writer = multiprocessing.get_context("spawn").Process(
                target=many_prims, args=(path, options.prims)
            )
            writer.start()
            writer.join()
            stages.append(str(path))
        jobs = [("nothing", "")] + [(way, stage) for stage in stages for way in ("info", "sandbox")]
        print("| what | off: s | CPU s | MB | on: s | CPU s | MB | more CPU s (pairs) |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- |")
        found: dict[tuple[str, str], list[list[tuple[float, float, float]]]] = {}
        for _ in range(options.turns):
            for way, stage in jobs:
                pair = []
                for how in ("off", "on"):
                    pair.append(seconds(WAYS[way](stage, how)))
                found.setdefault((way, stage), []).append(pair)
        for way, stage in jobs:
            pairs = found[way, stage]
            cells = [
                f"{statistics.median(pair[side][figure] for pair in pairs):.3f}"
                for side in (0, 1)
                for figure in range(3)
            ]
            more = statistics.median(pair[1][1] - pair[0][1] for pair in pairs)
            name = f"{way} {Path(stage).name}".strip()
            print(f"| {name} | {' | '.join(cells)} | {more:.3f} |", flush=True)


if __name__ == "__main__":
    main()
