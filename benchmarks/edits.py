#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measure the time to edit the camera, a material or a light, and to move an object.

For each stage, prints the milliseconds and CPU milliseconds of the first edit of each kind and of
the fastest of ten further edits. Edits the first material, the first light and the first mesh.
"""

import argparse
import os
import sys
import time

import numpy as np

import wavecomb

COUNT = 10


def edits_of(renderer, stage):
    """Returns a function for each kind of edit, which takes the amount of change."""
    from pxr import UsdGeom

    from wavecomb.usd import LoadReport, open_stage
    from wavecomb.usd.stage.report import capture_diagnostics

    scene = renderer.scene
    material, light = next(iter(renderer.materials)), next(iter(renderer.lights))
    colour = np.array(scene.light(renderer.lights[light][0])["color"])
    camera = np.array(scene.camera["to_world"])
    with capture_diagnostics(LoadReport()):
        usd = open_stage(stage)
    prims = [prim for prim in usd.Traverse() if prim.IsA(UsdGeom.Mesh)]
    mesh = next(path for prim in prims if scene.bounds_of(path := str(prim.GetPath())))

    def shifted(matrix, by):
        out = np.array(matrix, float)
        out[3, 0] += by
        return out

    return {
        "camera": lambda x: renderer.edit(camera={"transform": shifted(camera, x)}),
        "material": lambda x: renderer.edit(materials={material: {"roughness": 0.3 + x}}),
        "light": lambda x: renderer.edit(lights={light: {"color": tuple(colour * (1.0 + x))}}),
        "move": lambda x: renderer.edit(moves={mesh: shifted(np.eye(4), x)}),
    }


def timed(edit, value):
    """Returns the wall and CPU milliseconds that an edit takes."""
    start, cpu = time.perf_counter(), time.process_time()
    edit(value)
    return 1e3 * (time.perf_counter() - start), 1e3 * (time.process_time() - cpu)


def main():
    """Measure each stage in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stages", nargs="+")
    for stage in parser.parse_args().stages:
        renderer = wavecomb.Renderer(stage, size=(960, 540))
        sys.stdout.write(f"{os.path.basename(stage)}, load {os.getloadavg()[0]:.1f}\n")
        for kind, edit in edits_of(renderer, stage).items():
            first = timed(edit, 1e-3)
            rest = [timed(edit, 1e-3 * (k + 2)) for k in range(COUNT)]
            best = min(wall for wall, _ in rest), min(cpu for _, cpu in rest)
            sys.stdout.write(
                f"  {kind:10}first {first[0]:8.2f} ms (CPU {first[1]:.2f}), "
                f"best of {COUNT} {best[0]:6.2f} ms (CPU {best[1]:.2f})\n"
            )


if __name__ == "__main__":
    main()
