# SPDX-License-Identifier: Apache-2.0
"""Collects images from folders, sequences and single files."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import kind_of
from wavecomb.run.frame_names import frame_text, has_place, matching

ENDINGS = (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr")
"""Extensions of image files in folders."""


def is_many(source: str) -> bool:
    """Returns whether a name stands for several images: a folder, or a frame pattern.

    An existing file with such a name counts as a single file.
    """
    return os.path.isdir(source) or (has_place(source) and not os.path.exists(source))


def images_of(source: str) -> dict[str, str]:
    """Returns files by name: frames of a sequence in order, or all images in a folder tree.

    Args:
        source: A folder, or a name with a frame placeholder, such as ``out/shot.####.exr``.

    Raises:
        WavecombError: There are no images.
    """
    try:
        if os.path.isdir(source):
            found = {name: os.path.join(source, name) for name in _below(source)}
        else:
            found = {frame_text(frame): file for frame, file in matching(source).items()}
    except OSError as error:
        raise WavecombError(f"{source}: {error.strerror or error}") from error
    if not found:
        what = "image in it" if os.path.isdir(source) else "such file"
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
    """Returns files by name of all images in folders, sequences and files, in the given order.

    Raises:
        WavecombError: A source does not exist.
    """
    found: dict[str, str] = {}
    for source in sources:
        if is_many(source):
            found.update(images_of(source))
        elif os.path.isfile(source):
            found[os.path.basename(source) if len(found) else source] = source
        else:
            kind = kind_of(source)
            why = "no such file" if kind is None else f"is {kind}, not a regular file"
            raise WavecombError(f"{source}: {why}")
    return found


def natural(name: str) -> list[tuple[int, int, str]]:
    """Returns a sort key that orders numbers by value.

    >>> sorted(["a10.exr", "a9.exr"], key=natural)
    ['a9.exr', 'a10.exr']
    """
    parts = re.split(r"(\d+)", name)
    return [(1, int(part), "") if k % 2 else (0, 0, part) for k, part in enumerate(parts)]
