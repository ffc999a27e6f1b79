# SPDX-License-Identifier: Apache-2.0
"""Hardware counters of a worker's timed render, by ``perf stat`` if the kernel allows it."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

EVENTS = {
    "cycles": ("cycles",),
    "instructions": ("instructions",),
    "l1d_misses": ("L1-dcache-load-misses",),
    "l2_misses": ("l2_rqsts.miss", "l2_cache_req_stat.ic_dc_miss_in_l2", "l2d_cache_refill"),
    "llc_misses": ("LLC-load-misses", "cache-misses"),
    "branch_misses": ("branch-misses",),
}
"""Names of perf events for each column, in order of preference, because CPUs differ."""


@dataclass(frozen=True)
class Counters:
    """Hardware counters of this machine.

    Attributes:
        events: Name of the perf event for each available column.
        missing: Reason for each column that cannot be counted.
    """

    events: dict[str, str] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


def available(events: dict[str, tuple[str, ...]] = EVENTS) -> Counters:
    """Determines which events perf can count, by trying each on the command ``true``."""
    if shutil.which("perf") is None:
        return Counters(missing=dict.fromkeys(events, "perf is not installed"))
    found = Counters()
    for column, names in events.items():
        for name in names:
            why = _trial(name)
            if why is None:
                found.events[column] = name
                found.missing.pop(column, None)
                break
            found.missing[column] = why
    return found


def _trial(event: str) -> str | None:
    """Returns None if perf can count the event for a user's process, else the reason why not."""
    done = subprocess.run(
        ["perf", "stat", "-x", ",", "-e", f"{event}:u", "--", "true"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        if lines and lines[0].startswith("event syntax error"):
            return f"perf knows no event {event} on this CPU"
        return lines[0].strip()[:200] if lines else f"perf ended with code {done.returncode}"
    for line in done.stderr.splitlines():
        value = line.split(",")[0]
        if value in ("<not supported>", "<not counted>"):
            return f"perf: {event} {value.strip('<>')} (a virtual machine without its counters?)"
    return None


class Session:
    """Runs one worker under perf, which counts only while the worker has enabled it.

    ``command`` is the prefix of the worker's command, and ``fds`` are file descriptors to pass to
    it. The worker gets ``job`` as the entry ``perf`` of its job.
    """

    def __init__(self, events: dict[str, str], report: Path) -> None:
        self._events = events
        self._report = report
        self._control, self._worker_writes = os.pipe()
        self._worker_reads, self._acknowledge = os.pipe()
        self.fds = (
            self._control,
            self._worker_writes,
            self._worker_reads,
            self._acknowledge,
        )
        self.command = [
            *("perf", "stat", "-x", ",", "-o", str(report)),
            *("--delay=-1", f"--control=fd:{self._control},{self._acknowledge}"),
            *("-e", ",".join(f"{event}:u" for event in events.values()), "--"),
        ]
        self.job = {"write": self._worker_writes, "read": self._worker_reads}

    def close(self) -> dict[str, float]:
        """Returns the counts by column, after the worker has ended."""
        for fd in self.fds:
            os.close(fd)
        counts: dict[str, float] = {}
        try:
            lines = self._report.read_text(encoding="utf-8").splitlines()
            self._report.unlink()
        except OSError:
            return counts
        columns = {f"{event}:u": column for column, event in self._events.items()}
        for line in lines:
            fields = line.split(",")
            if len(fields) > 2 and fields[2] in columns:
                try:
                    counts[columns[fields[2]]] = float(fields[0])
                except ValueError:
                    continue
        return counts


class Switch:
    """Switch in the worker that turns counting on and off. Does nothing without perf."""

    def __init__(self, job: dict[str, int] | None) -> None:
        self._job = job

    def start(self) -> None:
        """Starts counting."""
        self._say(b"enable\n")

    def stop(self) -> None:
        """Stops counting."""
        self._say(b"disable\n")

    def _say(self, word: bytes) -> None:
        if self._job is not None:
            os.write(self._job["write"], word)
            os.read(self._job["read"], 16)  # perf answers "ack\n"
