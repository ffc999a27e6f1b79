# SPDX-License-Identifier: Apache-2.0
"""Hashes of files that a machine has read once: a worker that starts need not read them again."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import time
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.files import read_json, write_json

_FRESH_NS = 2_000_000_000
"""A file that changed so short a time before it was read may change again under one time stamp."""


class Hashes:
    """What is known of files on this machine, kept in a job's folder.

    A hash counts while size, time of change, inode and device of the file are what they were.
    """

    def __init__(self, folder: Path) -> None:
        """Reads what is known. ``folder``: the job's."""
        host = re.sub(r"[^A-Za-z0-9.-]", "-", socket.gethostname())[:64] or "host"
        self._file = folder / "hashes" / f"{host}.json"
        self._known: dict[str, Any] = {}
        with contextlib.suppress(OSError, WavecombError):
            found = read_json(self._file)
            self._known = found if isinstance(found, dict) else {}
        self._is_new = False

    def of(self, path: str) -> str:
        """SHA-256 of a file. Raises OSError."""
        from wavecomb.farm.assets import file_hash

        found = os.stat(path)
        stamp = [found.st_size, found.st_mtime_ns, found.st_ino, found.st_dev, found.st_ctime_ns]
        known = self._known.get(path)
        if isinstance(known, list) and known[:-1] == stamp:
            return str(known[-1])
        told = file_hash(path)
        changed = max(found.st_mtime_ns, found.st_ctime_ns)
        if time.time_ns() - changed > _FRESH_NS:
            self._known[path] = [*stamp, told]
            self._is_new = True
        return told

    def save(self) -> None:
        """Writes what is known, as far as there is room."""
        if self._is_new:
            with contextlib.suppress(OSError):
                self._file.parent.mkdir(exist_ok=True)
                write_json(self._file, self._known)
