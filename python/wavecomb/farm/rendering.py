# SPDX-License-Identifier: Apache-2.0
"""Renders tiles of a job. The stage and the renderer stay loaded between tiles."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from wavecomb.errors import WavecombError
from wavecomb.farm.assembly import file_hash
from wavecomb.farm.job import Job, Shot, StageFile, Task
from wavecomb.farm.tiling import Rectangle, border, grown, max_error_checks
from wavecomb.image.rendered import Picture, picture_of
from wavecomb.path_maps import here, use_maps
from wavecomb.run.bands import without_samples
from wavecomb.run.callbacks import Reporter, Watcher
from wavecomb.run.sequence import Frames
from wavecomb.run.settings import check_memory

if TYPE_CHECKING:
    from pathlib import Path

    from wavecomb._core import Settings
    from wavecomb.usd import LoadedStage

_ABSENT = re.compile(r"(texture|MaterialX file|IES profile) .* cannot be read|cannot open layer")
"""Pattern of warnings about missing files of the stage."""
_MAX_NAMED = 3
_PLAN = "wavecomb-plan"


class Stopped(Exception):
    """Exception raised when a render was cancelled."""


class Renderer:
    """Renderer for the tiles of one job."""

    def __init__(
        self,
        job: Job,
        *,
        threads: int = 0,
        learned: bytes | None = None,
        reporter: Reporter | None = None,
        loading: Callable[[int, int], None] | None = None,
        is_stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Creates a renderer without opening the stage yet.

        Args:
            job: The job.
            threads: Number of threads; 0 uses the job's value.
            learned: Guiding field for all images, or None.
            reporter: Progress display of the render.
            loading: Called while a stage is loading.
            is_stopped: Returns whether to cancel the render.
        """
        self.job = job
        self.warnings: dict[str, None] = {}
        self._threads = threads
        self._learned = learned
        self._reporter = reporter
        self._loading = loading
        self._is_stopped = is_stopped
        self._plan: tuple[int, bytes] | None = None
        self._open: tuple[int, Frames] | None = None
        self._loaded: tuple[tuple[int, float | None], LoadedStage] | None = None

    def close(self) -> None:
        """Releases the stage."""
        self._open = self._loaded = None

    def render(
        self,
        task: Task,
        path: Path,
        machine: str,
        checks: int = 0,
        *,
        plan: Path | None = None,
        with_job: bool = False,
        replacing: Any = None,
    ) -> dict[str, Any]:
        """Renders a tile to a file.

        Args:
            task: The tile.
            path: File of the tile.
            machine: Class of this machine.
            checks: Number of error checks that a border must allow for; 0 means a likely number.
            plan: File that ``plan`` has written for the image. Without the file, the tile repeats
                the pilot renders, with the same results.
            with_job: Whether the tile file also stores the job.
            replacing: As in ``save_tile``.

        Returns:
            Counts for the progress display.

        Raises:
            Stopped: ``is_stopped`` cancelled the render.
            WavecombError: The stage or the settings cannot be rendered.
        """
        from wavecomb.farm.tile_file import replacing_quickly, save_tile

        shot, tile = self.job.shot(task.image), self.job.rectangles(task.image)[task.tile]
        settings, rendered, checks = self._settings(task.image, shot, tile, checks)
        check_memory(settings, shot.aovs)
        key = self.job.image_key(task.image, machine)
        learned = self._learned or self._planned(task.image, plan, key)
        picture, frames = self._render(task, shot, settings, learned)
        save_tile(
            path, picture, key=self.job.tile_key(task, machine), number=task.tile, tile=tile,
            rendered=rendered, machine=machine, checks=checks,
            empty=self._empty(task, shot, frames, picture),
            job=self.job.as_json() if with_job else None,
            replacing=replacing or replacing_quickly,
        )  # fmt: skip
        return {"samples": picture.stats["counts"]["samples"]}

    def plan(self, image: int, path: Path, machine: str) -> None:
        """Writes the results of an image's pilot renders to a file, unless it exists.

        Pilot renders do not depend on the pixels to render, so rendering one pixel is sufficient.

        Args:
            image: Index of the image.
            path: The file.
            machine: Class of this machine.

        Raises:
            Stopped: ``is_stopped`` cancelled the render.
            WavecombError: The stage or the settings cannot be rendered.
        """
        from wavecomb import _core

        key = self.job.image_key(image, machine)
        if load_plan(path, key) is not None:
            return
        shot = self.job.shot(image)
        x, y = shot.region[:2]
        pixel = {"region": (x, y, x + 1, y + 1), "crop": True}
        settings = _core.Settings(**{**self._chosen(shot), **pixel})
        picture, _ = self._render(Task(image, 0), shot, settings, None)
        save_plan(path, key, picture.learned)

    def _planned(self, image: int, path: Path | None, key: str) -> bytes | None:
        """Returns the results of an image's pilot renders, or None if they are unknown."""
        if path is None:
            return None
        if self._plan is None or self._plan[0] != image:
            learned = load_plan(path, key)
            if learned is None:
                return None
            self._plan = image, learned
        return self._plan[1] or None

    def _chosen(self, shot: Shot) -> dict[str, Any]:
        """Returns the settings of a shot with the number of threads of this renderer."""
        return {**shot.settings, "threads": self._threads or shot.settings.get("threads", 0)}

    def _settings(
        self, image: int, shot: Shot, tile: Rectangle, checks: int
    ) -> tuple[Settings, Rectangle, int]:
        """Returns a tile's settings, bordered rectangle and the border's number of error checks."""
        from wavecomb import _core

        chosen = self._chosen(shot)
        if self.job.tile_count(image) == 1:
            return _core.Settings(**chosen), shot.window, 0
        checks = error_checks_for(shot, checks)
        rendered = grown(tile, border(shot.settings, checks), shot.region)
        return _core.Settings(**{**chosen, "region": rendered, "crop": True}), rendered, checks

    def _render(
        self, task: Task, shot: Shot, settings: Settings, learned: bytes | None
    ) -> tuple[Picture, Frames]:
        frames = self._frames(task, settings.threads)
        loaded = self._load(frames, task, shot)
        if loaded.catchers:
            raise WavecombError(
                f"{loaded.catchers[0]}: is a shadow catcher, which takes three renders and is not "
                "for a farm: render the stage by `wavecomb render`"
            )
        if "light_groups" in shot.aovs:
            check_memory(settings, shot.aovs, len(loaded.scene.light_groups))
        watcher = Watcher(
            reporter=self._reporter, is_stopped=self._is_stopped,
            warn=lambda line: self.warnings.setdefault(line),
        )  # fmt: skip
        result = frames.render(settings, costs=self.job.costs, watcher=watcher, learned=learned)
        if result.cancelled:
            raise Stopped
        stats = {**frames.stats(result), "stage": self.job.stage}
        return picture_of(result, stats, scene=loaded.scene, aovs=shot.aovs), frames

    def _load(self, frames: Frames, task: Task, shot: Shot) -> LoadedStage:
        """Returns the loaded stage for a task. Tiles of one image share it."""
        key = self.job.images[task.image]
        if self._loaded is None or self._loaded[0] != key:
            self._loaded = None
            size = int(shot.settings["width"]), int(shot.settings["height"])
            loaded = frames.load(self.job.frame(task.image), progress=self._loading, size=size)
            for line in (
                *(finding.line() for finding in loaded.report.warnings), *loaded.scene.warnings,
            ):  # fmt: skip
                if self.job.strict and _ABSENT.match(line):
                    raise WavecombError(f"{line} (--no-strict renders without)")
                self.warnings.setdefault(line)
            self._loaded = key, loaded
        return self._loaded[1]

    def _frames(self, task: Task, threads: int) -> Frames:
        """Returns the open stage for the shot of a task."""
        index = self.job.images[task.image][0]
        if self._open is None or self._open[0] != index:
            self.close()
            options: dict[str, Any] = {
                name: tuple(value) if isinstance(value, list) else value
                for name, value in self.job.shots[index].loading.items()
            }
            if options.get("session_layer"):
                options["session_layer"] = self.job.place(options["session_layer"])
            stage = self.job.place(self.job.stage)
            self._open = index, Frames(stage, threads=threads, **options)
        return self._open[1]

    def _empty(self, task: Task, shot: Shot, frames: Frames, picture: Picture) -> Picture | None:
        """Renders a small image whose last pixel has the values of pixels without samples.

        Returns None if all pixels of the whole image have samples, and for all tiles except the
        first.
        """
        cropped = shot.settings.get("region") is None or shot.settings.get("crop")
        if cropped or task.tile != 0:
            return None
        from wavecomb import _core

        def render(settings: Settings) -> Picture:
            return picture_of(frames.render(settings), picture.stats, aovs=shot.aovs)

        return without_samples(render, _core.Settings(**{**shot.settings, "threads": 1}), 2)


def save_plan(path: Path, key: str, learned: bytes) -> None:
    """Writes the results of an image's pilot renders.

    Args:
        path: The file.
        key: ``Job.image_key`` of the image.
        learned: The results; empty if there were no pilot renders.
    """
    import numpy as np

    from wavecomb.image.files.archive import write_archive

    path.parent.mkdir(parents=True, exist_ok=True)
    header = {"kind": _PLAN, "key": key}
    write_archive(path, header, {"learned": np.frombuffer(learned, np.uint8)})


def load_plan(path: Path, key: str) -> bytes | None:
    """Reads a file of ``save_plan``.

    Returns None if the file is missing or damaged, or belongs to another image.
    """
    from wavecomb.image.files.archive import ArchiveError, read_archive

    try:
        header, arrays = read_archive(str(path))
        found = header == {"kind": _PLAN, "key": key}
        return bytes(arrays["learned"].tobytes()) if found else None
    except (OSError, ArchiveError, KeyError):
        return None


def error_checks_for(shot: Shot, checks: int = 0) -> int:
    """Returns the number of error checks of adaptive sampling that tile borders allow for.

    The number is ``checks`` or, if ``checks`` is 0, a likely number. Renders that are not adaptive
    need no error checks.
    """
    if not shot.is_adaptive:
        return 0
    return checks or max_error_checks(shot.settings)


def list_files(
    stage: str, variants: Mapping[str, str] | None, session_layer: str | None
) -> tuple[tuple[StageFile, ...], tuple[str, ...]]:
    """Lists all files that a stage needs, with hashes.

    Returns:
        The files, and a line for each missing file.

    Raises:
        WavecombError: The stage cannot be opened.
    """
    from pathlib import Path

    from wavecomb.api import import_usd

    import_usd()
    from wavecomb.usd.layers.dependencies import dependencies

    session = None if session_layer is None else Path(session_layer)
    found = dependencies(Path(stage), variants, session)
    files = []
    for path in found.files:
        stat = os.stat(path)
        files.append(StageFile(path, stat.st_size, stat.st_mtime_ns, file_hash(path)))
    return tuple(files), found.missing


def use_job_maps(job: Job) -> None:
    """Applies the path maps of a job to this process."""
    use_maps(here(job.maps))


def check_files(job: Job) -> None:
    """Raises WavecombError unless files of the job on this machine have the expected hashes."""
    lines = []
    for one in job.files:
        path = job.place(one.path)
        name = one.path if path == one.path else f"{one.path} ({path})"
        try:
            stat = os.stat(path)
            if (stat.st_size, stat.st_mtime_ns) == (one.bytes, one.mtime_ns):
                continue
            if stat.st_size != one.bytes or file_hash(path) != one.sha256:
                lines.append(f"{name} is not what it was when the job was submitted")
        except OSError as error:
            lines.append(f"{name} is not on this machine: {error.strerror}")
    if lines:
        more = len(lines) - _MAX_NAMED
        lines = lines[:_MAX_NAMED] + [f"and {more} more files"] * (more > 0)
        raise WavecombError("; ".join(lines))
