# SPDX-License-Identifier: Apache-2.0
"""Measure peak memory of renders of stages that are larger than memory.

    .venv/bin/python benchmarks/large_stages.py --gb 12     # 12 GB of disk for each, one at a time

The benchmark has two kinds of stages, as in production shots. `cache` is one .usdc file of a sea
surface that has a million points in every frame; one frame is rendered. `parts` has a hundred
payloads, each with one mesh, and is rendered with a `--mask` that loads a single payload. Each
stage is compared with a copy without the data that the frame does not need.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

ROOT = Path(__file__).resolve().parents[1]
BYTES_A_POINT = 12
PARTS = 100


def main() -> None:
    """Write the stages, render them, print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gb", type=float, default=12.0, help="size of each stage in GB (12)")
    parser.add_argument("--points", type=int, default=1_000_000, help="points per mesh (10^6)")
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "large", help="folder of the stages"
    )
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    side = max(round(args.points**0.5), 2)
    frames = max(round(args.gb * 1e9 / (side * side * BYTES_A_POINT)), 2)
    print(f"{'stage':8} {'GB':>7} {'opened, built s':>16} {'peak MB':>8}   alone: s, MB")
    copies = max(round(frames / PARTS), 1)
    kinds: dict[str, tuple[Callable[[Path, int, int, int], Path], tuple[str, ...]]] = {
        "cache": (write_cache, ("--frame", "1")),
        "parts": (write_parts, ("--mask", "/World/P0", "--mask", "/World/Cam")),
    }
    for name, (write, options) in kinds.items():
        whole, one = (
            render(write(args.folder / f"{name}{count}", count, side, copies), options)
            for count in (frames if name == "cache" else PARTS, 1)
        )
        cells = f"{name:8} {whole[0]:7.2f} {whole[1]:16.1f} {whole[2]:8.0f}"
        print(f"{cells}   {one[1]:.1f}, {one[2]:.0f}", flush=True)


def write_cache(folder: Path, frames: int, side: int, _: int) -> Path:
    """Write one file with points for each frame, frame by frame."""
    path = folder / "sea.usdc"
    stage = _new(path)
    points = _mesh(stage, "/World/Sea", side).GetPointsAttr()
    for frame in range(1, frames + 1):
        points.Set(Vt.Vec3fArray.FromNumpy(sea(side, frame)), frame)
        if frame % 8 == 0:
            stage.GetRootLayer().Save()
    stage.GetRootLayer().Save()
    return path


def write_parts(folder: Path, count: int, side: int, copies: int) -> Path:
    """Write a stage with payloads; their meshes have ``copies`` primvars as large as the points."""
    path = folder / "set.usda"
    stage = _new(path)
    for i in range(count):
        part = Usd.Stage.CreateNew(str(folder / f"part{i}.usdc"))
        mesh = _mesh(part, "/Part", side)
        part.SetDefaultPrim(mesh.GetPrim())
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(sea(side, i)))
        for k in range(1, copies):
            rest = mesh.GetPrim().CreateAttribute(f"rest{k}", Sdf.ValueTypeNames.Point3fArray)
            rest.Set(Vt.Vec3fArray.FromNumpy(sea(side, 1000 + k)))
        part.GetRootLayer().Save()
        stage.DefinePrim(f"/World/P{i}").GetPayloads().AddPayload(f"./part{i}.usdc")
    stage.GetRootLayer().Save()
    return path


def render(path: Path, options: tuple[str, ...]) -> tuple[float, float, float]:
    """Render a stage and remove its files; return GB of files, seconds to load, peak MB."""
    stats = path.with_suffix(".json")
    size = sum(file.stat().st_size for file in path.parent.glob("*.usd*"))
    command = [
        sys.executable, "-m", "wavecomb", "render", str(path), "-o", str(path.with_suffix(".exr")),
        "--size", "64", "64", "--spp", "1", "--stats", str(stats), *options,
    ]  # fmt: skip
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    read = json.loads(stats.read_text(encoding="utf-8"))
    for file in path.parent.iterdir():
        file.unlink()
    path.parent.rmdir()
    seconds = read["seconds"]["load"] + read["seconds"]["build"]
    return size / 1e9, seconds, read["peak_rss_bytes"] / 1e6


def sea(side: int, frame: int) -> NDArray[np.float32]:
    """Return points of a moving sea, (side^2, 3), with noise that makes files hard to compress."""
    x = np.linspace(-1, 1, side, dtype=np.float32)
    u, v = np.meshgrid(x, x, indexing="ij")
    rough = np.random.default_rng(frame).random((side, side), np.float32)
    z = 0.1 * np.sin(6 * u + 0.1 * np.float32(frame)) * np.cos(5 * v) + np.float32(1e-3) * rough
    return np.stack([u, v, z], -1).reshape(-1, 3).astype(np.float32)


def _new(path: Path) -> Usd.Stage:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    camera = UsdGeom.Camera.Define(stage, "/World/Cam")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, 4))
    return stage


def _mesh(stage: Usd.Stage, path: str, side: int) -> UsdGeom.Mesh:
    """Return the topology of a grid of quads, without its points."""
    i = np.arange(side * side, dtype=np.int32).reshape(side, side)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], -1).reshape(-1)
    mesh = UsdGeom.Mesh.Define(stage, path)
    counts = np.full(len(quads) // 4, 4, np.int32)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreatePointsAttr()
    return mesh


if __name__ == "__main__":
    main()
