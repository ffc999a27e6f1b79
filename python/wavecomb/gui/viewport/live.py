# SPDX-License-Identifier: Apache-2.0
"""A live render on the UI thread.

A live render can be edited while it runs, and shows only frames of the newest version.
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
    """An ``engine.Listener`` that keeps the newest item of each kind until it is taken.

    Args:
        told: Port that receives None when the first new item arrives.
    """

    def __init__(self, told: Port) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._news: dict[tuple[str, str], Any] = {}

    def take(self) -> list[tuple[str, Any]]:
        """Removes and returns all items as (kind, content), in order of arrival."""
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
        """Keeps the frame until it is taken, replacing an older one."""
        self._put("frame", frame)

    def on_statistics(self, statistics: dict[str, Any], version: int) -> None:
        """Keeps the statistics and their version until they are taken."""
        self._put("statistics", (statistics, version))

    def on_failed(self, message: str) -> None:
        """Keeps an error message until it is taken.

        An error message does not replace a different one.
        """
        self._put("failed", message, message)

    def on_ready(self, renderer: Renderer) -> None:
        """Keeps the renderer of a new scene until it is taken."""
        self._put("ready", renderer)

    def on_refused(self, message: str) -> None:
        """Keeps the reason of refused moves until it is taken."""
        self._put("refused", message)


SETTLE_MS = 50
"""Delay between the last movement and the full image, in milliseconds."""
BURST_S = 0.15
"""Edits at shorter intervals, in seconds, count as a drag with reduced images."""
WAIT_S = 3.0
"""Largest time that an image may take during a movement before the next edit stops it, in
seconds."""
DENOISE_AGAIN = 1.5
"""Factor of the number of samples after which a frame is denoised again."""
LATE = 4
"""A denoised image counts as late if the newest frame has more than this many times its samples."""

IDLE, RENDERING, PAUSED, STOPPED, FINISHED = "idle", "rendering", "paused", "stopped", "finished"


class Live(QObject):
    """A live render with separate settings. All methods are for the UI thread; none blocks.

    Attributes:
        setup: Settings.
        last_frame: The last emitted frame, or None.
        version: Version of scene and settings.
        oldest: Oldest version whose frames may still be shown.
        state: The last emitted state.
        renderer: The core's renderer, or None.
        beauty_only: Whether no layer except the beauty is displayed, so that the first frame at
            full size may lack the layers.

    Signals:
        frame(Frame): A new frame of the newest version.
        statistics(dict): Statistics (docs/statistics.md), about twice per second during a render.
        setup_changed(Setup): Settings changed.
        edited(int): Scene or settings changed; carries the new version.
        state_changed(str): "idle", "rendering", "paused", "stopped" or "finished".
        failed(str), warned(str): Message in one line.
        refused(str): The scene could not make the moves of an edit, for the given reason.
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
        self._is_reduced = False  # Whether the current task asks only for a reduced image.
        self._submitted = 0.0
        self._denoised = self._denoising = 0  # samples of the images that were denoised last
        self._settle = QTimer(self)
        self._settle.setSingleShot(True)
        self._settle.setInterval(SETTLE_MS)
        self._settle.timeout.connect(self._on_still)
        # The render thread only holds the News object, which is not a Qt object.
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
        """Starts rendering a new scene. ``make`` creates its renderer on the render thread.

        ``moving`` says whether a reduced image is enough.
        """
        self._pending = Edit()
        self._moving = moving
        self.renderer = None
        self._submit(Task(self.setup, 0, edit, moving, loaded, make))

    def change(self, **values: Any) -> bool:
        """Changes fields of the setup and restarts. Emits ``failed`` if a value is invalid.

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
        """Changes the scene and restarts.

        Args:
            edit: The changes of the scene.
            moving: Whether similar edits follow. Images are reduced until ``settle`` is called, or
                until no edit came for some time.
        """
        self._pending.add(edit)
        now = time.perf_counter()
        self._moving = moving or now - self._submitted < BURST_S
        if self._moving:
            self._settle.start()
            if self._awaiting and self._is_reduced and now - self._submitted < WAIT_S:
                # Shows the current image first, so that frequent edits do not suppress all images.
                return
        self._flush()

    def _on_still(self) -> None:
        """Ends a movement, but shows the image of it that is being rendered first."""
        recent = time.perf_counter() - self._submitted < WAIT_S
        if recent and self._pending and self._awaiting and self._is_reduced:
            self._settle.start()
        else:
            self.settle()

    def settle(self) -> None:
        """Ends a movement and starts the full image."""
        self._settle.stop()
        if self._moving:
            self._moving = False
            if self._pending or not (self._awaiting and self._is_reduced):
                self._flush()  # otherwise after the reduced image, which is being rendered

    def restart(self) -> None:
        """Restarts from the first sample."""
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
        # During a movement, the previous image may still be on its way to the screen.
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
        """Handles the newest item of each kind of the render thread's news."""
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
        if version == self.version:  # statistics of an older version do not describe this one
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
            # Without a result, the reduced image stays until the frame looks better.
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
        """Denoises a complete frame in the background; reduced images are denoised already."""
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
