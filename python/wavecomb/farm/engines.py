# SPDX-License-Identifier: Apache-2.0
"""Who works on a job: what ``--on`` says."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from wavecomb import processes
from wavecomb.errors import WavecombError
from wavecomb.farm.dask_engine import Dask, Tls, parse_address
from wavecomb.farm.folder import Folder
from wavecomb.farm.local import Local
from wavecomb.farm.slurm_engine import Slurm
from wavecomb.machine import usable_cores

_SLURM_WORKERS = 4
_MOST_WORKERS = 1024


def threads_of_each(workers: int, wanted: int) -> int:
    """Threads of each of so many workers: what the job says, else its share of the cores."""
    return wanted or max(1, usable_cores() // workers)


class Runner(Protocol):
    """An engine at work.

    Attributes:
        stopped: Number of the signal that ended it early; None: none did.
        errors: What workers said that could not work.
    """

    stopped: int | None
    errors: list[str]

    def run(self, look: Callable[[], None] = ...) -> None:
        """Works until nothing is left to do, or a signal comes; ``look`` is called now and then."""


@dataclass(frozen=True)
class Engine:
    """Who works on a job.

    Attributes:
        kind: "local", "ssh", "dask", "slurm", or "none": others will.
        workers: How many, of "local" and "slurm"; 0: as many as is best, of "local" one.
        hosts: Of "ssh".
        address: Of "dask".
        tls: Likewise.
    """

    kind: str
    workers: int = 0
    hosts: tuple[str, ...] = ()
    address: str = ""
    tls: Tls = field(default_factory=Tls)

    @property
    def count(self) -> int:
        """Workers that are expected; 0: nobody knows."""
        if self.kind in ("none", "dask"):
            return 0
        return len(self.hosts) or max(1, self.workers)

    def commands(self, folder: Folder, threads: int) -> list[list[str]]:
        """What starts each of the workers, of "local" and "ssh".

        Args:
            folder: The job's.
            threads: Of each; 0: on this machine its share of the cores, elsewhere all.
        """
        words = processes.command(
            "wavecomb", "farm", "worker", str(folder.path), "--tied", "--quiet", "--threads",
            parent=None if self.kind == "ssh" else os.getpid(),
        )  # fmt: skip
        if self.kind == "ssh":
            remote = shlex.join([*words, str(threads)])
            return [["ssh", "-o", "BatchMode=yes", host, remote] for host in self.hosts]
        return [[*words, str(threads_of_each(self.count, threads))]] * self.count

    def runner(self, folder: Folder, threads: int) -> Runner:
        """What works on a job.

        Args:
            folder: The job's.
            threads: Of each worker; 0: as is best.
        """
        if self.kind == "dask":
            return Dask(folder, self.address, self.tls, threads)
        if self.kind == "slurm":
            return Slurm(folder, self.count)
        return Local(folder, self.commands(folder, threads))


_HOST = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.@:-]*")


def parse_engine(text: str, tls: Tls | None = None) -> Engine:
    """What ``--on`` says.

    Args:
        text: It.
        tls: Certificates for Dask.

    Raises:
        WavecombError: It is no engine.
    """
    name, colon, rest = text.partition(":")
    tls = tls or Tls()
    if name == "dask" and colon:
        engine = Engine("dask", address=parse_address(rest), tls=tls)
        tls.check(engine.address)
        return engine
    if tls != Tls():
        raise WavecombError(f"--on {text}: --tls-... are for dask:tls://HOST:PORT")
    if name == "none" and not colon:
        return Engine("none")
    if name in ("local", "slurm") and (
        not colon or (rest.isdecimal() and 1 <= int(rest) <= _MOST_WORKERS)
    ):
        return Engine(name, int(rest or (_SLURM_WORKERS if name == "slurm" else 0)))
    hosts = tuple(rest.split(","))
    if name == "ssh" and all(map(_HOST.fullmatch, hosts)):
        return Engine("ssh", hosts=hosts)
    raise WavecombError(
        f"--on {text}: must be local, local:N with N workers, ssh:HOST,HOST ..., "
        "dask:tls://HOST:PORT, slurm:N, or none: others will work on the folder with "
        "`wavecomb farm worker`"
    )
