# SPDX-License-Identifier: Apache-2.0
"""Renders the tasks of a job; the stage stays open from task to task."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.errors import WavecombError
from wavecomb.farm.assemble import assemble
from wavecomb.farm.at_hand import stage_place
from wavecomb.farm.files import read_json, write_json
from wavecomb.farm.folder import Folder
from wavecomb.farm.output import write_picture
from wavecomb.farm.part import NarrowBorder, save_part
from wavecomb.farm.spec import Shot, Task
from wavecomb.farm.tiling import Rectangle, border, grown, most_looks
from wavecomb.picture.rendered import Picture, picture_of
from wavecomb.run.bands import without_samples
from wavecomb.run.checkpoint import Checkpoint, check_fits, load_checkpoint, make_header
from wavecomb.run.learned import load_learned
from wavecomb.run.sequence import Frames
from wavecomb.run.settings import check_memory
from wavecomb.run.watcher import CheckpointSink, Reporter, Watcher

if TYPE_CHECKING:
    from wavecomb._core import Settings, Snapshot
    from wavecomb.usd import LoadedStage

_ABSENT = re.compile(r"(texture|MaterialX file|IES profile) .* cannot be read|cannot open layer")
"""Of warnings: a file that the picture lacks."""
_MORE_LOOKS = 4
"""Beyond those that were seen, where a border was too narrow."""


class Stopped(Exception):
    """Somebody wants the task to end; a checkpoint holds what was done, unless another did it."""


class Absent(WavecombError):
    """A file that the stage names is not there: trying again brings the same."""


class _OnStop(CheckpointSink):
    """Saves a checkpoint now and then, and where a render was stopped; not at its end.

    Its header, which hashes the whole scene, is made when it is needed.
    """

    def __init__(
        self,
        is_stopped: Callable[[], bool],
        is_dropped: Callable[[], bool],
        path: str | os.PathLike[str],
        every: float,
        header: Callable[[], Mapping[str, Any]],
        seconds: float,
    ) -> None:
        super().__init__(path, every, {}, seconds)
        self._is_stopped = is_stopped
        self._is_dropped = is_dropped
        self._make_header = header

    def take(self, snapshot: Snapshot) -> str | None:
        """Writes the file, unless the render is done, or another's."""
        if self._is_dropped():
            return None
        return None if snapshot.finished and not self._is_stopped() else super().take(snapshot)

    def write(self, snapshot: Snapshot) -> None:
        """All that the render holds."""
        self._header = self._make_header()
        super().write(snapshot)


class Renderer:
    """Does tasks of one job, one after another."""

    def __init__(
        self,
        folder: Folder,
        *,
        threads: int = 0,
        reporter: Reporter | None = None,
        loading: Callable[[int, int], None] | None = None,
        is_stopped: Callable[[], bool] = lambda: False,
        is_dropped: Callable[[], bool] = lambda: False,
        log: Callable[[str], None] = lambda line: None,
    ) -> None:
        """Opens nothing yet.

        Args:
            folder: The job's.
            threads: 0: as the job says.
            reporter: Shows progress.
            loading: Called while a stage is read.
            is_stopped: Whether a task is to end early.
            is_dropped: Whether nobody wants what was done of it.
            log: Gets warnings.
        """
        self._folder = folder
        self._spec = folder.spec
        self._threads = threads
        self._reporter = reporter
        self._loading = loading
        self._is_stopped = is_stopped
        self._is_dropped = is_dropped
        self._log = log
        self._open: tuple[int, Frames] | None = None
        self._loaded: tuple[tuple[int, float | None], LoadedStage] | None = None
        self._warned: set[str] = set()
        self._given: bytes | None = None

    def close(self) -> None:
        """Lets the stage go."""
        self._open = self._loaded = None

    def do(self, task: Task, *, copy: bool = False) -> dict[str, Any]:
        """Does a task; gives what came of it, for its result.

        Args:
            task: The task.
            copy: Whether it is another's, too, whose checkpoint stays as it is.

        Raises:
            Stopped: It was to end early, or another did it meanwhile.
            Absent: A file is missing.
            WavecombError: It failed.
        """
        if task.is_join:
            picture = self._assemble(task.picture)
            self._check_wanted(task)
            files = write_picture(self._spec, task.picture, picture, self._threads)
            with contextlib.suppress(OSError):
                self._looks_file(task.picture).unlink()
            return {"files": files}
        shot = self._spec.shot(task)
        tile = self._spec.rectangles(task.picture)[int(task.part)]
        settings, rendered, looks = self._settings(task.picture, shot, tile)
        check_memory(settings, shot.aovs)
        picture, frames = self._render(task, shot, settings, copy)
        self._check_wanted(task)
        if not self._spec.is_tiled:
            files = write_picture(self._spec, task.picture, picture, settings.threads)
        else:
            save_part(
                self._folder.part(task), picture, job=self._spec.id, task=task, tile=tile,
                rendered=rendered, looks=looks, empty=self._empty(task, shot, frames, picture),
            )  # fmt: skip
            files = []
            if self._folder.is_done(self._spec.last_of(task.picture)):
                # Another did it, and the picture is there: nobody else would remove the tile.
                with contextlib.suppress(OSError):
                    self._folder.part(task).unlink()
        counts = picture.stats["counts"]
        return {
            "files": files, "samples": counts["samples"], "rays": counts["rays"],
            "seconds": picture.stats["seconds"], "peak_rss_bytes": picture.stats["peak_rss_bytes"],
        }  # fmt: skip

    def _check_wanted(self, task: Task) -> None:
        """Raises Stopped where another did a task meanwhile: what it wrote stays as it is."""
        if self._is_dropped() or self._folder.is_done(task):
            raise Stopped

    def _assemble(self, picture: int) -> Picture:
        try:
            return assemble(self._folder, picture)
        except NarrowBorder as error:
            write_json(self._looks_file(picture), error.passes + _MORE_LOOKS)
            self._folder.remove_parts(picture)
            raise

    def _looks_file(self, picture: int) -> Path:
        """Says how many looks borders have to allow for, where that turned out."""
        return self._folder.path / "parts" / f"{picture:06d}.looks"

    def _looks(self, picture: int, shot: Shot) -> int:
        if not shot.is_adaptive:
            return 0
        with contextlib.suppress(FileNotFoundError):
            return int(read_json(self._looks_file(picture)))
        return most_looks(shot.settings)

    def _settings(
        self, picture: int, shot: Shot, tile: Rectangle
    ) -> tuple[Settings, Rectangle, int]:
        """Settings of a tile, what is rendered of it, and the looks at errors that this allows."""
        from wavecomb import _core

        chosen = {**shot.settings, "threads": self._threads or shot.settings.get("threads", 0)}
        if not self._spec.is_tiled:
            return _core.Settings(**chosen), tile, 0
        looks = self._looks(picture, shot)
        rendered = grown(tile, border(shot.settings, looks), shot.region)
        return _core.Settings(**{**chosen, "region": rendered, "crop": True}), rendered, looks

    def _render(
        self, task: Task, shot: Shot, settings: Settings, copy: bool
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

        def header() -> dict[str, Any]:
            stage, aovs = self._spec.stage, shot.aovs
            return make_header(loaded.scene, settings, stage=stage, source={}, aovs=aovs)

        before, seconds, sinks = self._checkpoint(task, header), 0.0, []
        if before is not None:
            seconds = before.seconds
        if not (copy or (shot.is_adaptive and self._spec.is_tiled)):  # whose passes are counted
            file = self._folder.checkpoint(task)
            every, dropped = self._spec.every, self._is_dropped
            sinks.append(_OnStop(self._is_stopped, dropped, file, every, header, seconds))
        watcher = Watcher(
            sinks, reporter=self._reporter, is_stopped=self._is_stopped, warn=self._log
        )
        state = None if before is None else before.state
        result = frames.render(
            settings, costs=self._spec.costs, watcher=watcher, state=state, learned=self._learned()
        )
        if result.cancelled:
            raise Stopped
        stats = {**frames.stats(result, resumed_s=seconds), "stage": self._spec.stage}
        return picture_of(result, stats, scene=loaded.scene, aovs=shot.aovs), frames

    def _learned(self) -> bytes | None:
        """What guides all pictures of the job, if it was given that."""
        if self._given is None and self._folder.learned.exists():
            self._given = load_learned(self._folder.learned)
        return self._given

    def _load(self, frames: Frames, task: Task, shot: Shot) -> LoadedStage:
        """The stage for a task; tiles of one picture share it."""
        key = self._spec.pictures[task.picture]
        if self._loaded is None or self._loaded[0] != key:
            self._loaded = None
            size = int(shot.settings["width"]), int(shot.settings["height"])
            loaded = frames.load(self._spec.frame(task), progress=self._loading, size=size)
            self._check(loaded)
            self._loaded = key, loaded
        return self._loaded[1]

    def _frames(self, task: Task, threads: int) -> Frames:
        """The stage, open, for the shot of a task."""
        index = self._spec.pictures[task.picture][0]
        if self._open is None or self._open[0] != index:
            self.close()
            stage = stage_place(self._folder, self._spec.stage)
            options = _loading(self._spec.shots[index].loading)
            if options.get("session_layer"):
                options["session_layer"] = stage_place(self._folder, options["session_layer"])
            self._open = index, Frames(stage, threads=threads, **options)
        return self._open[1]

    def _check(self, loaded: LoadedStage) -> None:
        """Says what is wrong with the stage, each once; a file that is missing is an error."""
        lines = [finding.line() for finding in loaded.report.warnings]
        for line in lines:
            if self._spec.strict and _ABSENT.match(line):
                raise Absent(f"{line} (--no-strict renders without)")
            if line not in self._warned:
                self._warned.add(line)
                self._log(line)

    def _checkpoint(self, task: Task, header: Callable[[], Mapping[str, Any]]) -> Checkpoint | None:
        """What another began of a task; None: nothing that is of use."""
        file = self._folder.checkpoint(task)
        if not file.exists():
            return None
        try:
            found = load_checkpoint(file)
            check_fits(found, header())
        except (OSError, WavecombError) as error:
            self._log(f"begins anew: {error}")
            return None
        self._log(f"goes on after {found.seconds:.1f} s of rendering")
        return found

    def _empty(self, task: Task, shot: Shot, frames: Frames, picture: Picture) -> Picture | None:
        """A picture whose last pixel has no samples, where the whole one has such pixels."""
        cropped = shot.settings.get("region") is None or shot.settings.get("crop")
        if cropped or int(task.part) != 0:
            return None
        from wavecomb import _core

        def render(settings: Settings) -> Picture:
            return picture_of(frames.render(settings), picture.stats, aovs=shot.aovs)

        settings = _core.Settings(**{**shot.settings, "threads": 1})
        return without_samples(render, settings, 2)


def _loading(options: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of ``LoadOptions`` as they were before they were JSON."""
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in options.items()
    }
