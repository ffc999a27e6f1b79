# SPDX-License-Identifier: Apache-2.0
"""Runs processes that read untrusted files in a bubblewrap sandbox (docs/decisions/sandbox.md)."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

MODES = ("auto", "on", "off")

_PROGRAM = "bwrap"

_HIDDEN = ("/tmp", "/var/tmp", "/run", "/dev/shm")
"""Folders that are empty inside the sandbox, since they hold sockets and files of other
programs."""

_SYSTEM = (
    "/usr", "/lib", "/lib32", "/lib64", "/bin", "/sbin", "/opt", "/nix/store", "/gnu/store",
    "/etc/alternatives", "/etc/fonts", "/etc/group", "/etc/ld.so.cache", "/etc/ld.so.conf",
    "/etc/ld.so.conf.d", "/etc/ld.so.preload", "/etc/localtime", "/etc/machine-id",
    "/etc/nsswitch.conf", "/etc/OpenCL", "/etc/passwd",
)  # fmt: skip
"""Files and folders that libraries read; ``--sandbox-read`` adds further paths."""

_SEARCHED = (
    "PXR_AR_DEFAULT_SEARCH_PATH", "PXR_PLUGINPATH_NAME", "PXR_MTLX_PLUGIN_SEARCH_PATHS",
    "PXR_MTLX_STDLIB_SEARCH_PATHS", "MATERIALX_SEARCH_PATH", "OIIO_LIBRARY_PATH", "OCIO",
    "LD_LIBRARY_PATH",
)  # fmt: skip
"""Environment variables that list files and folders which libraries read."""

_GPU = ("/dev/dri", "/dev/nvidiactl", "/dev/nvidia-uvm", "/dev/nvidia-uvm-tools", "/dev/kfd")


def command(
    words: Sequence[str],
    *,
    private: Path,
    inputs: Iterable[str] = (),
    reads: Sequence[str] = (),
    gpu: bool = False,
) -> list[str]:
    """Returns the command line that runs ``words`` in the sandbox.

    The sandboxed process has separate namespaces, no network and no capabilities. Only the folder
    ``private`` is writable. The process ends when its parent ends.

    Args:
        words: Command to run, with absolute paths.
        private: The only writable folder, which also holds temporary files.
        inputs: Files and folders that are named on the command line. The inputs remain readable
            even if a hidden
            folder (/tmp, /run) or ``reads`` would hide them.
        reads: Folders of ``--sandbox-read``. If ``reads`` is not empty, only these folders,
            ``inputs`` and the libraries are readable; otherwise all files of the user are readable.
        gpu: Whether the sandboxed process can use GPU devices.
    """
    line = [_PROGRAM, "--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL"]
    named, places = _existing(inputs), library_places()
    if reads:
        for path in _existing((*_SYSTEM, *places, *reads)):
            line += ["--ro-bind", path, path]
    else:
        line += ["--ro-bind", "/", "/"]
    for path in _HIDDEN:
        if not reads or path == "/tmp":
            line += ["--tmpfs", path] if os.path.isdir(path) and not os.path.islink(path) else []
    line += ["--dev", "/dev", "--proc", "/proc"]
    hidden = [path for path in _HIDDEN if os.path.isdir(path)]
    for path in (*places, *reads, *named):
        if (path in named and reads) or any(_is_below(path, folder) for folder in hidden):
            line += ["--ro-bind-try", path, path]
    for device in _devices() if gpu else ():
        line += ["--dev-bind-try", device, device]
    line += ["--bind", str(private), str(private), "--setenv", "TMPDIR", str(private)]
    here = os.getcwd()
    if reads or any(_is_below(here, folder) for folder in hidden):
        line += ["--dir", here]
    return [*line, "--chdir", here, "--", *words]


def _existing(paths: Iterable[str]) -> list[str]:
    """Returns those paths that exist, as absolute paths, and the targets of symbolic links."""
    found: dict[str, None] = {}
    for path in paths:
        if path and os.path.exists(path):
            found[os.path.abspath(path)] = found[os.path.realpath(path)] = None
    return list(found)


def _is_below(path: str, folder: str) -> bool:
    return os.path.commonpath([path, folder]) == folder


def _devices() -> list[str]:
    return [*_GPU, *(str(path) for path in Path("/dev").glob("nvidia[0-9]*"))]


def library_places() -> list[str]:
    """Returns the folders of Python and of Wavecomb, and the paths in environment variables."""
    import wavecomb

    places = [sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix]
    places += [os.path.dirname(path) for path in wavecomb.__path__]
    for name in _SEARCHED:
        places += os.environ.get(name, "").split(os.pathsep)
    return [path for path in dict.fromkeys(places) if os.path.isabs(path) and os.path.exists(path)]


def inputs_of(words: Iterable[str]) -> list[str]:
    """Returns the paths that must stay readable for a command line.

    For a file in /tmp/shot/usd the result is /tmp/shot, with all assets next to the stage. For a
    file directly in /tmp, the result is all regular files directly in /tmp.
    """
    found: dict[str, None] = {}
    for word in words:
        for path in (word, word.partition("=")[2]):
            if not path or "\0" in path or not os.path.lexists(path):
                continue
            for one in (os.path.abspath(path), os.path.realpath(path)):
                found.update(dict.fromkeys(_visible(one)))
    return list(found)


def _visible(path: str) -> list[str]:
    for folder in _HIDDEN:
        if path != folder and _is_below(path, folder):
            top = os.path.join(folder, os.path.relpath(path, folder).split(os.sep)[0])
            if os.path.isdir(top):
                return [top]
            return [entry.path for entry in os.scandir(folder) if entry.is_file()]
    return [path]


@functools.cache
def obstacle() -> str | None:
    """Returns the reason why this system has no sandbox, or None if a sandbox is available.

    Runs bubblewrap once.
    """
    if sys.platform != "linux":
        return "bubblewrap is for Linux only"
    program = shutil.which(_PROGRAM)
    if program is None:
        return "bubblewrap is not installed (Debian, Ubuntu: apt install bubblewrap)"
    done = subprocess.run(
        [program, "--unshare-all", "--ro-bind", "/", "/", "--proc", "/proc", "/bin/true"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        errors="replace", check=False,
    )  # fmt: skip
    if done.returncode == 0:
        return None
    lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    return f"bubblewrap does not run here ({lines[-1].removeprefix('bwrap: ')})"


def describe() -> dict[str, Any]:
    """Returns whether this system has a sandbox, for ``wavecomb info --machine`` and ``doctor``."""
    why_not = obstacle()
    return {"available": why_not is None, "obstacle": why_not}
