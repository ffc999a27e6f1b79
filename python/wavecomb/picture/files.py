# SPDX-License-Identifier: Apache-2.0
"""Output files, written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Protocol


class Publisher(Protocol):
    """Who gives files their names where this process may not."""

    def is_own(self, target: Path) -> bool:
        """Whether a file is in a folder that this process may do anything in."""

    def part_of(self, target: Path) -> Path:
        """Where to write what is to be a file."""

    def check(self, target: Path) -> None:
        """Raises OSError unless the file could be written now."""

    def publish(self, part: Path, target: Path, *, durable: bool) -> None:
        """Gives what was written its name."""


publisher: Publisher | None = None
owner: str = ""
"""Of temporary names, beside the number of the process, where processes of several machines write
to one folder: ``remove_leftovers`` leaves such files alone."""


def _publisher_of(target: Path) -> Publisher | None:
    return None if publisher is None or publisher.is_own(target) else publisher


def private_name(pid: int) -> str:
    """Folder beside its outputs that a process in a sandbox writes to."""
    return f".wavecomb.{pid}.part"


def _target(path: str | os.PathLike[str]) -> Path:
    """The file behind symbolic links; raises OSError where no file can be written."""
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


def _prefix(target: Path) -> str:
    """What temporary names begin with. Names stay short, and those of two files differ."""
    stem = os.fsencode(target.stem)
    return f".{target.stem if len(stem) <= 100 else hashlib.sha256(stem).hexdigest()[:32]}."


def _part(target: Path) -> Path:
    """The temporary name: hidden, in the same folder, with the same ending, of this process."""
    return target.with_name(f"{_prefix(target)}{owner}{os.getpid()}.part{target.suffix}")


def reason(error: OSError) -> str:
    """Why, in words: "Permission denied"; the whole message where there is no number."""
    return error.strerror or str(error)


def one_line(message: str, name: str) -> str:
    """A library's message in one line, without the file's name, which the caller gives."""
    line = " ".join(message.replace(f'"{name}"', "it").split())
    return line.rstrip(".") or "unknown reason"


def problem_of(library: Any) -> str:
    """What OpenImageIO, or one of its readers, says went wrong.

    It quotes what it finds in files, which need not be text.
    """
    try:
        return str(library.geterror())
    except UnicodeDecodeError:
        return "its header is damaged"


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raises OSError, in one line that names the file, unless it could be written now.

    To be called before long work: writes and removes an empty temporary file.
    """
    target = _target(path)
    other = _publisher_of(target)
    try:
        if other is not None:
            other.check(target)
            return
        part = _part(target)
        # There may be one: in a container each process can have the number of one that was killed.
        part.open("wb").close()
        part.unlink()
    except OSError as error:
        why = reason(error)
        if other is not None and "cannot be written: " in why:
            raise OSError(why.replace(os.fspath(target), os.fspath(path))) from error
        raise OSError(f"{os.fspath(path)}: cannot be written: {why}") from error


def remove_leftovers(target: Path) -> None:
    """Removes temporary files of ``target`` whose process is no more: it was killed."""
    ends = [(_prefix(target), f".part{target.suffix}"), (".wavecomb.", ".part")]
    for other in target.parent.iterdir():
        for start, end in ends:
            pid = other.name[len(start) : -len(end)]
            if other.name.startswith(start) and other.name.endswith(end) and pid.isdecimal():
                break
        else:
            continue
        if _is_running(int(pid)):
            continue
        with contextlib.suppress(OSError):
            if end == ".part" and other.is_dir() and not other.is_symlink():
                shutil.rmtree(other)
            else:
                other.unlink()


def _is_running(pid: int) -> bool:
    """Whether a process has this number; one that was killed but not yet waited for has not."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True  # it lives, and is another user's
    try:
        state = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
    except OSError:
        return True  # no Linux
    return state[:1] not in (["Z"], ["X"])


def _sync(path: Path) -> None:
    """Waits until a file, or what a folder says of its files, is on the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def publish(part: Path, target: Path, *, durable: bool = False) -> None:
    """Gives what was written its name; on another file system by a copy beside it."""
    if durable:
        _sync(part)
    try:
        os.replace(part, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        beside = _part(target)
        try:
            shutil.copyfile(part, beside)
            if durable:
                _sync(beside)
            os.replace(beside, target)
        finally:
            with contextlib.suppress(OSError):
                beside.unlink()
    if durable:
        _sync(target.parent)


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = False) -> Iterator[Path]:
    """Gives a temporary name beside ``path``; renames it to ``path`` if all went well.

    On any exception the temporary file is removed and ``path`` is as it was. A process that is
    killed leaves ``path`` as it was, too; what it left beside it goes with the next call.

    Args:
        path: The file.
        durable: Also where the machine fails: the file is on the disk before it gets its name.

    >>> with replacing("/tmp/answer.txt") as part:
    ...     _ = part.write_text("42")
    """
    target = _target(path)
    other = _publisher_of(target)
    part = _part(target) if other is None else other.part_of(target)
    try:
        if other is None:
            remove_leftovers(target)
        yield part
        if other is None:
            publish(part, target, durable=durable)
        else:
            other.publish(part, target, durable=durable)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(f"{os.fspath(path)}: cannot be written: {reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


@contextlib.contextmanager
def replacing_all(paths: Iterable[str | os.PathLike[str]]) -> Iterator[list[Path]]:
    """``replacing`` for several files: none is put in its place before all are written."""
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(replacing(path)) for path in paths]
