# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps a Wavecomb process that has loaded its modules and waits for the next render.

Starting Wavecomb takes longer than exporting most scenes. While the scene of the open window uses
Wavecomb, one process waits, so that a render starts at once. A waiting process uses no CPU time.
"""

from __future__ import annotations

import atexit
import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import bpy

from . import settings
from .process import Render, WavecombError


class _Start(threading.Thread):
    """Thread that starts a process, so that Blender's interface does not wait for it.

    Attributes:
        program: The program that starts.
    """

    def __init__(self, program: str) -> None:
        super().__init__(name="wavecomb-standby", daemon=True)
        self.program = program
        self._render: Render | None = None
        self._is_cancelled = False
        self._lock = threading.Lock()

    def run(self) -> None:
        """Starts the process. A failure is reported by the next render, which tries again."""
        with contextlib.suppress(WavecombError, OSError):
            render = Render(self.program)
            with self._lock:
                if not self._is_cancelled:
                    self._render = render
                    return
            render.kill()

    def take(self) -> Render | None:
        """Returns the process after it has started; None if it does not run."""
        self.join()
        render, self._render = self._render, None
        return render if render is not None and render.is_running else None

    def cancel(self) -> None:
        """Ends the process."""
        with self._lock:
            self._is_cancelled = True
            render, self._render = self._render, None
        if render is not None:
            render.kill()


_lock = threading.Lock()
_started: _Start | None = None
_renders = 0


def is_wanted() -> bool:
    """Returns whether a process should wait for a render that may not come."""
    return not bpy.app.background


def start() -> None:
    """Starts a process that waits, unless one was started and not used."""
    global _started
    program = settings.program()
    with _lock:
        old = _started
        if old is not None and old.program == program:
            return
        _started = _Start(program)
        _started.start()
    if old is not None:
        old.cancel()


def stop() -> None:
    """Ends the waiting process."""
    one = _remove()
    if one is not None:
        one.cancel()


def take(program: str) -> Render | None:
    """Returns the waiting process of a program for the caller to use; None if there is none."""
    one = _remove()
    if one is None:
        return None
    if one.program == program:
        return one.take()
    one.cancel()
    return None


def _remove() -> _Start | None:
    global _started
    with _lock:
        one, _started = _started, None
    return one


@contextlib.contextmanager
def rendering(is_animation: bool) -> Iterator[None]:
    """Prevents ``update`` from starting a process during a render; then starts the next one."""
    global _renders
    _renders += 1
    try:
        yield
    finally:
        _renders -= 1
        if _renders == 0 and (is_animation or is_wanted()):
            start()


@bpy.app.handlers.persistent  # type: ignore[untyped-decorator]
def update(*_: Any) -> None:
    """Starts or ends the waiting process if the scene's render engine has changed."""
    scene = bpy.context.scene
    if _renders or scene is None or not is_wanted():
        return
    if scene.render.engine != "WAVECOMB":
        stop()
    elif _started is None:
        start()


@bpy.app.handlers.persistent  # type: ignore[untyped-decorator]
def end_renders(*_: Any) -> None:
    """Ends the process that waits after the last frame of an animation in the background."""
    if not is_wanted():
        stop()


HANDLERS = {
    "load_post": update, "depsgraph_update_post": update,
    "render_complete": end_renders, "render_cancel": end_renders,
}  # fmt: skip
"""Functions by the name of Blender's event."""

atexit.register(stop)
