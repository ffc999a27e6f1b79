# SPDX-License-Identifier: Apache-2.0
"""Render thread of a live render.

The thread runs the newest task, stops the previous task and sends frames.

Independent of Qt. If the full-size image would take long, a task first renders a reduced image.
The engine then renders the full-size image in passes.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from wavecomb.errors import Error
from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.frames import Frame, layers_of_result
from wavecomb.gui.viewport.previews import ALBEDO, Filler, Pace, smooth
from wavecomb.gui.viewport.watching import LOOK_S, Watch
from wavecomb.run.error_messages import describe

if TYPE_CHECKING:
    from wavecomb._core import Renderer, Result
    from wavecomb.usd import LoadedStage

MOVING_S = 0.11
"""Target render time, in seconds, of a reduced image during camera movements and edits, including
denoising."""
QUICK_S = 0.15
"""If a pass at full size takes longer than this time in seconds, a reduced image is shown first."""


@dataclass
class Edit:
    """Changes of a scene that the renderer applies together.

    A later value of a parameter replaces an earlier one.
    """

    camera: dict[str, Any] | None = None
    materials: dict[int, dict[str, Any]] = field(default_factory=dict)
    lights: dict[int, dict[str, Any]] = field(default_factory=dict)
    moves: dict[str, Any] = field(default_factory=dict)

    def add(self, other: Edit) -> None:
        """Merges a later edit."""
        self.camera = other.camera or self.camera
        for mine, others in ((self.materials, other.materials), (self.lights, other.lights)):
            for index, values in others.items():
                mine[index] = {**mine.get(index, {}), **values}
        self.moves.update(other.moves)

    def copied(self) -> Edit:
        """Returns a copy.

        Each live render needs a separate copy, since later edits are merged into this object.
        """
        return Edit(self.camera, dict(self.materials), dict(self.lights), dict(self.moves))

    def __bool__(self) -> bool:
        return bool(self.camera or self.materials or self.lights or self.moves)


@dataclass
class Task:
    """Description of the next render that the engine should do.

    Attributes:
        setup: Checked settings.
        version: Version number that the task's frames get.
        edit: Changes of the scene to apply first.
        moving: Whether the task renders only a reduced image.
        loaded: The loaded stage, for statistics.
        renderer: Renderer to use from now on; None keeps the current one.
        beauty_only: Whether the frame that shows only first hits may lack all layers except the
            beauty.
    """

    setup: Setup
    version: int
    edit: Edit = field(default_factory=Edit)
    moving: bool = False
    loaded: LoadedStage | None = None
    renderer: Callable[[], Renderer] | None = None
    beauty_only: bool = False


class Listener(Protocol):
    """Receiver of the engine's results. All methods are called on the render thread."""

    def on_frame(self, frame: Frame) -> None:
        """Accepts a frame."""

    def on_statistics(self, statistics: dict[str, Any], version: int) -> None:
        """Accepts the statistics (docs/statistics.md) of the task with the given version."""

    def on_failed(self, message: str) -> None:
        """Accepts an error message of one line. Reports that the task has ended."""

    def on_ready(self, renderer: Renderer) -> None:
        """Accepts a new renderer."""

    def on_refused(self, message: str) -> None:
        """Accepts the reason, in one line, why the scene rejects the moves of an edit."""


class Engine:
    """Render engine, which owns the render thread and the renderer.

    Attributes:
        listener: Receiver of the engine's results.
        superseded: Whether a newer task is waiting, so that the running render must stop.
    """

    def __init__(self, listener: Listener) -> None:
        self.listener = listener
        self._condition = threading.Condition()
        self._task: Task | None = None
        self._renderer: Renderer | None = None
        self._loaded: LoadedStage | None = None
        self.superseded = False
        self._working = False
        self._closing = False
        self._going = threading.Event()
        self._going.set()
        self._pace = Pace()
        self._shown: Frame | None = None
        self._thread = threading.Thread(target=self._run, name="wavecomb-render", daemon=True)
        self._thread.start()

    # ---- from any thread -----------------------------------------------------------------------

    def submit(self, task: Task) -> None:
        """Stops the current task and starts the given task.

        If the current task has not started yet, its edits are added to the new task.
        """
        with self._condition:
            before = self._task
            if before is not None and task.renderer is None:
                before.edit.add(task.edit)
                task.edit = before.edit
                task.renderer, task.loaded = before.renderer, task.loaded or before.loaded
            self._task = task
            self._end_running()
            self._condition.notify_all()

    def stop(self) -> None:
        """Stops the current task; its image stays visible."""
        with self._condition:
            if self._task is not None:
                # render only a reduced image, which is enough to apply the task's edits to the
                # scene
                self._task.moving = True
            self._end_running()

    def _end_running(self) -> None:
        self.superseded = True
        if self._renderer is not None:
            self._renderer.stop()

    def pause(self) -> None:
        """Pauses the render at its next callback."""
        self._going.clear()

    def resume(self) -> None:
        """Resumes the render."""
        self._going.set()

    def wait(self, seconds: float) -> None:
        """Waits until the render is resumed, for at most a few seconds."""
        self._going.wait(seconds)

    def is_busy(self) -> bool:
        """Returns whether a task is running or waiting."""
        with self._condition:
            return self._working or self._task is not None

    @property
    def paused(self) -> bool:
        """Whether the render is paused."""
        return not self._going.is_set()

    def close(self) -> None:
        """Ends the render thread."""
        with self._condition:
            self._closing = True
            self._task = None
            self._end_running()
            self._condition.notify_all()
        self._thread.join()
        self._renderer = None
        self._loaded = None

    # ---- the thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._condition:
                self._working = False
                while self._task is None and not self._closing:
                    self._condition.wait()
                if self._closing:
                    return
                task, self._task = self._task, None
                self.superseded = False
                self._working = True
            assert task is not None
            try:
                self._do(task)
            except Exception as error:
                self.listener.on_failed(describe(error))

    def _do(self, task: Task) -> None:
        if task.renderer is not None:
            self._renderer, self._pace, self._shown = None, Pace(), None
            self._loaded = task.loaded
            self._renderer = task.renderer()
            self.listener.on_ready(self._renderer)
        renderer = self._renderer
        if renderer is None:
            return
        if task.edit:
            self._apply(renderer, task.edit)
            self._shown = None
        scale = self._scale_for(task, QUICK_S)
        if task.moving or (scale > 1 and not self._is_shown(task)):
            self._shown = self._preview(renderer, task, self._scale_for(task, MOVING_S))
        if not task.moving and not self.superseded:
            filler = self._first_hits(renderer, task) if scale > 1 else Filler(None)
            if not self.superseded:
                self._whole(renderer, task, filler)

    def _apply(self, renderer: Renderer, edit: Edit) -> None:
        """Edits the scene.

        If the scene rejects the moves (transforms), applies only the other changes.
        """
        change = partial(
            renderer.edit, camera=edit.camera, materials=edit.materials, lights=edit.lights
        )
        try:
            change(moves=edit.moves)
        except Error as error:
            if not edit.moves:
                raise
            change()
            self.listener.on_refused(describe(error))

    def _is_shown(self, task: Task) -> bool:
        """Returns whether the last reduced image was rendered with the settings of the task."""
        return self._shown is not None and self._shown.setup == task.setup

    def _scale_for(self, task: Task, limit: float) -> int:
        pixels = task.setup.width * task.setup.height
        if task.setup.region is not None:
            x0, y0, x1, y1 = task.setup.region
            pixels = max(1, (x1 - x0) * (y1 - y0))
        return self._pace.scale(pixels, limit)

    def _preview(self, renderer: Renderer, task: Task, scale: int) -> Frame | None:
        settings = task.setup.settings(scale, preview=True)
        start = time.perf_counter()
        result = renderer.render(settings, progress=lambda *_: not self.superseded, interval=LOOK_S)
        if result.cancelled:
            if (seconds := time.perf_counter() - start) > QUICK_S:
                self._pace.learn(result.samples.size, seconds)
            return None
        done = {"samples_done": int(result.samples.sum()), "passes": 1, "preview": True}
        layers = layers_of_result(result)
        frame = Frame(result.beauty, layers, None, done, task.version, scale, False, task.setup)
        back = np.array(renderer.scene.camera["to_world"])[2, :3]
        frame = replace(frame, beauty=smooth(frame, back))
        self._pace.learn(frame.samples_done, time.perf_counter() - start)
        self.listener.on_frame(frame)
        return frame

    def _first_hits(self, renderer: Renderer, task: Task) -> Filler:
        """Sends a full-size frame of first hits, lit like the previous reduced image."""
        if self._shown is None or task.setup.region is not None:
            return Filler(self._shown)
        layers = (ALBEDO,) if task.beauty_only else None
        settings = task.setup.settings(preview=True, depth=0, layers=layers)
        result = renderer.render(settings, progress=lambda *_: not self.superseded, interval=LOOK_S)
        if result.cancelled:
            return Filler(None)
        found, status = layers_of_result(result), {"samples_done": 0, "passes": 0, "preview": True}
        frame = Frame(result.beauty, found, None, status, task.version, 1, False, task.setup)
        filler = Filler(self._shown, found[ALBEDO])
        self.listener.on_frame(filler.fill(frame))
        return filler

    def _whole(self, renderer: Renderer, task: Task, filler: Filler) -> None:
        watch = Watch(self, task.setup, task.version, filler)
        setup = task.setup
        result = renderer.render(
            setup.settings(), policy=setup.own_policy, costs=setup.profile, watcher=watch,
            interval=LOOK_S,
        )  # fmt: skip
        if self.superseded and self._task is not None:
            return
        statistics = self.statistics_of(result, watch.held_s)
        self.listener.on_statistics(statistics, task.version)
        if not result.samples.any():
            return
        self.listener.on_frame(self._last_frame(renderer, task, filler, result, statistics))

    def statistics_of(self, source: Any, held_s: float) -> dict[str, Any]:
        """Returns the statistics of a result or a snapshot. Called on the render thread."""
        from wavecomb.run.stats import make_stats

        stage = str(self._loaded.stage_path) if self._loaded is not None else None
        statistics = make_stats(source, stage=stage, loaded=self._loaded)
        statistics["seconds"]["held"] = held_s
        return statistics

    def _last_frame(
        self,
        renderer: Renderer,
        task: Task,
        filler: Filler,
        result: Result,
        statistics: dict[str, Any],
    ) -> Frame:
        from wavecomb.image.rendered import picture_of

        aovs = task.setup.aovs
        picture = picture_of(result, statistics, scene=renderer.scene, aovs=aovs)
        done = int(result.samples.sum())
        total = done if not result.cancelled else task.setup.spp * result.samples.size
        status = {
            "samples_done": done,
            "samples_total": total,
            "passes": statistics["passes"],
            "rays": statistics["counts"]["rays"] + statistics["counts"]["shadow_rays"],
            "seconds": statistics["seconds"]["render"],
            "error": statistics["error"],
            "cancelled": result.cancelled,
        }
        frame = Frame(
            result.beauty, layers_of_result(result), None, status, task.version, 1, True,
            task.setup, picture,
        )  # fmt: skip
        return filler.fill(frame)
