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

from wavecomb.errors import WavecombError
from wavecomb.farm.files import read_json
from wavecomb.farm.folder import BUSY, DONE, Entry, Folder
from wavecomb.farm.leases import gone, living
from wavecomb.farm.spec import Task

LEAST_S = 5.0
"""That a task has to take before another begins it, too: starting has its price."""
_LOOK_S = 1.0
_FRESH_S = 20.0
"""So long the usual time is good."""
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
        self._next = self._usual_until = 0.0
        self._usual: float | None = None

    def next(self) -> Entry | None:
        """A task of another, begun as a copy; None: there is none that is worth it."""
        factor = self._folder.spec.slow
        if not factor or time.monotonic() < self._next:
            return None
        now = self._clock()
        # Where many wait each looks less often, so that the disk is not asked by the square.
        self._next = time.monotonic() + _LOOK_S * max(1.0, living(self._folder, now) / 8)
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
        for entry in held:
            if self._is_slow(entry, now, usual, factor):
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
        if time.monotonic() < self._usual_until:
            return self._usual
        names = sorted(self._folder.ids(DONE))[-_LAST:]
        took = [self._folder.result(Task.of(name)).get("wall_s") for name in names]
        known = [float(seconds) for seconds in took if seconds is not None]
        self._usual = statistics.median(known) if known else None
        self._usual_until = time.monotonic() + (_FRESH_S if known else 0.0)
        return self._usual

    def _share(self, worker: str) -> float | None:
        """What a worker has done of its task; None: nobody knows."""
        try:
            facts = read_json(self._folder.path / "workers" / f"{worker}.json")
            progress = facts.get("progress") or {}
            done, total = progress.get("samples_done"), progress.get("samples_total")
            mine = progress.get("task") == facts.get("task")
            return done / total if mine and done and total else None
        except (OSError, WavecombError, AttributeError, TypeError):
            return None

    def _is_slow(self, entry: Entry, now: float, usual: float, factor: float) -> bool:
        try:
            begun = (self._folder.path / BUSY / entry.name).stat().st_mtime
        except OSError:
            return False
        took = now - begun
        if took < max(LEAST_S, factor * usual):
            return False
        share = self._share(entry.worker)
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
        files = (self._folder.path / "copies").iterdir()
        copies = [one for one in (Entry.of(file.name) for file in files) if one is not None]
        copies = [one for one in copies if one.task == task and one.worker != self._worker]
        ended = gone(self._folder, self._clock()) if copies else set()
        for one in copies:
            if one.worker in ended:
                self.end(one)
        return [one.worker for one in copies if one.worker not in ended]
