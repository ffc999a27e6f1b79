# SPDX-License-Identifier: Apache-2.0
"""What an expendable process is at, in memory that outlives it: a page shared with its parent."""

from __future__ import annotations

import mmap
import os
import signal

_SLOT = 1024
_SLOTS = ("at", "image", "limit")
_page: mmap.mmap | None = None


def new_page() -> int:
    """A descriptor of a page for both processes; it has no name, so nothing is left of it."""
    descriptor = os.memfd_create("wavecomb-trail", os.MFD_CLOEXEC)
    os.ftruncate(descriptor, _SLOT * len(_SLOTS))
    return descriptor


def open_page(descriptor: int) -> mmap.mmap:
    """The page of a descriptor."""
    return mmap.mmap(descriptor, _SLOT * len(_SLOTS))


def follow(descriptor: int) -> None:
    """Makes this process note what it is at; from here on it is expendable."""
    global _page
    _page = open_page(descriptor)


def is_expendable() -> bool:
    """Whether this process has a parent that lives on when it dies, and says why it did."""
    return _page is not None


def note(what: str, place: object = "", slot: str = "at") -> None:
    """Notes what begins now. Costs nothing where nobody would read it.

    Args:
        what: As in "it crashed while ...".
        place: Prim or file.
        slot: "at", "image" for what a thread beside does, or "limit" of memory in MB.
    """
    if _page is None:
        return
    text = f"{what} {place}".encode(errors="replace")[: _SLOT - 1] + b"\0"
    start = _SLOT * _SLOTS.index(slot)
    _page[start : start + len(text)] = text


def slot(page: mmap.mmap, name: str) -> str:
    """What the other process noted last in a slot, "" where it noted nothing."""
    start = _SLOT * _SLOTS.index(name)
    return page[start : start + _SLOT].split(b"\0")[0].decode(errors="replace").strip()


def read(page: mmap.mmap) -> str:
    """What the other process was at last, "" where it noted nothing."""
    return ", ".join(filter(None, (slot(page, name) for name in ("at", "image"))))


_NO_MEMORY = (
    "bad_alloc",
    "Cannot allocate memory",
    "Unable to allocate",
    "Resource temporarily unavailable",
    "ut of memory",
)
"""How libraries say that there was no memory, for threads too."""


def obituary(number: int, where: str, words: str, limit: str = "") -> str:
    """One line on a process that died of a signal.

    Args:
        number: Of the signal.
        where: As ``read`` gave it.
        words: What its libraries wrote to stderr.
        limit: Of its memory, in words.
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
