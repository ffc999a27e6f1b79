# SPDX-License-Identifier: Apache-2.0
"""Compare subdivision by Wavecomb and by Embree: time and memory of one mesh.

    .venv/bin/python benchmarks/subdivision.py Teapot.usd /Teapot/Geometry 4

Prints the cost of refinement, of Embree's BVH for the resulting triangles, and of Embree's
subdivision geometry at a tessellation rate of 2^level; one thread each. Compiles
benchmarks/subdivision_embree.cpp against the Embree in .deps/embree, or else against the
distribution's Embree.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from wavecomb import _core

ROOT = Path(__file__).resolve().parents[1]
STAGED = ROOT / ".deps" / "embree"


def compile_probe(folder: Path) -> list[str]:
    """Compile the Embree program; return the command that runs it."""
    program = folder / "subdivision_embree"
    source = ROOT / "benchmarks" / "subdivision_embree.cpp"
    command = ["g++", "-std=c++20", "-O2", str(source), "-o", str(program)]
    if STAGED.exists():
        command += [f"-I{STAGED}/include", f"{STAGED}/lib/libembree4.so.4"]
        command += ["-Wl,--allow-shlib-undefined", f"-Wl,-rpath,{STAGED}/lib"]
    else:
        command += ["-lembree4"]
    subprocess.run(command, check=True)
    return [str(program)]


def save(path: Path, points: Any, counts: Any, indices: Any) -> Path:
    """Save a mesh in the file format that subdivision_embree.cpp reads."""
    with path.open("wb") as file:
        file.write(np.array([len(points), len(counts), indices.size], np.int32).tobytes())
        for array in (points.astype(np.float32), counts.astype(np.int32), indices.astype(np.int32)):
            file.write(array.tobytes())
    return path


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stage")
    parser.add_argument("prim")
    parser.add_argument("level", type=int)
    args = parser.parse_args()
    stage = Usd.Stage.Open(args.stage)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(args.prim))
    first = Usd.TimeCode.EarliestTime()
    points = np.asarray(mesh.GetPointsAttr().Get(first), np.float32)
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(first), np.int32)
    indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(first), np.int32)
    cage: dict[str, Any] = {
        "level": args.level, "points": points, "counts": counts, "indices": indices,
        "scheme": "catmullClark", "boundary": "edgeAndCorner", "face_varying": "cornersPlus1",
        "smooth_triangles": False, "left_handed": False,
    }  # fmt: skip
    builder = _core.SceneBuilder(1)
    builder.make_surfaces([{**cage, "level": 1}], 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    (made,) = builder.make_surfaces([cage], 1)
    seconds = time.process_time() - start
    peak = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if isinstance(made, str):
        raise SystemExit(f"{args.prim}: {made}")
    triangles = len(made["triangles"])
    kept = sum(made[key].nbytes for key in ("positions", "normals", "triangles", "faces"))
    print(
        f"{triangles:,} triangles: refined in {seconds:.3f} s of CPU, {kept / 1e6:.1f} MB kept, "
        f"peak {peak / 1e6:.1f} MB ({peak / triangles:.0f} bytes a triangle)"
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = compile_probe(folder)
        environment = {**os.environ, "LD_LIBRARY_PATH": str(ROOT / ".venv" / "lib")}
        polygons = save(folder / "cage", points, counts, indices)
        refined = save(
            folder / "refined",
            made["positions"],
            np.full(triangles, 3),
            made["triangles"].reshape(-1),
        )
        for what, file, rate in (
            ("Embree over these triangles", refined, 0),
            ("Embree's own subdivision   ", polygons, 2**args.level),
        ):
            done = subprocess.run(
                [*run, str(file), str(rate)], env=environment, check=True, capture_output=True
            )
            print(f"{what}: {done.stdout.decode().strip()}")


if __name__ == "__main__":
    main()
