# SPDX-License-Identifier: Apache-2.0
"""Small files of a job folder, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.picture.files import reason


def write_json(path: str | os.PathLike[str], value: Any) -> None:
    """Writes a file beside its name and renames it.

    Unlike outputs, which ``replacing`` writes: it does not look through the folder for what those
    who were killed left behind, since there may be thousands of files.
    """
    target = Path(path)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        part.write_text(json.dumps(value, allow_nan=False) + "\n", encoding="utf-8")
        os.replace(part, target)
    except OSError as error:
        raise OSError(f"{target}: cannot be written: {reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def read_json(path: str | os.PathLike[str]) -> Any:
    """What a file says.

    Raises:
        OSError: It cannot be opened.
        WavecombError: It is damaged.
    """
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise WavecombError(f"{os.fspath(path)}: is damaged: {error}") from None


def create_json(path: Path, value: Any, own: str) -> bool:
    """Writes a file unless there is one: of several who try, one does it.

    Args:
        path: The file.
        value: For JSON.
        own: A name that no other process uses.

    Returns:
        Whether this call wrote it.
    """
    part = path.with_name(f".{path.name}.{own}.part")
    part.write_text(json.dumps(value, allow_nan=False) + "\n", encoding="utf-8")
    try:
        os.link(part, path)
    except FileExistsError:
        return False
    finally:
        part.unlink()
    return True
