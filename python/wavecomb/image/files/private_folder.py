# SPDX-License-Identifier: Apache-2.0
"""Hidden folders for unfinished files."""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
import shutil
import time
from pathlib import Path
from types import TracebackType

_START, _END, _LOCK = ".wavecomb-", ".part", ".lock"

_YOUNG_S = 60.0
"""Seconds for which a folder without a lock file is kept, since it may just be created."""


class PrivateFolder:
    """A hidden folder next to an output file, which is locked while its owner runs.

    The kernel releases the lock (flock) when the owner ends for any reason. A process id would not
    work, since containers that share a disk may have processes with the same id.

    Attributes:
        path: The folder.
    """

    def __init__(self, parent: Path) -> None:
        """Creates and locks the folder.

        Args:
            parent: Folder of the output file.

        Raises:
            OSError: The folder cannot be created.
        """
        while True:
            self.path = parent / f"{_START}{secrets.token_hex(6)}{_END}"
            self.path.mkdir(mode=0o700)
            try:
                self._lock = os.open(
                    self.path / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600
                )
            except OSError:
                with contextlib.suppress(OSError):
                    self.path.rmdir()
                raise
            if _try_lock(self._lock) is not False and _is_linked(self._lock):
                return
            # ``remove_abandoned`` removed the file before it was locked.
            os.close(self._lock)

    def close(self) -> None:
        """Removes the folder and its content."""
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)

    def __enter__(self) -> PrivateFolder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _try_lock(descriptor: int) -> bool | None:
    """Locks a file: returns True on success, False if it is locked, None without lock support."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _is_linked(descriptor: int) -> bool:
    return os.fstat(descriptor).st_nlink > 0


def remove_abandoned(parent: Path) -> None:
    """Removes private folders whose owners have ended without cleaning up.

    Keeps locked folders, and all folders on file systems without locks.
    """
    for folder in parent.glob(f"{_START}*{_END}"):
        with contextlib.suppress(OSError):
            if folder.is_symlink() or not folder.is_dir():
                continue
            try:
                lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
            except FileNotFoundError:
                if time.time() - folder.stat().st_mtime > _YOUNG_S:
                    shutil.rmtree(folder)
                continue
            try:
                if _try_lock(lock):
                    shutil.rmtree(folder)
            finally:
                os.close(lock)
