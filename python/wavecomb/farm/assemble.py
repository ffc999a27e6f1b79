# SPDX-License-Identifier: Apache-2.0
"""Tiles to a picture: the one that one machine would have rendered, bit for bit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import Folder
from wavecomb.farm.part import NarrowBorder, Part, load_part
from wavecomb.farm.spec import Shot, Spec
from wavecomb.farm.tiling import Rectangle
from wavecomb.picture.rendered import Picture
from wavecomb.run.bands import sum_stats

_AOV = "aov."


def assemble(folder: Folder, picture: int) -> Picture:
    """A picture of its tiles, without what is made of it afterwards (``denoised``).

    Raises:
        DamagedPart: A tile is missing or damaged.
        WavecombError: The tiles do not cover the picture, each pixel once, or do not fit.
    """
    spec = folder.spec
    tasks = spec.parts_of(picture)
    rectangles = spec.rectangles(picture)
    shot = spec.shot(tasks[0])
    check_cover(shot.region, rectangles)
    parts = (load_part(folder.part(task), spec.id, task) for task in tasks)
    return join(spec, shot, zip(parts, rectangles, strict=True))


def join(spec: Spec, shot: Shot, parts: Iterable[tuple[Part, Rectangle]]) -> Picture:
    """A picture of parts, which are read one at a time, and where each has to lie."""
    x0, y0, _, _ = window = _window(shot)
    whole: dict[str, NDArray[Any]] = {}
    kept: list[Part] = []
    manifests: dict[str, dict[str, int]] = {}
    for part, rectangle in parts:
        if part.tile != rectangle:
            raise WavecombError(f"{part.name}: lies at {part.tile}, and has to lie at {rectangle}")
        if not kept:
            whole = {name: _room(part, name, window) for name in part.layers}
        if part.layers.keys() != whole.keys():
            odd = sorted(part.layers.keys() ^ whole.keys())[0]
            raise WavecombError(f"{part.name}: differs from other tiles in its layer {odd}")
        left, top, right, bottom = rectangle
        for name, layer in part.layers.items():
            whole[name][top - y0 : bottom - y0, left - x0 : right - x0] = layer
        for level, names in part.manifests.items():
            manifests.setdefault(level, {}).update(names)
        part.layers.clear()
        kept.append(part)
    _check_looks(kept)
    named: dict[str, Any] = {n: array for n, array in whole.items() if not n.startswith(_AOV)}
    aovs = {name[len(_AOV) :]: array for name, array in whole.items() if name.startswith(_AOV)}
    return Picture(
        **{"albedo": None, "normal": None, "depth": None, **named},
        stats=_stats(spec, shot, kept),
        costs=kept[-1].costs,
        aovs=aovs,
        # In the order of bytes, as the core sorts names.
        manifests={
            level: dict(sorted(names.items(), key=lambda one: one[0].encode()))
            for level, names in manifests.items()
        },
        metadata=kept[0].metadata,
        chosen=shot.aovs,
    )


def check_cover(region: Rectangle, tiles: Sequence[Rectangle]) -> None:
    """Raises WavecombError unless tiles cover a region, each pixel once, and nothing else.

    >>> check_cover((0, 0, 4, 4), [(0, 0, 4, 2), (0, 2, 4, 4)])
    """
    x0, y0, x1, y1 = region
    seen = np.zeros((y1 - y0, x1 - x0), np.uint8)
    for left, top, right, bottom in tiles:
        if not (x0 <= left < right <= x1 and y0 <= top < bottom <= y1):
            raise WavecombError(f"tile {(left, top, right, bottom)} leaves the picture {region}")
        block = seen[top - y0 : bottom - y0, left - x0 : right - x0]
        if block.any():
            raise WavecombError(f"tile {(left, top, right, bottom)} lies over another one")
        block[:] = 1
    if not seen.all():
        y, x = np.argwhere(seen == 0)[0]
        raise WavecombError(f"no tile has the pixel {x + x0}, {y + y0}")


def _window(shot: Shot) -> Rectangle:
    """Pixels that the file holds."""
    if shot.settings.get("crop") and shot.settings.get("region") is not None:
        return shot.region
    return 0, 0, int(shot.settings["width"]), int(shot.settings["height"])


def _room(part: Part, name: str, window: Rectangle) -> NDArray[Any]:
    """An array for a whole picture; pixels outside of the region hold what those do."""
    layer, empty = part.layers[name], part.empty.get(name)
    x0, y0, x1, y1 = window
    room: NDArray[Any] = np.empty((y1 - y0, x1 - x0, *layer.shape[2:]), layer.dtype)
    if empty is not None:
        room[:] = empty[0, 0]
    return room


def _check_looks(parts: Sequence[Part]) -> None:
    """Raises NarrowBorder where a border was too narrow for what happened in another tile.

    If no tile took more passes than each border allows for, all decisions are those of the whole
    picture: each is right within its tile as long as what it depends on was rendered.
    """
    most = max(part.passes for part in parts)
    for part in parts:
        if 0 < part.looks < most:
            raise NarrowBorder(
                f"{part.name}: its border is good for {part.looks} looks at errors, and a tile "
                f"took {most}: all are rendered again with wider ones",
                most,
            )


def _stats(spec: Spec, shot: Shot, parts: Sequence[Part]) -> dict[str, Any]:
    """The statistics of tiles as those of one render."""
    out = sum_stats([part.stats for part in parts], shot.settings)
    del out["bands"]
    out["tiles"] = len(parts)
    out["stage"] = spec.stage
    return out
