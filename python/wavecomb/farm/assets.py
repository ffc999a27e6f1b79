# SPDX-License-Identifier: Apache-2.0
"""Files that a job's stage needs, with hashes: what a worker has to have, too."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError

_MOST_NAMED = 3


def list_assets(
    stage: str, variants: Mapping[str, str] | None = None, session_layer: str | None = None
) -> dict[str, Any]:
    """Files of a stage, read in this process: ``farm assets`` does it in a sandbox.

    Returns:
        ``files``: of each ``path``, ``bytes``, ``sha256``; ``missing``: lines.
    """
    from wavecomb.api import import_usd

    import_usd()
    from wavecomb.usd.stage.dependencies import dependencies

    session = None if session_layer is None else Path(session_layer)
    found = dependencies(Path(stage), variants, session)
    return {"files": [_entry(path) for path in found.files], "missing": list(found.missing)}


def _entry(path: str) -> dict[str, Any]:
    return {"path": path, "bytes": os.path.getsize(path), "sha256": file_hash(path)}


def file_hash(path: str) -> str:
    """SHA-256 of a file."""
    told = hashlib.sha256()
    with Path(path).open("rb") as file:
        while block := file.read(1 << 20):
            told.update(block)
    return told.hexdigest()


def ask_assets(stage: str, options: Sequence[str]) -> dict[str, Any]:
    """``list_assets`` by a process in a sandbox.

    Args:
        stage: A file.
        options: Of ``wavecomb farm assets``.

    Raises:
        WavecombError: The stage cannot be opened.
    """
    words = [sys.executable, "-m", "wavecomb", "farm", "assets", stage, "--json", *options]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise WavecombError((said[-1] if said else "no word").removeprefix("error: "))
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def differences(files: Sequence[Mapping[str, Any]], folder: str) -> list[str]:
    """Files of a job that are not on this machine, or are others there: a line each, a few of them.

    Args:
        files: Of ``list_assets``.
        folder: That relative names count from.
    """
    found: list[str] = []
    for one in files:
        path = os.path.join(folder, one["path"])
        try:
            if os.path.getsize(path) != one["bytes"] or file_hash(path) != one["sha256"]:
                found.append(f"{one['path']} is not what it was when the job was submitted")
        except OSError as error:
            found.append(f"{one['path']} is not on this machine: {error.strerror}")
    more = len(found) - _MOST_NAMED
    return found[:_MOST_NAMED] + [f"and {more} more files"] * (more > 0)
