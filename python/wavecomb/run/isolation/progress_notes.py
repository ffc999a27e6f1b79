# SPDX-License-Identifier: Apache-2.0
"""Progress notes of a child process for its parent's crash report, in a page of shared memory."""

from __future__ import annotations

import mmap
import os
import signal

_SLOT = 1024
_SLOTS = ("at", "image", "limit")
_page: mmap.mmap | None = None


def new_page() -> int:
    """Creates an anonymous page that parent and child share, and returns its file descriptor."""
    descriptor = os.memfd_create("wavecomb-trail", os.MFD_CLOEXEC)
    os.ftruncate(descriptor, _SLOT * len(_SLOTS))
    return descriptor


def open_page(descriptor: int) -> mmap.mmap:
    """Maps the shared page of progress notes from its file descriptor."""
    return mmap.mmap(descriptor, _SLOT * len(_SLOTS))


def start(descriptor: int) -> None:
    """Starts writing progress notes to a page that the parent process reads after a crash."""
    global _page
    _page = open_page(descriptor)


def is_expendable() -> bool:
    """Returns whether this process has a parent that survives its crash and reports it."""
    return _page is not None


def note(what: str, place: object = "", slot: str = "at") -> None:
    """Writes a progress note; does nothing without a parent that reads it.

    Args:
        what: Activity of the process, which completes the message "it crashed while ...".
        place: Path of the prim or file that the process works on.
        slot: "at" for the activity of the main thread, "image" for the activity of a thread that
            decodes images, or "limit" for the memory limit in MB.
    """
    if _page is None:
        return
    text = f"{what} {place}".encode(errors="replace")[: _SLOT - 1] + b"\0"
    start = _SLOT * _SLOTS.index(slot)
    _page[start : start + len(text)] = text


def slot(page: mmap.mmap, name: str) -> str:
    """Returns the last note in a slot, or an empty string."""
    start = _SLOT * _SLOTS.index(name)
    return page[start : start + _SLOT].split(b"\0")[0].decode(errors="replace").strip()


def read(page: mmap.mmap) -> str:
    """Returns the last activities of the process that wrote the page, or an empty string."""
    return ", ".join(filter(None, (slot(page, name) for name in ("at", "image"))))


_NO_MEMORY = (
    "bad_alloc",
    "Cannot allocate memory",
    "Unable to allocate",
    "Resource temporarily unavailable",
    "ut of memory",
)
"""Parts of error messages of libraries that ran out of memory or threads."""


def crash_message(number: int, where: str, words: str, limit: str = "") -> str:
    """Returns the error message for a child process that was terminated by a signal.

    Args:
        number: Number of the signal.
        where: Last activity of the process, from ``read``.
        words: Output that libraries of the process wrote to stderr.
        limit: Memory limit of the process as text; empty if the process has no limit.
    """
    try:
        name = signal.Signals(number).name
    except ValueError:
        name = f"signal {number}"
    place = f" while {where}" if where else ""
    if any(text in words for text in _NO_MEMORY):
        most = f"the limit of {limit}" if limit else "this machine"
        return f"out of memory{place} ({name}): the file is damaged, or too large for {most}"
    if number == signal.SIGKILL:
        return f"killed{place} ({name}): most likely it takes more memory than there is"
    said = [line.strip() for line in words.splitlines() if line.strip()]
    more = f": {said[-1][:300]}" if said else ""
    return (
        f"a library crashed ({name}){place}{more}; most likely that file is damaged, or nested "
        "too deep (--isolate off shows the crash itself)"
    )
