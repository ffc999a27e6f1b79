# SPDX-License-Identifier: Apache-2.0
"""A limit to the memory of a process that is expendable.

It is on memory that a process writes to (RLIMIT_DATA): arrays, heaps, stacks. Address space that is
only reserved, files that are only read, and the tiles of a texture store do not count, so that a
limit of the size of the machine never hits a sound scene: docs/decisions/sandbox.md has figures.
"""

from __future__ import annotations

import mmap
import resource
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
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return None
    for line in lines:
        number, kinds, path = line.split(":", 2)
        if number == "0":
            folder, name = _CGROUP, "memory.max"
        elif "memory" in kinds.split(","):
            folder, name = _CGROUP / "memory", "memory.limit_in_bytes"
        else:
            continue
        place = folder / path.lstrip("/")
        # Within a container the path is that of outside: its own group is at the root.
        for group in (place, *place.parents):
            if not group.is_relative_to(folder):
                break
            try:
                text = (group / name).read_text().strip()
            except OSError:
                continue
            if text.isdecimal():
                limits.append(int(text))
    return min(limits, default=None)


def limit(megabytes: float | None = None) -> None:
    """Limits the memory of this process, which is expendable, and tells its parent.

    Args:
        megabytes: 10^6 bytes; None: what the machine has.

    Raises:
        WavecombError: Nothing could be done with so little, or no process is there to be limited.
    """
    if megabytes is not None and megabytes < LEAST_MB:
        raise WavecombError(f"memory limit {megabytes:g} MB: give at least {LEAST_MB} MB")
    if not trail.is_expendable():
        if megabytes is None:
            return
        raise WavecombError(
            f"memory limit {megabytes:g} MB: is that of the child process, and there is none; "
            "leave --isolate off out"
        )
    bytes_ = machine_limit() if megabytes is None else int(megabytes * MEGABYTE)
    if bytes_ is None:
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:
        bytes_ = min(bytes_, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (bytes_, bytes_))
    trail.note(f"{bytes_ / MEGABYTE:.0f}", slot="limit")


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
