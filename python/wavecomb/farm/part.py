# SPDX-License-Identifier: Apache-2.0
"""Tiles of pictures on disk: exact blocks of all layers, and what is known of them.

A file is a NumPy archive that is not compressed: ``header``, JSON as bytes, and an array for each
layer, as the core gave it. No pixel is shared by two tiles, so pixels are final values: what a
whole picture holds at these places, bit for bit.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.farm.spec import Task
from wavecomb.farm.tiling import Rectangle
from wavecomb.picture.archive import ArchiveError, read_archive
from wavecomb.picture.files import replacing
from wavecomb.picture.rendered import Picture
from wavecomb.run.stats import plain

KIND = "wavecomb-farm-part"
FORMAT = 1
_LAYERS = ("beauty", "albedo", "normal", "depth", "samples", "error", "variance")
_AOV = "aov."
_EMPTY = "empty."


class DamagedPart(WavecombError):
    """A tile's file is absent or damaged: the tile has to be rendered again."""


class NarrowBorder(DamagedPart):
    """Borders of adaptive tiles were too narrow.

    Attributes:
        passes: The most that a tile took.
    """

    def __init__(self, message: str, passes: int) -> None:
        super().__init__(message)
        self.passes = passes


@dataclass(frozen=True)
class Part:
    """A tile.

    Attributes:
        name: Of its file.
        tile: Where it lies.
        layers: Arrays of the picture by name, AOVs with "aov." before it.
        empty: Of each the value of a pixel without samples, where the picture has such.
        stats: As ``make_stats`` gave them.
        metadata: As ``Picture.metadata``.
        manifests: As ``Picture.manifests``.
        costs: As ``Picture.costs``.
        passes: Passes over the pixels, which are looks at errors in an adaptive render.
        looks: Looks that its border allows for.
    """

    name: str
    tile: Rectangle
    layers: dict[str, NDArray[Any]]
    empty: dict[str, NDArray[Any]]
    stats: dict[str, Any]
    metadata: dict[str, Any]
    manifests: dict[str, dict[str, int]]
    costs: dict[str, dict[str, float]]
    passes: int
    looks: int


def layers_of(picture: Picture) -> dict[str, NDArray[Any]]:
    """All arrays of a picture, under names of a part."""
    found = {name: getattr(picture, name) for name in _LAYERS}
    found |= {_AOV + name: array for name, array in picture.aovs.items()}
    return {name: array for name, array in found.items() if array is not None}


def save_part(
    path: str | os.PathLike[str],
    picture: Picture,
    *,
    job: str,
    task: Task,
    tile: Rectangle,
    rendered: Rectangle,
    looks: int = 0,
    empty: Picture | None = None,
) -> None:
    """Writes a tile; it is on the disk, and whole, when it has its name.

    Args:
        path: The file.
        picture: What was rendered.
        job: Id of the job.
        task: The tile's.
        tile: Where it lies.
        rendered: Where the picture lies: the tile, perhaps with a border.
        looks: Looks at errors that this border allows for.
        empty: A picture whose last pixel has no samples.
    """
    x, y = tile[0] - rendered[0], tile[1] - rendered[1]
    width, height = tile[2] - tile[0], tile[3] - tile[1]
    arrays: dict[str, Any] = {
        name: np.ascontiguousarray(array[y : y + height, x : x + width])
        for name, array in layers_of(picture).items()
    }
    if empty is not None:
        arrays |= {_EMPTY + name: array[-1:, -1:] for name, array in layers_of(empty).items()}
    header = {
        "kind": KIND, "format": FORMAT, "job": job, "task": task.id, "tile": list(tile),
        "stats": plain(picture.stats), "metadata": _metadata_text(picture.metadata),
        "manifests": picture.manifests, "costs": plain(picture.costs),
        "passes": int(picture.stats.get("passes", 0)), "looks": looks,
    }  # fmt: skip
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    with replacing(path, durable=True) as part, part.open("wb") as file:
        np.savez(file, **arrays)


def load_part(path: str | os.PathLike[str], job: str, task: Task) -> Part:
    """Reads a tile.

    Raises:
        DamagedPart: It is not there, or damaged.
        WavecombError: It is of another job or tile.
    """
    name = os.fspath(path)
    try:
        header, arrays = read_archive(name)
        if not isinstance(header, dict) or header.get("kind") != KIND:
            raise ArchiveError("it is of another kind")
        if header.get("format") != FORMAT:
            raise WavecombError(f"{name}: is of format {header.get('format')}, not {FORMAT}")
        if header["job"] != job or header["task"] != task.id:
            raise WavecombError(
                f"{name}: is task {header['task']} of job {header['job']}, not {task.id} of {job}"
            )
        x0, y0, x1, y1 = (int(edge) for edge in header["tile"])
        _check_arrays(arrays, (y1 - y0, x1 - x0))
        return Part(
            name,
            (x0, y0, x1, y1),
            {key: array for key, array in arrays.items() if not key.startswith(_EMPTY)},
            {key[len(_EMPTY) :]: a for key, a in arrays.items() if key.startswith(_EMPTY)},
            dict(header["stats"]),
            _metadata_of(header["metadata"]),
            {level: dict(names) for level, names in header["manifests"].items()},
            dict(header["costs"]),
            int(header["passes"]),
            int(header["looks"]),
        )
    except FileNotFoundError:
        raise DamagedPart(f"{name}: is not there; the tile has to be rendered again") from None
    except (ArchiveError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise DamagedPart(
            f"{name}: is damaged: {error}; the tile has to be rendered again"
        ) from None


def _check_arrays(arrays: Mapping[str, NDArray[Any]], size: tuple[int, int]) -> None:
    if not {"beauty", "samples"} <= arrays.keys():
        raise ArchiveError("it lacks a layer")
    for name, array in arrays.items():
        wanted = (1, 1) if name.startswith(_EMPTY) else size
        if array.ndim not in (2, 3) or array.shape[:2] != wanted:
            raise ArchiveError(f"its layer {name} is of another size")


def _metadata_text(metadata: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: {"matrix": value.tolist()} if isinstance(value, np.ndarray) else plain(value)
        for name, value in metadata.items()
    }


def _metadata_of(text: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: np.array(value["matrix"], np.float64) if isinstance(value, dict) else value
        for name, value in text.items()
    }
