# SPDX-License-Identifier: Apache-2.0
"""Denoises frames on a thread of its own: the newest wins."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from wavecomb.gui.viewport.frames import Frame
from wavecomb.run.faults import describe


class Denoiser:
    """Open Image Denoise for live frames.

    Args:
        done: Called on the thread with the frame and its denoised picture.
        failed: Called on the thread with one line.
    """

    def __init__(self, done: Callable[[Frame, Any], None], failed: Callable[[str], None]) -> None:
        self._done = done
        self._failed = failed
        self._condition = threading.Condition()
        self._frame: Frame | None = None
        self._closing = False
        self._thread: threading.Thread | None = None

    def want(self, frame: Frame) -> None:
        """Denoises this next, in place of what waits."""
        with self._condition:
            self._frame = frame
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run, name="wavecomb-denoise", daemon=True
                )
                self._thread.start()
            self._condition.notify_all()

    def close(self) -> None:
        """Ends the thread; waits for the picture that it works on."""
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while True:
            with self._condition:
                while self._frame is None and not self._closing:
                    self._condition.wait()
                if self._closing:
                    return
                frame, self._frame = self._frame, None
            assert frame is not None
            try:
                denoised = denoised_frame(frame)
            except Exception as error:
                self._failed(describe(error))
            else:
                if denoised is not None:
                    self._done(frame, denoised)


def denoised_frame(frame: Frame) -> Any:
    """The beauty of a frame without its noise; None where it lacks the layers for that."""
    from wavecomb.picture.denoise import denoise

    albedo = frame.layers.get("guide_albedo")
    normal = frame.layers.get("guide_normal")
    if albedo is None or normal is None:
        return None
    return denoise(frame.beauty, albedo, normal, threads=frame.setup.threads)
