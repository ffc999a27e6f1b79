# SPDX-License-Identifier: Apache-2.0
"""How ``wavecomb render`` shows what it does: a bar and a summary, lines of JSON, or nothing."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.summary import print_summary
from wavecomb.progress import ProgressBar, ProgressLines, Silent, progress_console

if TYPE_CHECKING:
    from rich.console import Console

    from wavecomb.usd import LoadReport


class Reporter:
    """Says nothing, but for warnings and errors."""

    def loading(self, stage: str) -> contextlib.AbstractContextManager[Any]:
        """Shows that the stage is being read."""
        return contextlib.nullcontext()

    def rendering(self) -> Silent:
        """What shows the progress of the render, as a context manager."""
        return Silent()

    def finished(self, picture: Any, report: LoadReport, files: Sequence[str]) -> None:
        """All files are written."""


class Summary(Reporter):
    """A summary at the end; before it a bar, where there is a console."""

    def __init__(self, console: Console | None) -> None:
        self._console = console

    def loading(self, stage: str) -> contextlib.AbstractContextManager[Any]:
        """The name of the file."""
        if self._console is None:
            return super().loading(stage)
        from rich.markup import escape

        return self._console.status(f"loading {escape(os.path.basename(stage))}")

    def rendering(self) -> Silent:
        """The bar."""
        return Silent() if self._console is None else ProgressBar(self._console)

    def finished(self, picture: Any, report: LoadReport, files: Sequence[str]) -> None:
        """The summary."""
        print_summary(picture.stats, report, files)


class Lines(Reporter):
    """Lines of JSON on stdout."""

    def __init__(self) -> None:
        self._lines = ProgressLines(click.echo)

    def rendering(self) -> Silent:
        """A line about once a second."""
        return self._lines

    def finished(self, picture: Any, report: LoadReport, files: Sequence[str]) -> None:
        """A line {"event": "done", ...}."""
        stats = picture.stats
        self._lines.event(
            "done",
            files=list(files),
            cancelled=stats["cancelled"],
            samples_done=int(picture.samples.sum()),
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
