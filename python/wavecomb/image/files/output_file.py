# SPDX-License-Identifier: Apache-2.0
"""Writes output files atomically. Unfinished files are in hidden folders."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import secrets
import shutil
import stat
import struct
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

_START, _END, _LOCK = ".wavecomb-", ".part", ".lock"

_YOUNG_S = 60.0
"""Seconds for which a private folder without a lock file is kept, since its owner may just be
creating it."""


class PrivateFolder:
    """A hidden folder next to an output file. The folder is locked while its owner process runs.

    The kernel releases the lock (flock) when the owner process ends, even after a crash. The id of
    the owner process would not suffice, since containers that share a disk can have processes with
    equal ids.

    Attributes:
        path: The folder.
    """

    def __init__(self, parent: Path) -> None:
        """Creates and locks a private folder.

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
            # Try again with a new lock file, since ``remove_abandoned`` has removed the file before
            # it was locked.
            os.close(self._lock)

    def close(self) -> None:
        """Removes the private folder and its content."""
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
    """Locks a file.

    Returns True on success, False if the file is locked, None without lock support.
    """
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
    """Removes private folders whose owner processes have ended without removing them.

    Keeps locked folders. On file systems without lock support, keeps all folders.
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


class Publisher(Protocol):
    """Interface that renames files for a process that lacks the permission to do so."""

    def is_own(self, target: Path) -> bool:
        """Returns whether this process may create and rename files in a file's folder."""

    def part_of(self, target: Path) -> Path:
        """Returns a temporary name for an output file."""

    def check(self, target: Path) -> None:
        """Raises OSError unless the output file can be written now."""

    def publish(self, part: Path, target: Path, *, durable: bool) -> None:
        """Renames the temporary file to the name of the output file."""


publisher: Publisher | None = None


def _publisher_of(target: Path) -> Publisher | None:
    return None if publisher is None or publisher.is_own(target) else publisher


def _target(path: str | os.PathLike[str]) -> Path:
    """Resolves symbolic links of a file name. Raises OSError if the file cannot be written."""
    check_name(path)
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(f"{os.fspath(path)}: is a folder; give a file name")
    if target.exists() and not target.is_file():
        raise OSError(f"{os.fspath(path)}: is not a regular file; give another name")
    if not target.parent.exists():
        raise FileNotFoundError(
            f"{os.fspath(path)}: the folder {target.parent} does not exist; make it first"
        )
    if not target.parent.is_dir():
        raise NotADirectoryError(f"{os.fspath(path)}: {target.parent} is not a folder")
    return target


def reason(error: OSError) -> str:
    """Returns the reason for an OSError, such as "Permission denied", or else the whole message."""
    return error.strerror or str(error)


_ENDINGS = (".exr", ".png", ".jpg", ".jpeg", ".html", ".learned")


def check_name(path: str | os.PathLike[str]) -> None:
    """Raises OSError with a one-line message if libraries cannot open a file of this name.

    USD and OpenImageIO require UTF-8 names and determine the format by the extension.
    """
    name = os.fspath(path)
    try:
        name.encode()
    except UnicodeEncodeError:
        raise OSError(f"{name}: the name is not UTF-8; rename the file or folder") from None
    if "\0" in name:
        raise OSError(f"{name}: the name holds a zero byte; give another name")
    last = os.path.basename(name)
    if last.lower() in _ENDINGS:
        raise OSError(f"{name}: is only an ending; give a name before it, such as image{last}")


def why_not_written(part: str | os.PathLike[str], said: str) -> str:
    """Returns the reason why a file could not be written: a full disk, or the library's message.

    Libraries do not report the operating system's error, so this function finds it by appending to
    the file.

    Args:
        part: The incomplete file.
        said: The library's error message.
    """
    try:
        with open(part, "ab", 0) as file:
            written = file.write(bytes(1 << 20))
            if written < 1 << 20:
                file.write(b"\0")
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            return "the disk is full, or its quota is used up; make space"
        if error.errno in (errno.EFBIG, errno.EIO, errno.EROFS):
            return reason(error)
    return said


def is_whole_png(path: str | os.PathLike[str]) -> bool:
    """Returns whether the chunks of a PNG file are complete."""
    with open(path, "rb") as file:
        end = os.fstat(file.fileno()).st_size
        place, kind = 8, b""
        while place + 12 <= end and kind != b"IEND":
            file.seek(place)
            length, kind = struct.unpack(">I4s", file.read(8))
            place += 12 + length
    return kind == b"IEND" and place == end


_KINDS = (
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def kind_of(path: str | os.PathLike[str]) -> str | None:
    """Returns the kind of a special file, such as "a FIFO", or None for regular files and folders.

    Opening a FIFO blocks until another process opens it for writing.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return None
    return next((kind for is_kind, kind in _KINDS if is_kind(mode)), None)


def check_regular(path: str | os.PathLike[str]) -> None:
    """Raises OSError with a one-line message for a special file (see ``kind_of``)."""
    kind = kind_of(path)
    if kind is not None:
        raise OSError(f"{os.fspath(path)}: is {kind}, not a regular file; give a regular file")


def one_line(message: str, name: str) -> str:
    """Converts a library's message to one line, without the file name, which the caller adds."""
    line = " ".join(message.replace(f'"{name}"', "it").split())
    return line.rstrip(".") or "unknown reason"


def problem_of(library: Any) -> str:
    """Returns the error message of OpenImageIO or of an OpenImageIO reader.

    The message may quote content of a damaged file, which may not be valid text.
    """
    try:
        return str(library.geterror())
    except UnicodeDecodeError:
        return "its header is damaged"


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raises OSError with a one-line message unless the file can be written now.

    Call this function before a long computation. The function creates missing folders. As a test,
    it also creates and removes a private folder next to the file.
    """
    check_name(path)
    target = Path(os.path.realpath(path))
    other = _publisher_of(target)
    is_missing = not target.parent.exists()
    try:
        if is_missing and other is None:
            target.parent.mkdir(parents=True, exist_ok=True)
        if not is_missing or other is None:
            _target(path)
        if other is not None:
            other.check(target)
            return
        PrivateFolder(target.parent).close()
    except OSError as error:
        why = reason(error)
        if other is not None and "cannot be written: " in why:
            raise OSError(why.replace(os.fspath(target), os.fspath(path))) from error
        raise OSError(f"{os.fspath(path)}: cannot be written: {why}") from error


def _sync(path: Path) -> None:
    """Flushes a file, or the entries of a folder, to disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def publish(part: Path, target: Path, *, durable: bool = False) -> None:
    """Renames a finished file.

    If the target is on another file system, copies the file there first.
    """
    if durable:
        _sync(part)
    try:
        os.replace(part, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        with PrivateFolder(target.parent) as folder:
            beside = folder.path / target.name
            shutil.copyfile(part, beside)
            if durable:
                _sync(beside)
            os.replace(beside, target)
    if durable:
        _sync(target.parent)


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = False) -> Iterator[Path]:
    """Yields a temporary file name, and renames the temporary file to ``path`` on success.

    The temporary file is in a private folder next to ``path``. On an exception the temporary file
    is removed and ``path`` remains unchanged. After a crash, ``path`` is also unchanged. The next
    call for a file in the same folder removes the private folder.

    Args:
        path: The file.
        durable: Whether to flush the file to disk before it is renamed, as a protection against
            power failures.

    >>> with replacing("/tmp/answer.txt") as part:
    ...     _ = part.write_text("42")
    """
    target = _target(path)
    other = _publisher_of(target)
    try:
        if other is not None:
            part = other.part_of(target)
            try:
                yield part
                other.publish(part, target, durable=durable)
            finally:
                with contextlib.suppress(OSError):
                    part.unlink()
            return
        remove_abandoned(target.parent)
        with PrivateFolder(target.parent) as folder:
            part = folder.path / target.name
            yield part
            publish(part, target, durable=durable)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(f"{os.fspath(path)}: cannot be written: {reason(error)}") from error


@contextlib.contextmanager
def replacing_all(paths: Iterable[str | os.PathLike[str]]) -> Iterator[list[Path]]:
    """Replaces several files. Renames the first file only after all files are written."""
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(replacing(path)) for path in paths]
