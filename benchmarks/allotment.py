# SPDX-License-Identifier: Apache-2.0
"""Compare the efficiency of sample allocation by pixel with uniform sampling.

    .venv/bin/python benchmarks/allotment.py out/cornell.usda out/mixed.usdc half

Renders each stage with every mode of ``--allocate`` and number of samples, with several seeds in
turn, and compares with a render of ``--reference`` samples and other seeds. Efficiency is 1 /
(relMSE x seconds), both as means over seeds. Seconds are CPU time, so that other work on the
machine has little effect. ``half`` is a stage made here: its left half is an open floor, its right
half a white box whose paths are many times as long.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from sitting import write_result

import wavecomb

WAYS = ("even", "error", "efficiency")

HALF = """#usda 1.0
(
  upAxis = "Y"
  defaultPrim = "World"
)
def Xform "World" {
  def Camera "Camera" {
    float focalLength = 30
    float horizontalAperture = 24
    float verticalAperture = 24
    double3 xformOp:translate = (0, 0, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
  def SphereLight "Lamp" {
    float inputs:intensity = 40
    float inputs:radius = 0.15
    double3 xformOp:translate = (-1.2, 1.5, 1.5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
  def SphereLight "Inside" {
    float inputs:intensity = 12
    float inputs:radius = 0.15
    double3 xformOp:translate = (1.3, 1.2, -1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
  def Mesh "Open" {
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-5, -3, -1), (-0.01, -3, -1), (-0.01, 3, -1), (-5, 3, -1)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    color3f[] primvars:displayColor = [(0.3, 0.3, 0.3)]
  }
  def Mesh "Box" {
    uniform token subdivisionScheme = "none"
    bool doubleSided = 1
    point3f[] points = [(0, -2.5, 0.5), (2.6, -2.5, 0.5), (2.6, 2.5, 0.5), (0, 2.5, 0.5),
      (0, -2.5, -3), (2.6, -2.5, -3), (2.6, 2.5, -3), (0, 2.5, -3)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4]
    int[] faceVertexIndices = [4, 5, 6, 7, 0, 1, 5, 4, 3, 7, 6, 2, 0, 4, 7, 3, 1, 2, 6, 5]
    color3f[] primvars:displayColor = [(0.95, 0.95, 0.95)]
  }
}
"""


def rel_mse(picture: Any, reference: Any) -> float:
    """Return the mean of (A - B)^2 / (B^2 + 0.01)."""
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 0.01)))


def measure(scene: Any, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Return a row for each number of samples and mode."""
    common: dict[str, Any] = {"size": (options.size, options.size), "threads": options.threads}
    reference = np.asarray(
        wavecomb.render(scene, spp=options.reference, seed=1000, **common).beauty, np.float64
    )
    rows = []
    for spp in options.spp:
        errors: dict[str, list[float]] = {way: [] for way in WAYS}
        seconds: dict[str, list[float]] = {way: [] for way in WAYS}
        for seed in range(options.seeds):
            for way in WAYS[seed % 3 :] + WAYS[: seed % 3]:
                before = time.process_time()
                picture = wavecomb.render(scene, spp=spp, seed=seed, allocate=way, **common)
                seconds[way].append(time.process_time() - before)
                errors[way].append(rel_mse(np.asarray(picture.beauty, np.float64), reference))
                if picture.samples.sum() != spp * options.size**2:
                    sys.exit(f"{way} at {spp}: the number of samples differs between renders")
        even = statistics.mean(errors["even"]) * statistics.mean(seconds["even"])
        for way in WAYS:
            error, took = statistics.mean(errors[way]), statistics.mean(seconds[way])
            rounds = [
                errors["even"][i] * seconds["even"][i] / (errors[way][i] * seconds[way][i])
                for i in range(options.seeds)
            ]
            spread = statistics.stdev(rounds) / options.seeds**0.5 if options.seeds > 1 else 0.0
            rows.append(
                {"spp": spp, "allocate": way, "rel_mse": error, "seconds": took,
                 "efficiency": even / (error * took), "standard_error": spread}
            )  # fmt: skip
    return rows


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+")
    parser.add_argument("--spp", type=int, nargs="+", default=[16, 64, 256])
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--reference", type=int, default=4096)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--output", type=Path, help="a JSON file")
    options = parser.parse_args()
    results = {}
    for name in options.stages:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(name)
            if name == "half":
                path = Path(folder) / "half.usda"
                path.write_text(HALF)
            scene = wavecomb.load(str(path)).scene
            results[path.stem] = measure(scene, options)
        for row in results[path.stem]:
            print(
                f"{path.stem:9} {row['spp']:4} {row['allocate']:10} relMSE {row['rel_mse']:.5f} "
                f"{row['seconds']:6.2f} s  efficiency {row['efficiency']:.2f} "
                f"± {row['standard_error']:.2f}",
                flush=True,
            )
        if options.output:
            content = {"size": options.size, "rounds": options.seeds, "stages": results}
            write_result(options.output, "wavecomb-allotment/1", content)


if __name__ == "__main__":
    main()
