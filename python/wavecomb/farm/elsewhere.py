# SPDX-License-Identifier: Apache-2.0
"""Engines whose workers another scheduler starts; this process watches the job's folder."""

from __future__ import annotations

import abc
import contextlib
import time
from collections.abc import Callable

from wavecomb.farm.checking import repair
from wavecomb.farm.folder import Folder
from wavecomb.farm.leases import take_back, workers
from wavecomb.farm.sweeping import sweep
from wavecomb.run.progress import Interrupt

POLL_S = 0.2
_LOOK_S = 1.0
_STOP_S = 60.0
"""For workers that are asked to stop."""
_OVER_S = 10.0
"""For workers to end when nothing is left to do."""


class Elsewhere(abc.ABC):
    """Workers of a job that another scheduler starts.

    Attributes:
        stopped: Number of the signal that ended them early; None: none did.
        errors: What workers said that could not work.
    """

    def __init__(self, folder: Folder) -> None:
        """Starts nothing yet."""
        self._folder = folder
        self.stopped: int | None = None
        self.errors: list[str] = []

    @abc.abstractmethod
    def begin(self) -> None:
        """Has workers started. Raises WavecombError where nobody answers."""

    @abc.abstractmethod
    def tend(self) -> bool:
        """Looks after them, each second; whether any works, or may come to work."""

    @abc.abstractmethod
    def end(self) -> None:
        """Lets go of them; none is to work any more."""

    def run(self, look: Callable[[], None] = lambda: None) -> None:
        """Works until nothing is left to do, or a signal comes; ``look`` is called now and then."""
        repair(self._folder)
        (self._folder.path / "cancel").unlink(missing_ok=True)
        with Interrupt() as interrupt:
            try:
                self.begin()
                self._watch(interrupt, look)
                if self.stopped is not None:
                    self._stop()
            finally:
                self.end()
        with contextlib.suppress(OSError):
            sweep(self._folder)
        look()

    def _watch(self, interrupt: Interrupt, look: Callable[[], None]) -> None:
        due, over = 0.0, None
        while True:
            if interrupt.requested:
                self.stopped = interrupt.signal
                return
            with contextlib.suppress(OSError):  # the share may be gone for a while
                look()
            if time.monotonic() >= due:
                due = time.monotonic() + _LOOK_S
                works = self.tend()
                with contextlib.suppress(OSError):
                    if self._folder.is_over():
                        over = time.monotonic() if over is None else over
                        if not self._has_workers():
                            return
                    else:
                        over = None
                    if not works or self._folder.is_cancelled():
                        return
            if over is not None and time.monotonic() - over > _OVER_S:
                return
            time.sleep(POLL_S)

    def _has_workers(self) -> bool:
        """Whether any worker of the job did not say that it ended."""
        return any(not worker.has_ended for worker in workers(self._folder))

    def _stop(self) -> None:
        """Has all workers keep what they have and end, by the folder alone."""
        mark = self._folder.path / "cancel"
        mark.touch()
        until = time.monotonic() + _STOP_S
        while self.tend() and time.monotonic() < until:
            time.sleep(POLL_S)
        take_back(self._folder)
        if time.monotonic() < until:
            mark.unlink(missing_ok=True)
