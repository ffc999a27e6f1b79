# SPDX-License-Identifier: Apache-2.0
"""Passes messages to the UI thread from threads that hold no Qt objects.

A thread puts a message into a plain Python mailbox and writes a byte to a socket. A socket notifier
on the window's thread sees the byte and passes the messages to their receivers. Only the UI thread
takes locks of Qt. The reason is in docs/decisions/window-threads.md.
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
    """Queue of messages that any thread may send to one thread. The queue is independent of Qt."""

    def __init__(self) -> None:
        self._letters: deque[tuple[int, Any]] = deque()
        self._reader, self._writer = socket.socketpair()
        self._reader.setblocking(False)
        self._writer.setblocking(False)

    def fileno(self) -> int:
        """Returns a file descriptor that is readable while the queue has messages."""
        return self._reader.fileno()

    def put(self, address: int, letter: Any) -> None:
        """Adds a message; any thread may call this method, which does not block."""
        self._letters.append((address, letter))
        self.wake()

    def wake(self) -> None:
        """Wakes the thread that reads the queue."""
        # Ignore the error if the socket's buffer is full, since its unread bytes already wake the
        # reading thread.
        with contextlib.suppress(OSError):
            self._writer.send(b"\0")

    def hush(self) -> None:
        """Removes all bytes that were written so far to wake the reading thread.

        Messages that are sent later wake the reading thread again.
        """
        with contextlib.suppress(OSError):
            while self._reader.recv(4096):
                pass

    def take(self) -> tuple[int, Any] | None:
        """Removes the oldest message and returns it with the address of its receiver.

        Returns None if there is no message.
        """
        return self._letters.popleft() if self._letters else None


class Port:
    """Sender of messages to one receiver.

    Senders are plain Python objects, so any thread may hold one.
    """

    __slots__ = ("_address", "_mailbox")

    def __init__(self, mailbox: Mailbox, address: int) -> None:
        self._mailbox, self._address = mailbox, address

    def send(self, letter: Any) -> None:
        """Sends a message to the receiver.

        The receiver gets messages in order, on the window's thread.
        """
        self._mailbox.put(self._address, letter)


class Bridge(QObject):
    """Dispatcher of messages to receivers; the application has one, on the thread of the window."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._mailbox = Mailbox()
        self._numbers = itertools.count()
        self._receivers: dict[int, weakref.ReferenceType[Any]] = {}
        self._notifier = QSocketNotifier(self._mailbox.fileno(), QSocketNotifier.Type.Read, self)
        self._notifier.activated.connect(self._deliver)

    def port(self, receive: Receive) -> Port:
        """Creates a port that sends to a bound method, without keeping the object alive."""
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
                # Wake the mailbox, so that it delivers the remaining messages later.
                self._mailbox.wake()
                raise


def _forget(receivers: dict[int, Any], address: int, reference: object) -> None:
    receivers.pop(address, None)


def _is_there(receiver: object) -> bool:
    """Returns whether the Qt object that owns the receiving method still exists."""
    return not isinstance(receiver, QObject) or shiboken6.isValid(receiver)


_bridge: Bridge | None = None


def port(receive: Receive) -> Port:
    """Creates a port through which other threads send messages to the window's thread.

    ``port`` must be called on the window's thread.

    Args:
        receive: A bound method that is called with each message. Messages are dropped after the
            object that owns the method is deleted.
    """
    global _bridge
    application = QCoreApplication.instance()
    assert application is not None, "there is no application yet"
    assert QThread.currentThread() is application.thread(), "ports are made on the window's thread"
    if _bridge is None or not shiboken6.isValid(_bridge):
        _bridge = Bridge(application)
    return _bridge.port(receive)
