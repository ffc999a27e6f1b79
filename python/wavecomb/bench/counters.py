# SPDX-License-Identifier: Apache-2.0
"""Hardware counters of a worker's timed render, by ``perf stat``, where the kernel gives them."""

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
"""Column -> perf's names for it, in order of preference: kinds of CPU differ."""


@dataclass(frozen=True)
class Counters:
    """What can be counted here.

    Attributes:
        events: Column -> perf's event.
        missing: Column -> why it is not counted.
    """

    events: dict[str, str] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


def available(events: dict[str, tuple[str, ...]] = EVENTS) -> Counters:
    """Tries each event once, on ``true``."""
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
    """None if perf counts the event of a user's process, else why not."""
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
    """One worker under perf, which counts between ``start`` and ``stop`` of the worker.

    ``command`` goes before the worker's command; ``fds`` are handed on to it, and the worker gets
    them in its job as ``perf``.
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
        """Counts by column, to be called when the worker is gone."""
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
    """The worker's side: turns counting on and off; does nothing without perf."""

    def __init__(self, job: dict[str, int] | None) -> None:
        self._job = job

    def start(self) -> None:
        """Counts from here."""
        self._say(b"enable\n")

    def stop(self) -> None:
        """Counts no more."""
        self._say(b"disable\n")

    def _say(self, word: bytes) -> None:
        if self._job is not None:
            os.write(self._job["write"], word)
            os.read(self._job["read"], 16)  # perf answers "ack\n"
