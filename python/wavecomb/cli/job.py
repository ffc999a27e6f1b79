# SPDX-License-Identifier: Apache-2.0
"""Loading, rendering and writing of one image of ``wavecomb render``."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.api import load
from wavecomb.cli.options import stage_warnings, warn
from wavecomb.cli.reporting import Done
from wavecomb.image.files.band_writer import BandFiles
from wavecomb.image.rendered import Picture, picture_of, window_of
from wavecomb.run import aovs as aov_names
from wavecomb.run import catchers
from wavecomb.run.bands import band_rows, render_bands, sum_stats, without_samples
from wavecomb.run.callbacks import CheckpointSink, PreviewSink, Sink, Watcher
from wavecomb.run.checkpoint import Checkpoint, build_note, check_fits, make_header
from wavecomb.run.progress import Interrupt
from wavecomb.run.settings import check_memory, image_size
from wavecomb.run.stats import make_stats, rendered_pixels, write_stats

if TYPE_CHECKING:
    from wavecomb.cli.render_options import RenderOptions
    from wavecomb.cli.reporting import Reporter
    from wavecomb.run.guiding_file import Learning
    from wavecomb.run.sequence import Frames
    from wavecomb.usd import LoadedStage


class Still:
    """Source of one image: loads a stage at one frame and renders it."""

    def __init__(self, job: Job, kept: Any = None) -> None:
        """Creates the source, which keeps the object ``kept`` alive until the stage is loaded."""
        self._renderer: Any = None
        self._kept = kept
        self._job = job
        self._loaded: LoadedStage | None = None

    def load(
        self, progress: Callable[[int, int], None] | None = None, **changes: Any
    ) -> LoadedStage:
        """Loads the stage. ``changes`` are fields of ``LoadOptions`` that override the options."""
        settings = self._job.settings
        own = {"size": (settings.width, settings.height), "threads": settings.threads}
        options = {**self._job.loading, **own, **changes}
        self._loaded = load(self._job.options.stage, progress=progress, **options)
        self._kept = None
        self._renderer = None
        return self._loaded

    def render(self, *arguments: Any, **named: Any) -> Any:
        """Renders the scene, and frees the renderer's data afterwards.

        The arguments are those of ``_core.render`` after the scene.
        """
        from wavecomb import _core

        assert self._loaded is not None
        return _core.render(self._loaded.scene, *arguments, **named)

    def render_part(self, settings: Any, *arguments: Any, **named: Any) -> Any:
        """Renders a band of the image, and keeps the renderer for the next band."""
        from wavecomb import _core

        assert self._loaded is not None
        if self._renderer is None:
            self._renderer = _core.Renderer(self._loaded.scene, settings.threads)
        return self._renderer.render(settings, *arguments, **named)

    def stats(self, result: Any, resumed_s: float) -> dict[str, Any]:
        """Returns the statistics; ``resumed_s`` are the seconds of the render that was resumed."""
        stage = self._job.options.stage
        return make_stats(result, stage=stage, loaded=self._loaded, resumed_s=resumed_s)


class FrameShot:
    """Source of one frame of a stage that stays open, with the interface of ``Still``."""

    def __init__(self, frames: Frames, frame: float | None, **options: Any) -> None:
        """Creates the source. ``options`` are arguments of ``Frames.load``."""
        self._frames = frames
        self._frame = frame
        self._options = options
        self.render = self.render_part = frames.render

    def load(
        self, progress: Callable[[int, int], None] | None = None, **changes: Any
    ) -> LoadedStage:
        """Loads the parts of the stage that changed since the previous frame."""
        return self._frames.load(self._frame, progress=progress, **self._options, **changes)

    def stats(self, result: Any, resumed_s: float) -> dict[str, Any]:
        """Returns the statistics of the image."""
        return self._frames.stats(result, resumed_s=resumed_s)


Shot = Still | FrameShot


@dataclass(frozen=True)
class Job:
    """One image, or a sequence of frames, whose options have passed all checks.

    Attributes:
        options: Options with the file names of the image.
        frames: Frames of a sequence; None for a single image.
        settings: Settings of the render.
        aovs: AOVs of the image.
        loading: Arguments of ``wavecomb.load``.
        profile: Initial scheduling costs, or None.
        learning: Initial path guiding data, which all jobs of a command share.
        reporter: Progress display.
    """

    options: RenderOptions
    frames: tuple[float, ...] | None
    settings: Any
    aovs: tuple[str, ...]
    loading: dict[str, Any]
    profile: dict[str, dict[str, float]] | None
    learning: Learning
    reporter: Reporter

    def at(self, frame: float) -> Job:
        """Returns the job of one frame of a sequence."""
        source = self.options.source
        source = replace(source, values={**source.values, "frame": frame})
        return replace(self, options=replace(self.options.at(frame), source=source))

    def run(
        self, shot: Shot, resumed: Checkpoint | None = None, *, keeps_stopped: bool = True
    ) -> Done:
        """Loads the stage and renders one image. Also writes the image if it is rendered in bands.

        Args:
            shot: Source of the image.
            resumed: Checkpoint to continue, or None.
            keeps_stopped: Whether an image in bands is written even if the render is stopped, once
                it has a sample.
        """
        options = self.options
        with self.reporter.loading(options.stage) as progress:
            loaded = shot.load(progress)
        warn(stage_warnings(loaded))
        groups = len(loaded.scene.light_groups) if "light_groups" in self.aovs else 1
        rows = band_rows(
            self.settings, self.aovs, options.film_memory, whole=options.whole, tile=options.tile,
            light_groups=groups,
        )  # fmt: skip
        settings, aovs = self.settings, self.aovs
        if loaded.catchers:
            own = {"--checkpoint": options.checkpoint, "--deep": options.deep}
            catchers.check(settings, {**own, "--film-memory": rows})
            settings = catchers.with_alpha(settings)
            aovs = aov_names.with_others(aovs, [catchers.LAYER])
        if rows is not None:
            return self._run_bands(shot, loaded, rows, keeps_stopped)
        if "light_groups" in aovs:
            check_memory(settings, aovs, groups)
        sinks, state, seconds = self._sinks(loaded, resumed)
        with Interrupt() as interrupt, self.reporter.rendering() as bar:
            watcher = Watcher(
                sinks,
                reporter=bar,
                is_stopped=lambda: interrupt.requested,
                warn=lambda line: warn([line]),
            )
            result = shot.render(
                settings, None, None, self.profile, watcher=watcher, state=state,
                learned=self.learning.given,
            )  # fmt: skip
            self.learning.take(result)
            stats = shot.stats(result, seconds)
            picture = picture_of(result, stats, scene=loaded.scene, aovs=aovs)
            if loaded.catchers and not result.cancelled:
                picture = self._caught(picture, shot, settings, lambda: interrupt.requested)
        stopped = (interrupt.signal or signal.SIGINT) if picture.cancelled else None
        return Done(stats, result.costs, loaded.report, stopped, picture)

    def _caught(
        self, picture: Picture, shot: Shot, settings: Any, is_stopped: Callable[[], bool]
    ) -> Picture:
        """Adds the shadows on shadow catchers to an image, unless the render was stopped."""

        def render(how: Mapping[str, str]) -> Any:
            shot.load(None, **how)
            watcher = Watcher(is_stopped=is_stopped, warn=lambda line: warn([line]))
            return shot.render(
                catchers.catcher_settings(settings), None, None, None, watcher=watcher,
                learned=self.learning.given,
            )  # fmt: skip

        with_shadows = catchers.with_catcher_shadows(picture, render)
        return replace(picture, cancelled=True) if is_stopped() else with_shadows

    def _run_bands(self, shot: Shot, loaded: LoadedStage, rows: int, keeps_stopped: bool) -> Done:
        """Renders an image in bands and writes each one.

        If the render is stopped, the remaining bands are written without samples.
        """
        options = self.options
        settings, height = self.settings.to_dict(), image_size(self.settings)[1]
        parts: list[dict[str, Any]] = []
        costs: Any = None
        broken = 0
        files = BandFiles(
            options.output,
            options.png,
            height=height,
            window=window_of(settings),
            file_options=options.file_options(),
            exposure=options.exposure,
            tone_map=options.tone_map,
        )
        with Interrupt() as interrupt, self.reporter.rendering() as bar:

            def render(band: Any, shown: Any) -> Any:
                watcher = Watcher(
                    reporter=shown,
                    is_stopped=lambda: interrupt.requested,
                    warn=lambda line: warn([line]),
                )
                return shot.render_part(
                    band, None, None, self.profile, watcher=watcher, state=None,
                    learned=self.learning.given,
                )  # fmt: skip

            def picture_in(result: Any, stats: dict[str, Any]) -> Picture:
                of_all = {**stats, "settings": settings}
                del of_all["seconds"]  # the final render time is not known yet
                return picture_of(result, of_all, scene=loaded.scene, aovs=self.aovs)

            def stopped_part(part: Any) -> Picture:
                return picture_in(shot.render_part(part), parts[-1])

            with contextlib.suppress(_NotKept), files:
                for result in render_bands(render, self.settings, rows, bar):
                    self.learning.take(result)
                    parts.append(shot.stats(result, 0.0))
                    costs = result.costs
                    if result.cancelled and not (keeps_stopped and _any_samples(parts)):
                        raise _NotKept
                    picture = picture_in(result, parts[-1])
                    broken += _broken_pixels(picture)
                    files.add(picture)
                    if result.cancelled:
                        break
                empty: Picture | None = None
                while files.rows < height:
                    left = min(rows, height - files.rows)
                    if empty is None or len(empty.beauty) != left:
                        empty = without_samples(stopped_part, self.settings, left)
                    files.add(empty)
        _warn_of_broken(broken)
        stats = sum_stats(parts, settings)
        stopped = (interrupt.signal or signal.SIGINT) if stats["cancelled"] else None
        written = [] if stopped is not None and not keeps_stopped else files.written
        if options.stats_file is not None and written:
            write_stats(options.stats_file, stats)
            written.append(options.stats_file)
        return Done(stats, costs, loaded.report, stopped, files=tuple(written))

    def _sinks(
        self, loaded: LoadedStage, resumed: Checkpoint | None
    ) -> tuple[list[Sink], dict[str, Any] | None, float]:
        """Prepares checkpoints and previews.

        Returns:
            Three values: the sinks that save checkpoints and previews; the state to resume, or
                None; and the seconds rendered so far.
        """
        options = self.options
        sinks: list[Sink] = []
        state, seconds = None, 0.0
        if options.checkpoint is not None:
            source = dict(options.source.values)
            header = make_header(
                loaded.scene, self.settings, stage=options.stage, source=source, aovs=self.aovs
            )
            if resumed is not None:
                check_fits(resumed, header)
                warn([note] if (note := build_note(resumed, header)) else [])
                state, seconds = resumed.state, resumed.seconds
            sinks.append(CheckpointSink(options.checkpoint, options.every, header, seconds))
        if options.preview is not None:
            sinks.append(
                PreviewSink(
                    options.preview,
                    options.preview_every,
                    exposure=options.exposure,
                    tone_map=options.tone_map,
                    working_space=loaded.working_space,
                )
            )
        return sinks, state, seconds

    def write(self, done: Done) -> tuple[Done, list[str]]:
        """Writes the image unless its bands were written already; returns image and files."""
        if done.picture is None:
            return done, list(done.files)
        options, picture = self.options, done.picture
        _warn_of_broken(_broken_pixels(picture))
        if options.denoise:
            with self.reporter.working("denoising"):
                picture = picture.with_denoised(threads=self.settings.threads)
        start = time.perf_counter()
        written: list[str] = []
        with self.reporter.working("writing"):
            if options.output is not None:
                written += map(str, picture.save(options.output, **options.file_options()))
            if options.png is not None:
                picture.save(options.png, exposure=options.exposure, tone_map=options.tone_map)
                written.append(options.png)
            if options.deep is not None:
                picture.save_deep(options.deep, half=options.half)
                written.append(options.deep)
        seconds = {**picture.stats["seconds"], "write": time.perf_counter() - start}
        stats = {**picture.stats, "seconds": seconds}
        if options.stats_file is not None:
            write_stats(options.stats_file, stats)
            written.append(options.stats_file)
        return replace(done, stats=stats, picture=picture), written


class _NotKept(Exception):
    """Exception for a stopped render in bands whose image file must not be written."""


def _broken_pixels(picture: Picture) -> int:
    return int((~np.isfinite(picture.beauty).all(axis=2)).sum())


def _warn_of_broken(count: int) -> None:
    warn([f"{count} pixels of the picture are not finite"] if count else [])


def _any_samples(parts: list[dict[str, Any]]) -> bool:
    return any(part["counts"]["samples"] for part in parts)


def how_far(done: Done) -> str:
    """Returns a phrase for the progress of a render.

    The phrase is a percentage, or the samples per pixel if the number of samples is not fixed.
    """
    settings = done.stats["settings"]
    mean = done.samples / rendered_pixels(settings)
    if any(settings.get(name) for name in ("adaptive", "noise", "time_limit")):
        return f"with {mean:.3g} samples a pixel"
    return f"at {100.0 * mean / settings['spp']:.0f} %"
