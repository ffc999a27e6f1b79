# SPDX-License-Identifier: Apache-2.0
"""Memory limit of an expendable process.

The limit applies to writable private memory (RLIMIT_DATA): arrays, heaps and stacks. Reserved
address space, mapped read-only files and tiles of a texture store do not count, so that a limit of
the machine's size never affects a valid scene. docs/decisions/sandbox.md has figures.
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
from wavecomb.run.isolation import progress_notes

MEGABYTE = 1_000_000
MIN_MB = 256

_CGROUP = Path("/sys/fs/cgroup")


def machine_limit() -> int | None:
    """Returns the bytes that this process may use, from the machine and its control groups."""
    found = [bytes_ for bytes_ in (memory_bytes(), _of_group()) if bytes_]
    return min(found) if found else None


def _of_group() -> int | None:
    """Returns the lowest limit of the control groups of this process; None without a limit."""
    limits: list[int] = []
    for place, name in _groups():
        # Inside a container, /proc names the control group by its path on the host, but the
        # container sees its group at the root of the cgroup file system.
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
    """Returns the control group folders of this process with the names of their limit files."""
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


requested_mb: float | None = None
"""Value of ``--memory-limit`` in units of 10^6 bytes; None uses the machine's memory."""


def request_limit(megabytes: float | None) -> None:
    """Stores the limit that ``apply_limit`` applies later.

    Raises:
        WavecombError: The limit is too small.
    """
    global requested_mb
    if megabytes is not None and megabytes < MIN_MB:
        raise WavecombError(f"memory limit {megabytes:g} MB: give at least {MIN_MB} MB")
    requested_mb = megabytes


def requested_limit() -> int | None:
    """Returns the limit in bytes; None without a limit."""
    return machine_limit() if requested_mb is None else int(requested_mb * MEGABYTE)


def apply_limit() -> None:
    """Limits the memory of this supervised child process and records the limit for its parent.

    Raises:
        WavecombError: A limit is set but there is no child process.
    """
    if not progress_notes.is_expendable():
        if requested_mb is None:
            return
        raise WavecombError(
            f"memory limit {requested_mb:g} MB: is that of the child process, and there is none; "
            "leave --isolate off out"
        )
    bytes_ = requested_limit()
    if bytes_ is None:
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:
        bytes_ = min(bytes_, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (bytes_, bytes_))
    progress_notes.note(f"{bytes_ / MEGABYTE:.0f}", slot="limit")


class Group:
    """A control group that limits all memory of a process, including shared mappings."""

    def __init__(self, path: Path) -> None:
        """Stores the folder of the control group."""
        self._path = path

    @classmethod
    def make(cls, bytes_: int | None) -> Group | None:
        """Creates a group inside that of this process; returns None if that is not permitted.

        Args:
            bytes_: Limit in bytes; None creates no group.
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
        """Moves a process into the control group."""
        with contextlib.suppress(OSError):
            (self._path / "cgroup.procs").write_text(str(pid))

    def close(self) -> None:
        """Removes the control group after its processes have ended."""
        with contextlib.suppress(OSError):
            self._path.rmdir()


def limit_text(page: mmap.mmap) -> str:
    """Returns the limit of a process for its crash message; "" without a limit."""
    megabytes = progress_notes.slot(page, "limit")
    return f"{megabytes} MB (--memory-limit)" if megabytes else ""


UNPACKED = 8160
"""Largest ratio of a value's size in memory to its size in a .usdc file.

Integer coding stores 8 bytes in 2 bits, and LZ4 compresses up to 255 bytes to one.
"""


def is_exhausted(error: BaseException, layer_bytes: Callable[[], int]) -> bool:
    """Returns whether an error means that this expendable process reached its memory limit.

    USD reports the same error for lack of memory and for damaged values. The value counts as
    damaged only if the files are too small to contain a value that exceeds the limit.

    Args:
        error: A MemoryError or a USD error.
        layer_bytes: Returns the size of the files that USD reads.
    """
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if not progress_notes.is_expendable() or bytes_ == resource.RLIM_INFINITY:
        return False
    if isinstance(error, MemoryError):
        return True
    if "exception thrown unpacking a value" not in str(error):
        return False
    return data_bytes() + UNPACKED * layer_bytes() > bytes_


def data_bytes() -> int:
    """Returns the memory of this process that counts towards the limit, in bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmData:"):
            return int(line.split()[1]) * 1024
    return 0


def available_bytes() -> int:
    """Returns the bytes that this process may still allocate."""
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if bytes_ == resource.RLIM_INFINITY:
        bytes_ = machine_limit() or 1 << 62
    return max(bytes_ - data_bytes(), 0)


def describe_limit() -> str:
    """Returns text such as "; the limit is 24000 MB (--memory-limit)" for messages, or ""."""
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if not progress_notes.is_expendable() or bytes_ == resource.RLIM_INFINITY:
        return ""
    return f"; the limit is {bytes_ / MEGABYTE:.0f} MB (--memory-limit)"
