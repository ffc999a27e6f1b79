# SPDX-License-Identifier: Apache-2.0
"""Measure the gain of --equiangular for a light in a box of fog, given as a volume or a mesh.

    .venv/bin/python benchmarks/lamps_in_fog.py

For several lights and extinctions, prints the relative variance of a pixel at 32 samples (mean over
pixels without the worst thousandth), the relative variance of the image (sum of variances over sum
of squares), and the CPU seconds. The gain for each variance is variance x seconds without
--equiangular, divided by variance x seconds with --equiangular.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import wavecomb

STAGE = """#usda 1.0
( metersPerUnit = 1
  upAxis = "Y" )
FOG
def Material "M" {
    token outputs:mtlx:volume.connect = </M/V.outputs:out>
    def Shader "V" {
        uniform token info:id = "ND_volume"
        token inputs:vdf.connect = </M/D.outputs:out>
        token outputs:out
    }
    def Shader "D" {
        uniform token info:id = "ND_anisotropic_vdf"
        color3f inputs:scattering = (EXT, EXT, EXT)
        token outputs:out
    }
}
def SphereLight "L" (prepend apiSchemas = ["ShapingAPI"]) {
    LAMP
}
def Camera "C" {
    float focalLength = 30
    float horizontalAperture = 24
    float verticalAperture = 24
    double3 xformOp:translate = (0.3, 0.2, 7)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
FOG = {
    "volume": """def Volume "Fog" {
    float3[] extent = [(-2, -2, -2), (2, 2, 2)]
    rel material:binding = </M>
}""",
    "mesh": """def Cube "Fog" {
    double size = 4
    rel material:binding = </M>
}""",
}
LAMPS = {
    "ball": """float inputs:radius = 0.02
    float inputs:intensity = 400
    double3 xformOp:translate = (0.4, 0.3, 0.1)
    uniform token[] xformOpOrder = ["xformOp:translate"]""",
    "spot": """float inputs:radius = 0.05
    float inputs:intensity = 400
    float inputs:shaping:cone:angle = 25
    double3 xformOp:translate = (0, 1.8, 0)
    float3 xformOp:rotateXYZ = (-90, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]""",
}


def measure(stage: Path, equiangular: str, seeds: int) -> tuple[float, float, float]:
    """Return the relative variances of pixels and of the image, and the CPU seconds taken."""
    loaded = wavecomb.load(stage, lights="hidden")
    pictures, seconds = [], 0.0
    for seed in range(seeds):
        started = time.process_time()
        picture = wavecomb.render(loaded, size=(96, 96), spp=32, seed=seed, threads=1,
                                  equiangular=equiangular)  # fmt: skip
        seconds += time.process_time() - started
        pictures.append(np.asarray(picture.beauty, np.float64).mean(-1))
    mean, variance = np.mean(pictures, 0), np.var(pictures, 0, ddof=1)
    seen = mean > 1e-6
    of_pixels = np.sort(variance[seen] / mean[seen] ** 2)
    whole = float(variance.sum() / (mean**2).sum())
    return float(of_pixels[: int(0.999 * len(of_pixels))].mean()), whole, seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    seeds = parser.parse_args().seeds
    print("| lamp | extinction | fog | variance off, on | of the picture | seconds | gain |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for lamp, prim in LAMPS.items():
        for extinction in (0.05, 0.25, 1.0):
            for kind, fog in FOG.items():
                with tempfile.TemporaryDirectory() as folder:
                    stage = Path(folder, "fog.usda")
                    text = STAGE.replace("FOG", fog).replace("LAMP", prim)
                    stage.write_text(text.replace("EXT", str(extinction)))
                    off, on = (measure(stage, how, seeds) for how in ("off", "on"))
                gains = [off[k] * off[2] / (on[k] * on[2]) for k in (0, 1)]
                print(f"| {lamp} | {extinction} | {kind} | {off[0]:.3f} {on[0]:.3f} | "
                      f"{off[1]:.4f} {on[1]:.4f} | {off[2]:.2f} {on[2]:.2f} | "
                      f"{gains[0]:.2f} {gains[1]:.2f} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
