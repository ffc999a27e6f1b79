# SPDX-License-Identifier: Apache-2.0
"""Measure stages that are large in one respect: many prims, many instances, many triangles.

    .venv/bin/python benchmarks/scale.py
    .venv/bin/python benchmarks/scale.py --only instances --count 4000000 --rounds 3

Each stage is written once (below --folder), then read and rendered with 1 sample per pixel by new
processes, as ``benchmarks/loading.py`` does. Prints medians of the seconds to load and to build,
and of the peak memory relative to the scene's arrays and BVH. ``prims`` are meshes of 12 triangles,
each in a separate Xform; ``instances`` belong to one point instancer; ``natives`` are native
instances; ``triangles`` are in one mesh with normals and texture coordinates.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from loading import turn
from pxr import Sdf, Usd, UsdGeom, Vt

COUNTS = {"prims": 100_000, "instances": 1_000_000, "natives": 100_000, "triangles": 10_000_000}
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32) * 0.6
FACES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], np.int32
)


def write_prims(stage: Usd.Stage, count: int) -> None:
    """Write ``count`` prims: Xforms with one mesh inside each."""
    for path, place in zip(_paths("/World", count // 2), _places(count // 2), strict=True):
        xform = UsdGeom.Xform.Define(stage, path)
        xform.AddTranslateOp().Set(tuple(map(float, place)))
        _cube(stage, f"{path}/Mesh")


def write_instances(stage: Usd.Stage, count: int) -> None:
    """Write one point instancer of two prototypes, with rotations, scales and colours."""
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/Instancer")
    paths = [_cube(stage, f"/World/Instancer/Prototypes/P{k}") for k in range(2)]
    instancer.CreatePrototypesRel().SetTargets(paths)
    random = np.random.default_rng(1)
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.arange(count, dtype=np.int32) % 2))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(_places(count).astype(np.float32)))
    turns = random.normal(size=(count, 4)).astype(np.float16)
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns))
    sizes = random.uniform(0.5, 1.5, (count, 3)).astype(np.float32)
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(sizes))
    colours = random.uniform(size=(count, 3)).astype(np.float32)
    primvars = UsdGeom.PrimvarsAPI(instancer)
    made = primvars.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex")
    made.Set(Vt.Vec3fArray.FromNumpy(colours))


def write_natives(stage: Usd.Stage, count: int) -> None:
    """Write native instances of one class."""
    stage.CreateClassPrim("/Prototype")
    _cube(stage, "/Prototype/Mesh")
    for path, place in zip(_paths("/World", count), _places(count), strict=True):
        xform = UsdGeom.Xform.Define(stage, path)
        xform.AddTranslateOp().Set(tuple(map(float, place)))
        prim = xform.GetPrim()
        prim.GetReferences().AddInternalReference("/Prototype")
        prim.SetInstanceable(True)


def write_triangles(stage: Usd.Stage, count: int) -> None:
    """Write one mesh of a wavy surface."""
    edge = round((count / 2) ** 0.5)
    mesh = UsdGeom.Mesh.Define(stage, "/World/Waves")
    u, v = np.meshgrid(*[np.linspace(0, 1, edge + 1, dtype=np.float32)] * 2)
    height = 0.02 * np.sin(40 * u) * np.cos(30 * v)
    points = np.stack([u, height, v], axis=-1).reshape(-1, 3)
    slopes = np.gradient(height, 1 / edge)
    normals = np.stack([-slopes[1], np.ones_like(u), -slopes[0]], axis=-1).reshape(-1, 3)
    first = (np.arange(edge)[:, None] * (edge + 1) + np.arange(edge)).ravel()
    corner = np.stack([first, first + edge + 1, first + 1], axis=1)
    other = np.stack([first + 1, first + edge + 1, first + edge + 2], axis=1)
    indices = np.stack([corner, other], axis=1).ravel().astype(np.int32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(2 * edge**2, 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
    mesh.CreateSubdivisionSchemeAttr("none")
    primvars = UsdGeom.PrimvarsAPI(mesh)
    made = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    made.Set(Vt.Vec2fArray.FromNumpy(np.stack([u, v], axis=-1).reshape(-1, 2)))


WRITERS: dict[str, Callable[[Usd.Stage, int], None]] = {
    "prims": write_prims,
    "instances": write_instances,
    "natives": write_natives,
    "triangles": write_triangles,
}


def _paths(folder: str, count: int) -> list[str]:
    """Return ``count`` paths, at most 1000 per parent, since USD is slow with more children."""
    return [f"{folder}/G{i // 1000}/P{i}" for i in range(count)]


def _places(count: int) -> np.ndarray[Any, Any]:
    """Return ``count`` positions on a cubic grid, (count, 3)."""
    edge = int(np.ceil(count ** (1 / 3)))
    at = np.arange(count)
    return np.stack([at % edge, at // edge % edge, at // edge**2], axis=1).astype(np.float64)


def _cube(stage: Usd.Stage, path: str) -> str:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(CUBE))
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr(FACES.ravel().tolist())
    mesh.CreateSubdivisionSchemeAttr("none")
    return path


def make(name: str, count: int, folder: Path) -> Path:
    """Return the file of a stage; write it if it is missing."""
    path = folder / f"{name}-{count}.usdc"
    if not path.exists():
        part = path.with_suffix(".part.usdc")
        stage = Usd.Stage.CreateNew(str(part))
        WRITERS[name](stage, count)
        stage.Save()
        part.rename(path)
    return path


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=list(WRITERS), help="only this kind of stage")
    parser.add_argument(
        "--count", type=int, help="with --only: number of prims, instances or triangles"
    )
    parser.add_argument(
        "--folder", type=Path, default=Path("out"), help="folder of generated stages"
    )
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", type=int, default=300)
    parser.add_argument("--threads", type=int, default=0, help="number of threads; 0 means all")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    print("| stage | load s | build s | peak MB | arrays + BVH MB | ratio | bytes each |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in [options.only] if options.only else WRITERS:
        count = (options.only and options.count) or COUNTS[name]
        path = make(name, count, options.folder)
        turn(path, options.size, options.threads)
        turns = [turn(path, options.size, options.threads) for _ in range(options.rounds)]
        load = statistics.median(t["load"] - t["imports"] for t in turns)
        build = statistics.median(t["build"] - t["load"] for t in turns)
        peak, parts, ratio = (
            statistics.median(t[key] for t in turns) for key in ("peak_mb", "parts_mb", "ratio")
        )
        each = statistics.median(_scene_bytes(t) / count for t in turns)
        print(
            f"| {count:,} {name} | {load:.2f} | {build:.2f} | {peak:.0f} | {parts:.0f} | "
            f"{ratio:.2f} | {each:.0f} |",
            flush=True,
        )


def _scene_bytes(record: dict[str, Any]) -> int:
    """Return the bytes of the mesh arrays, the per-instance records and the BVH."""
    parts = record["memory_bytes"]
    return int(sum(parts[name] for name in ("accelerator", "meshes", "records")))


if __name__ == "__main__":
    main()
