# SPDX-License-Identifier: Apache-2.0
"""Works on a job with processes of this machine, and shows how far it is."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click

from wavecomb.errors import WavecombError
from wavecomb.run.progress import progress_console

if TYPE_CHECKING:
    from wavecomb.farm.engines import Engine
    from wavecomb.farm.folder import Folder

_SHOW_S = 1.0
KINDS = "local[:N]|ssh:HOSTS|dask:ADDRESS|slurm[:N]|none"


def engine_options(command: Any) -> Any:
    """Adds ``--on`` and certificates: ``engine``, ``tls_ca``, ``tls_cert``, ``tls_key``."""
    for option in (
        click.option(
            "--on", "engine", default="local", metavar=KINDS,
            help="Who renders: N workers on this machine, or one on each of HOSTS, with commas "
            "between them, or one on each worker of a Dask cluster, or N that Slurm starts, until "
            "all is done; or whoever runs `wavecomb farm worker`.  "
            "[default: local: one worker on all cores]",
        ),
        click.option("--tls-ca", type=click.Path(), metavar="FILE",
                     help="Who signed certificates, for dask:tls://HOST:PORT."),
        click.option("--tls-cert", type=click.Path(), metavar="FILE", help="One's own."),
        click.option("--tls-key", type=click.Path(), metavar="FILE", help="Its key."),
    ):  # fmt: skip
        command = option(command)
    return command


def chosen_engine(text: str, ca: str | None, cert: str | None, key: str | None) -> Engine:
    """What these options say. Raises WavecombError."""
    from wavecomb.farm.dask_engine import Tls
    from wavecomb.farm.engines import parse_engine

    for path in (ca, cert, key):
        if path is not None and not os.path.isfile(path):
            raise WavecombError(f"{path}: no such file")
    return parse_engine(text, Tls(ca, cert, key))


PAGE = click.option(
    "--page", is_flag=False, flag_value="0", default=None, metavar="[PORT]",
    help="Serves a page, to this machine alone, that shows tiles as they arrive, the picture so "
    "far, workers and logs.",
)  # fmt: skip


@contextlib.contextmanager
def served(folder: Folder, page: str | None, *, err: bool = False) -> Iterator[None]:
    """Serves the page of a job meanwhile, and says where; None: it does not.

    Raises:
        WavecombError: It cannot, or is asked to serve others.
    """
    if page is None:
        yield
        return
    from wavecomb.farm.server import Server, parse_address

    with Server(folder, *parse_address(page)) as server:
        click.echo(f"page {server.url}", err=err)
        yield


def run_local(
    folder: Folder,
    engine: Engine,
    threads: int,
    *,
    page: str | None = None,
    as_json: bool = False,
    quiet: bool = False,
) -> None:
    """Has an engine work until nothing is left to do, and says what came of it.

    Args:
        folder: The job's.
        engine: Who works.
        threads: Of each worker; 0: as is best.
        page: As of ``served``; its address goes to standard error where a program reads the rest.
        as_json: For programs.
        quiet: Only errors.

    Raises:
        WavecombError: Tasks failed, or no worker may work on the job.
        click.exceptions.Exit: Somebody stopped it.
    """
    from wavecomb.farm.folder import say
    from wavecomb.farm.state import status

    if not (as_json or quiet):
        tasks = sum(folder.counts().values())
        many = f"{engine.count} workers" if engine.count > 1 else "a worker"
        many = many if engine.count else "all workers of the cluster"
        click.echo(f"job {folder.path}: {tasks} tasks for {many}")
    local = engine.runner(folder, threads)
    started = time.monotonic()
    with served(folder, page, err=as_json), _shown(folder, quiet or as_json) as look:
        local.run(look)
    state = status(folder, tasks=False)
    if as_json:
        click.echo(say(state))
    if local.stopped is not None:
        click.echo(
            f"stopped: {_pictures(state)}; `wavecomb farm resume {folder.path}` goes on", err=True
        )
        raise click.exceptions.Exit(128 + local.stopped)
    failed = state["failed"]
    if failed:
        more = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        raise WavecombError(
            f"{_pictures(state)}; failed: {failed[0]['title']}: {failed[0]['error']}{more} "
            f"(`wavecomb farm status {folder.path}` names all)"
        )
    if state["state"] != "done":
        why = local.errors[0] if local.errors else f"{_pictures(state)}, and nobody works on it"
        raise WavecombError(why)
    if not (as_json or quiet):
        from wavecomb.run.progress import time_text

        click.echo(f"{_pictures(state)} in {time_text(time.monotonic() - started)}")


def _pictures(state: dict[str, Any]) -> str:
    pictures = state["pictures"]
    return f"{pictures['done']} of {pictures['all']} pictures are written"


@contextlib.contextmanager
def _shown(folder: Folder, silent: bool) -> Any:
    """Gives what shows the progress of a job when it is called: a bar, where there is a console."""
    console = None if silent else progress_console()
    if console is None:
        yield lambda: None
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    with Progress(
        TextColumn("tasks"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[figures]}"),
        console=console,
        transient=True,
    ) as bar:
        yield _looker(folder, bar)


def _looker(folder: Folder, bar: Any) -> Callable[[], None]:
    from wavecomb.farm.folder import BUSY, DONE, FAILED

    task, due = bar.add_task("", total=None, figures=""), [0.0]

    def look() -> None:
        if time.monotonic() < due[0]:
            return
        due[0] = time.monotonic() + _SHOW_S
        counts = folder.counts()
        failed = f", {counts[FAILED]} failed" if counts[FAILED] else ""
        bar.update(
            task,
            completed=counts[DONE],
            total=sum(counts.values()),
            figures=f"{counts[DONE]} done, {counts[BUSY]} at work{failed}",
        )

    return look
