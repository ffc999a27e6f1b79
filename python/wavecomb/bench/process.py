# SPDX-License-Identifier: Apache-2.0
"""Runs jobs in separate processes, and records hardware counters and the machine's load."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wavecomb import processes
from wavecomb.bench import machine

EVENTS = {
    "cycles": ("cycles",),
    "instructions": ("instructions",),
    "l1d_misses": ("L1-dcache-load-misses",),
    "l2_misses": ("l2_rqsts.miss", "l2_cache_req_stat.ic_dc_miss_in_l2", "l2d_cache_refill"),
    "llc_misses": ("LLC-load-misses", "cache-misses"),
    "branch_misses": ("branch-misses",),
}
"""Names of perf events for each column, in order of preference; a CPU supports only some."""


@dataclass(frozen=True)
class Counters:
    """Hardware counters of this machine.

    Attributes:
        events: Name of the perf event for each available column.
        missing: For each column that cannot be counted, the reason.
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
    """Returns the reason why perf cannot count an event for a user's process, or None if it can."""
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
    """Runs one worker under perf, which counts only while the worker has counting enabled.

    ``command`` is the prefix of the worker's command, and ``fds`` are file descriptors to pass to
    the worker. The value of ``job`` is passed to the worker as the entry ``perf`` of its job.
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
    """Switch in the worker that turns perf's counting on and off. It has no effect without perf."""

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


@dataclass
class Outcome:
    """Answer and measurements of a process.

    Attributes:
        answer: JSON object that the process printed, or {"status": "failed", "error": line}.
        wall_s: Wall time in seconds.
        others_share: Fraction of all cores' time that other processes took; None if unknown.
        load_average: Load average of one minute, at the start.
        started: UTC time of the start.
        code: Exit code.
    """

    answer: dict[str, Any]
    wall_s: float
    others_share: float | None
    load_average: float
    started: str
    code: int


def run_worker(job: dict[str, Any], events: dict[str, str], scratch: Path) -> Outcome:
    """Runs ``wavecomb.bench.worker``, under perf if there are events to count."""
    if not events:
        return run_process(processes.command("wavecomb.bench.worker", parent=os.getpid()), job)
    session = Session(events, scratch / f".perf-{os.getpid()}.csv")
    command = processes.command("wavecomb.bench.worker", parent=0, keep=session.fds)  # perf's child
    outcome = run_process(
        [*session.command, *command], {**job, "perf": session.job}, fds=session.fds
    )
    outcome.answer["counters"] = session.close()
    return outcome


def run_process(
    command: Sequence[str], job: dict[str, Any], *, fds: tuple[int, ...] = ()
) -> Outcome:
    """Runs a command with a job as JSON input, and reads its answer from its last JSON line."""
    done = run_lines(command, json.dumps(job), fds=fds)
    outcome = done.outcome
    answer = done.lines[-1] if done.lines else None
    if isinstance(answer, dict) and answer.get("status") in ("ok", "failed"):
        outcome.answer = answer
    return outcome


@dataclass
class Lines:
    """Output of a process: the JSON objects that it printed, and its outcome or failure."""

    lines: list[Any]
    outcome: Outcome


def run_lines(command: Sequence[str], text: str, *, fds: tuple[int, ...] = ()) -> Lines:
    """Runs a command with a text as input, and reads JSON lines from its stdout."""
    load, started = machine.load_average()[0], machine.now()
    busy, own, clock = machine.busy_seconds(), _own_seconds(), time.perf_counter()
    process = processes.popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        pass_fds=fds,
    )
    try:
        out, err = process.communicate(text)
    except BaseException:
        with contextlib.suppress(ProcessLookupError):
            # Kill the process group, so that child processes of the process end, too.
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        raise
    wall = time.perf_counter() - clock
    own, after = _own_seconds() - own, machine.busy_seconds()
    others = None
    if busy is not None and after is not None and wall > 0.0:
        total = wall * (os.cpu_count() or 1)
        others = max(0.0, (after - busy - own) / total)
    failed = _failure(err, process.returncode)
    return Lines(_objects(out), Outcome(failed, wall, others, load, started, process.returncode))


def _objects(out: str) -> list[Any]:
    objects = []
    for line in out.splitlines():
        with contextlib.suppress(ValueError):
            objects.append(json.loads(line))
    return objects


def _failure(err: str, code: int) -> dict[str, Any]:
    said = [line.strip() for line in err.splitlines() if line.strip()]
    how = f"killed by signal {-code}" if code < 0 else f"ended with code {code}"
    return {"status": "failed", "error": f"{how}: {said[-1] if said else 'no answer'}"[:500]}


def _own_seconds() -> float:
    """Returns the CPU seconds of this process and its ended children."""
    usage = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in usage)
