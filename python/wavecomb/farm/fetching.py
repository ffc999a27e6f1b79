# SPDX-License-Identifier: Apache-2.0
"""Files of a stage that travel with its job: copied into its folder, and from there to workers.

    files/12/12ab...    in the job's folder, by their SHA-256
    CACHE/files/12/12ab...    what this machine fetched, for all jobs
    CACHE/jobs/ID/share/shot.usd    the same files under the names that the stage has for them

A worker that has a job's files where they are named uses these. One that lacks any of them uses
the tree in its cache: relative names lead to files beside, and absolute ones are mapped into it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError

_BLOCK = 1 << 20
_OLD_S = 24 * 3600.0
"""Of a copy that somebody who is no more had begun."""


def cache_folder() -> Path:
    """Where this machine keeps what it fetched: $WAVECOMB_CACHE, or in the user's cache."""
    given = os.environ.get("WAVECOMB_CACHE")
    if given:
        return Path(given) / "farm"
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base) / "wavecomb" / "farm"


def store_name(files: Path, sha256: str) -> Path:
    """Where a file lies in a store."""
    return files / sha256[:2] / sha256


def copy_into(store: Path, source: str | os.PathLike[str], sha256: str) -> bool:
    """Copies a file into a store by its content, whole or not at all; False: it was there.

    Raises:
        WavecombError: It is not what its hash says.
        OSError: It cannot be read or written.
    """
    target = store_name(store, sha256)
    if target.exists():
        return False
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{os.getpid()}-{os.urandom(4).hex()}.part")
    told = hashlib.sha256()
    try:
        with Path(source).open("rb") as read, part.open("xb") as written:
            while block := read.read(_BLOCK):
                told.update(block)
                written.write(block)
        if told.hexdigest() != sha256:
            raise WavecombError(f"{os.fspath(source)}: changed while it was copied, or is damaged")
        os.replace(part, target)
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
    return True


def pack(folder: Path, files: Sequence[Mapping[str, Any]]) -> int:
    """Copies the files of a stage into a job's folder; how many bytes.

    Args:
        folder: The job's.
        files: Of ``list_assets``.
    """
    store = folder / "files"
    return sum(int(one["bytes"]) for one in files if copy_into(store, one["path"], one["sha256"]))


def fetch(folder: Path, job: str, files: Sequence[Mapping[str, Any]]) -> Path:
    """The tree with the files of a job, on this machine.

    Args:
        folder: The job's.
        job: Its id.
        files: Of ``list_assets``, with absolute names.

    Raises:
        WavecombError: A file of the job is damaged.
        OSError: One is not there, or there is no room.
    """
    cache = cache_folder()
    tree = cache / "jobs" / job
    for one in files:
        path = os.path.normpath(one["path"])
        if not os.path.isabs(path):
            raise WavecombError(f"{one['path']}: is no absolute name")
        store = cache / "files"
        with contextlib.suppress(OSError):
            _sweep(store_name(store, one["sha256"]).parent)
        copy_into(store, store_name(folder / "files", one["sha256"]), one["sha256"])
        target = tree / path.lstrip("/")
        if target.exists():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):  # another worker was quicker
            os.link(store_name(store, one["sha256"]), target)
    return tree


def _sweep(folder: Path) -> None:
    """Removes copies that nobody ended."""
    for file in folder.glob(".*.part"):
        with contextlib.suppress(OSError):
            if time.time() - file.stat().st_mtime > _OLD_S:
                file.unlink()
