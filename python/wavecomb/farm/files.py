# SPDX-License-Identifier: Apache-2.0
"""Small files of a job folder, written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.picture.files import reason

_OURS = secrets.token_hex(4)
"""Beside the number of the process: those of two machines may be the same."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LEAST_FREE = 1 << 16
"""Bytes; a disk with less is full, whatever the error says."""


def write_json(path: str | os.PathLike[str], value: Any, *, only_new: bool = False) -> bool:
    """Writes a file beside its name and renames it.

    Unlike outputs, which ``replacing`` writes: it does not look through the folder for what those
    who were killed left behind, since there may be thousands of files.

    Args:
        path: The file.
        value: For JSON.
        only_new: Whether a file that is there stays: of several who try, one writes it.

    Returns:
        Whether this call wrote it.
    """
    target = Path(path)
    part = target.with_name(f".{target.name}.{os.getpid()}-{_OURS}.part")
    try:
        part.write_text(json.dumps(value, allow_nan=False) + "\n", encoding="utf-8")
        if only_new:
            os.link(part, target)
        else:
            os.replace(part, target)
    except FileExistsError:
        return False
    except OSError as error:
        raise OSError(f"{target}: cannot be written: {reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
    return True


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


def is_full(error: BaseException, folders: Iterable[str | os.PathLike[str]]) -> bool:
    """Whether an error is of a disk that is full, or of a quota.

    Args:
        error: With its causes.
        folders: That were written to. Libraries do not say why they cannot write.
    """
    if not isinstance(error, OSError):
        return False
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.errno in _FULL:
            return True
        cause = cause.__cause__
    for folder in folders:
        with contextlib.suppress(OSError):
            found = os.statvfs(folder)
            if found.f_bavail * found.f_frsize < _LEAST_FREE:
                return True
    return False
