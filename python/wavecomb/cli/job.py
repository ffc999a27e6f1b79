# SPDX-License-Identifier: Apache-2.0
"""Loading, rendering and writing of one image of ``wavecomb render``."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from wavecomb.cli.aovs import AovOptions
from wavecomb.cli.options import StageOptions, stage_warnings, warn
from wavecomb.cli.purpose import PurposeOptions
from wavecomb.cli.reporting import Done
from wavecomb.cli.shots import Shot
from wavecomb.run import aovs as aov_names
from wavecomb.run.frame_names import fill
from wavecomb.run.guiding_file import Learning

if TYPE_CHECKING:
    from wavecomb.cli.reporting import Reporter
    from wavecomb.image.rendered import Picture
    from wavecomb.run.checkpoint import Checkpoint
    from wavecomb.usd import LoadedStage


@dataclass(frozen=True)
class Names:
    """File names of one image. In a sequence, they hold placeholders for the frame.

    ``output`` is the EXR; None if only a PNG is written.
    """

    output: str | None
    png: str | None
    stats: str | None
    deep: str | None = None

    @property
    def image(self) -> str:
        """The EXR, or the PNG if that is the only image."""
        image = self.output or self.png
        assert image is not None
        return image

    def at(self, frame: float) -> Names:
        """Returns the file names for a frame."""
        names = (self.output, self.png, self.stats, self.deep)
        return Names(*(None if name is None else fill(name, frame) for name in names))

    def all(self) -> list[str]:
        """Returns all file names that are not None, in the order in which files are written."""
        names = (self.output, self.png, self.deep, self.stats)
        return [name for name in names if name is not None]


@dataclass(frozen=True)
class Job:
    """Settings and objects that all images of one command share."""

    stage: str
    settings: Any
    aovs: tuple[str, ...]
    profile: dict[str, dict[str, float]] | None
    layers: AovOptions
    reporter: Reporter
    exposure: float
    tone_map: Any
    film_memory: float | None = None
    learning: Learning = field(default_factory=Learning)

    def run(
        self,
        shot: Shot,
        source: StageOptions,
        purpose: PurposeOptions,
        names: Names,
        resumed: Checkpoint | None = None,
        *,
        keeps_stopped: bool = True,
    ) -> Done:
        """Loads the stage and renders it. An image in bands is also written to ``names``.

        ``keeps_stopped`` says whether an image in bands is still written if the render is stopped
        after its first sample.
        """
        from wavecomb.image.rendered import picture_of
        from wavecomb.run.bands import band_rows
        from wavecomb.run.callbacks import Watcher
        from wavecomb.run.progress import Interrupt
        from wavecomb.run.settings import check_memory

        with self.reporter.loading(self.stage) as progress:
            loaded = shot.load(progress)
        warn(stage_warnings(loaded))
        groups = len(loaded.scene.light_groups) if "light_groups" in self.aovs else 1
        whole = purpose.whole or ("" if names.deep is None else "--deep")
        rows = band_rows(
            self.settings, self.aovs, self.film_memory, whole=whole, tile=self.layers.tile,
            light_groups=groups,
        )  # fmt: skip
        settings, aovs = self.settings, self.aovs
        if loaded.catchers:
            from wavecomb.run import catchers

            own = {"--checkpoint": purpose.checkpoint_file, "--deep": names.deep}
            catchers.check(settings, {**own, "--film-memory": rows})
            settings = catchers.with_alpha(settings)
            aovs = aov_names.with_others(aovs, [catchers.LAYER])
        if rows is not None:
            return self._run_bands(shot, loaded, rows, names, keeps_stopped)
        if "light_groups" in aovs:
            check_memory(settings, aovs, groups)
        sinks, state, seconds = self._sinks(loaded, source, purpose, resumed)
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
        """Adds the shadows on catchers to an image; leaves them out if the render was stopped."""
        from wavecomb.run import catchers
        from wavecomb.run.callbacks import Watcher

        def render(how: Mapping[str, str]) -> Any:
            shot.load(None, **how)
            watcher = Watcher(is_stopped=is_stopped, warn=lambda line: warn([line]))
            return shot.render(
                catchers.catcher_settings(settings), None, None, None, watcher=watcher,
                learned=self.learning.given,
            )  # fmt: skip

        with_shadows = catchers.with_catcher_shadows(picture, render)
        return replace(picture, cancelled=True) if is_stopped() else with_shadows

    def _run_bands(
        self, shot: Shot, loaded: LoadedStage, rows: int, names: Names, keeps_stopped: bool
    ) -> Done:
        """Renders an image in bands and writes each one.

        If stopped, fills the rest with empty bands.
        """
        from wavecomb.image.files.band_writer import BandFiles
        from wavecomb.image.rendered import picture_of, window_of
        from wavecomb.run.bands import render_bands, sum_stats, without_samples
        from wavecomb.run.callbacks import Watcher
        from wavecomb.run.progress import Interrupt
        from wavecomb.run.settings import image_size
        from wavecomb.run.stats import write_stats

        settings, height = self.settings.to_dict(), image_size(self.settings)[1]
        parts: list[dict[str, Any]] = []
        costs: Any = None
        broken = 0
        files = BandFiles(
            names.output,
            names.png,
            height=height,
            window=window_of(settings),
            file_options=self.layers.file_options(),
            exposure=self.exposure,
            tone_map=self.tone_map,
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
                del of_all["seconds"]  # the render time is not known yet
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
        if names.stats is not None and written:
            write_stats(names.stats, stats)
            written.append(names.stats)
        return Done(stats, costs, loaded.report, stopped, files=tuple(written))

    def _sinks(
        self,
        loaded: LoadedStage,
        source: StageOptions,
        purpose: PurposeOptions,
        resumed: Checkpoint | None,
    ) -> tuple[list[Any], dict[str, Any] | None, float]:
        """Prepares checkpoints and previews.

        Returns:
            The sinks that save them, the state to resume or None, and its render time in seconds.
        """
        from wavecomb.run.callbacks import CheckpointSink, PreviewSink, Sink

        sinks: list[Sink] = []
        state, seconds = None, 0.0
        if purpose.checkpoint_file is not None:
            from wavecomb.run.checkpoint import build_note, check_fits, make_header

            header = make_header(
                loaded.scene,
                self.settings,
                stage=self.stage,
                source=source.as_dict(),
                aovs=self.aovs,
            )
            if resumed is not None:
                check_fits(resumed, header)
                warn([note] if (note := build_note(resumed, header)) else [])
                state, seconds = resumed.state, resumed.seconds
            sinks.append(CheckpointSink(purpose.checkpoint_file, purpose.every, header, seconds))
        if purpose.preview is not None:
            sinks.append(
                PreviewSink(
                    purpose.preview,
                    purpose.preview_every,
                    exposure=self.exposure,
                    tone_map=self.tone_map,
                    working_space=loaded.working_space,
                )
            )
        return sinks, state, seconds

    def write(self, done: Done, names: Names, *, denoise: bool) -> tuple[Done, list[str]]:
        """Writes the files of an image unless written; returns the image and the file names."""
        if done.picture is None:
            return done, list(done.files)
        from wavecomb.run.stats import write_stats

        picture = done.picture
        _warn_of_broken(_broken_pixels(picture))
        if denoise:
            with self.reporter.working("denoising"):
                picture = picture.with_denoised(threads=self.settings.threads)
        start = time.perf_counter()
        with self.reporter.working("writing"):
            written = self._save(picture, names)
        seconds = {**picture.stats["seconds"], "write": time.perf_counter() - start}
        stats = {**picture.stats, "seconds": seconds}
        if names.stats is not None:
            write_stats(names.stats, stats)
            written.append(names.stats)
        return replace(done, stats=stats, picture=picture), written

    def _save(self, picture: Picture, names: Names) -> list[str]:
        """Writes the image files; returns their names."""
        written: list[str] = []
        if names.output is not None:
            files = picture.save(names.output, **self.layers.file_options())
            written += map(str, files)
        if names.png is not None:
            picture.save(names.png, exposure=self.exposure, tone_map=self.tone_map)
            written.append(names.png)
        if names.deep is not None:
            picture.save_deep(names.deep, half=self.layers.half)
            written.append(names.deep)
        return written


class _NotKept(Exception):
    """Stopped render of an image in bands that is not to be written."""


def _broken_pixels(picture: Picture) -> int:
    import numpy as np

    return int((~np.isfinite(picture.beauty).all(axis=2)).sum())


def _warn_of_broken(count: int) -> None:
    warn([f"{count} pixels of the picture are not finite"] if count else [])


def _any_samples(parts: list[dict[str, Any]]) -> bool:
    return any(part["counts"]["samples"] for part in parts)


def purpose_at(purpose: PurposeOptions, frame: float) -> PurposeOptions:
    """Returns the options with the frame filled into the names of checkpoint and preview."""
    return replace(
        purpose,
        checkpoint=None if purpose.checkpoint is None else fill(purpose.checkpoint, frame),
        preview=None if purpose.preview is None else fill(purpose.preview, frame),
    )


def how_far(done: Done) -> str:
    """Returns a phrase for the progress of a render.

    This is a percentage, or the samples per pixel if the number of samples is not fixed.
    """
    from wavecomb.run.stats import rendered_pixels

    settings = done.stats["settings"]
    mean = done.samples / rendered_pixels(settings)
    if any(settings.get(name) for name in ("adaptive", "noise", "time_limit")):
        return f"with {mean:.3g} samples a pixel"
    return f"at {100.0 * mean / settings['spp']:.0f} %"
