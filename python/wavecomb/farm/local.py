# SPDX-License-Identifier: Apache-2.0
"""Engines: worker processes here, or by ssh elsewhere, which end with the one that started them."""

from __future__ import annotations

import contextlib
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wavecomb.errors import WavecombError
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


@dataclass(frozen=True)
class Engine:
    """Who works on a job.

    Attributes:
        kind: "local", "ssh", or "none": others will.
        workers: How many, of "local"; 0: as many as is best, which is one.
        hosts: Of "ssh".
    """

    kind: str
    workers: int = 0
    hosts: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Workers that are expected; 0: nobody knows."""
        return 0 if self.kind == "none" else len(self.hosts) or max(1, self.workers)

    def commands(self, folder: Folder, threads: int) -> list[list[str]]:
        """What starts each of the workers.

        Args:
            folder: The job's.
            threads: Of each; 0: on this machine its share of the cores, elsewhere all.
        """
        words = [sys.executable, "-m", "wavecomb", "farm", "worker", str(folder.path)]
        words += ["--tied", "--quiet", "--threads"]
        if self.kind == "ssh":
            remote = shlex.join([*words, str(threads)])
            return [["ssh", "-o", "BatchMode=yes", host, remote] for host in self.hosts]
        return [[*words, str(threads_of_each(self.count, threads))]] * self.count


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
        self._running: dict[int, subprocess.Popen[str]] = {}
        self._starts = [0] * len(commands)
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
        """Those that do not run, as long as there is something to do."""
        for index, command in enumerate(self._commands):
            if index in self._running or not self._may_start(index):
                continue
            self._starts[index] += 1
            self._running[index] = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                # A signal of the terminal comes to this process alone.
                start_new_session=True,
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
                self._let_go(process)
                take_back(self._folder)
        return bool(self._running) or any(map(self._may_start, range(len(self._commands))))

    def _let_go(self, process: subprocess.Popen[str]) -> None:
        assert process.stdin is not None and process.stderr is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        said = process.stderr.read().strip().splitlines()
        process.stderr.close()
        if process.returncode in (2, 255) and said:  # 255: ssh's own
            self.errors.append(said[-1].removeprefix("error: "))

    def _end(self) -> None:
        """Asks workers to stop, by the end of their stdin; who does not is killed."""
        for process in self._running.values():
            assert process.stdin is not None
            with contextlib.suppress(OSError):
                process.stdin.close()
        until = time.monotonic() + _STOP_S
        for process in self._running.values():
            try:
                process.wait(max(0.1, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            self._let_go(process)
        self._running = {}
        take_back(self._folder)


_HOST = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.@:-]*")


def parse_engine(text: str) -> Engine:
    """What ``--on`` says.

    Raises:
        WavecombError: It is no engine.
    """
    name, colon, rest = text.partition(":")
    if name == "none" and not colon:
        return Engine("none")
    if name == "local" and (not colon or (rest.isdecimal() and 1 <= int(rest) <= 1024)):
        return Engine("local", int(rest or 0))
    hosts = tuple(rest.split(","))
    if name == "ssh" and all(map(_HOST.fullmatch, hosts)):
        return Engine("ssh", hosts=hosts)
    raise WavecombError(
        f"--on {text}: must be local, local:N with N workers, ssh:HOST,HOST ..., or none: others "
        "will work on the folder with `wavecomb farm worker`"
    )
