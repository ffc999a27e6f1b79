# SPDX-License-Identifier: Apache-2.0
"""A second worker for a task that takes much longer than others, where nothing else is left to do.

Whoever is done first says so; the other one is told to stop. Both render the same bits, and each
file gets its name whole, so it does not matter who wrote it.
"""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Callable

from wavecomb.farm.folder import BUSY, DONE, Entry, Folder
from wavecomb.farm.leases import gone, workers
from wavecomb.farm.spec import Task

LEAST_S = 5.0
"""That a task has to take before another begins it, too: starting has its price."""
_LOOK_S = 1.0
_LAST = 64
"""Tasks whose times tell enough."""


class Copies:
    """Begins tasks of others for one worker."""

    def __init__(self, folder: Folder, worker: str, clock: Callable[[], float]) -> None:
        """``clock``: of the file system."""
        self._folder = folder
        self._worker = worker
        self._clock = clock
        self._tried: set[tuple[Task, int]] = set()
        self._next = 0.0

    def next(self) -> Entry | None:
        """A task of another, begun as a copy; None: there is none that is worth it."""
        factor = self._folder.spec.slow
        if not factor or time.monotonic() < self._next:
            return None
        self._next = time.monotonic() + _LOOK_S
        held = [
            entry
            for entry in self._folder.entries(BUSY)
            if entry.worker != self._worker and (entry.task, entry.attempt) not in self._tried
        ]
        if not held:
            return None
        usual = self._usual_s()
        if usual is None:
            return None
        now, shares = self._clock(), self._shares()
        for entry in held:
            if self._is_slow(entry, now, usual, factor, shares.get(entry.worker)):
                mine = self._begin(entry)
                if mine is not None:
                    return mine
        return None

    def end(self, mine: Entry) -> None:
        """Lets a copy go."""
        with contextlib.suppress(OSError):
            (self._folder.path / "copies" / mine.name).unlink()

    def _usual_s(self) -> float | None:
        """Seconds that a task takes, the median of some; None: none is done."""
        names = sorted(self._folder.ids(DONE))[-_LAST:]
        took = [self._folder.result(Task.of(name)).get("wall_s") for name in names]
        known = [float(seconds) for seconds in took if seconds is not None]
        return statistics.median(known) if known else None

    def _shares(self) -> dict[str, float]:
        """Of their tasks what workers have done."""
        found = {}
        for worker in workers(self._folder):
            progress = worker.facts.get("progress") or {}
            done, total = progress.get("samples_done"), progress.get("samples_total")
            if progress.get("task") == worker.facts.get("task") and done and total:
                found[worker.name] = done / total
        return found

    def _is_slow(
        self, entry: Entry, now: float, usual: float, factor: float, share: float | None
    ) -> bool:
        try:
            begun = (self._folder.path / BUSY / entry.name).stat().st_mtime
        except OSError:
            return False
        took = now - begun
        if took < max(LEAST_S, factor * usual):
            return False
        # One that is nearly done needs no help.
        return share is None or took * (1.0 - share) / share > usual

    def _begin(self, entry: Entry) -> Entry | None:
        """Says that this worker has begun it, too; None: another has."""
        place = self._folder.path / "copies"
        place.mkdir(exist_ok=True)
        if self._others(entry.task):
            return None
        mine = Entry(entry.task, entry.attempt, self._worker)
        self._tried.add((entry.task, entry.attempt))
        (place / mine.name).touch()
        # Of two who begin at once one goes on.
        if any(other < self._worker for other in self._others(entry.task)):
            self.end(mine)
            return None
        return mine

    def _others(self, task: Task) -> list[str]:
        """Workers that have a copy of a task."""
        found = []
        for file in (self._folder.path / "copies").iterdir():
            other = Entry.of(file.name)
            if other is None or other.task != task or other.worker == self._worker:
                continue
            if other.worker in gone(self._folder, self._clock()):
                self.end(other)
            else:
                found.append(other.worker)
        return found
