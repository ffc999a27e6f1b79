# SPDX-License-Identifier: Apache-2.0
"""How ``wavecomb render`` shows what it does and what came of it: a bar, JSON lines, nothing."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.summary import print_summary
from wavecomb.run.progress import (
    LoadProgress,
    ProgressBar,
    ProgressLines,
    Silent,
    loading_bar,
    progress_console,
)

if TYPE_CHECKING:
    from rich.console import Console

    from wavecomb.picture.rendered import Picture
    from wavecomb.usd import LoadReport

TIMES = ("load", "build", "render")
"""Seconds that are said of a frame."""


class Reporter:
    """Says nothing, but for warnings and errors."""

    def loading(self, stage: str) -> contextlib.AbstractContextManager[LoadProgress | None]:
        """Shows that the stage is being read; gives what to tell of it."""
        return contextlib.nullcontext()

    def begins(self, frame: str, number: int, count: int) -> None:
        """A frame of a sequence begins, the number-th of so many."""

    def ended(self, done: Done, files: Sequence[str]) -> None:
        """A frame of a sequence is written."""

    def said(self, line: str) -> None:
        """Something about a sequence."""

    def rendering(self) -> Silent:
        """What shows the progress of the render, as a context manager."""
        return Silent()

    def finished(self, done: Done, report: LoadReport, files: Sequence[str]) -> None:
        """All files are written."""


class Summary(Reporter):
    """A summary at the end; before it a bar, where there is a console."""

    def __init__(self, console: Console | None) -> None:
        self._console = console
        self._frame = self._place = ""

    def loading(self, stage: str) -> contextlib.AbstractContextManager[LoadProgress | None]:
        """The name of the file, and a bar where there is much to read."""
        if self._console is None:
            return super().loading(stage)
        return loading_bar(self._console, f"{self._place}loading {os.path.basename(stage)}")

    def rendering(self) -> Silent:
        """The bar."""
        if self._console is None:
            return Silent()
        return ProgressBar(self._console, f"{self._place}rendering")

    def begins(self, frame: str, number: int, count: int) -> None:
        """Makes bars name the frame."""
        self._frame = f"frame {frame} ({number} of {count})"
        self._place = f"{self._frame}: "

    def ended(self, done: Done, files: Sequence[str]) -> None:
        """A line."""
        from wavecomb.run.progress import time_text

        seconds = done.stats["seconds"]
        times = ", ".join(f"{name} {time_text(seconds[name])}" for name in TIMES)
        click.echo(f"{self._frame}: {times}; wrote {', '.join(files)}")

    def said(self, line: str) -> None:
        """The line."""
        click.echo(line)

    def finished(self, done: Done, report: LoadReport, files: Sequence[str]) -> None:
        """The summary; of a sequence, that of its last frame."""
        if self._frame:
            click.echo(f"{self._frame}:")
            files = [f"{len(files)} files"]
        print_summary(done.stats, report, files)


class Lines(Reporter):
    """Lines of JSON on stdout."""

    def __init__(self) -> None:
        self._lines = ProgressLines(click.echo)

    def rendering(self) -> Silent:
        """A line about once a second."""
        return self._lines

    def begins(self, frame: str, number: int, count: int) -> None:
        """A line {"event": "frame", ...}."""
        self._lines.event("frame", frame=float(frame), number=number, count=count)

    def ended(self, done: Done, files: Sequence[str]) -> None:
        """A line {"event": "wrote", ...} for each file."""
        for name in files:
            self._lines.wrote(name)

    def finished(self, done: Done, report: LoadReport, files: Sequence[str]) -> None:
        """A line {"event": "done", ...}; the figures of a sequence are those of its last frame."""
        stats = done.stats
        self._lines.event(
            "done",
            files=list(files),
            cancelled=stats["cancelled"],
            samples_done=done.samples,
            seconds=stats["seconds"]["render"],
            error=stats["error"],
        )


def make_reporter(progress: str | None, quiet: bool) -> Reporter:
    """What ``--progress`` and ``--quiet`` ask for."""
    if progress == "json":
        return Lines()
    if quiet:
        return Reporter()
    return Summary(None if progress == "off" else progress_console())


@dataclass(frozen=True)
class Done:
    """What came of a render.

    Attributes:
        stats: As ``make_stats`` gives them.
        costs: A profile for other renders.
        report: What to say of the stage.
        stopped: Number of the signal that stopped it; None: it went to its end.
        picture: To be written; None: it was written band by band.
        files: Those that were written so.
    """

    stats: dict[str, Any]
    costs: Any
    report: LoadReport
    stopped: int | None
    picture: Picture | None = None
    files: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """All, with those of a checkpoint."""
        return int(self.stats["counts"]["samples"] + self.stats["resumed_samples"])
