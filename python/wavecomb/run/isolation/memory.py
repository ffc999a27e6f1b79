# SPDX-License-Identifier: Apache-2.0
"""Memory limit of a child process that may be killed.

The limit applies to writable private memory (RLIMIT_DATA): arrays, heaps and stacks. Reserved
address space, mapped read-only files and tiles of a texture store do not count. A limit equal to
the machine's memory therefore never affects a valid scene (docs/decisions/sandbox.md).
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
    """Returns the bytes that this process may use, as limited by machine and control groups."""
    found = [bytes_ for bytes_ in (memory_bytes(), _of_group()) if bytes_]
    return min(found) if found else None


def _of_group() -> int | None:
    """Returns the lowest memory limit of this process's control groups, or None without a limit."""
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
    """Returns this process's control group folders, with the names of their memory limit files."""
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
    """Stores the memory limit that ``apply_limit`` applies later.

    Raises:
        WavecombError: The memory limit is too small.
    """
    global requested_mb
    if megabytes is not None and megabytes < MIN_MB:
        raise WavecombError(f"memory limit {megabytes:g} MB: give at least {MIN_MB} MB")
    requested_mb = megabytes


def requested_limit() -> int | None:
    """Returns the memory limit in bytes, or None without a limit."""
    return machine_limit() if requested_mb is None else int(requested_mb * MEGABYTE)


def apply_limit() -> None:
    """Applies the memory limit to this child process, and records the limit for the parent process.

    Raises:
        WavecombError: A memory limit was requested, but this process is not an isolated child
            process.
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
    """A control group (cgroup) that limits all memory of a process, including shared mappings."""

    def __init__(self, path: Path) -> None:
        """Stores the folder of the control group."""
        self._path = path

    @classmethod
    def make(cls, bytes_: int | None) -> Group | None:
        """Creates a control group inside the control group of this process.

        Returns None if this is not permitted.

        Args:
            bytes_: Memory limit in bytes; None means that no group is created.
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
    """Returns the memory limit of a child process as text for its crash message, or ""."""
    megabytes = progress_notes.slot(page, "limit")
    return f"{megabytes} MB (--memory-limit)" if megabytes else ""


UNPACKED = 8160
"""Upper bound of a value's size in memory, as a multiple of its size in a .usdc file.

The integer coding of .usdc files stores 8 bytes in 2 bits, and LZ4 compresses up to 255 bytes to
one byte.
"""


def is_exhausted(error: BaseException, layer_bytes: Callable[[], int]) -> bool:
    """Returns whether an error means that this child process has reached its memory limit.

    USD reports an exhausted memory and a damaged value in a file by the same error. The total size
    of the files bounds the size of a value in memory. If this bound is below the memory limit, the
    error is attributed to damage.

    Args:
        error: The MemoryError or USD error.
        layer_bytes: Function that returns the total size of the files that USD reads.
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
    """Returns the bytes of this process that count towards its memory limit."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmData:"):
            return int(line.split()[1]) * 1024
    return 0


def available_bytes() -> int:
    """Returns the bytes that this process may still allocate before it reaches its memory limit."""
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if bytes_ == resource.RLIM_INFINITY:
        bytes_ = machine_limit() or 1 << 62
    return max(bytes_ - data_bytes(), 0)


def describe_limit() -> str:
    """Returns a text for messages, such as "; the limit is 24000 MB (--memory-limit)", or ""."""
    bytes_ = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if not progress_notes.is_expendable() or bytes_ == resource.RLIM_INFINITY:
        return ""
    return f"; the limit is {bytes_ / MEGABYTE:.0f} MB (--memory-limit)"
