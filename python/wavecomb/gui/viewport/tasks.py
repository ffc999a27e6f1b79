# SPDX-License-Identifier: Apache-2.0
"""What goes on beside rendering, and the words for it."""

from __future__ import annotations

import itertools
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from wavecomb.gui.worker import Errands


class Tasks(QObject):
    """Tasks that are under way; the one that was begun last is told.

    Signals:
        busy(str): What goes on: "writing a.exr"; "": nothing.
        failed(str): One line.

    Attributes:
        jobs: Key and words of each.
    """

    busy = Signal(str)
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.jobs: list[tuple[str, str]] = []
        self._errands = Errands("work", self)
        self._numbers = itertools.count()

    def begin(self, key: str, what: str) -> None:
        """Something goes on, in place of what has the same key."""
        self.jobs = [job for job in self.jobs if job[0] != key] + [(key, what)]
        self.busy.emit(what)

    def end(self, key: str) -> None:
        """It has ended."""
        self.jobs = [job for job in self.jobs if job[0] != key]
        self.busy.emit(self.jobs[-1][1] if self.jobs else "")

    def run(self, what: str, work: Callable[[], object], then: Callable[[], None] | None) -> None:
        """Does something plain on another thread, after what was asked before."""
        key = f"{what} {next(self._numbers)}"
        self.begin(key, what)

        def done(result: object) -> None:
            if then is not None:
                then()
            self.end(key)

        def failed(line: str) -> None:
            self.failed.emit(line)
            self.end(key)

        self._errands.submit(work, done, failed)

    def close(self) -> None:
        """Waits for what runs; nothing is told any more."""
        self._errands.close()
