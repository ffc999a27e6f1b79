# SPDX-License-Identifier: Apache-2.0
"""Messages between the process that reads a stage and the one that asked for it.

A message is a head (its length as 4 bytes, then JSON) and the bytes of its arrays, one after the
other, as the head describes them. Nothing that comes is run: no pickle, no names of modules. Who
receives takes any byte for one that was chosen to harm: lengths, types and shapes are checked
before there is memory for them, and their sum is limited.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import struct
import threading
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LENGTH = struct.Struct("=I")
MOST_HEAD = 1 << 30
"""Bytes of a head: names of millions of instances."""
MOST_ARRAYS = 4096
_MOST_NESTING = 64
_BUFFER = 1 << 18
_KEPT = 1 << 12
"""Arrays of fewer bytes are sent again rather than remembered."""

TYPES = ("|u1", "<f2", "<f4", "<f8", "<i4", "<u4", "<i8", "<u8")
"""Types of arrays, as NumPy writes them."""

Array = NDArray[Any]


class Refused(Exception):
    """What came is no message, or not what may come; says why in a few words."""


@dataclass
class Message:
    """What was sent: a kind, JSON of so many bytes, and arrays that it names by their numbers."""

    kind: str
    body: dict[str, Any] = field(default_factory=dict)
    arrays: list[Array] = field(default_factory=list)
    size: int = 0


def packed(value: Any, arrays: list[Array]) -> Any:
    """A value as JSON has it; arrays and bytes are put with the others, and their number here."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, bytes):
        arrays.append(np.frombuffer(value, np.uint8))
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): packed(entry, arrays) for key, entry in value.items()}
    if hasattr(value, "__fspath__"):
        return value.__fspath__()
    if hasattr(value, "__iter__"):
        return [packed(entry, arrays) for entry in value]
    if hasattr(value, "__float__"):
        return float(value)
    raise TypeError(f"{type(value).__name__} cannot be sent to another process")


class Sender:
    """Writes messages. Any thread may send.

    Arrays that are to be remembered, and are the same objects still in the frame after, are named
    by their numbers there.
    """

    def __init__(self, channel: socket.socket) -> None:
        self._file = channel.makefile("wb", _BUFFER)
        self._lock = threading.Lock()
        self._count = 0
        self._known: dict[int, tuple[weakref.ref[Array], int]] = {}
        self._used: dict[int, tuple[weakref.ref[Array], int]] = {}

    def send(
        self, kind: str, body: Mapping[str, Any], *, flush: bool = True, remember: bool = False
    ) -> None:
        """Sends what ``packed`` takes. Raises OSError where nobody listens."""
        found: list[Array] = []
        packed_body = packed(body, found)
        with self._lock:
            described, blobs = [], []
            for array in found:
                entry, blob = self._describe(array, remember)
                described.append(entry)
                if blob is not None:
                    blobs.append(blob)
            head = {"kind": kind, "body": packed_body, "arrays": described}
            data = json.dumps(head, separators=(",", ":")).encode()
            self._file.write(_LENGTH.pack(len(data)))
            self._file.write(data)
            for blob in blobs:
                if blob.nbytes:
                    self._file.write(blob.reshape(-1).view(np.uint8).data)
            if flush:
                self._file.flush()

    def _describe(self, array: Array, remember: bool) -> tuple[list[Any], Array | None]:
        """The entry of an array in the head, and its bytes, unless they are there."""
        entry: list[Any] = [array.dtype.newbyteorder("=").str, list(array.shape)]
        if not remember or array.nbytes < _KEPT:
            return entry, np.ascontiguousarray(array)
        before = self._used.get(id(array)) or self._known.get(id(array))
        if before is not None and before[0]() is array:
            self._used[id(array)] = before
            return [*entry, before[1], True], None
        self._count += 1
        self._used[id(array)] = weakref.ref(array), self._count
        return [*entry, self._count, False], np.ascontiguousarray(array)

    def end_frame(self) -> None:
        """Forgets, as who receives does, the arrays that the frame did not use."""
        self._known, self._used = self._used, {}

    def close(self) -> None:
        """Lets go of the channel."""
        with contextlib.suppress(OSError, ValueError):
            self._file.close()


class Receiver:
    """Reads messages of who is not trusted.

    Attributes:
        limit: Bytes that all that is received and not given back may take.
        held: Bytes that count towards it.
    """

    def __init__(self, channel: socket.socket, limit: int | None = None) -> None:
        self._file = channel.makefile("rb", _BUFFER)
        self.limit = limit
        self.held = 0
        self._known: dict[int, Array] = {}
        self._used: dict[int, Array] = {}

    def receive(self) -> Message | None:
        """The next message; None: the other side ended between two.

        Raises:
            Refused: It is none.
            MemoryError: It would take more than the limit.
        """
        start = self._file.read(_LENGTH.size)
        if not start:
            return None
        if len(start) < _LENGTH.size:
            raise Refused("a message that ends in its length")
        (length,) = _LENGTH.unpack(start)
        if length > MOST_HEAD:
            raise Refused(f"a head of {length:,} bytes")
        # JSON as objects is some times as large, for a moment; names and numbers in it stay.
        self._allow(8 * length)
        self.held += length
        text = self._file.read(length)
        if len(text) < length:
            raise Refused("a message that ends in its head")
        kind, body, entries = _parsed(text)
        return Message(kind, body, [self._array(entry) for entry in entries], length)

    def _allow(self, more: int) -> None:
        if self.limit is not None and self.held + more > self.limit:
            raise MemoryError

    def _array(self, entry: Any) -> Array:
        dtype, shape, number, is_known = _checked_entry(entry)
        if is_known:
            known = self._used.get(number, self._known.get(number))
            if known is None or known.dtype != dtype or list(known.shape) != shape:
                raise Refused(f"array {number}, which never came like this")
            self._used[number] = known
            return known
        size = math.prod(shape) * dtype.itemsize
        self._allow(size)
        self.held += size
        array = np.empty(shape, dtype)
        if size and self._read_into(array.reshape(-1).view(np.uint8).data) < size:
            raise Refused("a message that ends in its arrays")
        if number >= 0:
            self._used[number] = array
        return array

    def _read_into(self, view: memoryview) -> int:
        done = 0
        while done < len(view):
            more = self._file.readinto(view[done:])  # type: ignore[attr-defined]
            if not more:
                break
            done += more
        return done

    def give_back(self, size: int) -> None:
        """Says that so many bytes are no longer held."""
        self.held = max(0, self.held - size)

    def end_frame(self) -> None:
        """Forgets the arrays that the frame did not use."""
        self._known, self._used = self._used, {}
        self.held = sum(array.nbytes for array in self._known.values())

    def close(self) -> None:
        """Lets go of the channel."""
        self._file.close()


def _parsed(text: bytes) -> tuple[str, dict[str, Any], list[Any]]:
    """Kind, body and arrays of a head."""
    try:
        head = json.loads(text)
    except (ValueError, RecursionError):
        raise Refused("a head that is no JSON") from None
    if not isinstance(head, dict) or set(head) != {"kind", "body", "arrays"}:
        raise Refused("a head without kind, body and arrays")
    kind, body, entries = head["kind"], head["body"], head["arrays"]
    if not (isinstance(kind, str) and isinstance(body, dict) and isinstance(entries, list)):
        raise Refused("a head with other things for kind, body and arrays")
    if len(entries) > MOST_ARRAYS:
        raise Refused(f"a message of {len(entries):,} arrays")
    _check_nesting(body)
    return kind, body, entries


def _check_nesting(body: Any) -> None:
    level: list[Any] = [body]
    for _ in range(_MOST_NESTING):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                inner += [v for v in value.values() if isinstance(v, (dict, list))]
            else:
                inner += [v for v in value if isinstance(v, (dict, list))]
        if not inner:
            return
        level = inner
    raise Refused("a body that is nested too deep")


def _checked_entry(entry: Any) -> tuple[np.dtype[Any], list[int], int, bool]:
    """Type, shape, number (-1: none) and whether it is there already, of an array in a head."""
    if not isinstance(entry, list) or len(entry) not in (2, 4):
        raise Refused("an array that is not described")
    name, shape, number, is_known = (*entry, -1, False)[:4]
    if name not in TYPES:
        raise Refused(f"an array of type {str(name)[:32]!r}")
    if not is_shape(shape):
        raise Refused("an array of an impossible shape")
    if type(number) is not int or not -1 <= number < 1 << 53:
        raise Refused("an array with an impossible number")
    if type(is_known) is not bool or (is_known and number < 0):
        raise Refused("an array that is not described")
    return np.dtype(name), shape, number, is_known


def is_shape(value: Any) -> bool:
    """Whether a value is a shape of at most 5 dimensions and 2^53 values."""
    return (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and len(value) <= 5
        and all(type(edge) is int and 0 <= edge < 1 << 53 for edge in value)
        and math.prod(max(edge, 1) for edge in value) < 1 << 53
    )
