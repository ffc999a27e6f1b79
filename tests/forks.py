# SPDX-License-Identifier: Apache-2.0
"""Run Python processes without importing OpenUSD and NumPy each time.

Importing `wavecomb` takes most of a second. `wavecomb(...)`, `code(...)` and `Popen` send a request
to a server process, which has imported all modules, has a single thread, and forks for each
request. The forked process uses the requested folder, variables and descriptors and then runs like
`python -m` or `python -c`, with the same supervisor, sandbox, signals and exit codes as a command.
A request that a fork cannot serve starts a process as usual: another program, limits set by
`preexec_fn`, or a change of a variable that is read at import (all except `HARMLESS`). Tests of
imports and their order start real processes.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

HARMLESS = frozenset((
    "WAVECOMB_DEBUG", "HOME", "TMPDIR", "PYTEST_CURRENT_TEST", "COLUMNS",
    "OPENBLAS_NUM_THREADS",
))  # fmt: skip
"""Variables that are read when a command runs, or that a command sets before it imports the module
which reads them. All other variables may be read at import."""

_MOST = 100_000
_Popen = subprocess.Popen
_server: Server | None = None
cpu_s = 0.0
"""CPU time of the processes that the server forked and that have ended."""
_lock = threading.Lock()


def wavecomb(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run `wavecomb ARGUMENTS` and return its output and exit code; options are those of `run`."""
    return run(["-m", "wavecomb", *map(str, arguments)], **options)


def code(text: str, *arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run `python -c TEXT ARGUMENTS` in a process that has already imported `wavecomb`."""
    return run(["-c", text, *map(str, arguments)], **options)


def run(
    words: Sequence[str],
    *,
    env: Mapping[str, str] | None = None,
    cwd: str | Path | None = None,
    timeout: float = 100,
) -> subprocess.CompletedProcess[str]:
    """Run Python with the given arguments, like `subprocess.run`; capture the output as text."""
    pipe, command = subprocess.PIPE, [sys.executable, *words]
    process = Popen(command, stdout=pipe, stderr=pipe, text=True, env=env, cwd=cwd)
    with process:
        try:
            out, err = process.communicate(timeout=timeout)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, err)


def close() -> None:
    """End the server if it is running."""
    global _server
    if _server is not None:
        _server.close()
    _server = None


class Server:
    """Connection of the tests to the server process."""

    def __init__(self) -> None:
        self._variables = _read_at_import(os.environ)
        self._channel, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            self._process = _Popen(
                [sys.executable, __file__, str(its.fileno())],
                pass_fds=[its.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )

    def serves(self, variables: Mapping[str, str]) -> bool:
        """Whether the variables that are read at import have the same values as in the server."""
        return _read_at_import(variables) == self._variables

    def fork(self, request: Mapping[str, Any], descriptors: Sequence[int]) -> socket.socket:
        """Fork a process; return the socket that reports its process id and exit status."""
        mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            data = json.dumps(request).encode()
            socket.send_fds(self._channel, [data], [its.fileno(), *descriptors])
        return mine

    def close(self) -> None:
        """End the server."""
        self._channel.close()
        self._process.wait(10)


def _read_at_import(variables: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in variables.items() if name not in HARMLESS}


class _OwnStart(_Popen):
    """A `subprocess.Popen` that starts some processes in another way, given by `_start`."""

    def _execute_child(
        self, args: Any, executable: Any, preexec_fn: Any, close_fds: Any, pass_fds: Any,
        cwd: Any, env: Any, startupinfo: Any, creationflags: Any, shell: Any,
        p2cread: int, p2cwrite: int, c2pread: int, c2pwrite: int, errread: int, errwrite: int,
        *more: Any,
    ) -> None:  # fmt: skip
        words = [] if isinstance(args, (str, bytes)) else [str(word) for word in args]
        # `more`: restore_signals, gid, gids, uid, umask, start_new_session, process_group
        is_plain = not (preexec_fn or shell or executable or any(more[1:4]) or more[6:] > (-1,))
        given, own = (p2cread, c2pwrite, errwrite), (p2cwrite, c2pread, errread)
        pid = 0
        if is_plain and _is_python(words):
            pid = self._start(words, given, pass_fds, cwd, env, bool(more[5]))
        if pid == 0:
            super()._execute_child(
                args, executable, preexec_fn, close_fds, pass_fds, cwd, env, startupinfo,
                creationflags, shell, p2cread, p2cwrite, c2pread, c2pwrite, errread, errwrite,
                *more,
            )  # fmt: skip
            return
        self.pid = pid
        self._child_created = True
        shut = {end for end, mine in zip(given, own, strict=True) if end != -1 and mine != -1}
        for end in shut | ({getattr(self, "_devnull", None)} - {None}):
            os.close(end)

    def _start(
        self, words: Sequence[str], streams: Sequence[int], pass_fds: Sequence[int], cwd: Any,
        env: Any, session: bool,
    ) -> int:  # fmt: skip
        """Start a Python process and return its id, or 0 to start it as usual.

        `streams` are descriptors of the standard streams, or -1 for those of this process.
        """
        raise NotImplementedError


class Popen(_OwnStart):
    """A `subprocess.Popen` that lets the server fork the process if the result is the same."""

    _told: socket.socket | None = None

    def _start(
        self, words: Sequence[str], streams: Sequence[int], pass_fds: Sequence[int], cwd: Any,
        env: Any, session: bool,
    ) -> int:  # fmt: skip
        variables = {str(k): str(v) for k, v in (os.environ if env is None else env).items()}
        request = {"words": words[1:], "env": variables, "cwd": os.fspath(cwd or os.getcwd()),
                   "numbers": [0, 1, 2, *pass_fds], "session": session}  # fmt: skip
        server = _started()
        if server is None or not server.serves(variables) or len(json.dumps(request)) > _MOST:
            return 0
        ends = [number if end == -1 else end for number, end in enumerate(streams)]
        self._told = server.fork(request, [*ends, *pass_fds])
        return int(self._told.recv(64))

    def _try_wait(self, wait_flags: int) -> tuple[int, int]:
        if self._told is None:
            return super()._try_wait(wait_flags)
        if wait_flags & os.WNOHANG and not select.select([self._told], [], [], 0)[0]:
            return 0, 0
        global cpu_s
        status, _, seconds = self._told.recv(64).decode().partition(" ")
        self._told.close()
        cpu_s += float(seconds or 0)
        return self.pid, int(status or 9)

    def _internal_poll(self, *arguments: Any, **options: Any) -> int | None:
        if self._told is None:
            return super()._internal_poll(*arguments, **options)
        if self.returncode is None and self._waitpid_lock.acquire(False):
            with contextlib.ExitStack() as held:
                held.callback(self._waitpid_lock.release)
                pid, status = (0, 0) if self.returncode is not None else self._try_wait(os.WNOHANG)
                if pid:
                    self._handle_exitstatus(status)
        return self.returncode


def _is_python(words: Sequence[str]) -> bool:
    if len(words) < 3 or words[0] != sys.executable:
        return False
    return words[1] in ("-m", "-c") or _is_booted(words[1:])


def _is_booted(words: Sequence[str]) -> bool:
    """Whether arguments start a command of ``wavecomb.processes`` without more Python flags."""
    return words[0] == "-I" and words[1].endswith(os.path.join("wavecomb", "boot.py"))


def _started() -> Server | None:
    global _server
    with _lock:
        if _server is None and sys.platform == "linux" and hasattr(socket, "send_fds"):
            _server = Server()
            atexit.register(close)
        return _server


# ---- server process ------------------------------------------------------------------------------


def _import_everything() -> None:
    """Import all modules of the package except the window's, and their deferred imports.

    The volume plug-in is excluded, because OpenVDB's logging starts threads when it is loaded.
    """
    import importlib
    import pkgutil

    import wavecomb

    names = [module.name for module in pkgutil.walk_packages(wavecomb.__path__, "wavecomb.", str)]
    names += ["difflib", "runpy"]
    for name in names:
        if not name.startswith(("wavecomb.gui", "wavecomb._vdb")) and not name.endswith("__main__"):
            # Modules of optional extras may be missing; the commands that need them report it.
            with contextlib.suppress(ImportError):
                importlib.import_module(name)


def _serve(channel: socket.socket) -> dict[str, Any] | None:
    """Fork for each request. Return the request in the child, and None after the tests."""
    while True:
        data, descriptors, _, _ = socket.recv_fds(channel, 2 * _MOST, 16)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        if not data:
            return None
        if os.fork() == 0:
            channel.close()
            request: dict[str, Any] = json.loads(data)
            _fork(request, descriptors)
            return request
        for descriptor in descriptors:
            os.close(descriptor)


def _fork(request: Mapping[str, Any], descriptors: Sequence[int]) -> None:
    """Continue in a child with the given descriptors; the parent waits and reports its exit."""
    import fcntl

    told, *given = (fcntl.fcntl(one, fcntl.F_DUPFD_CLOEXEC, 500) for one in descriptors)
    for one in descriptors:
        os.close(one)
    channel = socket.socket(fileno=told)
    child = os.fork()
    if child:
        for one in (0, 1, 2, *given):
            os.close(one)
        channel.send(str(child).encode())
        _, status, usage = os.wait4(child, 0)
        with contextlib.suppress(OSError):
            channel.send(f"{status} {usage.ru_utime + usage.ru_stime}".encode())
        os._exit(0)
    channel.close()
    for number, one in zip(request["numbers"], given, strict=True):
        os.dup2(one, number)
        os.close(one)
    if request["session"]:
        os.setsid()


class _PlanPopen(_OwnStart):
    """A `subprocess.Popen` in forked processes, which forks again to plan jobs of a farm.

    A process that has threads cannot fork, and starts the planning process as usual.
    """

    def _start(
        self, words: Sequence[str], streams: Sequence[int], pass_fds: Sequence[int], cwd: Any,
        env: Any, session: bool,
    ) -> int:  # fmt: skip
        plans = words[1] == "-I" and words[-4:-1] == _PLAN
        if not plans or env is not None or cwd is not None:
            return 0
        if len(os.listdir("/proc/self/task")) > 1:
            return 0
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        pid = os.fork()
        if pid == 0:
            try:
                _plan(words[3:], streams, session)
            finally:
                os._exit(70)
        return pid


_PLAN = ["wavecomb", "farm", "plan"]


def _plan(words: Sequence[str], streams: Sequence[int], session: bool) -> None:
    """Run ``wavecomb.boot`` in a process that `_PlanPopen` forked, and end the process."""
    import signal

    from wavecomb import boot

    atexit._clear()
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            default = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
            signal.signal(number, default)
    for number, end in enumerate(streams):
        if end != -1:
            os.dup2(end, number)
    for name, number in (("stdout", 1), ("stderr", 2)):
        setattr(sys, name, open(number, "w", encoding="utf-8", closefd=False))  # noqa: SIM115
    if session:
        os.setsid()
    _run(lambda: boot.main(words))


def _run(work: Callable[[], object]) -> None:
    """Call a function and end the process like Python."""
    code: object = 0
    try:
        work()
    except SystemExit as end:
        code = end.code
    except BaseException:
        sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
        code = 1
    _end(code)


def _end(code: object) -> None:
    """End this process like Python, but skip the teardown of modules, which takes long."""
    if code is not None and not isinstance(code, int):
        print(code, file=sys.stderr)
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit((code or 0) & 0xFF)


def _main(descriptor: int) -> None:
    # Set before NumPy is imported, since its matrix products would start threads; commands set this
    # variable as well.
    mine = "OPENBLAS_NUM_THREADS" not in os.environ
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    here = os.path.dirname(os.path.abspath(__file__))
    sys.path[:] = [place for place in sys.path if os.path.abspath(place) != here]
    _import_everything()
    if mine:
        del os.environ["OPENBLAS_NUM_THREADS"]
    import gc

    gc.collect()
    gc.freeze()
    assert len(os.listdir("/proc/self/task")) == 1, "a fork would lack the other threads"
    request = _serve(socket.socket(fileno=descriptor))
    if request is None:
        return
    os.chdir(request["cwd"])
    os.environ.clear()
    os.environ.update(request["env"])
    way, what, *rest = request["words"]
    sys.argv[:] = [way, *rest]
    if way != "-I":
        sys.path.insert(0, "" if way == "-c" else request["cwd"])
    subprocess.Popen = _PlanPopen  # type: ignore[misc]
    _run(lambda: _do(way, what, rest))


def _do(way: str, what: str, rest: Sequence[str]) -> None:
    """Run the Python code or module of a request."""
    import runpy

    if way == "-I":
        from wavecomb import boot

        alive = f"--parent={os.getppid()}"
        boot.main([alive if one.startswith("--parent=") else one for one in rest])
    elif way == "-m":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        module = type(sys)("__main__")
        sys.modules["__main__"] = module
        exec(compile(what, "<string>", "exec"), module.__dict__)


if __name__ == "__main__":
    _main(int(sys.argv[1]))
