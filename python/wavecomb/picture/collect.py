# SPDX-License-Identifier: Apache-2.0
"""Pictures that are named together: those of a folder, of a sequence, or one by one."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from wavecomb.errors import WavecombError
from wavecomb.picture.files import kind_of
from wavecomb.run.frame_names import frame_text, has_place, matching

ENDINGS = (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr")
"""What counts as a picture in a folder."""


def is_many(source: str) -> bool:
    """Whether a name stands for several pictures: a folder, or a name with a place for the frame.

    A file that is called so is a file.
    """
    return os.path.isdir(source) or (has_place(source) and not os.path.exists(source))


def pictures_of(source: str) -> dict[str, str]:
    """Name -> file: frames of a sequence in their order, or what is in a folder and below it.

    Args:
        source: A folder, or a name with a place for the frame: ``out/shot.####.exr``.

    Raises:
        WavecombError: There are none.
    """
    try:
        if os.path.isdir(source):
            found = {name: os.path.join(source, name) for name in _below(source)}
        else:
            found = {frame_text(frame): file for frame, file in matching(source).items()}
    except OSError as error:
        raise WavecombError(f"{source}: {error.strerror or error}") from error
    if not found:
        what = "picture in it" if os.path.isdir(source) else "such file"
        raise WavecombError(f"{source}: there is no {what}")
    return found


def _below(folder: str) -> list[str]:
    names = []
    for path in Path(folder).rglob("*"):
        relative = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in relative.parts)
        if path.suffix.lower() in ENDINGS and path.is_file() and not is_hidden:
            names.append(relative.as_posix())
    return sorted(names, key=natural)


def collect(sources: Iterable[str]) -> dict[str, str]:
    """Name -> file of all pictures of folders, sequences and files, in the order they are named.

    Raises:
        WavecombError: One of them is not there.
    """
    found: dict[str, str] = {}
    for source in sources:
        if is_many(source):
            found.update(pictures_of(source))
        elif os.path.isfile(source):
            found[os.path.basename(source) if len(found) else source] = source
        else:
            kind = kind_of(source)
            why = "no such file" if kind is None else f"is {kind}, not a regular file"
            raise WavecombError(f"{source}: {why}")
    return found


def natural(name: str) -> list[tuple[int, int, str]]:
    """A key by which 9 comes before 10.

    >>> sorted(["a10.exr", "a9.exr"], key=natural)
    ['a9.exr', 'a10.exr']
    """
    parts = re.split(r"(\d+)", name)
    return [(1, int(part), "") if k % 2 else (0, 0, part) for k, part in enumerate(parts)]
