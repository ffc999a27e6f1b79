# SPDX-License-Identifier: Apache-2.0
"""A worker's patience with the disk of its job, which may be gone for a while."""

from __future__ import annotations

import time
from collections.abc import Callable

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import Folder

LOST_S = 600.0
"""For a job's folder that is not there to come back."""
_LOOK_S = 0.25
_MOST_TROUBLES = 5
"""Errors of a disk that is there, one after another."""


class Patience:
    """Waits where the disk fails."""

    def __init__(
        self,
        folder: Folder,
        worker: str,
        is_stopped: Callable[[], bool],
        say: Callable[[str], None],
    ) -> None:
        """Nothing failed yet.

        Args:
            folder: The job's.
            worker: Who waits, for errors.
            is_stopped: Whether somebody wants the worker to end.
            say: Gets a line where it waits.
        """
        self._folder = folder
        self._worker = worker
        self._is_stopped = is_stopped
        self._say = say
        self._troubles = 0

    def bear(self, error: OSError) -> None:
        """Waits until the job's folder is there, or the worker is to stop.

        Raises:
            WavecombError: It does not come back, or is there and fails again and again.
        """
        if self._folder.is_there():
            self._troubles += 1
            if self._troubles > _MOST_TROUBLES:
                raise WavecombError(f"{self._worker}: {error}") from None
            time.sleep(1.0)
            return
        until = time.monotonic() + LOST_S
        self._say(f"{self._folder.path}: is not there; waiting for it")
        while not self._folder.is_there():
            if self._is_stopped():
                return
            if time.monotonic() > until:
                raise WavecombError(
                    f"{self._worker}: {self._folder.path} was not there for {LOST_S:.0f} s"
                ) from None
            time.sleep(_LOOK_S)

    def calm(self) -> None:
        """Nothing failed any more."""
        self._troubles = 0

    def insist(self, act: Callable[[], bool]) -> bool:
        """Says something of a task, again and again while the disk is gone; what came of it."""
        while True:
            try:
                done = act()
                self.calm()
                return done
            except OSError as error:
                self.bear(error)
                if self._is_stopped() and not self._folder.is_there():
                    return False
