# SPDX-License-Identifier: Apache-2.0
"""Output files, written whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path


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


def _part(target: Path) -> Path:
    """The temporary name: hidden, in the same folder, with the same ending, of this process."""
    return target.with_name(f".{target.stem[:100]}.{os.getpid()}.part{target.suffix}")


def reason(error: OSError) -> str:
    """Why, in words: "Permission denied"; the whole message where there is no number."""
    return error.strerror or str(error)


def one_line(message: str, name: str) -> str:
    """A library's message in one line, without the file's name, which the caller gives."""
    line = " ".join(message.replace(f'"{name}"', "it").split())
    return line.rstrip(".") or "unknown reason"


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raises OSError, in one line that names the file, unless it could be written now.

    To be called before long work: writes and removes an empty temporary file.
    """
    target = _target(path)
    part = _part(target)
    try:
        part.open("xb").close()
        part.unlink()
    except OSError as error:
        raise OSError(f"{os.fspath(path)}: cannot be written: {reason(error)}") from error


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Gives a temporary name beside ``path``; renames it to ``path`` if all went well.

    On any exception the temporary file is removed and ``path`` is as it was.

    >>> with replacing("/tmp/answer.txt") as part:
    ...     _ = part.write_text("42")
    """
    target = _target(path)
    part = _part(target)
    try:
        yield part
        os.replace(part, target)
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
