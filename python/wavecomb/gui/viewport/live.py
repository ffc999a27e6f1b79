# SPDX-License-Identifier: Apache-2.0
"""A live render, controlled from the UI thread.

A live render can be edited while it runs. It shows only frames of the newest scene version.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, QTimer, Signal

from wavecomb.gui.bridge import port
from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.engine import Edit, Engine, Task
from wavecomb.gui.viewport.frames import Frame, denoised_frame
from wavecomb.gui.worker import Worker
from wavecomb.run.error_messages import describe

if TYPE_CHECKING:
    from wavecomb._core import Renderer
    from wavecomb.gui.bridge import Port
    from wavecomb.gui.viewport.frames import Frame
    from wavecomb.usd import LoadedStage


class News:
    """An ``engine.Listener`` that stores the newest results until the UI thread takes them.

    Args:
        told: Port that receives None when a result arrives while no other result is stored.
    """

    def __init__(self, told: Port) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._news: dict[tuple[str, str], Any] = {}

    def take(self) -> list[tuple[str, Any]]:
        """Removes and returns all stored results as (kind, content), in order of arrival."""
        with self._lock:
            news, self._news = self._news, {}
        return [(kind, content) for (kind, _), content in news.items()]

    def _put(self, kind: str, content: Any, apart: str = "") -> None:
        with self._lock:
            first = not self._news
            self._news.pop((kind, apart), None)
            self._news[(kind, apart)] = content
        if first:
            self._told.send(None)

    # ---- on the render thread ------------------------------------------------------------------

    def on_frame(self, frame: Frame) -> None:
        """Stores the frame in place of an older stored frame."""
        self._put("frame", frame)

    def on_statistics(self, statistics: dict[str, Any], version: int) -> None:
        """Stores the statistics and their version."""
        self._put("statistics", (statistics, version))

    def on_failed(self, message: str) -> None:
        """Stores an error message.

        Different error messages are all stored.
        """
        self._put("failed", message, message)

    def on_ready(self, renderer: Renderer) -> None:
        """Stores the renderer of a new scene."""
        self._put("ready", renderer)

    def on_refused(self, message: str) -> None:
        """Stores the reason why the scene refused moves (transforms) of an edit."""
        self._put("refused", message)


SETTLE_MS = 50
"""Delay in milliseconds between the last movement or edit and the start of the full-size image."""
BURST_S = 0.15
"""Edits that follow each other within this time, in seconds, count as a drag and show reduced
images."""
WAIT_S = 3.0
"""Time in seconds that an image may take during a movement before the next edit stops its
render."""
DENOISE_AGAIN = 1.5
"""A frame is denoised again when its sample count has grown by this factor."""
LATE = 4
"""A denoised image is outdated once the newest frame has more than this factor times its
samples."""

IDLE, RENDERING, PAUSED, STOPPED, FINISHED = "idle", "rendering", "paused", "stopped", "finished"


class Live(QObject):
    """A live render with separate settings.

    All methods must be called on the UI thread, and none blocks.

    Attributes:
        setup: Settings.
        last_frame: The frame that was emitted last, or None.
        version: Current version of the scene and the settings.
        oldest: Oldest version whose frames may still be shown.
        state: The state that was emitted last.
        renderer: The core's renderer, or None.
        beauty_only: Whether no layer except the beauty is displayed, so that the first frame at
            full size may lack the layers.

    Signals:
        frame(Frame): A new frame of the newest version.
        statistics(dict): Statistics (docs/statistics.md), emitted about twice per second during a
            render.
        setup_changed(Setup): Settings changed.
        edited(int): The scene or the settings changed. The argument is the new version.
        state_changed(str): "idle", "rendering", "paused", "stopped" or "finished".
        failed(str), warned(str): Error or warning message in one line.
        refused(str): The scene could not apply the moves (transforms) of an edit; the argument is
        the reason.
    """

    frame = Signal(object)
    statistics = Signal(object)
    setup_changed = Signal(object)
    edited = Signal(int)
    state_changed = Signal(str)
    failed = Signal(str)
    warned = Signal(str)
    refused = Signal(str)

    def __init__(self, setup: Setup | None = None, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.setup = setup or Setup()
        self.last_frame: Frame | None = None
        self.version = 0
        self.oldest = 0
        self.state = IDLE
        self.renderer: Renderer | None = None
        self.beauty_only = False
        self._numbers = itertools.count(1)
        self._pending = Edit()
        self._moving = False
        self._awaiting = False
        self._is_reduced = False  # Whether the current task renders only a reduced image.
        self._submitted = 0.0
        # Number of samples in the last denoised image, and number of samples in the image that is
        # being denoised.
        self._denoised = self._denoising = 0
        self._settle = QTimer(self)
        self._settle.setSingleShot(True)
        self._settle.setInterval(SETTLE_MS)
        self._settle.timeout.connect(self._on_still)
        # The render thread must not hold references to Qt objects, so it reports through a News
        # object.
        self._news = News(port(self._receive))
        self._engine = Engine(self._news)
        self._denoiser = Worker("denoise", self)
        self._denoiser.done.connect(self._take_denoised)
        self._denoiser.failed.connect(self._warn)

    # ---- methods for widgets
    # -------------------------------------------------------------------------

    def begin(
        self,
        make: Callable[[], Renderer],
        loaded: LoadedStage | None,
        edit: Edit,
        *,
        moving: bool = False,
    ) -> None:
        """Starts rendering a new scene; ``make`` creates the renderer on the render thread.

        ``moving`` says whether a reduced image is sufficient.
        """
        self._pending = Edit()
        self._moving = moving
        self.renderer = None
        self._submit(Task(self.setup, 0, edit, moving, loaded, make))

    def change(self, **values: Any) -> bool:
        """Changes fields of the setup and restarts the render.

        Emits ``failed`` if a value is invalid.

        Returns:
            Returns whether the setup was changed.
        """
        try:
            new = self.setup.changed(**values)
            restart = (
                self.setup.settings().to_dict() != new.settings().to_dict()
                or new.own_policy is not self.setup.own_policy
                or new.profile != self.setup.profile
            )
        except Exception as error:
            self.failed.emit(describe(error))
            return False
        old, self.setup = self.setup, new
        if new != old:
            self.setup_changed.emit(new)
        if restart:
            self.restart()
        elif new != old and self.last_frame is not None:
            self._show(replace(self.last_frame, setup=new))
        return True

    def edit(self, edit: Edit, *, moving: bool = False) -> None:
        """Changes the scene and restarts the render.

        Args:
            edit: The changes of the scene.
            moving: Whether the edit belongs to a series of edits, such as a drag. Only reduced
                images are rendered until ``settle`` is called or no edit has arrived for some time.
        """
        self._pending.add(edit)
        now = time.perf_counter()
        self._moving = moving or now - self._submitted < BURST_S
        if self._moving:
            self._settle.start()
            if self._awaiting and self._is_reduced and now - self._submitted < WAIT_S:
                # Wait until the current image is shown. Otherwise, frequent edits would replace
                # every image before it is shown.
                return
        self._flush()

    def _on_still(self) -> None:
        """Ends a movement, after waiting for its reduced image if one is being rendered."""
        recent = time.perf_counter() - self._submitted < WAIT_S
        if recent and self._pending and self._awaiting and self._is_reduced:
            self._settle.start()
        else:
            self.settle()

    def settle(self) -> None:
        """Ends a series of edits and starts the full-size image."""
        self._settle.stop()
        if self._moving:
            self._moving = False
            if self._pending or not (self._awaiting and self._is_reduced):
                # If this branch is not taken, a reduced image is being rendered, and `_flush` is
                # called when the image is complete.
                self._flush()

    def restart(self) -> None:
        """Restarts the render from the first sample."""
        self._moving = False
        self._flush()

    def pause(self) -> None:
        """Pauses the render and keeps the image."""
        if self.state == RENDERING:
            self._engine.pause()
            self._set_state(PAUSED)

    def resume(self) -> None:
        """Resumes a paused render, or restarts a stopped one."""
        if self.state == PAUSED:
            self._engine.resume()
            self._set_state(RENDERING)
        elif self.state == STOPPED:
            self.restart()

    def stop(self) -> None:
        """Stops the render and keeps the image."""
        self._settle.stop()
        if self.state in (RENDERING, PAUSED):
            self._set_state(STOPPED)
            self._engine.stop()
            self._engine.resume()

    def shutdown(self) -> None:
        """Ends the threads of the render, which takes about 10 ms."""
        self._settle.stop()
        self._engine.close()
        self._denoiser.close()
        self._news.take()
        self.renderer = None
        self._set_state(IDLE)

    # ---- inside --------------------------------------------------------------------------------

    def _flush(self) -> None:
        edit, self._pending = self._pending, Edit()
        self._submit(Task(self.setup, 0, edit, self._moving))

    def _submit(self, task: Task) -> None:
        self.version = task.version = next(self._numbers)
        # While the camera moves, also accept images of the previous version, because the last of
        # them may not have reached the screen yet.
        last = self.last_frame.version if self.last_frame is not None else self.version
        self.oldest = last if task.moving else self.version
        self._is_reduced = task.moving
        task.beauty_only = self.beauty_only
        self._awaiting, self._submitted = True, time.perf_counter()
        if self.state == PAUSED:
            self._engine.resume()
        self._engine.submit(task)
        self._set_state(RENDERING)
        self.edited.emit(self.version)

    def _set_state(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self.state_changed.emit(state)

    def _receive(self, letter: None) -> None:
        """Handles the frame, statistics, error and renderer that the render thread has stored."""
        takes: dict[str, Callable[[Any], None]] = {
            "frame": self._take,
            "statistics": self._take_statistics,
            "failed": self._fail,
            "ready": self._take_renderer,
            "refused": self.refused.emit,
        }
        for kind, news in self._news.take():
            takes[kind](news)

    def _take_renderer(self, renderer: Renderer) -> None:
        self.renderer = renderer

    def _take_statistics(self, news: tuple[dict[str, Any], int]) -> None:
        statistics, version = news
        if version == self.version:  # ignore statistics of an older version of the settings
            self.statistics.emit(statistics)

    def _warn(self, key: object, line: str) -> None:
        self.warned.emit(line)

    def _fail(self, message: str) -> None:
        self._awaiting = False
        self._set_state(STOPPED)
        self.failed.emit(message)

    def _take(self, frame: Frame) -> None:
        if frame.version != self.version:
            return
        self._awaiting = False
        last = self.last_frame
        if last is not None and (last.version, last.scale) == (frame.version, frame.scale):
            # Keep showing the previous denoised image. If it comes from the reduced image, keep it
            # only while the frame has few samples.
            if self._denoised or frame.samples_done <= LATE * frame.width * frame.height:
                frame = replace(frame, denoised=last.denoised)
        else:
            self._denoised = self._denoising = 0
        self._show(frame)
        if frame.final and self.state == RENDERING:
            self._set_state(FINISHED)
        self._denoise(frame)
        if self._pending if self._moving else self._is_reduced:
            self._flush()

    def _show(self, frame: Frame) -> None:
        self.last_frame = frame
        self.frame.emit(frame)

    def _denoise(self, frame: Frame) -> None:
        """Denoises a complete frame on another thread. Reduced images are already denoised."""
        if not self.setup.denoise or frame.status.get("preview") or not frame.is_complete:
            return
        if frame.final or frame.samples_done >= DENOISE_AGAIN * self._denoising:
            self._denoising = frame.samples_done
            self._denoiser.submit(partial(denoised_frame, frame))

    def _take_denoised(self, key: object, result: tuple[Frame, Any]) -> None:
        frame, denoised = result
        last = self.last_frame
        if denoised is None or last is None or not self.setup.denoise:
            return
        if (last.version, last.scale) != (frame.version, frame.scale):
            return
        if last.samples_done <= LATE * frame.samples_done:
            self._denoised = frame.samples_done
            self._show(replace(last, denoised=denoised))
