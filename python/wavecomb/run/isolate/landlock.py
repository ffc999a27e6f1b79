# SPDX-License-Identifier: Apache-2.0
"""Landlock, by its system calls: what files a process may open, and no TCP.

Numbers and bits are those of linux/landlock.h; the system calls have one number on all machines.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterable
from functools import cache

_CREATE, _ADD, _RESTRICT = 444, 445, 446
_VERSION = 1 << 0
_PATH_BENEATH = 1

EXECUTE = 1 << 0
WRITE_FILE = 1 << 1
READ_FILE = 1 << 2
READ_DIR = 1 << 3
REMOVE_DIR = 1 << 4
REMOVE_FILE = 1 << 5
MAKE_REG = 1 << 8
REFER = 1 << 13
TRUNCATE = 1 << 14
IOCTL_DEV = 1 << 15

OF_FILES = EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE | IOCTL_DEV
"""What a rule of a single file may say."""
READS = READ_FILE | READ_DIR
KEEPS = READS | WRITE_FILE | REMOVE_FILE | MAKE_REG | TRUNCATE
"""For folders in which files are made."""

_BITS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}
"""Version of the interface -> how many kinds of access it knows."""
_CONNECTS = 0b11
"""To bind and to connect TCP."""
_SCOPES = 0b11
"""Abstract sockets and signals, of processes outside."""


def _call(number: int, *arguments: object) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    result = int(libc.syscall(number, *arguments))
    if result < 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
    return result


@cache
def version() -> int:
    """The version of the interface that this system has; 0: none."""
    if sys.platform != "linux":
        return 0
    try:
        return _call(_CREATE, None, ctypes.c_size_t(0), ctypes.c_uint32(_VERSION))
    except OSError:
        return 0


def known(access: int) -> int:
    """The kinds of access among some that this system can refuse."""
    return access & ((1 << _BITS.get(version(), 16 if version() else 0)) - 1)


class Ruleset:
    """What is refused, but for what is allowed. Rulesets add up: each can only refuse more."""

    def __init__(self, refused: int, *, network: bool = False) -> None:
        """``refused``: kinds of access to files; ``network``: TCP and processes outside, too."""
        self._refused = known(refused)
        fields = [self._refused]
        if version() >= 4:
            fields.append(_CONNECTS if network else 0)
        if version() >= 6:
            fields.append(_SCOPES if network else 0)
        attributes = struct.pack(f"={len(fields)}Q", *fields)
        self.descriptor = _call(
            _CREATE, attributes, ctypes.c_size_t(len(attributes)), ctypes.c_uint32(0)
        )

    def allow(self, paths: Iterable[str | os.PathLike[str]], access: int) -> None:
        """Allows access to files, and to all that is in folders; passes by what is not there."""
        for path in paths:
            try:
                descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
            except (OSError, ValueError):
                continue
            try:
                allowed = access & self._refused
                if not os.path.isdir(path):
                    allowed &= OF_FILES
                if allowed:
                    rule = struct.pack("=Qi", allowed, descriptor)
                    _call(
                        _ADD, ctypes.c_int(self.descriptor), ctypes.c_int(_PATH_BENEATH), rule,
                        ctypes.c_uint32(0),
                    )  # fmt: skip
            finally:
                os.close(descriptor)

    def apply(self) -> None:
        """To this thread, and to those that it starts from now on."""
        no_new_privileges()
        _call(_RESTRICT, ctypes.c_int(self.descriptor), ctypes.c_uint32(0))
        self.close()

    def close(self) -> None:
        """Frees the descriptor."""
        os.close(self.descriptor)


def no_new_privileges() -> None:
    """No program that this process starts gets more rights than it has."""
    set_no_new_privs = 38
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(set_no_new_privs, 1, 0, 0, 0) != 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))


def drop_capabilities() -> None:
    """Leaves root, and who has some of its rights, with that to read any file. One thread."""
    version_3, read_search = 0x20080522, 1 << 2
    libc = ctypes.CDLL(None, use_errno=True)
    head = ctypes.create_string_buffer(struct.pack("=Ii", version_3, 0))
    data = ctypes.create_string_buffer(24)
    if libc.capget(head, data) != 0:
        return
    effective, permitted, _, *_ = struct.unpack("=6I", data.raw)
    kept = struct.pack("=6I", effective & read_search, permitted & read_search, 0, 0, 0, 0)
    libc.capset(head, ctypes.create_string_buffer(kept, 24))
