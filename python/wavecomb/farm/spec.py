# SPDX-License-Identifier: Apache-2.0
"""What a job is: pictures, tiles of them, and how they are rendered; as JSON in its folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.maps import Pair, here, place
from wavecomb.farm.tiling import Rectangle, tiles_of
from wavecomb.run.frame_names import fill, frame_text
from wavecomb.version import version

KIND = "wavecomb-farm-job"
FORMAT = 1
JOIN = "join"
"""In place of a tile's number: the task that puts a picture's tiles together."""
MAX_TASKS = 200_000


@dataclass(frozen=True)
class Shot:
    """Pictures of one camera or product.

    Attributes:
        settings: Of the whole picture, as ``Settings.to_dict`` gives them.
        aovs: As ``aovs.expand`` gives them.
        loading: Fields of ``LoadOptions``, but the frame.
        output: The picture's file, with a place for the frame.
        png: Likewise; None: there is none.
        stats: Likewise.
    """

    settings: dict[str, Any]
    aovs: tuple[str, ...]
    loading: dict[str, Any]
    output: str
    png: str | None = None
    stats: str | None = None

    @property
    def region(self) -> Rectangle:
        """Pixels that are rendered."""
        found = self.settings.get("region")
        if found is None:
            return 0, 0, int(self.settings["width"]), int(self.settings["height"])
        x0, y0, x1, y1 = (int(edge) for edge in found)
        return x0, y0, x1, y1

    @property
    def is_adaptive(self) -> bool:
        """Whether pixels end by their error."""
        return bool(self.settings.get("adaptive"))


@dataclass(frozen=True)
class Task:
    """A piece of work: a tile of a picture, a whole one, or putting one together.

    Attributes:
        picture: Index in ``Spec.pictures``.
        part: Number of the tile, or ``JOIN``.
    """

    picture: int
    part: str

    @property
    def id(self) -> str:
        """Its name: that of its files."""
        return f"{self.picture:06d}.{self.part}"

    @classmethod
    def of(cls, text: str) -> Task:
        """The task of an id. Raises WavecombError."""
        number, point, part = text.partition(".")
        if not (point and number.isdecimal() and (part == JOIN or part.isdecimal())):
            raise WavecombError(
                f"task {text}: is no task; `wavecomb farm status --json` lists them"
            )
        return cls(int(number), part)

    @property
    def is_join(self) -> bool:
        """Whether it puts a picture together."""
        return self.part == JOIN


@dataclass(frozen=True)
class Spec:
    """A job; every field is JSON.

    Attributes:
        id: Of its own: parts of another job are refused.
        stage: As it was given; a relative name counts from ``folder``.
        folder: Where the job was submitted.
        shots: See ``Shot``.
        pictures: (index of the shot, frame or None) of each picture.
        tiles: Columns and rows of tiles of each picture.
        chunk: Pictures that a worker takes one after another.
        file: half, compression, tile and split of ``Picture.save``.
        exposure: Of PNGs.
        tone_map: Likewise.
        denoise: Whether pictures get the layer ``denoised``.
        costs: A profile to start from.
        tries: Of a task.
        every: Seconds between checkpoints of a task.
        lease_s: A worker that gave no sign for so long has lost its task.
        hang_s: A render that said nothing for so long is ended.
        slow: A task that takes so many times as long as others is begun elsewhere, too, where
            nothing else is left to do; 0: never.
        strict: Whether a file that is missing fails a picture.
        assets: "shared": workers see the stage's files; "copy": those that lack them fetch them.
        maps: Folders that lie elsewhere, where they are not found under their first name.
        isa: Library that workers are to use; None: that of the first worker.
        command: The words that made it.
        version: Of Wavecomb.
    """

    id: str
    stage: str
    folder: str
    shots: tuple[Shot, ...]
    pictures: tuple[tuple[int, float | None], ...]
    tiles: tuple[int, int] = (1, 1)
    chunk: int = 1
    file: dict[str, Any] = field(default_factory=dict)
    exposure: float = 0.0
    tone_map: str = "clamp"
    denoise: bool = False
    costs: dict[str, dict[str, float]] | None = None
    tries: int = 3
    every: float = 120.0
    lease_s: float = 60.0
    hang_s: float = 1800.0
    slow: float = 3.0
    strict: bool = True
    assets: str = "shared"
    maps: tuple[Pair, ...] = ()
    isa: str | None = None
    command: tuple[str, ...] = ()
    version: str = field(default_factory=version)

    @property
    def is_tiled(self) -> bool:
        """Whether pictures have more than one tile."""
        return self.tiles != (1, 1)

    def shot(self, task: Task) -> Shot:
        """That of a task."""
        return self.shots[self.pictures[task.picture][0]]

    def frame(self, task: Task) -> float | None:
        """That of a task."""
        return self.pictures[task.picture][1]

    def rectangles(self, picture: int) -> list[Rectangle]:
        """The tiles of a picture."""
        shot = self.shots[self.pictures[picture][0]]
        return tiles_of(shot.region, self.tiles)

    def parts_of(self, picture: int) -> list[Task]:
        """The tasks of a picture's tiles."""
        return [Task(picture, f"{number:04d}") for number in range(self.tile_count(picture))]

    def last_of(self, picture: int) -> Task:
        """The task that writes a picture's files."""
        return Task(picture, JOIN if self.is_tiled else "0000")

    def tile_count(self, picture: int) -> int:
        """How many tiles a picture has: no more columns and rows than pixels."""
        x0, y0, x1, y1 = self.shots[self.pictures[picture][0]].region
        return min(self.tiles[0], x1 - x0) * min(self.tiles[1], y1 - y0)

    def tasks(self) -> list[Task]:
        """All, in the order in which they are best done."""
        out: list[Task] = []
        for picture in range(len(self.pictures)):
            out += self.parts_of(picture)
            out += [Task(picture, JOIN)] * self.is_tiled
        return out

    def names(self, picture: int) -> dict[str, str]:
        """Files of a picture by what they are: output, png, stats."""
        index, frame = self.pictures[picture]
        shot = self.shots[index]
        found = {"output": shot.output, "png": shot.png, "stats": shot.stats}
        return {
            kind: name if frame is None else fill(name, frame)
            for kind, name in found.items()
            if name is not None
        }

    def place(self, name: str) -> str:
        """Where a file of the job lies on this machine."""
        return place(os.path.join(self.folder, name), here(self.maps))

    def title(self, task: Task) -> str:
        """A task for people.

        >>> # frame 12, tile 3 of 8
        """
        frame = self.frame(task)
        words = [] if frame is None else [f"frame {frame_text(frame)}"]
        if len(self.shots) > 1:
            words.append(f"product {self.pictures[task.picture][0] + 1} of {len(self.shots)}")
        if task.is_join:
            words.append("assembly")
        elif self.is_tiled:
            words.append(f"tile {int(task.part) + 1} of {self.tile_count(task.picture)}")
        return ", ".join(words) or "the picture"

    def as_json(self) -> dict[str, Any]:
        """For a file."""
        return {"kind": KIND, "format": FORMAT, **asdict(self)}

    @classmethod
    def of(cls, value: Any, name: str) -> Spec:
        """What a file said; raises WavecombError that begins with its name."""
        if not isinstance(value, Mapping) or value.get("kind") != KIND:
            raise WavecombError(f"{name}: is no job of `wavecomb farm submit`")
        if value.get("format") != FORMAT:
            raise WavecombError(
                f"{name}: is a job of format {value.get('format')}, by Wavecomb "
                f"{value.get('version')}; this is {version()}, which reads format {FORMAT}"
            )
        try:
            given = {one.name: value[one.name] for one in fields(cls) if one.name in value}
            shots = tuple(Shot(**{**one, "aovs": tuple(one["aovs"])}) for one in given["shots"])
            pictures = tuple(
                (int(shot), None if frame is None else float(frame))
                for shot, frame in given["pictures"]
            )
            columns, rows = given["tiles"]
            given |= {
                "shots": shots, "pictures": pictures, "tiles": (int(columns), int(rows)),
                "command": tuple(given["command"]),
                "maps": tuple((str(named), str(lies)) for named, lies in given.get("maps", ())),
            }  # fmt: skip
            return cls(**given)
        except (KeyError, TypeError, ValueError) as error:
            raise WavecombError(f"{name}: is damaged: {error!r}") from None
