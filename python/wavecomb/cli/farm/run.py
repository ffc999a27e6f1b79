# SPDX-License-Identifier: Apache-2.0
"""Runs a farm job on a cluster and shows its progress."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.options import warn
from wavecomb.errors import WavecombError
from wavecomb.run.progress import Interrupt, progress_console, time_text
from wavecomb.terminal import say

if TYPE_CHECKING:
    from wavecomb.farm.assembly import Outcome
    from wavecomb.farm.clusters import ClusterSpec
    from wavecomb.farm.folder import Folder

_SHOW_S = 0.5

ON = click.option(
    "--on", default="local", metavar="local[:N]|dask:ADDRESS|slurm[:N]|none",
    help="Render with N local workers, a Dask cluster or N Slurm workers; none writes the job "
    "without rendering it.  [default: local, one worker]",
)  # fmt: skip
DASHBOARD = click.option(
    "--dashboard", type=click.IntRange(0, 65535), is_flag=False, flag_value=0, default=None,
    metavar="[PORT]",
    help="Serve Dask's dashboard to browsers on this machine, and print its address.",
)  # fmt: skip


def run_job(
    folder: Folder,
    where: ClusterSpec,
    *,
    threads: int = 0,
    dashboard: int | None = None,
    as_json: bool = False,
    quiet: bool = False,
) -> None:
    """Runs a job on a cluster until all tasks are done, and reports the result.

    Args:
        folder: Folder of the job.
        where: The cluster.
        threads: Threads of each local worker; 0 uses the job's value, else an equal share of the
            cores.
        dashboard: Port of Dask's dashboard; None starts no dashboard.
        as_json: Print progress and result as lines of JSON.
        quiet: Print only warnings and errors.

    Raises:
        WavecombError: Tasks failed, or there are no workers.
        click.exceptions.Exit: The user stopped the job.
    """
    from wavecomb.farm.client import run

    silent = as_json or quiet
    if not silent:
        say(f"job {folder.path}: {folder.job.task_count()} tasks")
    started = time.monotonic()
    with Interrupt() as interrupt, _shown(silent, as_json) as show:
        out = run(
            folder, where, threads=threads, dashboard=dashboard, show=show,
            warn=lambda line: warn([line]), say=lambda line: say(line, err=True),
            is_stopped=lambda: interrupt.requested,
        )  # fmt: skip
    if as_json:
        click.echo(json.dumps({"job": str(folder.path), **out.as_dict()}))
    if out.stopped and out.state != "done":
        say(f"stopped: {how_far(out)}; `wavecomb farm resume {folder.path}` continues", err=True)
        raise click.exceptions.Exit(128 + (interrupt.signal or 2))
    if out.failed:
        title, line = out.failed[0]
        more = f" and {len(out.failed) - 1} more" if len(out.failed) > 1 else ""
        raise WavecombError(
            f"{how_far(out)}; failed: {title}: {line}{more} (`wavecomb farm resume {folder.path}` "
            "tries again)"
        )
    if out.state != "done":
        raise WavecombError(f"{how_far(out)}; `wavecomb farm resume {folder.path}` continues")
    if not silent:
        say(f"{how_far(out)} in {time_text(time.monotonic() - started)}")


def how_far(out: Outcome) -> str:
    """Returns a phrase with the numbers of finished images and tiles of a job."""
    words = f"{out.images_done} of {out.images} images are written"
    if out.images_done < out.images:
        words += f", {out.tasks_done} of {out.tasks} tiles are rendered"
    return words


@contextlib.contextmanager
def _shown(silent: bool, as_json: bool) -> Any:
    """Yields a function that shows the progress of a job, as a console bar or as lines of JSON."""
    if as_json:
        yield _limited(lambda out: click.echo(json.dumps({"progress": out.as_dict()})))
        return
    console = None if silent else progress_console()
    if console is None:
        yield lambda out: None
        return
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    with Progress(
        TextColumn("tiles"), BarColumn(), TaskProgressColumn(),
        TextColumn("{task.fields[figures]}"), TimeRemainingColumn(), console=console,
        transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task("", total=None, figures="")

        def show(out: Outcome) -> None:
            failed = f", {len(out.failed)} failed" if out.failed else ""
            figures = f"{out.images_done} of {out.images} images{failed}"
            bar.update(task, completed=out.tasks_done, total=out.tasks, figures=figures)

        yield show


def _limited(show: Callable[[Outcome], None]) -> Callable[[Outcome], None]:
    """Limits a progress function to one call in ``_SHOW_S`` seconds."""
    due = [0.0]

    def limited(out: Outcome) -> None:
        if time.monotonic() >= due[0]:
            due[0] = time.monotonic() + _SHOW_S
            show(out)

    return limited
