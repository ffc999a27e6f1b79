# SPDX-License-Identifier: Apache-2.0
"""A command in a child process: whatever kills it, the shell gets one line and exit code 2.

The parent forks before anything large is loaded, and then only waits: it hands signals on, and the
exit code back. The child has a process group of its own, so that a signal of the terminal, which
goes to a whole group, comes to it once.
"""

from __future__ import annotations

import io
import os
import signal
import socket
import sys
import threading
from typing import Any

from wavecomb.boot import end_with_parent
from wavecomb.run.isolate import box, trail
from wavecomb.run.isolate.broker import Broker, Client
from wavecomb.run.isolate.memory import limit_of

_PASSED_ON = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGUSR1,
    signal.SIGUSR2,
)
_WATCHED = {*_PASSED_ON, signal.SIGTSTP, signal.SIGCONT, signal.SIGCHLD}
CHATTER = (
    "libpng ",
    "failed call to posix_madvise",
    "UnicodeDecodeError: 'utf-8'",
)
"""What libraries print of files that they refuse, and USD of names that are no text; a warning
says it better."""
_NO_VALUE = "No to_python (by-value) converter"
"""What Boost.Python prints of a value that USD could not read."""


def is_wise() -> bool:
    """Whether a fork is safe and seen by no one: Linux, one thread, streams that are the process's.

    A program that calls the command line within itself is left as it is, and so is a developer
    (``WAVECOMB_DEBUG``), who wants to see a crash where it happens.
    """
    return (
        sys.platform == "linux"
        and not os.environ.get("WAVECOMB_DEBUG")
        and sys.stdout is sys.__stdout__
        and sys.stderr is sys.__stderr__
        and threading.active_count() == 1
        and len(os.listdir("/proc/self/task")) == 1
    )


def supervise() -> None:
    """Goes on in a child; the parent stays behind until that ends, and ends as it did.

    Contract: one thread. Returns in the child only.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    page, words = trail.new_page(), os.memfd_create("wavecomb-stderr", os.MFD_CLOEXEC)
    mine, its = socket.socketpair()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _WATCHED)
    chld = signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        mine.close()
        box.ask(client=Client(its))
        _become_expendable(parent, page, words)
        signal.signal(signal.SIGCHLD, chld)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return
    its.close()
    broker = Broker(child)
    threading.Thread(target=broker.serve, args=(mine,), daemon=True).start()
    try:
        status, sent = _wait(child)
    except BaseException:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    finally:
        broker.clean()
    _end(status, sent, page, words)


def _become_expendable(parent: int, page: int, words: int) -> None:
    os.setpgid(0, 0)
    # Of a group that is not the terminal's: writing there must not stop it.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    end_with_parent(parent)
    trail.follow(page)
    sys.excepthook = _print_exception
    # What is said in Python goes where it always went; what libraries write is kept for later.
    stderr = sys.stderr
    own = os.dup(2)
    os.dup2(words, 2)
    sys.stderr = io.TextIOWrapper(
        os.fdopen(own, "wb", 0),
        encoding=stderr.encoding,
        errors=stderr.errors,
        line_buffering=True,
        write_through=True,
    )


def _print_exception(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    if not str(error).startswith(_NO_VALUE):
        sys.__excepthook__(kind, error, trace)


def _wait(child: int) -> tuple[int, set[int]]:
    """(exit status, signals that were passed on)."""
    sent: set[int] = set()
    while True:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            return status, sent
        number = signal.sigwaitinfo(_WATCHED).si_signo
        if number == signal.SIGTSTP:  # Ctrl-Z: stop both, and go on together
            os.kill(child, signal.SIGSTOP)
            os.kill(os.getpid(), signal.SIGSTOP)
        elif number != signal.SIGCHLD:
            if number in _PASSED_ON:
                sent.add(number)
            os.kill(child, number)


def _end(status: int, sent: set[int], page: int, words: int) -> None:
    """Ends this process as the child ended, or with a line and code 2 where it crashed."""
    text = os.pread(words, 1 << 20, 0).decode(errors="replace")
    code = os.waitstatus_to_exitcode(status)
    if code < 0 and -code in sent:
        signal.signal(-code, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _WATCHED)
        os.kill(os.getpid(), -code)
    if code < 0:
        seen = trail.open_page(page)
        line = trail.obituary(-code, trail.read(seen), text, limit_of(seen))
        os.write(2, f"error: {' '.join(line.split())}\n".encode(errors="replace"))
        os._exit(2)
    rest = [line for line in text.splitlines(keepends=True) if not line.startswith(CHATTER)]
    os.write(2, "".join(rest).encode(errors="replace"))
    os._exit(code)
