# SPDX-License-Identifier: Apache-2.0
"""Frame sequences of ``wavecomb render``, with --frames and --skip-existing."""

from __future__ import annotations

import os
from typing import Any

import click

from wavecomb.api import import_usd
from wavecomb.cli.job import FrameShot, Job, how_far
from wavecomb.cli.reporting import Done
from wavecomb.errors import WavecombError
from wavecomb.run.error_messages import describe
from wavecomb.run.frame_names import frame_text
from wavecomb.terminal import say


def render_sequence(job: Job) -> tuple[Done | None, list[str]]:
    """Renders the frames of a job one after another.

    Returns:
        The result of the last frame, and all files that were written.

    Raises:
        WavecombError: A frame failed. A frame cannot be rendered. The message names the frame;
            files of earlier frames are written.
        click.exceptions.Exit: The user stopped the render; completed frames are written.
    """
    frames = wanted = job.frames or ()
    if job.options.skip_existing:
        wanted = tuple(f for f in frames if not job.options.at(f).exist())
        if len(wanted) < len(frames):
            job.reporter.said(f"{len(frames) - len(wanted)} of {len(frames)} frames exist")
    done: Done | None = None
    opened: Any = None
    files: list[str] = []
    for number, frame in enumerate(wanted, 1):
        place = f"frame {frame_text(frame)}"
        job.reporter.begins(frame_text(frame), number, len(wanted))
        try:
            if opened is None:
                opened = open_frames(job)
            here = job.at(frame)
            done = here.run(FrameShot(opened, frame), keeps_stopped=False)
            if done.stopped is not None:
                so_far = f"{number - 1} of {len(wanted)} frames are written"
                checkpoint = here.options.checkpoint
                kept = f"; {checkpoint} continues it" if checkpoint else ""
                say(
                    f"stopped in {place} {how_far(done)}, which is not written{kept}; {so_far}, "
                    "and --skip-existing continues after them",
                    err=True,
                )
                raise click.exceptions.Exit(128 + done.stopped)
            done, written = here.write(done)
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


def open_frames(job: Job) -> Any:
    """Opens the stage of a job for rendering several frames or cameras; returns its ``Frames``."""
    import_usd()
    from wavecomb.run.sequence import Frames

    size = job.settings.width, job.settings.height
    options = {name: value for name, value in job.loading.items() if name != "frame"}
    return Frames(job.options.stage, size=size, threads=job.settings.threads, **options)
