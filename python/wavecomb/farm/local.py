# SPDX-License-Identifier: Apache-2.0
"""Worker processes here, or by ssh elsewhere, which end with the one that started them."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from typing import IO

from wavecomb import processes
from wavecomb.farm.checking import repair
from wavecomb.farm.folder import Folder
from wavecomb.farm.leases import take_back
from wavecomb.farm.sweeping import sweep
from wavecomb.run.progress import Interrupt

POLL_S = 0.2
_STOP_S = 60.0
"""For workers that are asked to stop."""
OVER_S = 10.0
"""For workers to end when nothing is left to do."""
_DIE_S = 10.0
_LOOK_S = 1.0
_MOST_SAID = 1 << 20
_MOST_STARTS = 3
"""Of workers in place of those that died, for each."""


class Local:
    """Workers of a job that this process starts.

    Attributes:
        stopped: Number of the signal that ended them early; None: none did.
        errors: What workers said that could not work.
    """

    def __init__(self, folder: Folder, commands: Sequence[Sequence[str]]) -> None:
        """Starts nothing yet.

        Args:
            folder: The job's.
            commands: What starts each worker.
        """
        self._folder = folder
        self._commands = commands
        self._running: dict[int, subprocess.Popen[bytes]] = {}
        self._said: dict[int, IO[bytes]] = {}
        self._starts = [0] * len(commands)
        self._next_look = 0.0
        self.stopped: int | None = None
        self.errors: list[str] = []

    def run(self, look: Callable[[], None] = lambda: None) -> None:
        """Works until nothing is left to do, or a signal comes; ``look`` is called now and then."""
        repair(self._folder)
        with contextlib.suppress(FileNotFoundError):
            (self._folder.path / "cancel").unlink()
        over: float | None = None
        with Interrupt() as interrupt:
            try:
                while True:
                    if interrupt.requested:
                        self.stopped = interrupt.signal
                        break
                    try:
                        self._start()
                        look()
                        if not self._reap() or self._folder.is_cancelled():
                            break
                        over = self._since_over(over)
                    except OSError:
                        # Workers wait for a disk that is gone; those that do not, end.
                        if self._folder.is_there():
                            raise
                    if over is not None and time.monotonic() - over > OVER_S:
                        break  # one that hangs is not waited for
                    time.sleep(POLL_S)
            finally:
                self._end(_STOP_S if over is None else OVER_S)
                with contextlib.suppress(OSError):
                    take_back(self._folder)
                    sweep(self._folder)
        look()

    def _since_over(self, over: float | None) -> float | None:
        """When nothing was left to do; None: there is still something."""
        if time.monotonic() < self._next_look:
            return over
        self._next_look = time.monotonic() + _LOOK_S
        if not self._folder.is_over():
            return None
        return time.monotonic() if over is None else over

    def _start(self) -> None:
        """Those that do not run, as long as there is something to do."""
        for index, command in enumerate(self._commands):
            if index in self._running or not self._may_start(index):
                continue
            self._starts[index] += 1
            # A file: a pipe would stand still when it is full, and stay open with whoever has it.
            said = self._said[index] = tempfile.TemporaryFile()  # noqa: SIM115
            self._running[index] = processes.popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=said,
            )

    def _may_start(self, index: int) -> bool:
        if not self._starts[index]:
            return True
        may = self._starts[index] < _MOST_STARTS and not self.errors
        return may and not self._folder.is_over()

    def _reap(self) -> bool:
        """Lets go of workers that ended; whether any is left, or is to be started."""
        for index, process in list(self._running.items()):
            if process.poll() is not None:
                del self._running[index]
                self._let_go(index, process)
                take_back(self._folder)
        return bool(self._running) or any(map(self._may_start, range(len(self._commands))))

    def _let_go(self, index: int, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        file = self._said.pop(index)
        file.seek(0)
        said = file.read(_MOST_SAID).decode(errors="replace").strip().splitlines()
        file.close()
        if process.returncode in (2, 255) and said:  # 255: ssh's own
            self.errors.append(said[-1].removeprefix("error: "))

    def _end(self, seconds: float) -> None:
        """Asks workers to stop, by the end of their stdin; who does not is killed."""
        for process in self._running.values():
            assert process.stdin is not None
            with contextlib.suppress(OSError):
                process.stdin.close()
        until = time.monotonic() + seconds
        for index, process in self._running.items():
            try:
                process.wait(max(0.1, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(_DIE_S)
            self._let_go(index, process)
        self._running = {}
