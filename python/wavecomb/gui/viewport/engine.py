# SPDX-License-Identifier: Apache-2.0
"""Render thread of a live render: takes the newest task, stops the previous one, returns frames.

Independent of Qt. If the full image would take long, a task first renders a reduced image. Then the
engine renders the full image pass by pass.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.frames import Frame, enlarged, layers_of_result, layers_of_snapshot
from wavecomb.run.error_messages import describe

if TYPE_CHECKING:
    from wavecomb._core import Renderer, Result, Snapshot
    from wavecomb.usd import LoadedStage

SCALES = (1, 2, 3, 4, 6, 8, 12)
MOVING_S = 1 / 15
"""Target time of an image during movements, in seconds."""
QUICK_S = 0.15
"""Time of a full pass above which a reduced image comes first, in seconds."""
LOOK_S = 0.05
STATISTICS_S = 0.5


@dataclass
class Edit:
    """Changes of a scene that are applied together. Later values replace earlier ones."""

    camera: dict[str, Any] | None = None
    materials: dict[int, dict[str, Any]] = field(default_factory=dict)
    lights: dict[int, dict[str, Any]] = field(default_factory=dict)

    def add(self, other: Edit) -> None:
        """Merges a later edit."""
        self.camera = other.camera or self.camera
        for mine, others in ((self.materials, other.materials), (self.lights, other.lights)):
            for index, values in others.items():
                mine[index] = {**mine.get(index, {}), **values}

    def copied(self) -> Edit:
        """Returns a copy, because each live render merges later edits separately."""
        return Edit(self.camera, dict(self.materials), dict(self.lights))

    def __bool__(self) -> bool:
        return bool(self.camera or self.materials or self.lights)


@dataclass
class Task:
    """Description of the next render.

    Attributes:
        setup: Checked settings.
        version: Version number of its frames.
        edit: Changes to apply first.
        moving: Whether only a reduced image is wanted.
        loaded: The loaded stage, for statistics.
        renderer: Renderer to use from now on; None keeps the current one.
    """

    setup: Setup
    version: int
    edit: Edit = field(default_factory=Edit)
    moving: bool = False
    loaded: LoadedStage | None = None
    renderer: Callable[[], Renderer] | None = None


class Listener(Protocol):
    """Receiver of results, called on the render thread."""

    def on_frame(self, frame: Frame) -> None:
        """Takes a frame."""

    def on_statistics(self, statistics: dict[str, Any], version: int) -> None:
        """Takes the statistics so far (docs/statistics.md) of the task with that version."""

    def on_failed(self, message: str) -> None:
        """Takes an error in one line. The task has ended."""

    def on_ready(self, renderer: Renderer) -> None:
        """Takes a new renderer."""


class Engine:
    """Owner of the render thread and the renderer."""

    def __init__(self, listener: Listener) -> None:
        self._listener = listener
        self._condition = threading.Condition()
        self._task: Task | None = None
        self._renderer: Renderer | None = None
        self._loaded: LoadedStage | None = None
        self._superseded = False
        self._working = False
        self._closing = False
        self._going = threading.Event()
        self._going.set()
        self._rate = 0.0
        self._overhead = 0.01
        self._thread = threading.Thread(target=self._run, name="wavecomb-render", daemon=True)
        self._thread.start()

    # ---- from any thread -----------------------------------------------------------------------

    def submit(self, task: Task) -> None:
        """Stops the current task and starts this one.

        Keeps the edits of a task that had not started.
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
        """Stops the current task and keeps its image."""
        with self._condition:
            if self._task is not None:
                self._task.moving = True  # applies its edits, for which a reduced image is enough
            self._end_running()

    def _end_running(self) -> None:
        self._superseded = True
        if self._renderer is not None:
            self._renderer.stop()

    def pause(self) -> None:
        """Pauses the render at its next callback."""
        self._going.clear()

    def resume(self) -> None:
        """Resumes the render."""
        self._going.set()

    def is_busy(self) -> bool:
        """Returns whether a task is running or waiting."""
        with self._condition:
            return self._working or self._task is not None

    @property
    def paused(self) -> bool:
        """Whether the render is paused."""
        return not self._going.is_set()

    def close(self) -> None:
        """Ends the thread."""
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
                self._superseded = False
                self._working = True
            assert task is not None
            try:
                self._do(task)
            except Exception as error:
                self._listener.on_failed(describe(error))

    def _do(self, task: Task) -> None:
        if task.renderer is not None:
            self._renderer, self._rate = None, 0.0
            self._loaded = task.loaded
            self._renderer = task.renderer()
            self._listener.on_ready(self._renderer)
        renderer = self._renderer
        if renderer is None:
            return
        if task.edit:
            _apply(renderer, task.edit)
        scale = self._scale_for(task)
        preview: Frame | None = None
        if scale > 1 or task.moving:
            preview = self._preview(renderer, task, scale)
        if not task.moving and not self._superseded:
            self._whole(renderer, task, preview)

    def _scale_for(self, task: Task) -> int:
        pixels = task.setup.width * task.setup.height
        if task.setup.region is not None:
            x0, y0, x1, y1 = task.setup.region
            pixels = max(1, (x1 - x0) * (y1 - y0))
        limit = MOVING_S if task.moving else QUICK_S
        return reduced_scale(pixels, self._rate, self._overhead, limit)

    def _preview(self, renderer: Renderer, task: Task, scale: int) -> Frame | None:
        settings = task.setup.settings(scale, preview=True)
        start = time.perf_counter()
        result = renderer.render(settings, watcher=_Stopper(self), interval=LOOK_S)
        if result.cancelled:
            return None
        self._learn(time.perf_counter() - start, int(result.samples.sum()))
        done = {"samples_done": int(result.samples.sum()), "passes": 1, "preview": True}
        layers = layers_of_result(result)
        frame = Frame(result.beauty, layers, None, done, task.version, scale, False, task.setup)
        self._listener.on_frame(frame)
        return frame

    def _learn(self, seconds: float, samples: int) -> None:
        """Updates the sample rate from a short render.

        Slower values count fully, faster ones by half.
        """
        rate = samples / max(seconds - self._overhead, 1e-4)
        self._rate = rate if self._rate == 0.0 else min(rate, 0.5 * (rate + self._rate))

    def _whole(self, renderer: Renderer, task: Task, preview: Frame | None) -> None:
        watch = _Watch(self, task, preview)
        setup = task.setup
        result = renderer.render(
            setup.settings(), policy=setup.own_policy, costs=setup.profile, watcher=watch,
            interval=LOOK_S,
        )  # fmt: skip
        if self._superseded and self._task is not None:
            return
        statistics = self._statistics(result, watch.held_s)
        self._listener.on_statistics(statistics, task.version)
        if not result.samples.any():
            return
        self._listener.on_frame(self._last_frame(renderer, task, preview, result, statistics))

    def _statistics(self, source: Any, held_s: float) -> dict[str, Any]:
        from wavecomb.run.stats import make_stats

        stage = str(self._loaded.stage_path) if self._loaded is not None else None
        statistics = make_stats(source, stage=stage, loaded=self._loaded)
        statistics["seconds"]["held"] = held_s
        return statistics

    def _last_frame(
        self,
        renderer: Renderer,
        task: Task,
        preview: Frame | None,
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
        beauty = filled(result.beauty, result.samples, preview)
        layers = layers_of_result(result)
        return Frame(beauty, layers, None, status, task.version, 1, True, task.setup, picture)


def _apply(renderer: Renderer, edit: Edit) -> None:
    renderer.edit(camera=edit.camera, materials=edit.materials, lights=edit.lights)


def reduced_scale(pixels: int, rate: float, overhead: float, limit: float) -> int:
    """Returns the smallest reduction that renders one sample per pixel within a time limit.

    Args:
        pixels: Pixels of the full image.
        rate: Samples per second; 0 if unknown.
        overhead: Constant time of a render, in seconds.
        limit: Time limit in seconds.

    >>> reduced_scale(1_000_000, 2_000_000.0, 0.01, 0.06)
    4
    """
    if rate <= 0.0:
        rate = 300_000.0
    for scale in SCALES:
        if overhead + pixels / scale**2 / rate <= limit:
            return scale
    return SCALES[-1]


def filled(beauty: Any, samples: Any, preview: Frame | None) -> Any:
    """Returns the beauty, with pixels of a reduced image where there are no samples yet."""
    if preview is None:
        return beauty
    holes = samples == 0
    if not holes.any():
        return beauty
    height, width = samples.shape
    return np.where(holes[:, :, None], enlarged(preview.beauty, width, height), beauty)


class _Stopper:
    """Watcher that stops a render when it is superseded."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def progress(self, status: Mapping[str, Any]) -> str | None:
        """Requests a stop, or nothing."""
        return "stop" if self._engine._superseded else None

    def snapshot(self, snapshot: Snapshot) -> None:
        """Ignores snapshots, which are not requested."""


class _Watch:
    """Watcher of a full render, which takes frames, pauses and stops."""

    def __init__(self, engine: Engine, task: Task, preview: Frame | None) -> None:
        self._engine = engine
        self._task = task
        self._preview = preview
        self.held_s = 0.0
        """Total time in pauses, in seconds."""
        self._next = 0.0
        self._next_statistics = time.perf_counter() + 0.25
        self._begun = time.perf_counter()

    def progress(self, status: Mapping[str, Any]) -> str | None:
        """Requests a stop, a snapshot, or nothing."""
        engine = self._engine
        if engine._superseded:
            return "stop"
        if engine.paused or time.perf_counter() >= self._next:
            return "snapshot" if status["samples_done"] else None
        return None

    def snapshot(self, snapshot: Snapshot) -> None:
        """Sends a frame, and waits while the engine is paused."""
        if snapshot.finished or self._engine._superseded:
            return
        start = time.perf_counter()
        said = self._send(snapshot)
        now = time.perf_counter()
        # Snapshots take at most a tenth of the time, but there is at least one per second.
        pause = max(10.0 * (now - start), 0.1 if now - self._begun < 5.0 else 0.4)
        self._next = now + min(pause, 1.0)
        if self._engine.paused:
            if not said:  # the pause began while the frame was made
                self._send(snapshot)
            self._stand_still()

    def _stand_still(self) -> None:
        start = time.perf_counter()
        while self._engine.paused and not self._engine._superseded:
            self._engine._going.wait(0.02)
        self.held_s += time.perf_counter() - start

    def _send(self, snapshot: Snapshot) -> bool:
        """Sends a frame. Returns whether the frame states that the render is paused."""
        paused = self._engine.paused
        layers = layers_of_snapshot(snapshot, self._task.setup.layers())
        beauty = filled(snapshot.beauty(), layers["samples"], self._preview)
        status = {**snapshot.status, "paused": paused}
        frame = Frame(beauty, layers, None, status, self._task.version, 1, False, self._task.setup)
        self._engine._listener.on_frame(frame)
        now = time.perf_counter()
        if now >= self._next_statistics or paused:
            self._next_statistics = now + STATISTICS_S
            statistics = self._engine._statistics(_SoFar(snapshot), self.held_s)
            self._engine._listener.on_statistics(statistics, self._task.version)
        return paused


class _SoFar:
    """Adapts a snapshot to the interface of results that ``make_stats`` expects."""

    cancelled = False

    def __init__(self, snapshot: Snapshot) -> None:
        self.stats = snapshot.stats
