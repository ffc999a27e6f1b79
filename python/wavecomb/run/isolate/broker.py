# SPDX-License-Identifier: Apache-2.0
"""Who gives files their names: the parent of a process that may not.

A process in a sandbox writes into folders of its own, one beside each output. Landlock cannot allow
a folder without all that is below it; so it is the parent who renames, and only to the names that
it was told of before anything of a stage was read.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import stat
import struct
import tempfile
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wavecomb.picture import files

_HEAD = struct.Struct("=I")
_MOST = 1 << 28


@dataclass(frozen=True)
class Outputs:
    """What a process may write.

    Attributes:
        names: Files.
        parts: (folder, what names begin with, what they end in).
        trees: (folder, what names end in): anywhere below.
    """

    names: tuple[str, ...] = ()
    parts: tuple[tuple[str, str, str], ...] = ()
    trees: tuple[tuple[str, str], ...] = ()

    def resolved(self) -> Outputs:
        """With links followed."""
        real = os.path.realpath
        return Outputs(
            tuple(dict.fromkeys(map(real, self.names))),
            tuple((real(folder), start, end) for folder, start, end in self.parts),
            tuple((real(folder), end) for folder, end in self.trees),
        )

    def folders(self) -> list[str]:
        """Those that files go to."""
        named = [os.path.dirname(name) for name in self.names]
        named += [part[0] for part in self.parts] + [tree[0] for tree in self.trees]
        return list(dict.fromkeys(named))

    def allow(self, target: str) -> bool:
        """Whether a file, its links followed, is one of them."""
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
    """The next message; None: the other side is no more."""
    size = _exactly(channel, _HEAD.size)
    if size is None:
        return None
    (count,) = _HEAD.unpack(size)
    data = None if count > _MOST else _exactly(channel, count)
    return None if data is None else json.loads(data.decode("utf-8", "surrogatepass"))


def _exactly(channel: socket.socket, count: int) -> bytes | None:
    data = bytearray()
    while len(data) < count:
        more = channel.recv(min(count - len(data), 1 << 20))
        if not more:
            return None
        data += more
    return bytes(data)


@dataclass
class Broker:
    """The parent's side."""

    child: int
    outputs: Outputs | None = None
    private: dict[str, str] = field(default_factory=dict)
    """Folder -> the child's own folder in it; "": its temporary one."""

    def serve(self, channel: socket.socket) -> None:
        """Answers until the child is no more. On a thread of its own."""
        with contextlib.suppress(OSError, ValueError):
            while (message := _receive(channel)) is not None:
                _send(channel, self._answer(message))

    def _answer(self, message: Any) -> dict[str, Any]:
        try:
            kind, *arguments = message
            handlers: dict[str, Callable[..., Any]] = {
                "seal": self._seal, "check": self._check, "publish": self._publish,
            }  # fmt: skip
            return {"value": handlers[kind](*arguments)}
        except OSError as error:
            return {"number": error.errno, "why": error.strerror or str(error)}
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            return {"number": None, "why": f"the child asks for what is none: {error}"}

    def _seal(self, names: list[str], parts: list[Any], trees: list[Any]) -> dict[str, str]:
        """Learns what may be written, once; makes the folders. Gives them."""
        if self.outputs is not None:
            raise ValueError("it is said already")
        self.outputs = Outputs(
            tuple(map(str, names)),
            tuple((str(a), str(b), str(c)) for a, b, c in parts),
            tuple((str(a), str(b)) for a, b in trees),
        ).resolved()
        for folder in self.outputs.folders():
            own = os.path.join(folder, files.private_name(self.child))
            with contextlib.suppress(OSError):  # also where nothing is left to write
                files.remove_leftovers(Path(own))
            with contextlib.suppress(OSError):
                if os.path.isdir(own):  # of a process that had this number and was killed
                    shutil.rmtree(own)
                os.mkdir(own, 0o700)
                self.private[folder] = own
        with contextlib.suppress(OSError):
            from wavecomb.machine import temporary_folder

            self.private[""] = tempfile.mkdtemp(prefix="wavecomb-", dir=temporary_folder())
        return self.private

    def _target(self, path: str) -> str:
        target = os.path.realpath(path)
        if self.outputs is None or not self.outputs.allow(target):
            raise PermissionError(1, "it is no output of this command")
        return target

    def _check(self, path: str) -> None:
        target = self._target(path)
        try:
            files.check_writable(target)
        except OSError as error:
            # Whoever asked names the file.
            raise OSError(None, str(error).replace(target, path)) from error

    def _publish(self, part: str, path: str, durable: bool) -> None:
        """Gives a file of the child's own its name."""
        target = self._target(path)
        folder, name = os.path.split(part)
        if folder not in self.private.values() or name in ("", ".", ".."):
            raise PermissionError(1, "it is no file of the child's own")
        state = os.lstat(part)
        if not stat.S_ISREG(state.st_mode) or state.st_nlink != 1:
            raise PermissionError(1, "it is no regular file")
        if os.path.isdir(target) or (os.path.exists(target) and not os.path.isfile(target)):
            raise PermissionError(1, "it is no regular file")
        files.remove_leftovers(Path(target))
        files.publish(Path(part), Path(target), durable=durable)

    def clean(self) -> None:
        """Removes the child's own folders."""
        for folder in self.private.values():
            shutil.rmtree(folder, ignore_errors=True)


class Client:
    """The child's side: what ``wavecomb.picture.files`` asks. Any thread may call it."""

    def __init__(self, channel: socket.socket) -> None:
        self._channel = channel
        self._lock = threading.Lock()
        self._count = 0
        self.private: dict[str, str] = {}

    def _ask(self, *message: Any) -> Any:
        with self._lock:
            _send(self._channel, message)
            answer = _receive(self._channel)
        if answer is None:
            raise OSError("the parent of this process is no more")
        if "why" in answer:
            raise OSError(answer["number"], answer["why"])
        return answer["value"]

    def seal(self, outputs: Outputs) -> Iterable[str]:
        """Says what will be written; gives the folders that are this process's own."""
        self.private = self._ask("seal", outputs.names, outputs.parts, outputs.trees)
        return self.private.values()

    def temporary(self) -> str | None:
        """The folder for temporary files."""
        return self.private.get("")

    def is_own(self, target: Path) -> bool:
        """Whether a file is in one of those folders."""
        return str(target.parent) in self.private.values()

    def part_of(self, target: Path) -> Path:
        """Where to write what is to be a file."""
        folder = self.private.get(str(target.parent)) or self.private.get("")
        for tree, own in self.private.items():
            if tree and str(target.parent) not in self.private and target.is_relative_to(tree):
                folder = own
        if folder is None:
            raise PermissionError(13, "there is no folder to write to")
        with self._lock:
            self._count += 1
            return Path(folder) / f"{self._count}{target.suffix}"

    def check(self, target: Path) -> None:
        """Raises OSError unless the file could be written now."""
        self._ask("check", str(target))

    def publish(self, part: Path, target: Path, *, durable: bool) -> None:
        """Gives what was written its name."""
        self._ask("publish", str(part), str(target), durable)
