# SPDX-License-Identifier: Apache-2.0
"""What this process may use of the machine."""

from __future__ import annotations

import os
import tempfile


def usable_cores() -> int:
    """Cores that this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def memory_bytes() -> int | None:
    """Memory of the machine; None where it does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return None


def give_back_memory() -> None:
    """Hands memory that was freed to the system."""
    from wavecomb import _core

    _core.give_back_memory()


def temporary_folder() -> str:
    """Where temporary files go: ``TMPDIR``, else /var/tmp, which is on a disk, else /tmp."""
    chosen = os.environ.get("TMPDIR")
    if chosen:
        return chosen
    return "/var/tmp" if os.access("/var/tmp", os.W_OK | os.X_OK) else tempfile.gettempdir()
