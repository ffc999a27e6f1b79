# SPDX-License-Identifier: Apache-2.0
"""Work on another thread of which only the newest counts."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal

from wavecomb.run.faults import describe

Work = Callable[[], Any]


class Latest(QObject):
    """Does one piece of work at a time; what waits is replaced by what is newer.

    Contract: lives on the UI thread. What runs is not ended, but a result that is no longer wanted
    (``forget``) is not told.

    Signals:
        done(key, result), failed(key, line): On the UI thread.
    """

    done = Signal(object, object)
    failed = Signal(object, str)
    _ended = Signal(object)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._name = name
        self._running: object = None
        self._waiting: tuple[object, Work] | None = None
        self._told = True
        self._closed = False
        self._ended.connect(self._end, Qt.ConnectionType.QueuedConnection)

    @property
    def busy(self) -> bool:
        """Whether something runs or waits."""
        return self._running is not None

    def want(self, key: object, work: Work) -> None:
        """Does ``work`` next, unless that with this key runs; ``work`` must touch no widget."""
        if self._closed:
            return
        if self._running == key:
            self._waiting, self._told = None, True
        elif self._running is not None:
            self._waiting = (key, work)
        else:
            self._start(key, work)

    def forget(self) -> None:
        """Nothing is wanted any more."""
        self._waiting, self._told = None, False

    def close(self) -> None:
        """Nothing is told any more."""
        self._closed = True
        self.forget()

    def _start(self, key: object, work: Work) -> None:
        self._running, self._told = key, True

        def body() -> None:
            try:
                outcome: tuple[Any, str | None] = (work(), None)
            except Exception as error:
                outcome = (None, describe(error))
            with contextlib.suppress(RuntimeError):  # the window may be gone
                self._ended.emit(outcome)

        threading.Thread(target=body, name=f"wavecomb-{self._name}", daemon=True).start()

    def _end(self, outcome: tuple[Any, str | None]) -> None:
        key, self._running = self._running, None
        told, waiting, self._waiting = self._told, self._waiting, None
        if waiting is not None:
            self._start(*waiting)
        if not told or self._closed:
            return
        result, message = outcome
        if message is None:
            self.done.emit(key, result)
        else:
            self.failed.emit(key, message)
