# SPDX-License-Identifier: Apache-2.0
"""The local engine: worker processes on this machine, which end with the one that started them."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Callable

from wavecomb.farm.checking import repair
from wavecomb.farm.folder import Folder
from wavecomb.farm.leases import take_back
from wavecomb.machine import usable_cores
from wavecomb.run.progress import Interrupt

POLL_S = 0.2
_STOP_S = 60.0
"""For workers that are asked to stop."""
_MOST_STARTS = 3
"""Of workers in place of those that died, for each."""


def threads_of_each(workers: int, wanted: int) -> int:
    """Threads of each of so many workers: what the job says, else its share of the cores."""
    return wanted or max(1, usable_cores() // workers)


class Local:
    """Workers of a job on this machine.

    Attributes:
        stopped: Number of the signal that ended them early; None: none did.
        errors: What workers said that could not work.
    """

    def __init__(self, folder: Folder, workers: int, threads: int) -> None:
        """Starts nothing yet.

        Args:
            folder: The job's.
            workers: How many.
            threads: Of each.
        """
        self._folder = folder
        self._count = workers
        self._threads = threads
        self._running: list[subprocess.Popen[str]] = []
        self._starts = 0
        self.stopped: int | None = None
        self.errors: list[str] = []

    def run(self, look: Callable[[], None] = lambda: None) -> None:
        """Works until nothing is left to do, or a signal comes; ``look`` is called now and then."""
        repair(self._folder)
        with contextlib.suppress(FileNotFoundError):
            (self._folder.path / "cancel").unlink()
        with Interrupt() as interrupt:
            try:
                while True:
                    self._start()
                    look()
                    if interrupt.requested:
                        self.stopped = interrupt.signal
                        break
                    if not self._reap() or self._folder.is_cancelled():
                        break
                    time.sleep(POLL_S)
            finally:
                self._end()
        look()

    def _start(self) -> None:
        """As many as are wanted, as long as there is something to do."""
        most = self._count * _MOST_STARTS
        while len(self._running) < self._count and self._starts < most:
            if self._starts >= self._count and (self.errors or self._folder.is_over()):
                return
            self._starts += 1
            words = ["farm", "worker", str(self._folder.path), "--threads", str(self._threads)]
            self._running.append(
                subprocess.Popen(
                    [sys.executable, "-m", "wavecomb", *words, "--tied", "--quiet"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    text=True,
                    # A signal of the terminal comes to this process alone.
                    start_new_session=True,
                )
            )

    def _reap(self) -> bool:
        """Lets go of workers that ended; whether any is left, or is to be started."""
        for process in [one for one in self._running if one.poll() is not None]:
            self._running.remove(process)
            self._let_go(process)
            take_back(self._folder)
        if self._running:
            return True
        may_start = self._starts < self._count * _MOST_STARTS and not self.errors
        return may_start and not self._folder.is_over()

    def _let_go(self, process: subprocess.Popen[str]) -> None:
        assert process.stdin is not None and process.stderr is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        said = process.stderr.read().strip().splitlines()
        process.stderr.close()
        if process.returncode == 2 and said:
            self.errors.append(said[-1].removeprefix("error: "))

    def _end(self) -> None:
        """Asks workers to stop; who does not is killed, with its child."""
        for process in self._running:
            with contextlib.suppress(OSError):
                process.send_signal(signal.SIGTERM)
        until = time.monotonic() + _STOP_S
        for process in self._running:
            try:
                process.wait(max(0.1, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            self._let_go(process)
        self._running = []
        take_back(self._folder)


def parse_engine(text: str) -> tuple[str, int]:
    """What ``--on`` says: "local" or "none", and workers (0: as many as is best).

    Raises:
        WavecombError: It is neither.
    """
    from wavecomb.errors import WavecombError

    name, colon, count = text.partition(":")
    if name == "none" and not colon:
        return "none", 0
    if name == "local" and (not colon or (count.isdecimal() and 1 <= int(count) <= 1024)):
        return "local", int(count or 0)
    raise WavecombError(
        f"--on {text}: must be local, local:N with N workers, or none: others will work on the "
        "folder with `wavecomb farm worker`"
    )


def default_workers() -> int:
    """Workers where nobody says how many: one, which uses all cores and holds the scene once."""
    return 1
