# SPDX-License-Identifier: Apache-2.0
"""Reports why a pytest-xdist worker ended: the stacks of its threads, at the end of the output.

pytest writes these stacks to standard error, where they precede thousands of lines in a long log. A
worker that ends without stacks was killed by a signal such as SIGKILL.
"""

from __future__ import annotations

import faulthandler
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any, TextIO

FOLDER = "crash_folder"
_MOST_LINES = 80
_own: Path | None = None
_file: TextIO | None = None


def give_folder(values: dict[str, Any]) -> None:
    """Add the folder for stacks to the values that pytest-xdist passes to a worker."""
    global _own
    _own = _own or Path(tempfile.mkdtemp(prefix="pytest-crashes-"))
    values[FOLDER] = str(_own)


def write_stacks(config: Any) -> None:
    """Write the stacks of this worker to its file if it crashes or if a test takes too long."""
    from _pytest.faulthandler import fault_handler_stderr_fd_key

    global _file
    values = config.workerinput
    path = Path(values[FOLDER]) / values["workerid"]
    _file = path.open("w", encoding="utf-8")
    faulthandler.enable(_file)
    os.dup2(_file.fileno(), config.stash[fault_handler_stderr_fd_key])


def report() -> list[str]:
    """Return the lines of all workers that wrote stacks, and remove the folder."""
    global _own
    if _own is None:
        return []
    lines: list[str] = []
    for path in sorted(_own.iterdir()):
        text = path.read_text(encoding="utf-8", errors="replace").splitlines()
        if text:
            lines += [f"worker {path.name}:", *text[:_MOST_LINES]]
    shutil.rmtree(_own, ignore_errors=True)
    _own = None
    return lines
