# SPDX-License-Identifier: Apache-2.0
"""Measures export and the first visible image: ``python speed.py [TRIANGLES] [RUNS]``.

Prints one JSON row per run. A row has the seconds and CPU seconds of Blender's exporter alone, of
the exporter and the correction layer, and of the time from F12 to the first image (including
Wavecomb's process): with a process that has waited for the render, as in Blender's window, and
without (``cold``). The environment variable WAVECOMB names the program to run.
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
    running: list[tuple[Any, float]] = []
    kind, shows_progress = engine.WavecombRenderEngine, engine.shows_progress
    show, render_by = kind._show, kind._render_by

    def record(self: Any, render: Any, *words: Any) -> None:
        running.append((render, _cpu_of(render._process.pid)))
        render_by(self, render, *words)

    def show_first(self: Any, *words: Any) -> None:
        show(self, *words)
        if not found:
            render, before = running[0]
            used = _cpu() - cpu + _cpu_of(render._process.pid) - before
            found.append((time.perf_counter() - start, used))
            render.stop()

    kind._render_by, kind._show, engine.shows_progress = record, show_first, lambda engine: True
    start, cpu = time.perf_counter(), _cpu()
    try:
        bpy.ops.render.render()
    finally:
        kind._render_by, kind._show, engine.shows_progress = render_by, show, shows_progress
    return found[0]


def prepare_standby(standby: Any) -> None:
    """Starts the process that waits for a render, as Blender's window does; waits until it waits.

    The wheel has no window, so that the extension would start no process by itself.
    """
    wanted = standby.is_wanted
    standby.is_wanted = lambda: True
    try:
        bpy.context.view_layer.update()
        standby.update()
    finally:
        standby.is_wanted = wanted
    standby._started.join()
    process = standby._started._render._process.pid
    used = -1.0
    while used != _cpu_of(process):
        used = _cpu_of(process)
        time.sleep(1.0)


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
    cold = first_image(engine)
    engine.close_sessions()
    prepare_standby(sys.modules["wavecomb_blender.standby"])
    first = first_image(engine)
    engine.close_sessions()
    rows = {"exporter": alone, "export": whole, "first_image": first, "first_image_cold": cold}
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
