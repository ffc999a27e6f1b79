# SPDX-License-Identifier: Apache-2.0
"""Checks whether the system can show a window, without importing Qt."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence

from wavecomb import processes
from wavecomb.errors import WavecombError
from wavecomb.extras import check_installed

NO_DISPLAY = (
    "no display to open a window on: set DISPLAY or WAYLAND_DISPLAY (over ssh: ssh -X), "
    "or use `wavecomb render`"
)


def has_display() -> bool:
    """Returns whether the environment has a display for a window."""
    if not sys.platform.startswith("linux"):
        return True
    return any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"))


_PACKAGES = {
    "libglib-2.0.so.0": "libglib2.0-0",
    "libgthread-2.0.so.0": "libglib2.0-0",
    "libz.so.1": "zlib1g",
}
"""Debian and Ubuntu packages whose names cannot be derived from the names of their libraries."""


def package_of(library: str) -> str:
    """Returns the Debian package of a shared library, by Debian's naming rule.

    >>> package_of("libxcb-icccm.so.4"), package_of("libdbus-1.so.3"), package_of("libGL.so.1")
    ('libxcb-icccm4', 'libdbus-1-3', 'libgl1')
    """
    if library in _PACKAGES:
        return _PACKAGES[library]
    name, _, version = library.lower().partition(".so.")
    return f"{name}-{version}" if name[-1:].isdigit() else f"{name}{version}"


def missing_libraries(plugin: str | None = None) -> list[str]:
    """Returns the system libraries that Qt's X11 plug-in needs and that are not installed.

    The list is empty if the missing libraries cannot be determined.

    Args:
        plugin: File of the plug-in; the default is the plug-in of PySide6.
    """
    import importlib.util
    import subprocess

    if not sys.platform.startswith("linux"):
        return []
    if plugin is None:
        found = importlib.util.find_spec("PySide6")
        if found is None or found.origin is None:
            return []
        folder = os.path.dirname(found.origin)
        plugin = os.path.join(folder, "Qt", "plugins", "platforms", "libqxcb.so")
    try:
        listed = subprocess.run(
            ["ldd", plugin], capture_output=True, text=True, timeout=30, check=False
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return []
    lines = (line.split(" => ") for line in listed.splitlines() if "not found" in line)
    return sorted({words[0].strip() for words in lines if len(words) == 2})


def libraries_message(libraries: Sequence[str]) -> str:
    """Returns a message that names missing system libraries and the command that installs them.

    >>> libraries_message(["libxcb-icccm.so.4"])
    'Qt needs system libraries that are missing: apt install libxcb-icccm4'
    """
    packages = dict.fromkeys(map(package_of, libraries))
    return f"Qt needs system libraries that are missing: apt install {' '.join(packages)}"


_START = """
from PySide6.QtWidgets import QApplication
print("platform:", QApplication(["wavecomb"]).platformName())
"""


def start_qt(timeout: float = 60.0) -> tuple[str, str]:
    """Starts Qt in a separate process, because Qt ends a process in which a library is missing.

    Args:
        timeout: Time limit of the process in seconds.

    Returns:
        Returns the name of Qt's platform, such as "xcb", and "". On failure returns "" and the
        problem.
    """
    import subprocess

    pipe = subprocess.PIPE
    child = processes.start("-c", _START, stdout=pipe, stderr=pipe, text=True)
    try:
        out, errors = child.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return "", f"Qt does not start within {timeout:g} s"
    for line in out.splitlines():
        if line.startswith("platform: ") and child.returncode == 0:
            return line.removeprefix("platform: "), ""
    if libraries := missing_libraries():
        return "", libraries_message(libraries)
    said = [line for line in errors.splitlines() if line.strip()]
    # Qt's messages begin with a category, such as "qt.qpa.xcb: ".
    why = said[0].strip() if said else f"Qt ended with code {child.returncode}"
    return "", re.sub(r"^qt\.[\w.]+: ", "", why)


def check_window() -> None:
    """Raises WavecombError with a one-line explanation if a window cannot be opened."""
    check_installed("gui", "the window")
    if not has_display():
        raise WavecombError(NO_DISPLAY)
