# SPDX-License-Identifier: Apache-2.0
"""Measures export and the first visible image: ``python speed.py [TRIANGLES] [RUNS]``.

Prints one JSON row per run. A row has the seconds and CPU seconds of Blender's exporter alone, of
the exporter and the correction layer, and of the time from F12 to the first image (including
Wavecomb's process). The environment variable WAVECOMB names the program to run.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import bpy  # noqa: E402
import build  # noqa: E402
import harness  # noqa: E402


def make(triangles: int) -> Any:
    """Makes a scene of one smooth mesh with texture coordinates and a material."""
    scene = harness.prepare(16)
    build.studio()
    side = round((triangles / 2) ** 0.5)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side, size=4.0)
    bpy.ops.object.shade_smooth()
    thing = bpy.context.object
    thing.location.z = 0.5
    thing.data.materials.append(build.principled(base_color=(0.5, 0.2, 0.1)))
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.render.engine = "WAVECOMB"
    return scene


def seconds(call: Callable[[], Any]) -> tuple[float, float]:
    """Returns seconds and CPU seconds of a call."""
    start, cpu = time.perf_counter(), _cpu()
    call()
    return time.perf_counter() - start, _cpu() - cpu


def _cpu() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _cpu_of(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def first_image(engine: Any) -> tuple[float, float]:
    """Returns seconds, and CPU seconds of both processes, from F12 to the first image."""
    found: list[tuple[float, float]] = []
    running: list[Any] = []
    kind, start_render, shows = engine.WavecombRenderEngine, engine.Render, engine.shows_progress
    original = kind._show
    start, cpu = time.perf_counter(), _cpu()

    class Recorded(start_render):  # type: ignore[misc,valid-type]
        def __init__(self, *words: Any) -> None:
            super().__init__(*words)
            running.append(self)

    def show(self: Any, *words: Any) -> None:
        original(self, *words)
        if not found:
            total = _cpu() - cpu + _cpu_of(running[0]._process.pid)
            found.append((time.perf_counter() - start, total))
            running[0].stop()

    kind._show, engine.shows_progress, engine.Render = show, lambda engine: True, Recorded
    try:
        bpy.ops.render.render()
    finally:
        kind._show, engine.shows_progress, engine.Render = original, shows, start_render
    return found[0]


def run(scene: Any) -> dict[str, Any]:
    """Measures the exporter, the whole export and the first image, each once."""
    engine, export = (sys.modules[f"wavecomb_blender.{n}"] for n in ("engine", "export"))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    folder = tempfile.mkdtemp()
    try:
        file = os.path.join(folder, "alone.usdc")
        alone = seconds(lambda: export.export_geometry(file, scene, depsgraph.view_layer))
        session = export.Session(folder)
        whole = seconds(lambda: export.export_stage(depsgraph, session, (960, 540)))
    finally:
        shutil.rmtree(folder)
    scene.wavecomb.spp = 1 << 16
    first = first_image(engine)
    engine.close_sessions()
    rows = {"exporter": alone, "export": whole, "first_image": first}
    found: dict[str, Any] = {f"{k}_s": round(v[0], 3) for k, v in rows.items()}
    found |= {f"{k}_cpu_s": round(v[1], 3) for k, v in rows.items()}
    found["export_ratio"] = round(whole[0] / alone[0], 3)
    found["export_cpu_ratio"] = round(whole[1] / alone[1], 3)
    found["first_image_limit_s"] = round(1.5 * alone[0] + 1.0, 3)
    return found


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    made = make(count)
    for _ in range(int(sys.argv[2]) if len(sys.argv) > 2 else 3):
        print("ROW " + json.dumps(run(made)), flush=True)
