# SPDX-License-Identifier: Apache-2.0
"""Frame sequences of ``wavecomb render``, with --frames and --skip-existing."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from wavecomb.cli.job import Job, Names, how_far, purpose_at
from wavecomb.cli.options import StageOptions
from wavecomb.cli.purpose import PurposeOptions
from wavecomb.cli.reporting import Done
from wavecomb.cli.setting_options import add_options, option
from wavecomb.cli.shots import FrameShot
from wavecomb.errors import WavecombError
from wavecomb.run.error_messages import describe
from wavecomb.run.frame_names import frame_text, has_place, parse_frames

if TYPE_CHECKING:
    from wavecomb.run.sequence import Frames


frame_options = add_options(
    option(
        "--frames RANGE", "text",
        "Frames to render, such as 1-48, 1-48x2 or 1,5,9; file names need a placeholder, as in "
        "shot.####.exr, shot.%04d.exr, shot.$F4.exr or shot.<frame>.exr.",
    ),
    option("--skip-existing", "flag", "With --frames, skip frames whose files already exist."),
)  # fmt: skip
"""Options --frames and --skip-existing."""


def check_frames(
    text: str | None, skip: bool, source: StageOptions, names: Names, purpose: PurposeOptions
) -> tuple[float, ...] | None:
    """Returns the frames of a sequence, or None for a single image. Raises WavecombError."""
    if text is None:
        if skip:
            raise WavecombError("--skip-existing applies to sequences: also give --frames")
        return None
    if source.frame is not None:
        raise WavecombError("--frame is one frame and --frames are several; give one of them")
    if purpose.resume is not None:
        raise WavecombError(
            "--resume continues one image: give its --frame, and then all other --frames "
            "with --skip-existing"
        )
    frames = parse_frames(text)
    if len(frames) > 1:
        for option, name in (
            ("-o", names.output),
            ("--png", names.png),
            ("--deep", names.deep),
            ("--stats", names.stats),
            ("--checkpoint", purpose.checkpoint),
        ):
            if name is not None and not has_place(name):
                stem, ending = os.path.splitext(name)
                raise WavecombError(
                    f"{option} {name}: would be written {len(frames)} times; "
                    f"say where the frame goes: {stem}.####{ending}"
                )
    return frames


def render_sequence(
    job: Job,
    frames: Sequence[float],
    names: Names,
    source: StageOptions,
    purpose: PurposeOptions,
    skip: bool,
) -> tuple[Done | None, list[str]]:
    """Renders frames one after another.

    Returns:
        The result of the last frame, and all files that were written.

    Raises:
        WavecombError: A frame failed. The message names it; earlier frames are written.
        click.exceptions.Exit: The user stopped the render; completed frames are written.
    """
    wanted = list(frames)
    if skip:
        wanted = [f for f in frames if not all(map(os.path.exists, names.at(f).all()))]
        if len(wanted) < len(frames):
            job.reporter.said(f"{len(frames) - len(wanted)} of {len(frames)} frames exist")
    done: Done | None = None
    opened: Frames | None = None
    files: list[str] = []
    for number, frame in enumerate(wanted, 1):
        place = f"frame {frame_text(frame)}"
        job.reporter.begins(frame_text(frame), number, len(wanted))
        try:
            if opened is None:
                opened = open_frames(job, source)
            here = purpose_at(purpose, frame)
            done = job.run(
                FrameShot(opened, frame), source.changed(frame=frame), here, names.at(frame),
                keeps_stopped=False,
            )  # fmt: skip
            if done.stopped is not None:
                so_far = f"{number - 1} of {len(wanted)} frames are written"
                kept = f"; {here.checkpoint} continues it" if here.checkpoint else ""
                click.echo(
                    f"stopped in {place} {how_far(done)}, which is not written{kept}; {so_far}, "
                    "and --skip-existing continues after them",
                    err=True,
                )
                raise click.exceptions.Exit(128 + done.stopped)
            done, written = job.write(done, names.at(frame), denoise=purpose.denoise)
        except click.exceptions.Exit:
            raise
        except Exception as error:
            if os.environ.get("WAVECOMB_DEBUG"):
                raise
            raise WavecombError(f"{place}: {describe(error)}") from error
        files += written
        job.reporter.ended(done, written)
    if done is not None:
        job.reporter.finished(done, done.report, files)
    return done, files


def open_frames(job: Job, source: StageOptions) -> Frames:
    """Opens the stage of a job for rendering several frames or cameras."""
    from wavecomb.api import import_usd

    import_usd()
    from wavecomb.run.sequence import Frames

    options = source.for_load((job.settings.width, job.settings.height))
    return Frames(job.stage, threads=job.settings.threads, **options)
