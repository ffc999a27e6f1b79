# SPDX-License-Identifier: Apache-2.0
"""A limit to the memory of a process that is expendable.

It is on memory that a process writes to (RLIMIT_DATA): arrays, heaps, stacks. Address space that is
only reserved, files that are only read, and the tiles of a texture store do not count, so that a
limit of the size of the machine never hits a sound scene: docs/decisions/sandbox.md has figures.
"""

from __future__ import annotations

import contextlib
import mmap
import resource
import secrets
from collections.abc import Callable
from pathlib import Path

from wavecomb.errors import WavecombError
from wavecomb.machine import memory_bytes
from wavecomb.run.isolate import trail

MEGABYTE = 1_000_000
LEAST_MB = 256

_CGROUP = Path("/sys/fs/cgroup")


def machine_limit() -> int | None:
    """Bytes that this process may take at most: of the machine, or of the group that it is in."""
    found = [bytes_ for bytes_ in (memory_bytes(), _of_group()) if bytes_]
    return min(found) if found else None


def _of_group() -> int | None:
    """The least limit of the control groups that hold this process; None: there is none."""
    limits: list[int] = []
    for place, name in _groups():
        # Within a container the path is that of outside: its own group is at the root.
        for group in (place, *place.parents):
            if not group.is_relative_to(_CGROUP):
                break
            try:
                text = (group / name).read_text().strip()
            except OSError:
                continue
            if text.isdecimal():
                limits.append(int(text))
    return min(limits, default=None)


def _groups() -> list[tuple[Path, str]]:
    """Folders of the control groups of this process, and the name of the file with the limit."""
    found = []
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return []
    for line in lines:
        number, kinds, path = line.split(":", 2)
        if number == "0":
            found.append((_CGROUP / path.lstrip("/"), "memory.max"))
        elif "memory" in kinds.split(","):
            found.append((_CGROUP / "memory" / path.lstrip("/"), "memory.limit_in_bytes"))
    return found


asked_mb: float | None = None
"""``--memory-limit`` in megabytes (10^6 bytes); None: what the machine has."""


def ask(megabytes: float | None) -> None:
    """Notes the limit that ``limit`` sets later.

    Raises:
        WavecombError: Nothing could be done with so little.
    """
    global asked_mb
    if megabytes is not None and megabytes < LEAST_MB:
        raise WavecombError(f"memory limit {megabytes:g} MB: give at least {LEAST_MB} MB")
    asked_mb = megabytes


def wanted() -> int | None:
    """The limit in bytes; None: there is none."""
    return machine_limit() if asked_mb is None else int(asked_mb * MEGABYTE)


def limit() -> None:
    """Limits the memory of this process, a supervised child, and notes the limit for its parent.

    Raises:
        WavecombError: A limit was asked for, and there is no child process.
    """
    if not trail.is_expendable():
        if asked_mb is None:
            return
        raise WavecombError(
            f"memory limit {asked_mb:g} MB: is that of the child process, and there is none; "
            "leave --isolate off out"
        )
    bytes_ = wanted()
    if bytes_ is None:
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:
        bytes_ = min(bytes_, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (bytes_, bytes_))
    trail.note(f"{bytes_ / MEGABYTE:.0f}", slot="limit")


class Group:
    """Control group that limits all memory of a process, shared mappings too."""

    def __init__(self, path: Path) -> None:
        """Takes the folder of the group."""
        self._path = path

    @classmethod
    def make(cls, bytes_: int | None) -> Group | None:
        """Makes a group within that of this process; None where that is not permitted.

        Args:
            bytes_: Its limit; None: none, and no group.
        """
        if bytes_ is None:
            return None
        for own, name in _groups():
            path = own / f"wavecomb-{secrets.token_hex(6)}"
            try:
                path.mkdir()
                try:
                    (path / name).write_text(str(bytes_))
                except OSError:
                    path.rmdir()
                    raise
            except OSError:
                continue
            return cls(path)
        return None

    def add(self, pid: int) -> None:
        """Moves a process into the group."""
        with contextlib.suppress(OSError):
            (self._path / "cgroup.procs").write_text(str(pid))

    def close(self) -> None:
        """Removes the group, whose processes have ended."""
        with contextlib.suppress(OSError):
            self._path.rmdir()


def limit_of(page: mmap.mmap) -> str:
    """How an obituary names the limit of a page's process; "" where it had none."""
    megabytes = trail.slot(page, "limit")
    return f"{megabytes} MB (--memory-limit)" if megabytes else ""


UNPACKED = 8160
"""Times that a value in a .usdc may be larger than what it is packed in: 2 bits for each of 8
bytes, and those by LZ4, which makes at most 255 bytes of one."""


def ran_out(error: BaseException, layer_bytes: Callable[[], int]) -> bool:
    """Whether an error means that this process, which is expendable, has met its limit.

    USD says of a value that it has no memory for what it says of one that is damaged; so it is
    taken for damaged only where the files are too small to hold one that large.

    Args:
        error: A MemoryError, or one of USD's.
        layer_bytes: Gives the size of the files that it reads.
    """
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if not trail.is_expendable() or bytes_ == resource.RLIM_INFINITY:
        return False
    if isinstance(error, MemoryError):
        return True
    if "exception thrown unpacking a value" not in str(error):
        return False
    return data_bytes() + UNPACKED * layer_bytes() > bytes_


def data_bytes() -> int:
    """Memory of this process as the limit counts it."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmData:"):
            return int(line.split()[1]) * 1024
    return 0


def room() -> int:
    """Bytes that this process may still take."""
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if bytes_ == resource.RLIM_INFINITY:
        bytes_ = machine_limit() or 1 << 62
    return max(bytes_ - data_bytes(), 0)


def describe_limit() -> str:
    """For a line about this process's memory: "; the limit is 24000 MB (--memory-limit)"."""
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if not trail.is_expendable() or bytes_ == resource.RLIM_INFINITY:
        return ""
    return f"; the limit is {bytes_ / MEGABYTE:.0f} MB (--memory-limit)"
