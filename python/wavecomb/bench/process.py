# SPDX-License-Identifier: Apache-2.0
"""Runs jobs in separate processes, and measures the load of the machine meanwhile."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb import processes
from wavecomb.bench import machine
from wavecomb.bench.counters import Session


@dataclass
class Outcome:
    """Answer and measurements of a process.

    Attributes:
        answer: Its JSON object, or {"status": "failed", "error": line} if there is none.
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
    """Runs a command that reads a JSON job, and takes its last line on stdout as JSON answer."""
    done = run_lines(command, json.dumps(job), fds=fds)
    outcome = done.outcome
    answer = done.lines[-1] if done.lines else None
    if isinstance(answer, dict) and answer.get("status") in ("ok", "failed"):
        outcome.answer = answer
    return outcome


@dataclass
class Lines:
    """JSON objects that a process printed, and its outcome with status "failed"."""

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
            os.killpg(process.pid, signal.SIGKILL)  # also kills child processes
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
