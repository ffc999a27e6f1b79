# SPDX-License-Identifier: Apache-2.0
"""Turns frames into images on a thread of its own: the newest wins."""

from __future__ import annotations

import threading

from PySide6.QtCore import QObject, Signal

from wavecomb.gui.viewport.display import Look, Shown, show
from wavecomb.gui.viewport.frames import Frame
from wavecomb.run.faults import describe


class Developer(QObject):
    """Develops frames.

    Signals:
        ready(Frame, Look, Shown, QImage): A frame as the screen shows it.
        failed(str): One line.
    """

    ready = Signal(object, object, object, object)
    failed = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._condition = threading.Condition()
        self._wanted: tuple[Frame, Look] | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="wavecomb-develop", daemon=True)
        self._thread.start()

    def want(self, frame: Frame, look: Look) -> None:
        """Develops this next, in place of what waits."""
        with self._condition:
            self._wanted = frame, look
            self._condition.notify_all()

    def close(self) -> None:
        """Ends the thread."""
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._condition:
                while self._wanted is None and not self._closing:
                    self._condition.wait()
                if self._closing:
                    return
                wanted, self._wanted = self._wanted, None
            assert wanted is not None
            try:
                shown = develop_frame(*wanted)
                self.ready.emit(*wanted, shown, shown.image())
            except Exception as error:
                self.failed.emit(describe(error))


def develop_frame(frame: Frame, look: Look) -> Shown:
    """A layer of a frame for the screen; the beauty where it does not have the layer yet."""
    from dataclasses import replace

    layer = frame.layer(look.layer)
    if layer is None:
        return show(frame.beauty, replace(look, layer="beauty"))
    return show(layer, look)
