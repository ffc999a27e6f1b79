# SPDX-License-Identifier: Apache-2.0
"""Output files of a sandboxed process, which must not write to the folders of these files.

The sandboxed process writes a file into its private folder and then asks its parent process to move
it. The parent process derives the permitted output files from the command line, and moves no other
files.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import stat
import struct
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb.image.files import output_file
from wavecomb.image.files.output_file import remove_abandoned

_HEAD = struct.Struct("=I")
_MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class Outputs:
    """Output files that a command may write.

    Attributes:
        names: File names.
        parts: Folder, prefix and suffix of files with a number between prefix and suffix.
        trees: Folder and suffix of files that may be anywhere below the folder.
    """

    names: tuple[str, ...] = ()
    parts: tuple[tuple[str, str, str], ...] = ()
    trees: tuple[tuple[str, str], ...] = ()

    def resolved(self) -> Outputs:
        """Returns a copy in which the symbolic links of all paths are resolved."""
        real = os.path.realpath
        return Outputs(
            tuple(dict.fromkeys(map(real, self.names))),
            tuple((real(folder), start, end) for folder, start, end in self.parts),
            tuple((real(folder), end) for folder, end in self.trees),
        )

    def folders(self) -> list[str]:
        """Returns the folders that contain the output files."""
        named = [os.path.dirname(name) for name in self.names]
        named += [part[0] for part in self.parts] + [tree[0] for tree in self.trees]
        return list(dict.fromkeys(named))

    def allow(self, target: str) -> bool:
        """Returns whether a path, with symbolic links resolved, is a permitted output file."""
        folder, name = os.path.split(target)
        return (
            target in self.names
            or any(
                folder == where and name.startswith(start) and name.endswith(end)
                for where, start, end in self.parts
            )
            or any(
                name.endswith(end) and os.path.commonpath([where, target]) == where
                for where, end in self.trees
            )
        )


def _send(channel: socket.socket, message: Any) -> None:
    data = json.dumps(message).encode("utf-8", "surrogatepass")
    channel.sendall(_HEAD.pack(len(data)) + data)


def _receive(channel: socket.socket) -> Any:
    """Returns the next message.

    Returns None if the other process has ended or the message is too large.
    """
    size = _exactly(channel, _HEAD.size)
    if size is None:
        return None
    (count,) = _HEAD.unpack(size)
    data = None if count > _MAX_BYTES else _exactly(channel, count)
    return None if data is None else json.loads(data.decode("utf-8", "surrogatepass"))


def _exactly(channel: socket.socket, count: int) -> bytes | None:
    data = bytearray()
    while len(data) < count:
        more = channel.recv(count - len(data))
        if not more:
            return None
        data += more
    return bytes(data)


class Mover:
    """Object in the parent process that moves finished files from the private folder."""

    def __init__(self, outputs: Outputs, private: Path) -> None:
        """Stores the permitted output files and the private folder of the child process."""
        self._outputs = outputs.resolved()
        self._private = private

    def serve(self, channel: socket.socket) -> None:
        """Answers requests of the child process until it ends.

        Call this method on a separate thread.
        """
        with contextlib.suppress(OSError, ValueError):
            while (message := _receive(channel)) is not None:
                _send(channel, self._answer(message))

    def _answer(self, message: Any) -> dict[str, Any]:
        try:
            kind, *arguments = message
            if kind == "check":
                self._check(*arguments)
            elif kind == "move":
                self._move(*arguments)
            else:
                raise ValueError(f"unknown request {kind!r}")
        except OSError as error:
            return {"number": error.errno, "why": error.strerror or str(error)}
        except (ValueError, TypeError, AttributeError) as error:
            return {"number": None, "why": f"invalid request: {error}"}
        return {}

    def _target(self, path: str) -> Path:
        target = os.path.realpath(path)
        if not self._outputs.allow(target):
            raise PermissionError(1, "not an output of this command")
        return Path(target)

    def _check(self, path: str) -> None:
        target = self._target(path)
        try:
            output_file.check_writable(target)
        except OSError as error:
            raise OSError(None, str(error).replace(str(target), path)) from error

    def _move(self, name: str, path: str, durable: bool) -> None:
        target = self._target(path)
        if os.path.basename(name) != name or name in ("", ".", ".."):
            raise PermissionError(1, "not a file of the private folder")
        part = self._private / name
        state = os.lstat(part)
        if not stat.S_ISREG(state.st_mode) or state.st_nlink != 1:
            raise PermissionError(1, "not a regular file")
        if target.exists() and not target.is_file():
            raise PermissionError(1, "not a regular file")
        remove_abandoned(target.parent)
        output_file.publish(part, target, durable=durable)


class Client:
    """Client in the child process, for ``wavecomb.image.files.output_file``.

    The class is thread-safe.
    """

    def __init__(self, channel: socket.socket, private: Path) -> None:
        """Stores the socket to the parent process and the private folder."""
        self._channel = channel
        self._private = private
        self._lock = threading.Lock()
        self._count = 0

    def _ask(self, *message: Any) -> None:
        with self._lock:
            _send(self._channel, message)
            answer = _receive(self._channel)
        if answer is None:
            raise OSError("the parent process has ended")
        if "why" in answer:
            raise OSError(answer["number"], answer["why"])

    def is_own(self, target: Path) -> bool:
        """Returns whether a file is in the private folder."""
        return target.is_relative_to(self._private)

    def part_of(self, target: Path) -> Path:
        """Returns a temporary name in the private folder for an output file."""
        with self._lock:
            self._count += 1
            return self._private / f"{self._count}{target.suffix}"

    def check(self, target: Path) -> None:
        """Raises OSError if the output file cannot be written now."""
        self._ask("check", str(target))

    def publish(self, part: Path, target: Path, *, durable: bool) -> None:
        """Moves a finished file from the private folder to its final name."""
        self._ask("move", part.name, str(target), durable)
