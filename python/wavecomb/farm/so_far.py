# SPDX-License-Identifier: Apache-2.0
"""The picture so far: what is there of it, as its PNG would show it."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import DONE, Folder
from wavecomb.farm.part import load_part
from wavecomb.picture.embedded import encoded
from wavecomb.picture.image import display, read_layers, read_metadata
from wavecomb.picture.working_space import to_rec709

MOST_EDGE = 1600
"""Pixels of the longer edge; of larger pictures every second, third ... pixel is shown."""
_NOT_YET = 0.02
"""Of pixels whose tile is still to come: a dark grey, so that black is seen to be black."""


def shown_so_far(folder: Folder, picture: int, most: int = MOST_EDGE) -> NDArray[np.float32]:
    """Colours of a picture, linear Rec.709: of its file, or else of the tiles that are there.

    Args:
        folder: The job's.
        picture: Which one.
        most: Pixels of the longer edge.

    Raises:
        WavecombError: Nothing is there yet.
    """
    written = _written(folder, picture, most)
    if written is not None:
        return written
    spec = folder.spec
    shot = spec.shots[spec.pictures[picture][0]]
    x0, y0, x1, y1 = shot.region
    step = _step(x1 - x0, y1 - y0, most)
    room = np.full((-(-(y1 - y0) // step), -(-(x1 - x0) // step), 3), _NOT_YET, np.float32)
    found = False
    for task in spec.parts_of(picture):
        if not (folder.path / DONE / task.id).exists():
            continue
        try:
            part = load_part(folder.part(task), spec.id, task)
        except (OSError, WavecombError):
            continue  # it was put together meanwhile
        left, top = part.tile[:2]
        # The first pixels of the tile that are shown.
        dx, dy = -(left - x0) % step, -(top - y0) % step
        block = part.layers["beauty"][dy::step, dx::step]
        column, row = (left - x0 + dx) // step, (top - y0 + dy) // step
        space = str(part.stats.get("working_space", "rec709"))
        room[row : row + block.shape[0], column : column + block.shape[1]] = to_rec709(block, space)
        found = True
    if not found:
        written = _written(folder, picture, most)
        if written is None:
            raise WavecombError("nothing of the picture is there yet")
        return written
    return room


def _step(width: int, height: int, most: int) -> int:
    return max(1, -(-max(width, height) // most))


def _written(folder: Folder, picture: int, most: int) -> NDArray[np.float32] | None:
    """Of a picture that is done; None: it is not, or cannot be read."""
    spec = folder.spec
    if not (folder.path / DONE / spec.last_of(picture).id).exists():
        return None
    file = spec.place(spec.names(picture)["output"])
    try:
        layers, facts = read_layers(file), read_metadata(file)
    except (OSError, ValueError):
        return None
    colours: Any = layers.get("denoised", layers.get("beauty"))
    if colours is None or colours.shape[2] < 3:
        return None
    step = _step(colours.shape[1], colours.shape[0], most)
    space = str(facts.get("wavecomb:working_space", "rec709"))
    return np.ascontiguousarray(to_rec709(colours[::step, ::step, :3], space))


def png_so_far(folder: Folder, picture: int) -> bytes:
    """The same as a PNG with the job's exposure and tone map.

    Raises:
        WavecombError: Nothing is there yet.
    """
    spec = folder.spec
    names = spec.names(picture)
    if "png" in names and (folder.path / DONE / spec.last_of(picture).id).exists():
        with contextlib.suppress(OSError):
            return Path(spec.place(names["png"])).read_bytes()
    colours = shown_so_far(folder, picture)
    return encoded(display(colours, exposure=spec.exposure, tone_map=spec.tone_map))  # type: ignore[arg-type]
