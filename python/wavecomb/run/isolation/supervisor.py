# SPDX-License-Identifier: Apache-2.0
"""Runs a command in a child process, so that a crash gives one message and exit code 2.

The parent only waits; it forwards signals to the child and returns its exit code. With a sandbox
the child is a new Python process that parses the same command line. Without a sandbox the child is
a fork that is made before large modules are loaded. The child always has a separate process group.
A signal from the terminal goes to a whole process group, so the child receives the signal only
once, from the parent.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb import processes, terminal
from wavecomb.boot import end_with_parent
from wavecomb.errors import WavecombError
from wavecomb.image.files import output_file
from wavecomb.image.files.output_file import PrivateFolder, remove_abandoned
from wavecomb.run.isolation import memory, progress_notes, sandbox
from wavecomb.run.isolation.outputs import Client, Mover, Outputs

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
"""Beginnings of library messages that are hidden, since a Wavecomb warning reports the same
problem."""
_NO_VALUE = "No to_python (by-value) converter"
"""Boost.Python's message for a USD value that Python cannot read."""


COMMAND = "from wavecomb.cli import main; main(prog_name='wavecomb')"
"""Python code that the sandboxed child runs."""

_CHILD = """import sys
from wavecomb.run.isolation.supervisor import become_child
become_child(sys.argv.pop(1))
"""


@dataclass
class Choices:
    """Command line options for the child process.

    Attributes:
        isolate: Value of ``--isolate``, which is "auto", "on" or "off".
        sandbox: ``--sandbox``, one of ``sandbox.MODES``.
        reads: Folders of ``--sandbox-read``.
        words: Arguments of the command line.
    """

    isolate: str = "off"
    sandbox: str = "auto"
    reads: tuple[str, ...] = ()
    words: tuple[str, ...] = ()


choices = Choices()
_is_child = False


def can_fork() -> bool:
    """Returns whether a fork is safe.

    A fork needs Linux, a single thread and unredirected standard streams. This excludes programs
    with threads or redirected output that call the command line in-process. If ``WAVECOMB_DEBUG``
    is set, the result is False, so that developers can debug the crash itself.
    """
    return (
        sys.platform == "linux"
        and not os.environ.get("WAVECOMB_DEBUG")
        and sys.stdout is sys.__stdout__
        and sys.stderr is sys.__stderr__
        and threading.active_count() == 1
        and len(os.listdir("/proc/self/task")) == 1
    )


def enter(outputs: Outputs, *, gpu: bool = False) -> None:
    """Continues the command in a child process, before it reads any untrusted file.

    In the parent this function ends the process when the child has ended. In the child, or if no
    child is started, the function returns.

    Args:
        outputs: Files that the command may write.
        gpu: Whether the command uses GPU devices.

    Raises:
        WavecombError: ``--sandbox on`` or ``--memory-limit`` cannot be applied.
    """
    if not _is_child:
        with_child = choices.isolate == "on" or (choices.isolate == "auto" and can_fork())
        if not with_child and choices.sandbox == "on":
            raise WavecombError("--sandbox on: there is no child process; leave --isolate off out")
        if with_child and choices.sandbox != "off":
            why_not = sandbox.obstacle()
            if why_not is None:
                run_in_sandbox(outputs, gpu=gpu)
            if choices.sandbox == "on":
                raise WavecombError(f"--sandbox on: {why_not}")
        if with_child:
            supervise()
    memory.apply_limit()


def supervise() -> None:
    """Forks; the child returns from this function, and the parent exits with the child's status.

    Contract: the process has one thread.
    """
    global _is_child
    terminal.flush_streams()
    page, words = progress_notes.new_page(), _memory_file("stderr")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _WATCHED)
    chld = signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        _is_child = True
        _become_expendable(parent, page, words)
        signal.signal(signal.SIGCHLD, chld)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return
    try:
        status, sent = _wait(child, lambda: child)
    except BaseException:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    _end(os.waitstatus_to_exitcode(status), sent, page, words)


def run_in_sandbox(outputs: Outputs, *, gpu: bool = False, program: str = COMMAND) -> None:
    """Runs the command line in the sandbox and exits with the child's status.

    Args:
        outputs: Files that the child may write; the parent moves them to their final names.
        gpu: Whether the child uses GPU devices.
        program: Python code that the child runs.
    """
    terminal.flush_streams()
    page, words = progress_notes.new_page(), _memory_file("stderr")
    mine, its = socket.socketpair()
    mine.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
    signal.pthread_sigmask(signal.SIG_BLOCK, _WATCHED)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    folder = _private_folder(outputs)
    group = memory.Group.make(memory.requested_limit())
    child = _Child(mine, Mover(outputs, folder.path), group)
    stderr = os.dup(2)
    given = {
        "channel": its.fileno(), "page": page, "stderr": stderr, "private": str(folder.path),
        "words": list(choices.words),
    }  # fmt: skip
    kept = (its.fileno(), page, stderr)
    line = sandbox.command(
        processes.command("-c", _CHILD + program, json.dumps(given), *choices.words, keep=kept),
        private=folder.path, inputs=sandbox.inputs_of([*choices.words, os.getcwd()]),
        reads=choices.reads, gpu=gpu,
    )  # fmt: skip
    process = processes.popen(
        line, stdin=subprocess.DEVNULL, stderr=words, pass_fds=kept, env=_variables()
    )
    its.close()
    os.close(stderr)
    child.listen()
    try:
        status, sent = _wait(process.pid, child.pid)
    except BaseException:
        process.kill()
        process.wait()
        raise
    finally:
        folder.close()
        if group is not None:
            group.close()
    code = os.waitstatus_to_exitcode(status)
    # If a signal ends the sandboxed process, bubblewrap exits with 128 plus the signal's number.
    # The codes 130 and 143 are Wavecomb's own exit codes.
    if code > 128 and code not in (128 + signal.SIGINT, 128 + signal.SIGTERM):
        code = 128 - code
    _end(code, sent, page, words)


def _variables() -> dict[str, str]:
    """Returns the child's environment, without variables that affect Python's module search."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


def _memory_file(name: str) -> int:
    return os.memfd_create(f"wavecomb-{name}", os.MFD_CLOEXEC)


def _private_folder(outputs: Outputs) -> PrivateFolder:
    """Creates the private folder of the child, next to the first output if possible."""
    from wavecomb.machine import temporary_folder

    for folder in outputs.resolved().folders():
        with contextlib.suppress(OSError):
            remove_abandoned(Path(folder))
            return PrivateFolder(Path(folder))
    return PrivateFolder(Path(temporary_folder()))


class _Child:
    """The parent's connection to its sandboxed child process."""

    def __init__(self, channel: socket.socket, mover: Mover, group: memory.Group | None) -> None:
        self._channel, self._mover, self._group = channel, mover, group
        self._pid = 0
        self._is_there = threading.Event()

    def listen(self) -> None:
        """Answers the child's requests on a separate thread."""
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        space = socket.CMSG_SPACE(struct.calcsize("3i"))
        with contextlib.suppress(OSError):
            _, ancillary, *_ = self._channel.recvmsg(1, space)
            for level, kind, data in ancillary:
                if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS):
                    self._pid = struct.unpack("3i", data)[0]
            if self._group is not None and self._pid:
                self._group.add(self._pid)
            self._is_there.set()
            self._channel.sendall(b"g")
            self._mover.serve(self._channel)

    def pid(self) -> int:
        """Returns the child's process id for signals; 0 if the child did not report in time."""
        self._is_there.wait(5.0)
        return self._pid


def become_child(given: str) -> None:
    """Sets up this sandboxed process as a child that reports to its parent.

    Args:
        given: Values that ``run_in_sandbox`` passes to the child, as JSON.
    """
    global _is_child
    _is_child = True
    found = json.loads(given)
    channel = socket.socket(fileno=found["channel"])
    # Send a message to the parent process. The kernel adds the id that this process has in the
    # parent's PID namespace.
    channel.sendall(b"h")
    # Wait until the parent has added this process to its control group.
    channel.recv(1)
    private = Path(found["private"])
    output_file.publisher = Client(channel, private)
    choices.words = tuple(found["words"])
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _WATCHED)
    progress_notes.start(found["page"])
    sys.excepthook = _print_exception
    _redirect_stderr(found["stderr"])


def _become_expendable(parent: int, page: int, words: int) -> None:
    os.setpgid(0, 0)
    # Ignore SIGTTOU, so that writing to the terminal from outside its foreground process group does
    # not stop the process.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    end_with_parent(parent)
    progress_notes.start(page)
    sys.excepthook = _print_exception
    own = os.dup(2)
    os.dup2(words, 2)
    _redirect_stderr(own)


def _redirect_stderr(descriptor: int) -> None:
    """Redirects Python's stderr to the file descriptor.

    Libraries still write to descriptor 2, whose output the parent captures.
    """
    stderr = sys.stderr
    sys.stderr = terminal.Stream(descriptor, stderr.encoding, is_prompt=True, owns=True)


def _print_exception(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    if not str(error).startswith(_NO_VALUE):
        sys.__excepthook__(kind, error, trace)


def _wait(process: int, child: Callable[[], int]) -> tuple[int, set[int]]:
    """Waits for a process and forwards signals.

    Args:
        process: Process to wait for.
        child: Function that returns the id of the process that receives the signals, or 0 if there
            is none.

    Returns:
        Exit status and the forwarded signals.
    """
    sent: set[int] = set()
    while True:
        pid, status = os.waitpid(process, os.WNOHANG)
        if pid:
            return status, sent
        number = signal.sigwaitinfo(_WATCHED).si_signo
        if number == signal.SIGCHLD:
            continue
        target = child() or process
        with contextlib.suppress(ProcessLookupError):
            # Ctrl-Z stops both the parent and the sandboxed process; SIGCONT continues both.
            if number == signal.SIGTSTP:
                os.kill(target, signal.SIGSTOP)
                os.kill(os.getpid(), signal.SIGSTOP)
            else:
                if number in _PASSED_ON:
                    sent.add(number)
                os.kill(target, number)


def _end(code: int, sent: set[int], page: int, words: int) -> None:
    """Exits with the child's status, or with a message and code 2 if the child crashed.

    Args:
        code: Exit code of the child; negative for a signal.
        sent: Forwarded signals.
        page: Descriptor of the page with progress notes.
        words: Descriptor of the file with the libraries' output to stderr.
    """
    text = os.pread(words, 1 << 20, 0).decode(errors="replace")
    if code < 0 and -code in sent:
        signal.signal(-code, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _WATCHED)
        os.kill(os.getpid(), -code)
    if code < 0:
        seen = progress_notes.open_page(page)
        line = progress_notes.crash_message(
            -code, progress_notes.read(seen), text, memory.limit_text(seen)
        )
        terminal.write_error(f"error: {' '.join(line.split())}\n")
        os._exit(2)
    rest = [line for line in text.splitlines(keepends=True) if not line.startswith(CHATTER)]
    terminal.write_error("".join(rest))
    os._exit(code)
