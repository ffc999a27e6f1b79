# SPDX-License-Identifier: Apache-2.0
"""Shows progress and results of ``wavecomb render`` as a bar, as lines of JSON or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.summary import print_summary, times_text
from wavecomb.run.progress import (
    LoadProgress,
    ProgressBar,
    ProgressLines,
    Silent,
    loading_bar,
    progress_console,
)
from wavecomb.terminal import say

if TYPE_CHECKING:
    from rich.console import Console

    from wavecomb.image.rendered import Picture
    from wavecomb.usd import LoadReport


class Reporter:
    """Base class of reporters, which prints nothing. Other code prints warnings and errors."""

    def loading(self, stage: str) -> contextlib.AbstractContextManager[LoadProgress | None]:
        """Shows that the stage is loading; yields a callback for loading progress, or None."""
        return contextlib.nullcontext()

    def begins(self, frame: str, number: int, count: int) -> None:
        """Reports the start of frame ``number`` of the ``count`` frames in a sequence."""

    def ended(self, done: Done, files: Sequence[str]) -> None:
        """Reports that a frame of a sequence is written."""

    def said(self, line: str) -> None:
        """Reports a remark about a sequence."""

    def rendering(self) -> Silent:
        """Returns the progress display of the render, which is a context manager."""
        return Silent()

    def working(self, what: str) -> contextlib.AbstractContextManager[Any]:
        """Shows that the image is processed after the render: "denoising" or "writing"."""
        return contextlib.nullcontext()

    def finished(self, done: Done, report: LoadReport, files: Sequence[str]) -> None:
        """Reports that all files are written."""


class Summary(Reporter):
    """Reporter that shows a progress bar on a console and prints a summary at the end."""

    def __init__(self, console: Console | None, *, verbose: bool = False) -> None:
        self._console = console
        self._verbose = verbose
        self._frame = self._place = ""

    def loading(self, stage: str) -> contextlib.AbstractContextManager[LoadProgress | None]:
        """Shows the name of the stage that is loading, with a bar for large stages."""
        if self._console is None:
            return super().loading(stage)
        return loading_bar(self._console, f"{self._place}loading {os.path.basename(stage)}")

    def rendering(self) -> Silent:
        """Returns the progress bar."""
        if self._console is None:
            return Silent()
        return ProgressBar(self._console, f"{self._place}rendering")

    def working(self, what: str) -> contextlib.AbstractContextManager[Any]:
        """Shows an indeterminate progress bar."""
        if self._console is None:
            return super().working(what)
        return loading_bar(self._console, f"{self._place}{what}")

    def begins(self, frame: str, number: int, count: int) -> None:
        """Adds the frame number to the titles of progress bars."""
        self._frame = f"frame {frame} ({number} of {count})"
        self._place = f"{self._frame}: "

    def ended(self, done: Done, files: Sequence[str]) -> None:
        """Prints a line with timings and files of a frame."""
        say(f"{self._frame}: {times_text(done.stats['seconds'])}; wrote {', '.join(files)}")

    def said(self, line: str) -> None:
        """Prints the line."""
        say(line)

    def finished(self, done: Done, report: LoadReport, files: Sequence[str]) -> None:
        """Prints the summary. The summary of a sequence has the statistics of its last frame."""
        if self._frame:
            say(f"{self._frame}:")
            files = [f"{len(files)} files"]
        print_summary(done.stats, report, files, verbose=self._verbose)


class Lines(Reporter):
    """Reporter that prints lines of JSON on standard output."""

    def __init__(self) -> None:
        self._lines = ProgressLines(click.echo)

    def rendering(self) -> Silent:
        """Returns a progress display that prints a line about once a second."""
        return self._lines

    def begins(self, frame: str, number: int, count: int) -> None:
        """Prints a line {"event": "frame", ...}."""
        self._lines.event("frame", frame=float(frame), number=number, count=count)

    def ended(self, done: Done, files: Sequence[str]) -> None:
        """Prints a line {"event": "wrote", ...} for each file."""
        for name in files:
            self._lines.wrote(name)

    def finished(self, done: Done, report: LoadReport, files: Sequence[str]) -> None:
        """Prints a line {"event": "done", ...}.

        The line of a sequence has the statistics of its last frame.
        """
        stats = done.stats
        self._lines.event(
            "done",
            files=list(files),
            cancelled=stats["cancelled"],
            samples_done=done.samples,
            seconds=stats["seconds"]["render"],
            error=stats["error"],
        )


def make_reporter(progress: str | None, quiet: bool, verbose: bool = False) -> Reporter:
    """Returns the reporter for ``--progress``, ``--quiet`` and ``--verbose``."""
    if progress == "json":
        return Lines()
    if quiet:
        return Reporter()
    return Summary(None if progress == "off" else progress_console(), verbose=verbose)


@dataclass(frozen=True)
class Done:
    """Result of a render.

    Attributes:
        stats: Statistics from ``make_stats``.
        costs: Cost profile for later renders.
        report: Loading report of the stage.
        stopped: Number of the signal that stopped the render; None if the render ran to its end.
        picture: Image to write; None if it was written band by band.
        files: Files that were written band by band.
    """

    stats: dict[str, Any]
    costs: Any
    report: LoadReport
    stopped: int | None
    picture: Picture | None = None
    files: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """Number of samples, including those of the resumed checkpoint."""
        return int(self.stats["counts"]["samples"] + self.stats["resumed_samples"])
