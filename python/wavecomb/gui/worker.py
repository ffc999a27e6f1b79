# SPDX-License-Identifier: Apache-2.0
"""Work on another thread: of which only the newest counts, or all of it in order.

Contract: both classes live on the window's thread and wait for nothing but in ``close``. A job is
plain: it holds and makes no object of Qt's, and its result is plain data.
"""

from __future__ import annotations

import functools
import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import shiboken6
from PySide6.QtCore import QObject, Signal, SignalInstance

from wavecomb.gui.bridge import Port, port
from wavecomb.run.faults import describe

Job = Callable[[], Any]
Outcome = tuple[Any, str | None]
"""The result and None, or None and a line."""


def refuse_qt(job: Job) -> None:
    """Raises TypeError where a job holds an object of Qt's, which its thread might let go last."""
    for held in _held(job):
        if isinstance(held, (shiboken6.Object, SignalInstance)):
            raise TypeError(f"a job must not hold an object of Qt's: {type(held).__name__}")


def _held(job: Any) -> Iterator[Any]:
    """What a function has beside its globals: self, arguments, defaults, variables around it."""
    yield getattr(job, "__self__", None)
    if isinstance(job, functools.partial):
        yield from job.args
        yield from job.keywords.values()
        yield from _held(job.func)
        return
    for cell in getattr(job, "__closure__", None) or ():
        yield cell.cell_contents
    yield from getattr(job, "__defaults__", None) or ()


def _run(number: int, job: Job, told: Port) -> None:
    """The thread: no name here is an object of Qt's."""
    try:
        outcome: Outcome = (job(), None)
    except Exception as error:
        outcome = (None, describe(error))
    told.send((number, outcome))


class _OneThread(QObject):
    """One job at a time."""

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._name = name
        self._number = 0
        self._thread: threading.Thread | None = None
        self._closed = False
        self._port = port(self._receive)

    @property
    def busy(self) -> bool:
        """Whether something runs or waits."""
        return self._thread is not None

    def _begin(self, job: Job) -> None:
        self._number += 1
        self._thread = threading.Thread(
            target=_run, args=(self._number, job, self._port), name=f"wavecomb-{self._name}",
            daemon=True,
        )  # fmt: skip
        self._thread.start()

    def _receive(self, letter: tuple[int, Outcome]) -> None:
        number, outcome = letter
        if number == self._number and not self._closed:
            self._thread = None
            self._end(outcome)

    def _end(self, outcome: Outcome) -> None:
        raise NotImplementedError

    def close(self, seconds: float = 5.0) -> bool:
        """Nothing is begun or told any more; waits for what runs, and says whether it has ended.

        What has not ended by then goes on by itself: there is nothing of the window in it.
        """
        self._closed = True
        thread, self._thread = self._thread, None
        if thread is None:
            return True
        thread.join(seconds)
        return not thread.is_alive()


class Worker(_OneThread):
    """The newest wins: a job that waits is replaced by one that comes later.

    What runs is not ended, and its result is told though something newer waits, unless it was
    cancelled.

    Signals:
        done(key, result), failed(key, line): On the window's thread.
    """

    done = Signal(object, object)
    failed = Signal(object, str)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(name, parent)
        self._key: object = None
        self._waiting: tuple[Job, object] | None = None
        self._told = True

    def submit(self, job: Job, key: object = None) -> None:
        """Does a job next.

        Args:
            job: Plain; a partial of a function at best.
            key: Comes back with the result. While a job with this key runs there is nothing to do.

        Raises:
            TypeError: The job holds an object of Qt's.
        """
        refuse_qt(job)
        if self._closed:
            return
        if self._thread is None:
            self._go(job, key)
        elif key is not None and key == self._key:
            self._waiting, self._told = None, True
        else:
            self._waiting = (job, key)

    def cancel(self) -> None:
        """Nothing is wanted any more."""
        self._waiting, self._told = None, False

    def close(self, seconds: float = 5.0) -> bool:
        """Nothing is begun or told any more; waits for what runs."""
        self.cancel()
        return super().close(seconds)

    def _go(self, job: Job, key: object) -> None:
        self._key, self._told = key, True
        self._begin(job)

    def _end(self, outcome: Outcome) -> None:
        key, told, waiting = self._key, self._told, self._waiting
        self._key = self._waiting = None
        if waiting is not None:
            self._go(*waiting)
        if not told:
            return
        result, line = outcome
        if line is None:
            self.done.emit(key, result)
        else:
            self.failed.emit(key, line)


class Errands(_OneThread):
    """All jobs are done, one after the other, and each is told to whom it was asked by."""

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(name, parent)
        self._jobs: deque[tuple[Job, Callable[[Any], None], Callable[[str], None]]] = deque()

    def submit(self, job: Job, done: Callable[[Any], None], failed: Callable[[str], None]) -> None:
        """Does a job after those before it; then calls ``done(result)`` or ``failed(line)``.

        Raises:
            TypeError: The job holds an object of Qt's.
        """
        refuse_qt(job)
        if self._closed:
            return
        self._jobs.append((job, done, failed))
        if self._thread is None:
            self._begin(job)

    def close(self, seconds: float = 5.0) -> bool:
        """Nothing is begun or told any more; waits for what runs."""
        self._jobs.clear()
        return super().close(seconds)

    def _end(self, outcome: Outcome) -> None:
        _, done, failed = self._jobs.popleft()
        if self._jobs:
            self._begin(self._jobs[0][0])
        result, line = outcome
        if line is None:
            done(result)
        else:
            failed(line)


# ---- What goes on beside rendering, and the words for it -----------------------------------------


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
