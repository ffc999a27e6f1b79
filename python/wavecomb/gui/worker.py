# SPDX-License-Identifier: Apache-2.0
"""Background workers, which run only the newest job or all jobs in order.

Workers belong to the UI thread. Only their method ``close`` blocks. A job must not hold or create
Qt objects, and its result must be plain data.
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
from wavecomb.run.error_messages import describe

Job = Callable[[], Any]
Outcome = tuple[Any, str | None]
"""Outcome of a job: (result, None), or (None, error line)."""


def refuse_qt(job: Job) -> None:
    """Raises TypeError if a job holds a Qt object.

    The thread of the job might otherwise delete that object by releasing its last reference.
    """
    for held in _held(job):
        if isinstance(held, (shiboken6.Object, SignalInstance)):
            raise TypeError(f"a job must not hold an object of Qt's: {type(held).__name__}")


def _held(job: Any) -> Iterator[Any]:
    """Yields the objects that a function holds: self, arguments, defaults, closure variables."""
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
    """Runs a job on its worker thread.

    No variable in this function may be a Qt object, since it could be deleted on this thread.
    """
    try:
        outcome: Outcome = (job(), None)
    except Exception as error:
        outcome = (None, describe(error))
    told.send((number, outcome))


class _OneThread(QObject):
    """Base class of objects that run one job at a time on a thread."""

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._name = name
        self._number = 0
        self._thread: threading.Thread | None = None
        self._closed = False
        self._port = port(self._receive)

    @property
    def busy(self) -> bool:
        """Whether a job is running or waiting."""
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
        """Rejects further jobs and waits for the running job. Returns whether this job has ended.

        A job that has not ended may continue, because it holds no object of the window.
        """
        self._closed = True
        thread, self._thread = self._thread, None
        if thread is None:
            return True
        thread.join(seconds)
        return not thread.is_alive()


class Worker(_OneThread):
    """Worker for the newest job. A later job replaces a job that is still waiting.

    A running job is not stopped. The running job's result is reported even if a newer job waits,
    unless ``cancel`` was called.

    Signals:
        done(key, result), failed(key, line): A job succeeded or failed. Emitted on the UI thread.
    """

    done = Signal(object, object)
    failed = Signal(object, str)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(name, parent)
        self._key: object = None
        self._waiting: tuple[Job, object] | None = None
        self._told = True

    def submit(self, job: Job, key: object = None) -> None:
        """Submits a job, which replaces a waiting job.

        Args:
            job: The job, preferably a ``functools.partial`` of a module-level function.
            key: Value that is emitted together with the result. If a job with this key is running,
                the new job is ignored.

        Raises:
            TypeError: The job holds a Qt object.
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
        """Drops the waiting job and the result of the running job."""
        self._waiting, self._told = None, False

    def close(self, seconds: float = 5.0) -> bool:
        """Rejects further jobs, drops all results and waits for the running job."""
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
    """Worker that runs all jobs one after the other, with separate callbacks for each job."""

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(name, parent)
        self._jobs: deque[tuple[Job, Callable[[Any], None], Callable[[str], None]]] = deque()

    def submit(self, job: Job, done: Callable[[Any], None], failed: Callable[[str], None]) -> None:
        """Queues a job. When the job has ended, calls ``done(result)`` or ``failed(line)``.

        Raises:
            TypeError: The job holds a Qt object.
        """
        refuse_qt(job)
        if self._closed:
            return
        self._jobs.append((job, done, failed))
        if self._thread is None:
            self._begin(job)

    def close(self, seconds: float = 5.0) -> bool:
        """Rejects further jobs, drops all results and waits for the running job."""
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


# ---- Background work and its descriptions
# -----------------------------------------------------------


class Tasks(QObject):
    """Queue of background tasks. A status text describes the newest task.

    Signals:
        busy(str): Description of the newest task, such as "writing a.exr", or "" if there is none.
        failed(str): A task failed. The argument is a message of one line.

    Attributes:
        jobs: Key and description of each task.
    """

    busy = Signal(str)
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.jobs: list[tuple[str, str]] = []
        self._errands = Errands("work", self)
        self._numbers = itertools.count()

    def begin(self, key: str, what: str) -> None:
        """Adds a task to the reported tasks, replacing a task with the same key."""
        self.jobs = [job for job in self.jobs if job[0] != key] + [(key, what)]
        self.busy.emit(what)

    def end(self, key: str) -> None:
        """Removes a task that has ended from the reported tasks."""
        self.jobs = [job for job in self.jobs if job[0] != key]
        self.busy.emit(self.jobs[-1][1] if self.jobs else "")

    def run(self, what: str, work: Callable[[], object], then: Callable[[], None] | None) -> None:
        """Runs a function on another thread, after all functions that were submitted earlier."""
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
        """Waits for the running task and drops the results of all tasks."""
        self._errands.close()
