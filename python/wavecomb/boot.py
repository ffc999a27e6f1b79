# SPDX-License-Identifier: Apache-2.0
"""Entry point of Python processes that Wavecomb starts: ``python -I boot.py OPTIONS TARGET``.

``wavecomb.processes`` builds this command. Python's isolated mode ignores variables such as
PYTHONPATH and puts neither the working folder nor a script's folder on ``sys.path``. This file adds
the given folders, closes inherited descriptors, creates a process group, makes the process end with
its parent, and then runs the target, which is a module or ``-c CODE``.

This file imports only the standard library, so that any Python can run it.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]
import sys

# Ctrl-C ends the command without a traceback during imports, as in wavecomb/__init__.py.
if (
    __name__ == "__main__"
    and next((word for word in sys.argv[1:] if word[:2] != "--"), "") == "wavecomb"
    and _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler
):
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

import contextlib
import os
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any

PACKAGE = os.path.dirname(os.path.abspath(__file__))
_PR_SET_PDEATHSIG = 1


def end_with_parent(parent: int) -> None:
    """Makes the kernel kill this process when its parent ends (on Linux only).

    The kernel kills this process as soon as the thread that started it ends.

    Args:
        parent: Process that started this one. If the parent has already ended, this process ends as
            well. 0 means the current parent and skips this check.
    """
    if not sys.platform.startswith("linux"):
        return
    import ctypes
    import signal

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if parent and os.getppid() != parent:
        os._exit(2)


def extended(path: Iterable[str], first: Iterable[str], last: Iterable[str]) -> list[str]:
    """Returns an absolute ``sys.path`` with added folders other than the working folder.

    Args:
        path: An isolated ``sys.path``: the standard library and site-packages.
        first: Folders inserted into the path before site-packages and after the standard library.
        last: Folders appended at the end of the path.
    """
    here = None
    with contextlib.suppress(OSError):
        here = os.path.realpath(os.getcwd())
    own = [place for place in path if os.path.isabs(place)]
    library = os.path.dirname(os.path.abspath(os.__file__))
    standard = (library, os.path.join(library, "lib-dynload"))
    cut = 1 + max((i for i, place in enumerate(own) if place in standard), default=-1)

    def added(places: Iterable[str]) -> list[str]:
        fit = (place for place in places if os.path.isabs(place) and place not in own)
        return list(dict.fromkeys(place for place in fit if os.path.realpath(place) != here))

    return own[:cut] + added(first) + own[cut:] + added(last)


class PackageFinder:
    """Import finder that finds only the ``wavecomb`` package that contains this file."""

    def find_spec(self, name: str, path: Any, target: ModuleType | None = None) -> Any:
        """Finds a module; part of the interface of ``sys.meta_path``."""
        if name != "wavecomb":
            return None
        from importlib.util import find_spec, spec_from_file_location

        sys.meta_path.remove(self)  # type: ignore[arg-type]
        try:
            found = find_spec(name)
        except (ImportError, ValueError):
            found = None
        own = os.path.join(PACKAGE, "__init__.py")
        origin = None if found is None else found.origin
        if origin is not None and os.path.realpath(origin) == os.path.realpath(own):
            # Use the import spec that was found, since the spec of an editable installation lists
            # further folders of the package.
            return found
        return spec_from_file_location(name, own, submodule_search_locations=[PACKAGE])


def close_others(kept: Iterable[int]) -> None:
    """Closes all descriptors above standard error except the given ones."""
    with contextlib.suppress(OSError):
        for name in os.listdir("/dev/fd"):
            if int(name) > 2 and int(name) not in kept:
                with contextlib.suppress(OSError):
                    os.close(int(name))


def _lead_group() -> None:
    if os.getpgrp() == os.getpid():
        return
    import signal

    with contextlib.suppress(OSError):
        os.setpgid(0, 0)
    # Ignore SIGTTOU, so that writing to the terminal from outside its foreground process group does
    # not stop the process.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)


def main(words: Sequence[str]) -> None:
    """Runs a target.

    Args:
        words: Options ``--parent=PID``, ``--keep=FD,FD``, ``--first=FOLDERS``, ``--last=FOLDERS``
            and ``--path=FOLDERS`` (which may include the working folder) in any order, then the
            target and its arguments.
    """
    rest, options = list(words), {}
    while rest[0].startswith("--"):
        name, _, value = rest.pop(0).partition("=")
        options[name] = value
    if "--parent" in options:
        _lead_group()
        end_with_parent(int(options["--parent"]))
    close_others({int(one) for one in options.get("--keep", "").split(",") if one})
    more = (options.get(name, "").split(os.pathsep) for name in ("--first", "--last"))
    sys.path[:] = extended(sys.path, *more)
    sys.path += filter(None, options.get("--path", "").split(os.pathsep))
    sys.meta_path.insert(0, PackageFinder())  # type: ignore[arg-type]
    target, *arguments = rest
    if target == "-c":
        code, *arguments = arguments
        sys.argv[:] = ["-c", *arguments]
        module = ModuleType("__main__")
        sys.modules["__main__"] = module
        exec(compile(code, "<string>", "exec"), module.__dict__)
        return
    import runpy

    sys.argv[:] = [target, *arguments]
    runpy.run_module(target, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main(sys.argv[1:])
