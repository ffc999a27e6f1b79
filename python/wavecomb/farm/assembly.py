# SPDX-License-Identifier: Apache-2.0
"""Joins tiles to the image that one process would have rendered, bit for bit.

This module also reports the progress of a job.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import Folder, write_json
from wavecomb.farm.job import Job, Shot, Task
from wavecomb.farm.tile_file import AOV, InvalidTile, RenderedTile, has_tile, load_tile, read_tile
from wavecomb.farm.tiling import Rectangle
from wavecomb.image.rendered import Picture
from wavecomb.run.bands import sum_stats
from wavecomb.run.stats import write_stats

_MORE_CHECKS = 4
"""If borders were too narrow, tiles are rendered again with borders that allow for this many more
error checks than any tile took."""


class NarrowBorder(WavecombError):
    """Error for adaptive tiles that must be rendered again because their borders were too narrow.

    Attributes:
        passes: Largest number of render passes that any tile took.
    """

    def __init__(self, message: str, passes: int) -> None:
        super().__init__(message)
        self.passes = passes


def join(job: Job, image: int, parts: Iterable[RenderedTile]) -> Picture:
    """Joins tiles into an image without denoising; only one tile at a time is in memory.

    Raises:
        InvalidTile: A tile is missing or damaged.
        NarrowBorder: Borders of adaptive tiles were too narrow.
        WavecombError: The tiles do not cover each pixel of the image exactly once, or differ in
            their layers.
    """
    shot, rectangles = job.shot(image), job.rectangles(image)
    check_cover(shot.region, rectangles)
    x0, y0, _, _ = window = shot.window
    whole: dict[str, NDArray[Any]] = {}
    kept: list[RenderedTile] = []
    manifests: dict[str, dict[str, int]] = {}
    for part, rectangle in zip(parts, rectangles, strict=True):
        if part.tile != rectangle:
            raise WavecombError(f"{part.name}: lies at {part.tile} and must lie at {rectangle}")
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
    _verify_borders(kept)
    named: dict[str, Any] = {n: array for n, array in whole.items() if not n.startswith(AOV)}
    return Picture(
        **{"albedo": None, "normal": None, "depth": None, **named},
        stats=_stats(job, shot, kept),
        costs=kept[-1].costs,
        aovs={n[len(AOV) :]: array for n, array in whole.items() if n.startswith(AOV)},
        # The core sorts names by their UTF-8 bytes.
        manifests={
            level: dict(sorted(names.items(), key=lambda one: one[0].encode()))
            for level, names in manifests.items()
        },
        metadata=kept[0].metadata,
        chosen=shot.aovs,
    )


def check_cover(region: Rectangle, tiles: Sequence[Rectangle]) -> None:
    """Raises WavecombError unless tiles cover each pixel of a region exactly once.

    >>> check_cover((0, 0, 4, 4), [(0, 0, 4, 2), (0, 2, 4, 4)])
    """
    x0, y0, x1, y1 = region
    seen = np.zeros((y1 - y0, x1 - x0), np.uint8)
    for left, top, right, bottom in tiles:
        if not (x0 <= left < right <= x1 and y0 <= top < bottom <= y1):
            raise WavecombError(f"tile {(left, top, right, bottom)} leaves the image {region}")
        block = seen[top - y0 : bottom - y0, left - x0 : right - x0]
        if block.any():
            raise WavecombError(f"tile {(left, top, right, bottom)} lies over another one")
        block[:] = 1
    if not seen.all():
        y, x = np.argwhere(seen == 0)[0]
        raise WavecombError(f"no tile has the pixel {x + x0}, {y + y0}")


def _room(part: RenderedTile, name: str, window: Rectangle) -> NDArray[Any]:
    """Allocates an array for the whole image, filled with the value of pixels without samples."""
    layer, empty = part.layers[name], part.empty.get(name)
    x0, y0, x1, y1 = window
    room: NDArray[Any] = np.empty((y1 - y0, x1 - x0, *layer.shape[2:]), layer.dtype)
    if empty is not None:
        room[:] = empty
    return room


def _verify_borders(parts: Sequence[RenderedTile]) -> None:
    """Raises NarrowBorder if a tile took more passes than the border of any tile allows for.

    An adaptive render decides from the error of a pixel and its neighbours whether to sample the
    pixel further. A tile makes the same decisions as the whole image only if its border contains
    all pixels that affect them, which holds if no tile took more passes than its border allows for.
    """
    most = max(part.passes for part in parts)
    for part in parts:
        if 0 < part.checks < most:
            raise NarrowBorder(
                f"{part.name}: its border is wide enough for {part.checks} error checks, and a "
                f"tile took {most}: all tiles must be rendered again with wider borders",
                most,
            )


def _stats(job: Job, shot: Shot, parts: Sequence[RenderedTile]) -> dict[str, Any]:
    """Merges the statistics of tiles into statistics of one render."""
    out = sum_stats([part.stats for part in parts], shot.settings)
    del out["bands"]
    out["tiles"] = len(parts)
    out["stage"] = job.stage
    return out


# ---- files ---------------------------------------------------------------------------------------


def write_image(job: Job, image: int, picture: Picture, threads: int) -> list[str]:
    """Writes the PNG, the statistics and finally the EXR. No file is ever partially written.

    Args:
        job: The job.
        image: Index of the image.
        picture: Result of ``join``.
        threads: Number of threads for denoising.

    Returns:
        Names of the files.
    """
    if job.denoise:
        picture = picture.with_denoised(threads=threads)
    # The file header states the settings of the whole image, not of a tile.
    settings = dict(job.shot(image).settings)
    picture = replace(picture, stats={**picture.stats, "settings": settings})
    names = {kind: job.place(name) for kind, name in job.names(image).items()}
    os.makedirs(os.path.dirname(names["output"]) or os.curdir, exist_ok=True)
    written = []
    if "png" in names:
        picture.save(names["png"], exposure=job.exposure, tone_map=job.tone_map)  # type: ignore[arg-type]
        written.append(names["png"])
    if "stats" in names:
        write_stats(names["stats"], picture.stats)
        written.append(names["stats"])
    return [str(name) for name in picture.save(names["output"], **job.file)] + written


def write_record(folder: Folder, image: int, files: Sequence[str]) -> None:
    """Records the hashes of an image's files for ``is_finished``."""
    file = folder.record(image)
    file.parent.mkdir(exist_ok=True)
    sums = {os.path.basename(name): file_hash(name) for name in files}
    write_json(file, {"key": folder.job.output_key(image), "files": sums})


def is_finished(folder: Folder, image: int, *, quick: bool = False) -> bool:
    """Returns whether all files of an image exist, belong to this job and are unchanged.

    Args:
        folder: Folder of the job.
        image: Index of the image.
        quick: Whether to check only that the files exist, without their hashes.
    """
    job = folder.job
    try:
        record = json.loads(folder.record(image).read_text(encoding="utf-8"))
        if record["key"] != job.output_key(image):
            return False
        where = {os.path.basename(name): job.place(name) for name in job.names(image).values()}
        beside = os.path.dirname(job.place(job.names(image)["output"]))
        if not where.keys() <= record["files"].keys():
            return False
        for name, wanted in record["files"].items():
            path = where.get(name, os.path.join(beside, name))
            if not os.path.isfile(path) or not (quick or file_hash(path) == wanted):
                return False
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False
    return True


def file_hash(path: str | os.PathLike[str]) -> str:
    """Returns the SHA-256 of a file."""
    found = hashlib.sha256()
    with Path(path).open("rb") as file:
        while block := file.read(1 << 20):
            found.update(block)
    return found.hexdigest()


# ---- a job's images ------------------------------------------------------------------------------


def machine_of(folder: Folder, task: Task) -> str:
    """Returns the machine class that rendered a tile, or "" if no such tile of this job exists."""
    file = folder.part(task)
    if not file.exists():
        return ""
    try:
        part = read_tile(file)
    except InvalidTile:
        return ""
    return part.machine if part.key == folder.job.tile_key(task, part.machine) else ""


def finish_image(folder: Folder, image: int, machine: str, threads: int = 0) -> dict[str, Any]:
    """Joins the tiles of an image, writes its files and removes the tiles.

    Args:
        folder: Folder of the job.
        image: Index of the image.
        machine: Class of the machines that rendered the tiles.
        threads: Number of threads for denoising.

    Returns:
        A dictionary with ``files``, the files written. If tiles must be rendered first, the
            dictionary also has the entries ``again``, the indices of these tiles, and ``checks``,
            the number of error checks that their borders must allow for, or 0.
    """
    job = folder.job
    tasks = list(zip(job.tasks_of(image), job.rectangles(image), strict=True))
    parts = (load_tile(folder.part(t), job.tile_key(t, machine), tile) for t, tile in tasks)
    try:
        picture = join(job, image, parts)
    except NarrowBorder as error:
        again = [task.tile for task, _ in tasks]
        return {"again": again, "checks": error.passes + _MORE_CHECKS}
    except InvalidTile:
        if is_finished(folder, image):
            # another client has finished the image and removed the image's tiles
            return {"files": []}
        again = [
            task.tile
            for task, tile in tasks
            if not has_tile(folder.part(task), job.tile_key(task, machine), tile)
        ]
        return {"again": again, "checks": 0}
    files = write_image(job, image, picture, threads)
    write_record(folder, image, files)
    shutil.rmtree(folder.parts(image), ignore_errors=True)
    return {"files": files}


@dataclass
class Outcome:
    """Progress of a job.

    Attributes:
        tasks: Number of tiles.
        tasks_done: Number of rendered tiles.
        images: Number of images.
        images_done: Number of written images.
        failed: Title and error line of each tile or image that failed.
        stopped: Whether ``is_stopped`` ended the run.
        others: Number of workers that were not used because their machine class differs.
    """

    tasks: int
    images: int
    tasks_done: int = 0
    images_done: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    stopped: bool = False
    others: int = 0

    @property
    def state(self) -> str:
        """State of the job: "done", "failed" or "unfinished"."""
        if self.images_done == self.images:
            return "done"
        return "failed" if self.failed else "unfinished"

    def as_dict(self) -> dict[str, Any]:
        """Returns the progress as a dictionary for JSON output."""
        return {
            "state": self.state, "tasks": {"all": self.tasks, "done": self.tasks_done},
            "images": {"all": self.images, "done": self.images_done},
            "failed": [{"title": title, "error": line} for title, line in self.failed],
        }  # fmt: skip


def status(folder: Folder) -> Outcome:
    """Returns the progress of a job. Reads and verifies each file."""
    job = folder.job
    out = Outcome(job.task_count(), len(job.images))
    for image in range(len(job.images)):
        if is_finished(folder, image):
            out.images_done += 1
            out.tasks_done += job.tile_count(image)
            continue
        keys: dict[str, int] = {}
        for task in job.tasks_of(image):
            machine = machine_of(folder, task)
            keys[machine] = keys.get(machine, 0) + 1
        keys.pop("", None)
        out.tasks_done += max(keys.values(), default=0)
    return out
