# SPDX-License-Identifier: Apache-2.0
"""What workers that were killed, or came second, left behind."""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import DONE, Folder
from wavecomb.farm.leases import gone
from wavecomb.farm.spec import Task

_PART = re.compile(r"\..*\.([A-Za-z0-9-]+-\d+-[0-9a-f]{4})-\d+\.part(\.\w+)?")
"""A temporary file of a renderer: see ``owner_of``."""
_JSON = re.compile(r"\..*\.json\.\d+-[0-9a-f]{8}\.part")


def owner_of(worker: str) -> str:
    """What temporary names of a worker's renderer have in them."""
    return f"{worker}-"


def sweep(folder: Folder) -> list[Path]:
    """Removes temporary files of workers that are no more, and parts of pictures that are done.

    Returns:
        Files that were removed.
    """
    ended, removed = gone(folder), []
    for file in _files(folder):
        match = _PART.fullmatch(file.name)
        if match is not None and match[1] in ended:
            removed.append(file)
    for place in ("results", "workers"):
        for file in (folder.path / place).iterdir():
            with contextlib.suppress(OSError):
                old = time.time() - file.stat().st_mtime > folder.spec.lease_s
                if old and _JSON.fullmatch(file.name):
                    removed.append(file)
    done = folder.ids(DONE)
    for file in (folder.path / "parts").iterdir():
        with contextlib.suppress(WavecombError):
            task = Task.of(file.name.rpartition(".")[0])
            if task.picture < len(folder.spec.pictures):
                last = folder.spec.last_of(task.picture)
                if last.id in done or (file.suffix == ".ckpt" and task.id in done):
                    removed.append(file)
    for file in removed:
        with contextlib.suppress(OSError):
            file.unlink()
    return removed


def _files(folder: Folder) -> Iterator[Path]:
    """Where renderers write."""
    spec = folder.spec
    places = {folder.path / "parts"}
    for picture in range(len(spec.pictures)):
        names = spec.names(picture).values()
        places |= {Path(os.path.dirname(spec.place(name)) or os.curdir) for name in names}
    for place in places:
        with contextlib.suppress(OSError):
            yield from place.iterdir()
