# SPDX-License-Identifier: Apache-2.0
"""Converts exceptions to messages for users."""

from __future__ import annotations

import os
import sys

from wavecomb.errors import WavecombError
from wavecomb.run.isolation.memory import describe_limit


def describe(error: Exception) -> str:
    """Returns the message of an exception as one line for the user."""
    core = sys.modules.get("wavecomb._core")
    if isinstance(error, WavecombError) or (core is not None and isinstance(error, core.Error)):
        return str(error)
    no_threads = isinstance(error, RuntimeError) and "start new thread" in str(error)
    if isinstance(error, MemoryError) or no_threads:
        return f"out of memory; choose a smaller --size or a simpler stage{describe_limit()}"
    if isinstance(error, OSError):
        if error.filename is not None and error.strerror:
            return f"{os.fspath(error.filename)}: {error.strerror}"
        return str(error)
    if isinstance(error, ImportError) and (error.name or "").startswith("wavecomb._core"):
        return f"the native module is missing or broken ({error}); `make build` makes it"
    return (
        f"internal: {type(error).__name__}: {error} (please report it; "
        "WAVECOMB_DEBUG=1 shows where)"
    )
