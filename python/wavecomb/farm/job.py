# SPDX-License-Identifier: Apache-2.0
"""Farm jobs: images, their tiles and render settings."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.tiling import MAX_TILES, Rectangle, tiles_of
from wavecomb.path_maps import Pair, here, mapped
from wavecomb.run.frame_names import fill, frame_text
from wavecomb.version import version

KIND = "wavecomb-farm-job"
FORMAT = 2
MAX_TASKS = 200_000
_MAX_EDGE = 65536


@dataclass(frozen=True)
class Shot:
    """A shot of a job: all frames of one camera or render product.

    Attributes:
        settings: Settings of the whole image, from ``Settings.to_dict``.
        aovs: AOVs, from ``aovs.expand``.
        loading: Fields of ``LoadOptions`` except the frame.
        output: File of the image, with a placeholder for the frame.
        png: File of the PNG, or None.
        stats: File of the statistics, or None.
    """

    settings: dict[str, Any]
    aovs: tuple[str, ...]
    loading: dict[str, Any]
    output: str
    png: str | None = None
    stats: str | None = None

    @property
    def region(self) -> Rectangle:
        """Rectangle of pixels to render."""
        found = self.settings.get("region")
        if found is None:
            return 0, 0, int(self.settings["width"]), int(self.settings["height"])
        x0, y0, x1, y1 = (int(edge) for edge in found)
        return x0, y0, x1, y1

    @property
    def window(self) -> Rectangle:
        """Rectangle of pixels that the image file holds."""
        if self.settings.get("crop") and self.settings.get("region") is not None:
            return self.region
        return 0, 0, int(self.settings["width"]), int(self.settings["height"])

    @property
    def is_adaptive(self) -> bool:
        """Whether the number of samples of a pixel depends on its error."""
        return bool(self.settings.get("adaptive"))


@dataclass(frozen=True)
class StageFile:
    """A file that the stage needs, such as a layer, texture or IES profile.

    If the size (``bytes``) and the time (``mtime_ns``) of a file are the same on a machine, the
    hash is not verified.
    """

    path: str
    bytes: int
    mtime_ns: int
    sha256: str


@dataclass(frozen=True, order=True)
class Task:
    """A tile of an image, by indices into the job."""

    image: int
    tile: int


@dataclass(frozen=True)
class Job:
    """A farm job. Every field can be stored as JSON.

    Attributes:
        stage: File name as the user gave it; a relative name is relative to ``folder``.
        folder: Working folder of ``farm submit``.
        shots: See ``Shot``.
        images: For each image, the index of its shot, and its frame or None.
        files: Files of the stage with their hashes.
        tiles: Numbers of tile columns and tile rows in each image.
        file: Arguments half, compression, tile and split of ``Picture.save``.
        exposure: Exposure of PNGs, in stops.
        tone_map: Tone mapping of PNGs.
        denoise: Whether images get the layer ``denoised``.
        costs: Initial profile of scheduling costs.
        learned: SHA-256 of the guiding field for all images, or None.
        tries: Number of attempts for each task.
        hang_s: Time in seconds without progress after which a worker is restarted.
        strict: Whether a missing file is an error.
        maps: Pairs of folders. Machines that lack the first folder of a pair look for its files in
            the second folder.
        isa: Instruction set that all workers must use; None allows any set that all workers share.
        version: Version of Wavecomb.
    """

    stage: str
    folder: str
    shots: tuple[Shot, ...]
    images: tuple[tuple[int, float | None], ...]
    files: tuple[StageFile, ...] = ()
    tiles: tuple[int, int] = (1, 1)
    file: dict[str, Any] = field(default_factory=dict)
    exposure: float = 0.0
    tone_map: str = "clamp"
    denoise: bool = False
    costs: dict[str, dict[str, float]] | None = None
    learned: str | None = None
    tries: int = 3
    hang_s: float = 1800.0
    strict: bool = True
    maps: tuple[Pair, ...] = ()
    isa: str | None = None
    version: str = field(default_factory=version)

    def __post_init__(self) -> None:
        """Creates caches for values that depend on the image and are computed once."""
        object.__setattr__(self, "_rectangles", {})
        object.__setattr__(self, "_image_keys", {})

    @property
    def id(self) -> str:
        """Hash of the whole job description."""
        return hashed(self.as_json())

    def shot(self, image: int) -> Shot:
        """Returns the camera or render product of an image, with its settings."""
        return self.shots[self.images[image][0]]

    def frame(self, image: int) -> float | None:
        """Returns the frame of an image, or None."""
        return self.images[image][1]

    def rectangles(self, image: int) -> list[Rectangle]:
        """Returns the tiles of an image, row by row."""
        known: dict[Rectangle, list[Rectangle]] = self._rectangles  # type: ignore[attr-defined]
        region = self.shot(image).region
        if region not in known:
            known[region] = tiles_of(region, self.tiles)
        return known[region]

    def tile_count(self, image: int) -> int:
        """Returns the number of tiles of an image.

        Tiles never have more columns or rows than the image has pixels.
        """
        x0, y0, x1, y1 = self.shot(image).region
        return min(self.tiles[0], x1 - x0) * min(self.tiles[1], y1 - y0)

    def tasks_of(self, image: int) -> list[Task]:
        """Returns the tasks of an image."""
        return [Task(image, tile) for tile in range(self.tile_count(image))]

    def tasks(self) -> Iterator[Task]:
        """Iterates over all tasks, in render order."""
        for image in range(len(self.images)):
            yield from self.tasks_of(image)

    def task_count(self) -> int:
        """Returns the number of tasks."""
        return sum(self.tile_count(image) for image in range(len(self.images)))

    def names(self, image: int) -> dict[str, str]:
        """Returns the files of an image by kind: output, png, stats."""
        shot, frame = self.shot(image), self.frame(image)
        found = {"output": shot.output, "png": shot.png, "stats": shot.stats}
        return {
            kind: name if frame is None else fill(name, frame)
            for kind, name in found.items()
            if name is not None
        }

    def place(self, name: str) -> str:
        """Returns the path of a file of the job on this machine, after path mapping."""
        return mapped(os.path.join(self.folder, name), here(self.maps))

    def title(self, image: int, tile: int | None = None) -> str:
        """Returns a name of an image or tile for messages, such as "frame 12, tile 3 of 8"."""
        frame = self.frame(image)
        words = [] if frame is None else [f"frame {frame_text(frame)}"]
        if len(self.shots) > 1:
            words.append(f"product {self.images[image][0] + 1} of {len(self.shots)}")
        if tile is not None and self.tile_count(image) > 1:
            words.append(f"tile {tile + 1} of {self.tile_count(image)}")
        return ", ".join(words) or "the image"

    # ---- keys ------------------------------------------------------------------------------------

    def image_key(self, image: int, machine: str) -> str:
        """Returns a hash of all inputs that determine the pixels of an image.

        Args:
            image: Index of the image.
            machine: Machine class, from ``machine_class``.
        """
        known: dict[tuple[int, str], str] = self._image_keys  # type: ignore[attr-defined]
        if (image, machine) in known:
            return known[image, machine]
        shot = self.shot(image)
        known[image, machine] = found = hashed(
            {
                "stage": self.stage, "files": [(one.path, one.sha256) for one in self.files],
                "settings": {**shot.settings, "threads": 0}, "aovs": shot.aovs,
                "loading": shot.loading, "frame": self.frame(image), "costs": self.costs,
                "learned": self.learned, "version": self.version, "machine": machine,
            }
        )  # fmt: skip
        return found

    def tile_key(self, task: Task, machine: str) -> str:
        """Returns a hash of all inputs that determine the pixels of a tile."""
        tile = self.rectangles(task.image)[task.tile]
        return hashed({"image": self.image_key(task.image, machine), "tile": tile})

    def output_key(self, image: int) -> str:
        """Returns a hash of all inputs of an image's files, except the machine class."""
        return hashed(
            {
                "image": self.image_key(image, ""), "names": self.names(image), "file": self.file,
                "exposure": self.exposure, "tone_map": self.tone_map, "denoise": self.denoise,
            }
        )  # fmt: skip

    # ---- JSON ------------------------------------------------------------------------------------

    def as_json(self) -> dict[str, Any]:
        """Returns the job as a dictionary for ``job.json``."""
        return {"kind": KIND, "format": FORMAT, **asdict(self)}

    @classmethod
    def of(cls, value: Any, name: str) -> Job:
        """Reads a job from parsed JSON.

        Raises:
            WavecombError: The JSON is not a job, has another format, or is damaged. The message
                begins with ``name``.
        """
        if not isinstance(value, Mapping) or value.get("kind") != KIND:
            raise WavecombError(f"{name}: is not a job of `wavecomb farm submit`")
        if value.get("format") != FORMAT:
            raise WavecombError(
                f"{name}: is a job of format {value.get('format')!s:.20}, and this version of "
                f"Wavecomb reads format {FORMAT} only: submit the job again"
            )
        try:
            return _checked(cls, value)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            why = error.args[0] if isinstance(error, ValueError) and error.args else repr(error)
            raise WavecombError(f"{name}: is damaged: {why}; submit the job again") from None


def hashed(value: Any) -> str:
    """Returns the SHA-256 of a value's JSON text."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), default=list)
    return hashlib.sha256(text.encode()).hexdigest()


def _checked(cls: type[Job], value: Mapping[str, Any]) -> Job:
    given = {one.name: value[one.name] for one in fields(cls)}
    shots = tuple(_shot(one) for one in _list(given["shots"], "shots"))
    images = []
    for shot, frame in _list(given["images"], "images"):
        _whole(shot, 0, len(shots) - 1, "an image's shot")
        images.append((shot, None if frame is None else _real(frame, "an image's frame")))
    columns, rows = (_whole(n, 1, MAX_TILES, "tiles") for n in given["tiles"])
    files = tuple(StageFile(**one) for one in given["files"])
    for one in files:
        if not (isinstance(one.path, str) and isinstance(one.sha256, str)):
            raise ValueError("files: must have path and sha256")
    if not (isinstance(given["stage"], str) and isinstance(given["folder"], str)):
        raise ValueError("stage and folder: must be names")
    if given["tone_map"] not in ("clamp", "neutral") and not str(given["tone_map"]).startswith(
        "ocio:"
    ):
        raise ValueError("tone_map: must be clamp, neutral or ocio:VIEW")
    job = cls(
        **{
            **given, "shots": shots, "images": tuple(images), "files": files,
            "tiles": (columns, rows), "maps": tuple((str(a), str(b)) for a, b in given["maps"]),
            "tries": _whole(given["tries"], 1, 100, "tries"),
            "hang_s": _real(given["hang_s"], "hang_s", 1.0),
            "exposure": _real(given["exposure"], "exposure"), "file": dict(given["file"]),
        }
    )  # fmt: skip
    if job.task_count() > MAX_TASKS:
        raise ValueError(f"{job.task_count():,} tasks: there may be {MAX_TASKS:,}")
    return job


def _shot(value: Mapping[str, Any]) -> Shot:
    shot = Shot(**{**value, "aovs": tuple(value["aovs"])})
    width = _whole(shot.settings["width"], 1, _MAX_EDGE, "width")
    height = _whole(shot.settings["height"], 1, _MAX_EDGE, "height")
    x0, y0, x1, y1 = shot.region
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise ValueError(f"region {[x0, y0, x1, y1]}: is empty or leaves the image")
    names = [shot.output, *(one for one in (shot.png, shot.stats) if one is not None)]
    if not all(isinstance(name, str) and name for name in (*names, *shot.aovs)):
        raise ValueError("output, png, stats and aovs: must be names")
    if not isinstance(shot.loading, dict):
        raise ValueError("loading: must be an object")
    return shot


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise ValueError(f"{what}: must be a list with an entry")
    return value


def _whole(value: Any, least: int, most: int, what: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ValueError(f"{what}: must be a whole number from {least} to {most}")
    return value


def _real(value: Any, what: str, least: float = -math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{what}: must be a number")
    if not math.isfinite(value) or value < least:
        raise ValueError(f"{what}: must be finite" + (f", at least {least:g}" * (least > 0)))
    return float(value)
