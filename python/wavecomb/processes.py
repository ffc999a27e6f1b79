# SPDX-License-Identifier: Apache-2.0
"""Starts Python processes; no other module does so.

A Python that is started with ``-c`` or ``-m`` has the working folder on its ``sys.path``, so that a
file ``json.py`` next to a shot would be executed. The processes started here are isolated (``python
-I``):
``wavecomb.boot`` builds their ``sys.path`` from the standard library, site-packages, and the
folders of ``folders``. Processes started here inherit only the given descriptors, have a separate
process group, and end with the process that started them.
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
    """Returns the program of this Python, also if another program embeds Python.

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
    """Returns folders that a process needs on its ``sys.path`` besides standard and site folders.

    Returns:
        First the folders of PYTHONPATH, which precede site-packages. Then the user's site folder,
            the folder of this package, and folders of dependencies that are in none of these, which
            occurs in programs that modify ``sys.path``. All folders are absolute; the working
            folder and the folder of the program's script are excluded.
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
    """Returns the command that runs a module in an isolated Python.

    Args:
        target: Module, or "-c", whose first argument is code.
        arguments: Arguments of the module.
        parent: Process with which the new one ends, and whose process group it leaves. 0 means the
            process that starts it; None makes it independent, for example on another machine.
        keep: Descriptors that the process inherits besides the standard streams.
        path: Absolute folders of Wavecomb that are added to its ``sys.path``.
        python: Program to run; None uses this Python.
        flags: Additional flags of Python.

    Raises:
        WavecombError: No Python was found.
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
    """Starts a module in an isolated Python that ends with this process.

    Args:
        target: Module, as for ``command``.
        arguments: Arguments of the module.
        keep: Descriptors that the process inherits, as for ``command``.
        flags: Additional flags of Python.
        **options: Arguments of ``subprocess.Popen``.

    Raises:
        WavecombError: No Python was found.
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

    The program replaces an isolated Python, which has closed inherited descriptors, created a
    process group, and made the process end with this one.

    Args:
        *words: Absolute path of the program, and its arguments.

    Raises:
        WavecombError: No Python was found.
    """
    return command("-c", _EXEC, *words, parent=os.getpid())


def popen(words: Sequence[str], **options: Any) -> subprocess.Popen[Any]:
    """Starts the result of ``command`` in a new session, from a permanent thread.

    The kernel kills a process when the thread that started it ends, not only when the whole parent
    does. Therefore threads other than the main thread delegate the start to a permanent thread.
    """
    options = {"start_new_session": True, **options}
    if threading.current_thread() is threading.main_thread():
        return subprocess.Popen(words, **options)
    done: Future[subprocess.Popen[Any]] = Future()
    _Starter.current().jobs.put((words, options, done))
    return done.result()


class _Starter:
    """A thread that starts processes for other threads.

    Attributes:
        jobs: Queue of processes to start: a command, options, and a future.
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
        """Returns the starter thread; creates a new one after a fork, which inherits no threads."""
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


def isolate_multiprocessing() -> None:
    """Makes ``multiprocessing`` start isolated processes, with "spawn" and "forkserver".

    Children of ``multiprocessing`` run ``python -c`` and receive this process's ``sys.path``.
    Commands of Wavecomb call this function before they or their libraries use the module.
    """
    from multiprocessing import spawn, util

    flags: Any = getattr(util, "_args_from_interpreter_flags")  # noqa: B009
    if getattr(flags, "isolates", False):
        return
    prepare = spawn.get_preparation_data

    def isolated_flags() -> list[str]:
        return ["-I", *(flag for flag in flags() if flag not in ("-I", "-E", "-s", "-P"))]

    def prepared(name: str) -> dict[str, Any]:
        data = prepare(name)
        first, last = folders()
        roots = {os.path.realpath(one) for one in (sys.prefix, sys.base_prefix, sys.exec_prefix)}
        own = [
            place
            for place in sys.path
            if _is_fit(place)
            and not _holds_script(place)
            and any(_is_within(place, root) for root in roots)
        ]
        data["sys_path"] = boot.extended(own, first, last)
        return data

    isolated_flags.isolates = True  # type: ignore[attr-defined]
    setattr(util, "_args_from_interpreter_flags", isolated_flags)  # noqa: B010
    spawn.get_preparation_data = prepared


def _is_within(place: str, root: str) -> bool:
    return os.path.commonpath([os.path.realpath(place), root]) == root
