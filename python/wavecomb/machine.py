# SPDX-License-Identifier: Apache-2.0
"""Resources of the machine that this process may use."""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


def usable_cores() -> int:
    """Returns the number of cores that this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def memory_bytes() -> int | None:
    """Returns the memory of the machine in bytes, or None if it is unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return None


@contextmanager
def without_collection() -> Iterator[None]:
    """Disables Python's cyclic garbage collector in a block that creates many objects.

    The collector would visit all objects repeatedly, which takes 10 to 20 % of the block's time.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def give_back_memory() -> None:
    """Returns memory that was freed, but is still reserved, to the operating system."""
    from wavecomb import _core

    _core.give_back_memory()


def temporary_folder() -> str:
    """Returns the folder for temporary files: ``TMPDIR``, else /var/tmp, else /tmp."""
    chosen = os.environ.get("TMPDIR")
    if chosen:
        return chosen
    return "/var/tmp" if os.access("/var/tmp", os.W_OK | os.X_OK) else tempfile.gettempdir()
