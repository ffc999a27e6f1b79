# SPDX-License-Identifier: Apache-2.0
"""Starts Python processes. No other module starts a Python process.

A Python process that is started with ``-c`` or ``-m`` has the working folder on its ``sys.path``.
Python would then import a file such as ``json.py`` next to a shot. This module therefore starts
isolated processes (``python -I``). ``wavecomb.boot`` builds the ``sys.path`` of such a process from
the standard library, site-packages, and the result of ``folders``. The new process inherits only
the given file descriptors, has a separate process group, and ends with the process that started it.
"""

from __future__ import annotations

import os
import queue
import site
import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import Future
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from wavecomb import boot
from wavecomb.errors import WavecombError

_DEPENDENCIES = ("pxr", "numpy", "OpenImageIO", "MaterialX", "click", "rich", "tomli")


def interpreter() -> str:
    """Returns the path of the Python program, even if another program embeds Python.

    Raises:
        WavecombError: No Python program was found.
    """
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    for name in (sys.executable, str(Path(sys.base_exec_prefix, "bin", version))):
        if name and Path(name).name.startswith(("python", "pypy")) and os.access(name, os.X_OK):
            return name
    raise WavecombError(
        f"no Python was found to start a process with: neither this program ({sys.executable}) nor "
        f"{sys.base_exec_prefix}/bin/{version} is one"
    )


def folders() -> tuple[list[str], list[str]]:
    """Returns folders for the ``sys.path`` of a process, without standard and site folders.

    Returns:
        First, the folders in PYTHONPATH, which precede site-packages. Second, the user's site
            folder, the folder of this package, and folders of dependencies that are elsewhere, as
            in programs that modify ``sys.path``. All folders are absolute. The working folder and
            the folder of the main script are excluded.
    """
    ignores = sys.flags.ignore_environment
    first = [] if ignores else os.environ.get("PYTHONPATH", "").split(os.pathsep)
    first = [place for place in first if _is_fit(place)]
    last = [os.path.dirname(boot.PACKAGE)]
    if site.ENABLE_USER_SITE:
        last.insert(0, site.getusersitepackages())
    known = [*first, *last, *site.getsitepackages()]
    others = [place for place in sys.path if _is_fit(place) and not _holds_script(place)]
    for name in _DEPENDENCIES:
        if PathFinder.find_spec(name, known) is None:
            found = PathFinder.find_spec(name, others)
            places = [] if found is None else found.submodule_search_locations or []
            last += [os.path.dirname(place) for place in places]
    return first, [place for place in dict.fromkeys(last) if _is_fit(place)]


def _is_fit(place: str) -> bool:
    if not os.path.isabs(place) or os.pathsep in place:
        return False
    try:
        return os.path.realpath(place) != os.path.realpath(os.getcwd())
    # os.getcwd() fails if the working folder was removed.
    except OSError:
        return True


def _holds_script(place: str) -> bool:
    script = getattr(sys.modules.get("__main__"), "__file__", None)
    return script is not None and os.path.dirname(os.path.realpath(script)) == place


def command(
    target: str,
    *arguments: str,
    parent: int | None = None,
    keep: Sequence[int] = (),
    path: Sequence[str] = (),
    python: str | None = None,
    flags: Sequence[str] = (),
) -> list[str]:
    """Returns the command line that runs a module in an isolated Python process.

    Args:
        target: Name of the module, or "-c" to run code, which is then the first argument.
        arguments: Command-line arguments of the module.
        parent: Id of a process. The new process ends with that process, but leaves that process's
            group. 0 means the process that starts it. None lets the new process run independently,
            for example on another machine.
        keep: File descriptors that the process inherits in addition to the standard streams.
        path: Absolute folders of Wavecomb that are added to the ``sys.path`` of the process.
        python: Path of the Python program; None means the program of this process.
        flags: Additional command-line flags of Python.

    Raises:
        WavecombError: No Python program was found.
    """
    first, last = folders() if python is None else ([], [])
    words = [python or interpreter(), "-I"]
    words += ["-B"] * bool(sys.dont_write_bytecode) + ["-X", "utf8"] * bool(sys.flags.utf8_mode)
    words += [*flags, os.path.join(boot.PACKAGE, "boot.py")]
    words += [] if parent is None else [f"--parent={parent}"]
    for name, values in (
        ("keep", [str(one) for one in keep]), ("first", first), ("last", last), ("path", path),
    ):  # fmt: skip
        if values:
            words.append(f"--{name}=" + ("," if name == "keep" else os.pathsep).join(values))
    return [*words, target, *arguments]


def start(
    target: str,
    *arguments: str,
    keep: Sequence[int] = (),
    flags: Sequence[str] = (),
    **options: Any,
) -> subprocess.Popen[Any]:
    """Starts a module in an isolated Python process, which ends with this process.

    Args:
        target: Name of the module, or "-c", as for ``command``.
        arguments: Command-line arguments of the module.
        keep: File descriptors that the process inherits, as for ``command``.
        flags: Additional command-line flags of Python.
        **options: Arguments of ``subprocess.Popen``.

    Raises:
        WavecombError: No Python program was found.
        OSError: The process could not be started.
    """
    words = command(target, *arguments, parent=os.getpid(), keep=keep, flags=flags)
    return popen(words, pass_fds=tuple(keep), **options)


_EXEC = """import os, sys
try:
    os.execv(sys.argv[1], sys.argv[1:])
except OSError as error:
    sys.exit(f"error: {sys.argv[1]} does not start: {error.strerror}")
"""


def program(*words: str) -> list[str]:
    """Returns the command that runs another program as ``command`` runs a module.

    An isolated Python process closes inherited descriptors, creates a process group, arranges to
    end with this process, and is then replaced by the program.

    Args:
        *words: Absolute path of the program, and its arguments.

    Raises:
        WavecombError: No Python was found.
    """
    return command("-c", _EXEC, *words, parent=os.getpid())


def popen(words: Sequence[str], **options: Any) -> subprocess.Popen[Any]:
    """Starts a command line from ``command`` in a new session, from a thread that never ends.

    The kernel ends such a process as soon as the thread that started it ends, even if the parent
    process continues. Threads other than the main thread therefore pass the start to a thread that
    never ends.
    """
    options = {"start_new_session": True, **options}
    if threading.current_thread() is threading.main_thread():
        return subprocess.Popen(words, **options)
    done: Future[subprocess.Popen[Any]] = Future()
    _Starter.current().jobs.put((words, options, done))
    return done.result()


class _Starter:
    """Thread that starts processes on behalf of other threads.

    Attributes:
        jobs: Queue of processes to start. An item is a command, its options and a future for the
            result.
    """

    _lock = threading.Lock()
    _current: _Starter | None = None

    def __init__(self) -> None:
        self.jobs: queue.SimpleQueue[tuple[Sequence[str], dict[str, Any], Future[Any]]]
        self.jobs = queue.SimpleQueue()
        self._process = os.getpid()
        threading.Thread(target=self._run, name="process starter", daemon=True).start()

    @classmethod
    def current(cls) -> _Starter:
        """Returns the thread that starts processes.

        A fork inherits no threads, so a new thread is then created.
        """
        with cls._lock:
            if cls._current is None or cls._current._process != os.getpid():
                cls._current = cls()
            return cls._current

    def _run(self) -> None:
        while True:
            words, options, done = self.jobs.get()
            try:
                done.set_result(subprocess.Popen(words, **options))
            except BaseException as error:
                done.set_exception(error)
            del words, options, done
