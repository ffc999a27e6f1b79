# SPDX-License-Identifier: Apache-2.0
"""Files that a job's stage needs, with hashes: what a worker has to have, too."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from wavecomb import processes
from wavecomb.errors import WavecombError

_MOST_NAMED = 3
_LIST_S = 4 * 3600.0
"""For all files of a stage to be read."""


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
    process = processes.start(
        "wavecomb", "farm", "assets", stage, "--json", *options,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        out, said = process.communicate(timeout=_LIST_S)
    except subprocess.TimeoutExpired:
        process.kill()
        raise WavecombError(
            f"{stage}: its files were not listed within {_LIST_S / 3600:.0f} hours (--no-strict "
            "goes on without)"
        ) from None
    if process.returncode:
        lines = said.strip().splitlines()
        raise WavecombError((lines[-1] if lines else "no word").removeprefix("error: "))
    found: dict[str, Any] = json.loads(out)
    return found


def differences(
    files: Sequence[Mapping[str, Any]],
    place: Callable[[str], str],
    hash_of: Callable[[str], str] = file_hash,
) -> list[str]:
    """Files of a job that are not on this machine, or are others there: a line each, a few of them.

    Args:
        files: Of ``list_assets``.
        place: Where a file lies here.
        hash_of: SHA-256 of a file.
    """
    found: list[str] = []
    for one in files:
        path = place(one["path"])
        name = one["path"] if path == one["path"] else f"{one['path']} ({path})"
        try:
            if os.path.getsize(path) != one["bytes"] or hash_of(path) != one["sha256"]:
                found.append(f"{name} is not what it was when the job was submitted")
        except OSError as error:
            found.append(f"{name} is not on this machine: {error.strerror}")
    more = len(found) - _MOST_NAMED
    return found[:_MOST_NAMED] + [f"and {more} more files"] * (more > 0)
