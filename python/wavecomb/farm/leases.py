# SPDX-License-Identifier: Apache-2.0
"""Who works on a job: signs of life, and tasks of workers that gave none.

A worker touches its file while it lives. What counts is the clock of the file system, not that of
a machine: whoever looks touches a file of its own first.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import socket
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.files import read_json, write_json
from wavecomb.farm.folder import BUSY, Entry, Folder

BEAT_S = 2.0
"""Between two signs of life."""


def new_name() -> str:
    """A name that no other worker has: host, process, four letters."""
    host = re.sub(r"[^A-Za-z0-9-]", "-", socket.gethostname())[:32] or "host"
    return f"{host}-{os.getpid()}-{secrets.token_hex(2)}"


def this_process() -> dict[str, Any]:
    """What tells a process from all others, as far as one on this machine can look."""
    pid = os.getpid()
    return {"host": socket.gethostname(), "pid": pid, "born": _born(pid), "system": _system()}


def _system() -> str:
    """The machine as it was started, and the space of numbers of processes; empty: no Linux."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot} {os.readlink('/proc/self/ns/pid')}"
    except OSError:
        return ""


def _born(pid: int) -> str:
    """When a process started, in ticks; empty: there is none, or no Linux."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(errors="replace")
    except OSError:
        return ""
    fields = text.rpartition(")")[2].split()
    return "" if fields[0] in "ZX" else fields[19]


def is_dead(process: dict[str, Any]) -> bool:
    """Whether a process of this machine is no more; False where that cannot be told."""
    system = _system()
    if not system or process.get("system") != system:
        return False
    pid = process.get("pid")
    return not isinstance(pid, int) or _born(pid) != process.get("born")


class Beat:
    """The sign of life of a worker.

    Attributes:
        name: Of the worker.
        progress: To be told with the next sign; None: nothing.
    """

    def __init__(self, folder: Folder, facts: dict[str, Any], name: str | None = None) -> None:
        """Gives the first sign. ``facts``: of the worker, for whoever looks."""
        self.name = new_name() if name is None else name
        self._facts = {**facts, **this_process(), "began": time.time()}
        self._file = folder.path / "workers" / f"{self.name}.json"
        self.progress: dict[str, Any] | None = None
        self._next = 0.0
        write_json(self._file, self._facts)

    def give(self) -> None:
        """A sign, if it is time for one. A share that is gone for a while does no harm."""
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + BEAT_S
        with contextlib.suppress(OSError):
            if self.progress is None:
                os.utime(self._file)
                return
            self._facts["progress"], self.progress = self.progress, None
            write_json(self._file, self._facts)

    def soon(self) -> None:
        """Has the next sign given as soon as it is asked for."""
        self._next = 0.0

    def now(self) -> float:
        """The clock of the file system."""
        os.utime(self._file)
        return self._file.stat().st_mtime

    def note(self, **facts: Any) -> None:
        """Adds to what is known of the worker, as far as there is a disk to write to."""
        self._facts |= facts
        with contextlib.suppress(OSError):
            write_json(self._file, self._facts)

    def end(self, why: str) -> None:
        """Says that the worker is no more."""
        self.note(ended=why)


@dataclass(frozen=True)
class Worker:
    """A worker, as its file says.

    Attributes:
        name: Its own.
        facts: What it said of itself.
        seen: Its last sign of life, by the file system's clock.
    """

    name: str
    facts: dict[str, Any]
    seen: float

    @property
    def has_ended(self) -> bool:
        """Whether it said so, or is seen to be no more."""
        return bool(self.facts.get("ended")) or is_dead(self.facts)


def workers(folder: Folder) -> list[Worker]:
    """All that ever worked on a job."""
    found = []
    for file in sorted((folder.path / "workers").glob("*.json")):
        try:
            facts, seen = read_json(file), file.stat().st_mtime
        except (OSError, WavecombError):
            continue
        if isinstance(facts, dict):
            found.append(Worker(file.stem, facts, seen))
    return found


def look_s(lease_s: float, living: int) -> float:
    """Seconds between two looks of one worker for tasks of others that are no more.

    A look reads a file of each worker. Eight workers look eight times a lease each; more look less
    often, so that what the disk is asked grows with their number and not with its square.

    >>> look_s(60.0, 4), look_s(60.0, 80)
    (7.5, 75.0)
    """
    return max(0.5, lease_s / 8) * max(1.0, living / 8)


def living(folder: Folder, now: float) -> int:
    """How many workers gave a sign of life within a lease."""
    with os.scandir(folder.path / "workers") as files:
        return sum(
            file.name.endswith(".json") and file.stat().st_mtime > now - folder.spec.lease_s
            for file in files
        )


def _why_gone(worker: Worker | None, now: float | None, lease_s: float) -> str:
    """Why a worker does not count any more; empty: it does."""
    if worker is None:
        return "its worker is not known"
    if worker.has_ended:
        return "its worker ended"
    if now is not None and now - worker.seen > lease_s:
        return f"its worker gave no sign of life for {now - worker.seen:.0f} s"
    return ""


def gone(folder: Folder, now: float | None = None) -> set[str]:
    """Names of workers of a job that are no more; ``now`` as of ``take_back``."""
    lease = folder.spec.lease_s
    return {one.name for one in workers(folder) if _why_gone(one, now, lease)}


def take_back(folder: Folder, now: float | None = None, *, counts: bool = True) -> list[Entry]:
    """Takes tasks from workers that are no more, or gave no sign for too long.

    Args:
        folder: The job's.
        now: The clock of its file system; None: only those that are known to be no more.
        counts: Whether each was a try.
    """
    held = [entry for entry in folder.entries(BUSY) if entry.worker]
    if not held:
        return []
    known = {worker.name: worker for worker in workers(folder)}
    taken = []
    for entry in held:
        why = _why_gone(known.get(entry.worker), now, folder.spec.lease_s)
        if not why:
            continue
        if not counts:
            folder.log(entry.task, f"taken from {entry.worker}: {why}")
        if folder.fail(entry, why) if counts else folder.give_back(entry):
            taken.append(entry)
    return taken
