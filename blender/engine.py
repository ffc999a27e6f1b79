# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: export, render in a separate process, passes, progress, cancel."""

from __future__ import annotations

import os
import shlex
import shutil
import tempfile
import time
from typing import Any

import bpy
import numpy as np

from . import cryptomatte, exr, settings, standby
from .camera import NoCamera
from .export import Exported, ExportError, Session, export_stage
from .motion import sample, shutter_of
from .passes import combined, pixels, wanted
from .process import Render, WavecombError

FAILURES = (ExportError, NoCamera, WavecombError, exr.ExrError, OSError)
"""Errors that end a render with one line in Blender's report."""

_sessions: dict[tuple[str, str], Session] = {}


@bpy.app.handlers.persistent  # type: ignore[untyped-decorator]
def close_sessions(*_: Any) -> None:
    """Removes the files of all renders."""
    chosen = settings.preferences()
    keep = (chosen is not None and chosen.keep_files) or "WAVECOMB_KEEP" in os.environ
    for session in _sessions.values():
        if keep:
            print(f"wavecomb: the stage is {session.folder}")
        else:
            shutil.rmtree(session.folder, ignore_errors=True)
    _sessions.clear()


class WavecombRenderEngine(bpy.types.RenderEngine):
    """Wavecomb as a render engine of Blender."""

    bl_idname = "WAVECOMB"
    bl_label = "Wavecomb"
    bl_use_preview = False
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False
    bl_use_spherical_stereo = False

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        """Declares the passes that the compositor and files will have."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for one in wanted(renderlayer, scene.wavecomb.denoise):
            channels = len(one.channels)
            self.register_pass(scene, renderlayer, one.name, channels, one.channels, one.kind)

    def render(self, depsgraph: Any) -> None:
        """Renders one view layer of one frame."""
        try:
            self._render(depsgraph)
        except FAILURES as error:
            self.report({"ERROR"}, f"Wavecomb: {' '.join(str(error).split())}")

    def _render(self, depsgraph: Any) -> None:
        scene, layer = depsgraph.scene, depsgraph.view_layer_eval
        program = settings.program()
        with standby.rendering(bool(getattr(self, "is_animation", False))):
            render = standby.take(program) or Render(program)
            try:
                self._render_by(render, depsgraph, scene, layer)
            finally:
                render.kill()

    def _render_by(self, render: Render, depsgraph: Any, scene: Any, layer: Any) -> None:
        """Exports the scene and renders it by a process that waits for it."""
        session = self._session(scene, layer)
        self.update_stats("", "Exporting")
        whole, region = image_size(scene)
        exported = self._export(depsgraph, session, whole)
        for line in exported.report.lines():
            self.report({"WARNING"}, f"Wavecomb: {line}")
            print(f"wavecomb: {line}", flush=True)
        output = os.path.join(session.folder, "image.exr")
        arguments = [*exported.options, *arguments_of(scene, layer, depsgraph, whole, region)]
        preview = os.path.join(session.folder, "preview.exr")
        self.update_stats("", "Starting Wavecomb")
        stage = [exported.stage, "-o", output, "--preview", preview, "--preview-every", "2"]
        if not shows_progress(self):
            stage = stage[:3]
        render.begin([*stage, *arguments])
        denoise = scene.wavecomb.denoise
        size = whole if region is None else (region[2] - region[0], region[3] - region[1])
        self._watch(render, lambda: self._show(preview, layer, size))
        for line in render.finish():
            self.report({"INFO"}, f"Wavecomb: {line}")
            print(f"wavecomb: {line}", flush=True)
        if os.path.exists(output):
            channels = exr.read(output)
            if any("Crypto" in name for name in channels):
                cryptomatte.rename(channels, exr.texts(output), cryptomatte.names_of(depsgraph))
            os.remove(output)
            self._fill(channels, layer, size, denoise)

    def _session(self, scene: Any, layer: Any) -> Session:
        key = (scene.name_full, layer.name)
        if key not in _sessions:
            _sessions[key] = Session(tempfile.mkdtemp(prefix="wavecomb-", dir=bpy.app.tempdir))
        return _sessions[key]

    def _export(self, depsgraph: Any, session: Session, size: tuple[int, int]) -> Exported:
        scene = depsgraph.scene
        reuse = bool(getattr(self, "is_animation", False))
        sampled = None
        if reuse or shutter_of(scene) is not None:

            def move_to(at: float) -> None:
                whole = int(np.floor(at))
                self.frame_set(whole, subframe=at - whole)

            steps = scene.wavecomb.steps | 1
            sampled = sample(depsgraph, move_to, reuse, steps)
        return export_stage(depsgraph, session, size, sampled)

    def _watch(self, render: Render, show: Any) -> None:
        """Shows progress in Blender until the process ends or the user cancels."""
        start, asked = time.monotonic(), None
        while render.is_running:
            event = render.event(0.1)
            if self.test_break() and asked is None:
                render.stop()
                asked = time.monotonic()
            if asked is not None and time.monotonic() - asked > 10.0:
                render.kill()
            if event is None:
                continue
            if event.get("event") == "progress":
                total = max(int(event.get("samples_total") or 0), 1)
                done = int(event.get("samples_done") or 0) / total
                self.update_progress(min(done, 1.0))
                left = event.get("seconds_left")
                text = f"{100 * done:.0f} %" + (f", {left:.0f} s left" if left else "")
                self.update_stats("", f"{text}, {time.monotonic() - start:.0f} s")
            elif event.get("event") == "wrote" and str(event.get("file")).endswith("preview.exr"):
                show()

    def _show(self, preview: str, layer: Any, size: tuple[int, int]) -> None:
        """Shows the image of the render in progress."""
        try:
            channels = exr.read(preview)
        except (OSError, exr.ExrError):
            return
        result = self.begin_result(0, 0, *size, layer=layer.name)
        _set(result.layers[0].passes["Combined"], combined(channels, False))
        self.update_result(result)
        self.end_result(result, cancel=False, highlight=False, do_merge_results=False)

    def _fill(
        self, channels: dict[str, np.ndarray], layer: Any, size: tuple[int, int], denoise: bool
    ) -> None:
        first = next(iter(channels.values()))
        if first.shape != (size[1], size[0]):
            raise WavecombError(f"the image has {first.shape[::-1]} pixels instead of {size}")
        extra = list(wanted(layer, denoise))
        standard = {one.name for one in extra if one.setting.startswith("use_pass")}
        for one in extra:
            if one.name not in standard:
                self.add_pass(one.name, len(one.channels), one.channels, layer=layer.name)
        result = self.begin_result(0, 0, *size, layer=layer.name)
        passes = result.layers[0].passes
        _set(passes["Combined"], combined(channels, denoise))
        for one in extra:
            target = passes.get(one.name)
            if target is not None:
                _set(target, pixels(one, channels))
        self.end_result(result)


def _set(target: Any, values: np.ndarray) -> None:
    target.rect.foreach_set(values.ravel())


def shows_progress(engine: Any) -> bool:
    """Returns whether somebody sees the image of a render in progress."""
    return not (engine.is_preview or bpy.app.background)


def image_size(scene: Any) -> tuple[tuple[int, int], tuple[int, int, int, int] | None]:
    """Returns the size of the whole image, and the region to render (x0, y0, x1, y1 from top)."""
    render = scene.render
    scale = render.resolution_percentage / 100.0
    width, height = int(render.resolution_x * scale), int(render.resolution_y * scale)
    if not render.use_border:
        return (width, height), None
    x0, x1 = int(render.border_min_x * width), int(render.border_max_x * width)
    y0, y1 = int(render.border_min_y * height), int(render.border_max_y * height)
    return (width, height), (x0, height - y1, x1, height - y0)


def arguments_of(
    scene: Any, layer: Any, depsgraph: Any, size: tuple[int, int], region: Any
) -> list[str]:
    """Returns the options of ``wavecomb render`` for the settings of a scene and view layer."""
    chosen = scene.wavecomb
    spp = layer.samples if layer.samples > 0 else chosen.spp
    found = ["--frame", repr(float(scene.frame_current_final)), "--spp", str(spp)]
    found += ["--size", f"{size[0]}x{size[1]}", "--compression", "none", "--seed", str(chosen.seed)]
    found += ["--max-depth", str(chosen.max_depth), "--filter", chosen.filter]
    found += ["--guiding", chosen.guiding, "--transport", chosen.transport]
    found += ["--firefly", chosen.firefly]
    for option, value in (
        ("--noise", chosen.noise), ("--time-limit", chosen.time_limit),
        ("--clamp-indirect", chosen.clamp_indirect), ("--threads", chosen.threads),
    ):  # fmt: skip
        if value > 0:
            found += [option, repr(value)]
    if chosen.lights == "hidden":
        found += ["--lights", "hidden"]
    if chosen.denoise:
        found.append("--denoise")
    if scene.render.film_transparent:
        found.append("--alpha")
    if not scene.render.use_motion_blur:
        found.append("--no-motion-blur")
    if region is not None:
        found += ["--region", *map(str, region), "--crop"]
    aovs = dict.fromkeys(one.aov for one in wanted(layer, chosen.denoise) if one.aov)
    for aov in aovs or ("samples",):
        found += ["--aov", aov]
    return found + shlex.split(chosen.arguments)
