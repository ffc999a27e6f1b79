# SPDX-License-Identifier: Apache-2.0
"""Dask clusters that render a job, as chosen by ``--on``.

Anyone who can reach a Dask scheduler can run code on its workers. A scheduler started by this
process therefore uses TLS with a private certificate. Workers run in Python's isolated mode, so
that they import nothing from the working folder.
"""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb import processes
from wavecomb.errors import WavecombError
from wavecomb.extras import needed
from wavecomb.farm.machine_class import PREFIX
from wavecomb.farm.worker import write_certificates
from wavecomb.machine import usable_cores

MAX_WORKERS = 1024
DASK_WAIT_S = 60.0
"""Time to wait for the first worker of an existing Dask cluster, in seconds."""
_QUERY_S = 1.0
"""Time between queries of the scheduler for its workers, in seconds."""
_SLURM_WORKERS = 4
_CONNECT_S = 10.0
_ANSWER_S = 60.0
"""Time limit for sbatch, squeue and scancel, in seconds."""
_ASK_S = 10.0
"""Time between calls of squeue, in seconds."""
_MAX_STARTS = 5
"""Largest number of consecutive worker starts during which no task finishes."""
_END_S = 5.0
_SCRIPT = '#!/bin/sh\nexec "$@" --nthreads "${SLURM_CPUS_PER_TASK:-1}"\n'


@dataclass(frozen=True)
class ClusterSpec:
    """Cluster that ``--on`` names.

    Attributes:
        kind: "local", "dask", "slurm", or "none", which only writes the job.
        workers: Number of workers for "local" and "slurm".
        address: Address of the scheduler for "dask".
    """

    kind: str
    workers: int = 0
    address: str = ""


def parse_cluster(text: str) -> ClusterSpec:
    """Parses the value of ``--on``. Raises WavecombError if it is invalid.

    >>> parse_cluster("local:4")
    ClusterSpec(kind='local', workers=4, address='')
    """
    kind, colon, rest = text.partition(":")
    if kind == "dask" and colon:
        return ClusterSpec("dask", address=parse_address(rest))
    if kind == "none" and not colon:
        return ClusterSpec("none")
    if kind in ("local", "slurm") and (
        not colon or (re.fullmatch(r"[0-9]{1,4}", rest) and 1 <= int(rest) <= MAX_WORKERS)
    ):
        return ClusterSpec(kind, int(rest or (_SLURM_WORKERS if kind == "slurm" else 1)))
    raise WavecombError(
        f"--on {text}: must be local, local:N with N workers, dask:tls://HOST:PORT, slurm:N, or "
        "none: only write the job"
    )


def parse_address(text: str) -> str:
    """Returns the address of a scheduler with its protocol.

    >>> parse_address("127.0.0.1:8786"), parse_address("tls://farm:8786")
    ('tcp://127.0.0.1:8786', 'tls://farm:8786')

    Raises:
        WavecombError: The address is invalid, or is on another machine without TLS.
    """
    kind, found, rest = text.partition("://")
    kind, rest = (kind, rest) if found else ("tcp", text)
    host, _, port = rest.rpartition(":")
    good = re.fullmatch(r"[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]", host)
    if kind not in ("tcp", "tls") or not good or not re.fullmatch("[0-9]{1,5}", port):
        raise WavecombError(f"--on dask:{text}: must be dask:HOST:PORT or dask:tls://HOST:PORT")
    is_loopback = host == "localhost"
    with contextlib.suppress(ValueError):
        is_loopback = is_loopback or ipaddress.ip_address(host.strip("[]")).is_loopback
    if int(port) > 65535 or (kind == "tcp" and not is_loopback):
        raise WavecombError(
            f"--on dask:{text}: is neither an address of this machine nor tls://: anyone who "
            "reaches a Dask scheduler can run code, so set up Dask's TLS (docs/farm.md)"
        )
    return f"{kind}://{rest}"


class Cluster:
    """Connection to a scheduler, with the workers that this process started.

    Attributes:
        client: Dask client.
    """

    wait_s: float | None = 120.0
    """Time to wait for the first worker, in seconds; None means no limit."""

    def __init__(self, client: Any, what: str) -> None:
        """Creates the connection. The argument ``what`` is the name of the cluster in messages."""
        self.client = client
        self.what = what

    def check(self, progressed: bool) -> None:
        """Replaces workers that have ended. Called regularly.

        Args:
            progressed: Whether any task finished since the last call.

        Raises:
            WavecombError: Workers end repeatedly without progress, or the scheduler is gone.
        """
        if self.client.status != "running":
            raise WavecombError(
                f"{self.what}: the scheduler is gone; `wavecomb farm resume` continues"
            )

    def close(self) -> None:
        """Ends the workers that this process started."""


class Workers:
    """Counts of the workers in a cluster for each machine class."""

    def __init__(self, cluster: Cluster) -> None:
        self._client = cluster.client
        self._facts: dict[str, Any] = {}
        self._next_query = 0.0

    def query(self, every: float = _QUERY_S) -> None:
        """Queries the scheduler for its workers, at most every ``every`` seconds."""
        if time.monotonic() < self._next_query:
            return
        self._next_query = time.monotonic() + every
        info = self._client.scheduler_info(n_workers=-1)
        self._facts = {} if info is None else dict(info.get("workers", {}))

    def expire(self) -> None:
        """Makes the next call of ``query`` ask the scheduler."""
        self._next_query = 0.0

    def classes(self) -> dict[str, int]:
        """Returns the number of workers of each machine class."""
        found: dict[str, int] = {}
        for facts in self._facts.values():
            for name, amount in facts["resources"].items():
                if name.startswith(PREFIX) and amount > 0:
                    found[name] = found.get(name, 0) + 1
        return found

    def count(self, machine: str) -> int:
        """Returns the number of workers of a class, or of all workers for ""."""
        found = self.classes()
        return found.get(machine, 0) if machine else sum(found.values())


class _LocalWorkers(Cluster):
    """Local workers, which share a process that is restarted when it ends."""

    def __init__(self, client: Any, what: str, words: list[str], log: Path) -> None:
        super().__init__(client, what)
        self._words, self._log = words, log
        self._process: subprocess.Popen[bytes] | None = None
        self._starts = 0
        self._start()

    def _start(self) -> None:
        self._starts += 1
        with self._log.open("wb") as log:
            self._process = processes.popen(
                self._words, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def check(self, progressed: bool) -> None:
        """Restarts the worker process if it has ended."""
        super().check(progressed)
        assert self._process is not None
        self._starts = 1 if progressed else self._starts
        if self._process.poll() is None:
            return
        if self._starts >= _MAX_STARTS:
            said = self._log.read_text(errors="replace").strip().splitlines() or ["no reason given"]
            raise WavecombError(f"{self.what}: workers ended {self._starts} times: {said[-1]}")
        self._start()

    def close(self) -> None:
        """Kills the worker process. Tile files are never written partially."""
        assert self._process is not None
        self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)


class _SlurmWorkers(Cluster):
    """Array of Slurm jobs, one for each worker. Workers that end are replaced."""

    wait_s = None

    def __init__(self, client: Any, what: str, script: Path, words: list[str], count: int) -> None:
        super().__init__(client, what)
        self._script, self._words, self._count = script, words, count
        self._ids: list[str] = []
        self._starts = 0
        self._next = 0.0
        self._submit(count)

    def _submit(self, count: int) -> None:
        self._starts += 1
        said = _ask(
            "sbatch", "--parsable", "--job-name=wavecomb", f"--array=1-{count}", "--no-requeue",
            "--signal=TERM@30", "--output=/dev/null", str(self._script), *self._words,
        ).strip().splitlines()  # fmt: skip
        match = re.fullmatch(r"(\d+)(;\S+)?", said[-1] if said else "")
        if match is None:
            raise WavecombError(f"--on slurm: sbatch gave no job number: {' '.join(said)!r}")
        self._ids.append(match[1])
        self._next = time.monotonic() + _ASK_S

    def check(self, progressed: bool) -> None:
        """Submits new workers to replace those that Slurm no longer lists."""
        super().check(progressed)
        self._starts = 0 if progressed else self._starts
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + _ASK_S
        try:
            ids = ",".join(self._ids)
            there = len(_ask("squeue", "--noheader", "--array", "--jobs", ids).split("\n")) - 1
        except WavecombError as error:
            if "Invalid job id" not in str(error):
                # other errors may be temporary; the next call of this method queries Slurm again
                return
            there = 0
        if there >= self._count:
            return
        if self._starts >= _MAX_STARTS:
            raise WavecombError(f"{self.what}: Slurm's jobs end without finishing anything")
        self._submit(self._count - there)

    def close(self) -> None:
        """Removes the workers from the queue."""
        for number in self._ids:
            with contextlib.suppress(WavecombError):
                _ask("scancel", number)


@contextlib.contextmanager
def connected(
    where: ClusterSpec, folder: Path, *, threads: int = 0, tries: int, hang_s: float,
    dashboard: int | None = None,
) -> Iterator[Cluster]:  # fmt: skip
    """Connects to a cluster, or starts one, for the duration of a ``with`` block.

    Args:
        where: The cluster.
        folder: Folder of the job. Workers on other machines read certificates from it.
        threads: Threads of each local worker; 0 means an equal share of the cores.
        tries: Number of workers that may crash during a task before the task fails. Does not apply
            to an existing Dask cluster.
        hang_s: Time in seconds without a heartbeat after which a worker is replaced. Does not apply
            to an existing Dask cluster.
        dashboard: Port of Dask's dashboard on this machine; None starts no dashboard.

    Raises:
        WavecombError: The cluster cannot be reached or started.
    """
    distributed = needed("distributed", "wavecomb farm", "farm")
    needed("cryptography", "wavecomb farm", "farm")
    _silence()
    if where.kind == "dask":
        with _client(distributed, where.address, None) as client:
            found = Cluster(client, f"--on dask:{where.address}")
            found.wait_s = DASK_WAIT_S
            yield found
        return
    import dask

    settings: dict[str, Any] = {
        "distributed.scheduler.allowed-failures": tries - 1,
        "distributed.scheduler.worker-ttl": f"{hang_s} s",
        "distributed.scheduler.work-stealing": False,
    }
    is_local = where.kind == "local"
    what = f"--on {where.kind}:{where.workers}"
    with contextlib.ExitStack() as stack:
        place = Path(
            stack.enter_context(
                tempfile.TemporaryDirectory(
                    prefix=".cluster-", dir=None if is_local else folder, ignore_cleanup_errors=True
                )
            )
        )
        # Dask imports modules from its temporary directory, so other users must not write to it.
        settings["temporary-directory"] = str(place)
        stack.enter_context(dask.config.set(settings))
        security = distributed.Security.temporary()
        write_certificates(place, security)
        before = list(sys.path)
        scheduler = stack.enter_context(
            distributed.LocalCluster(
                n_workers=0, processes=False, protocol="tls://", security=security,
                host="127.0.0.1" if is_local else None, silence_logs=logging.CRITICAL,
                dashboard_address=None if dashboard is None else f"127.0.0.1:{dashboard}",
            )
        )  # fmt: skip
        sys.path[:] = before
        address = scheduler.scheduler_address
        client = stack.enter_context(_client(distributed, address, security))
        words = processes.command(
            "wavecomb.farm.worker", str(place), address, "--no-dashboard", "--memory-limit", "0",
            "--death-timeout", "60", "--local-directory", str(place),
            parent=os.getpid() if is_local else None,
        )  # fmt: skip
        cluster: Cluster
        if is_local:
            each = threads or max(1, usable_cores() // where.workers)
            words += ["--host", "127.0.0.1", "--nworkers", str(where.workers)]
            words += ["--nthreads", str(each)]
            cluster = _LocalWorkers(client, what, words, place / "log")
        else:
            script = place / "worker.sh"
            script.write_text(_SCRIPT)
            cluster = _SlurmWorkers(client, what, script, words, where.workers)
        stack.callback(cluster.close)
        yield cluster


@contextlib.contextmanager
def _client(distributed: Any, address: str, security: Any) -> Iterator[Any]:
    try:
        client = distributed.Client(
            address, security=security, timeout=_CONNECT_S, set_as_default=False
        )
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        why = " ".join(str(error.__cause__ or error).split()) or type(error).__name__
        raise WavecombError(f"--on dask:{address}: no scheduler answers: {why}") from None
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):
            client.close(timeout=_END_S)


def _silence() -> None:
    """Turns off Dask's log messages, because relevant errors are reported in one line."""
    for name in ("distributed", "tornado", "asyncio", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _ask(*words: str) -> str:
    """Runs a Slurm command and returns its output. Raises WavecombError."""
    try:
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=_ANSWER_S
        )
    except FileNotFoundError:
        raise WavecombError(f"--on slurm: the command {words[0]} is not installed") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise WavecombError(f"--on slurm: {words[0]}: {error}") from None
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"]
        raise WavecombError(f"--on slurm: {words[0]}: {said[-1]}")
    return done.stdout
