# SPDX-License-Identifier: Apache-2.0
"""Checks for the requirements of a window, without importing Qt."""

from __future__ import annotations

import os
import sys

from wavecomb.errors import WavecombError
from wavecomb.extras import check_installed

NO_DISPLAY = (
    "no display to open a window on: set DISPLAY or WAYLAND_DISPLAY (over ssh: ssh -X), "
    "or use `wavecomb render`"
)


def has_display() -> bool:
    """Returns whether there is a display for a window."""
    if not sys.platform.startswith("linux"):
        return True
    return any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"))


def check_window() -> None:
    """Raises WavecombError with one line unless a window can be opened."""
    check_installed("gui", "the window")
    if not has_display():
        raise WavecombError(NO_DISPLAY)
