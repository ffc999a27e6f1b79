# SPDX-License-Identifier: Apache-2.0
"""The one way from other threads to the window's; they hold and make no object of Qt's for it.

A thread puts a letter into a mailbox of plain Python and writes a byte to a socket. A notifier on
the window's thread sees the byte and hands the letters to whom they are for. No thread but the
window's takes a lock of Qt's: docs/decisions/window-threads.md says why that matters.
"""

from __future__ import annotations

import contextlib
import itertools
import socket
import weakref
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import shiboken6
from PySide6.QtCore import QCoreApplication, QObject, QSocketNotifier, QThread

Receive = Callable[[Any], None]


class Mailbox:
    """Letters from any thread to one. Knows nothing of Qt."""

    def __init__(self) -> None:
        self._letters: deque[tuple[int, Any]] = deque()
        self._reader, self._writer = socket.socketpair()
        self._reader.setblocking(False)
        self._writer.setblocking(False)

    def fileno(self) -> int:
        """Can be read where there are letters."""
        return self._reader.fileno()

    def put(self, address: int, letter: Any) -> None:
        """From any thread; waits for nothing."""
        self._letters.append((address, letter))
        self.wake()

    def wake(self) -> None:
        """Makes the reader look."""
        # A full socket is one that is going to be read anyway.
        with contextlib.suppress(OSError):
            self._writer.send(b"\0")

    def hush(self) -> None:
        """What was written until now is seen; letters that come later wake the reader again."""
        with contextlib.suppress(OSError):
            while self._reader.recv(4096):
                pass

    def take(self) -> tuple[int, Any] | None:
        """The oldest letter and its address; None: there is none."""
        return self._letters.popleft() if self._letters else None


class Port:
    """Where a thread sends what one receiver is to have. Plain Python: any thread may keep it."""

    __slots__ = ("_address", "_mailbox")

    def __init__(self, mailbox: Mailbox, address: int) -> None:
        self._mailbox, self._address = mailbox, address

    def send(self, letter: Any) -> None:
        """The receiver gets it on the window's thread, after what was sent before."""
        self._mailbox.put(self._address, letter)


class Bridge(QObject):
    """Hands letters to their receivers; one for an application, on its thread."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._mailbox = Mailbox()
        self._numbers = itertools.count()
        self._receivers: dict[int, weakref.ReferenceType[Any]] = {}
        self._notifier = QSocketNotifier(self._mailbox.fileno(), QSocketNotifier.Type.Read, self)
        self._notifier.activated.connect(self._deliver)

    def port(self, receive: Receive) -> Port:
        """A port whose letters go to a method; it is not kept alive by that."""
        address = next(self._numbers)
        forget = partial(_forget, self._receivers, address)
        self._receivers[address] = weakref.WeakMethod(receive, forget)
        return Port(self._mailbox, address)

    def _deliver(self, *_: object) -> None:
        self._mailbox.hush()
        while (letter := self._mailbox.take()) is not None:
            known = self._receivers.get(letter[0])
            receive = known() if known is not None else None
            if receive is None or not _is_there(receive.__self__):
                continue
            try:
                receive(letter[1])
            except BaseException:
                self._mailbox.wake()  # the others still have to get theirs
                raise


def _forget(receivers: dict[int, Any], address: int, reference: object) -> None:
    receivers.pop(address, None)


def _is_there(receiver: object) -> bool:
    """Whether Qt has not destroyed it."""
    return not isinstance(receiver, QObject) or shiboken6.isValid(receiver)


_bridge: Bridge | None = None


def port(receive: Receive) -> Port:
    """Where another thread sends what a method is to get on the window's; called on the window's.

    Args:
        receive: A bound method. Where its object has gone letters are dropped.
    """
    global _bridge
    application = QCoreApplication.instance()
    assert application is not None, "there is no application yet"
    assert QThread.currentThread() is application.thread(), "ports are made on the window's thread"
    if _bridge is None or not shiboken6.isValid(_bridge):
        _bridge = Bridge(application)
    return _bridge.port(receive)
