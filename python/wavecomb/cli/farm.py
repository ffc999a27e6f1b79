# SPDX-License-Identifier: Apache-2.0
"""``wavecomb farm``: one job, many workers."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
import time
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.farm_run import PAGE, chosen_engine, engine_options, run_local, served
from wavecomb.cli.farm_submit import submit_command
from wavecomb.cli.options import examples, isolation_options
from wavecomb.errors import WavecombError
from wavecomb.run.progress import Interrupt

if TYPE_CHECKING:
    from wavecomb.farm.engines import Engine

JOB = click.argument("job", type=click.Path(), metavar="JOB")
AS_JSON = click.option("--json", "as_json", is_flag=True, help="For programs.")


@click.group(
    "farm",
    epilog=examples(
        "wavecomb farm submit shot.usd -o out/shot.####.exr --frames 1-48 --on local:4",
        "wavecomb farm status out/shot.farm",
        "wavecomb farm resume out/shot.farm --on local:4",
        "wavecomb farm worker /share/shot.farm",
    ),
)
def farm_command() -> None:
    """Render on several processes or machines: the same bits as one.

    A job is a folder: whoever sees it can work on it. docs/farm.md says more.
    """


farm_command.add_command(submit_command)


@farm_command.command("worker")
@JOB
@click.option("--threads", type=click.IntRange(min=0), default=0, metavar="N",
              help="Of the renderer.  [default: as the job says, else all]")  # fmt: skip
@click.option(
    "--map", "maps", multiple=True, metavar="FROM=TO",
    help="A folder of the job, its stage or its pictures, that lies elsewhere here.",
)  # fmt: skip
@click.option("--tied", is_flag=True, hidden=True, help="Ends when its stdin does.")
@click.option("--quiet", is_flag=True, help="Only errors.")
@AS_JSON
def worker_command(
    job: str, threads: int, maps: tuple[str, ...], tied: bool, quiet: bool, as_json: bool
) -> None:
    """Work on JOB until nothing is left to do.

    Starts as many as there are machines. Ctrl-C and SIGTERM keep what was done of the task at hand
    in a checkpoint, with which another worker goes on.
    """
    from wavecomb.boot import end_with_parent
    from wavecomb.farm.folder import Folder, say
    from wavecomb.farm.maps import parse_maps, set_own
    from wavecomb.farm.worker import Worker

    def tell(line: str) -> None:
        if not (quiet or as_json):
            click.echo(line)

    if maps:
        set_own(parse_maps(maps))
    worker = Worker(Folder(job), threads=threads, say=tell)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: worker.stop(number))
    if tied:
        end_with_parent(0)
        threading.Thread(target=_end_with_stdin, args=(worker,), daemon=True).start()
    done = worker.run()
    if as_json:
        click.echo(say({"worker": worker.name, **done}))
    if worker.stopped is not None:
        raise click.exceptions.Exit(128 + worker.stopped)


def _end_with_stdin(worker: Any) -> None:
    """Stops a worker when whoever started it wants that, or is no more."""
    # Not by sys.stdin, whose lock this thread would hold when Python ends, which aborts it.
    with contextlib.suppress(OSError):
        while os.read(0, 1 << 10):
            pass
    worker.stop(signal.SIGTERM)


@farm_command.command("status")
@JOB
@AS_JSON
@click.option("--html", type=click.Path(), metavar="FILE.html",
              help="Writes a page that can be looked at without anything else.")  # fmt: skip
@click.option("--serve", is_flag=False, flag_value="0", default=None, metavar="[PORT]",
              help="Serves the page of `farm submit --page`, to this machine alone, until "
              "Ctrl-C.")  # fmt: skip
def status_command(job: str, as_json: bool, html: str | None, serve: str | None) -> None:
    """Say where JOB stands: pictures, tasks, workers, time left, what failed and why."""
    from wavecomb.farm.folder import Folder, say
    from wavecomb.farm.state import lines, status

    folder = Folder(job)
    state = status(folder, tasks=as_json or html is not None)
    if html is not None:
        from wavecomb.farm.page import write_page

        write_page(html, state)
    click.echo(say(state) if as_json else "\n".join(lines(state)))
    if serve is not None:
        with Interrupt() as interrupt, served(folder, serve, err=as_json):
            while not interrupt.requested:
                time.sleep(0.1)


@farm_command.command("logs")
@JOB
@click.argument("name", required=False, metavar="[TASK|WORKER]")
@AS_JSON
def logs_command(job: str, name: str | None, as_json: bool) -> None:
    """Show the log of a task or of a worker of JOB; without a name of all that failed."""
    from wavecomb.farm.folder import FAILED, Folder, say

    folder = Folder(job)
    if name is not None and (os.sep in name or name.startswith(".")):
        raise WavecombError(f"{name}: is no task and no worker")
    names = [name] if name is not None else sorted(folder.ids(FAILED))
    texts = {one: folder.logs(one) for one in names}
    if name is not None and not texts[name]:
        raise WavecombError(f"{name}: there is no log of such a task or worker")
    if as_json:
        click.echo(say({one: text.splitlines() for one, text in texts.items()}))
        return
    for one, text in texts.items():
        click.echo(f"{one}:" if name is None else text.rstrip())
        if name is None:
            click.echo(text.rstrip())


@farm_command.command("retry")
@JOB
@click.argument("tasks", nargs=-1, metavar="[TASK ...]")
@engine_options
@PAGE
@click.option("--quiet", is_flag=True, help="Only errors.")
@AS_JSON
def retry_command(
    job: str,
    tasks: tuple[str, ...],
    engine: str,
    tls_ca: str | None,
    tls_cert: str | None,
    tls_key: str | None,
    page: str | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Have tasks of JOB done again that failed, by default all, and work on it."""
    from wavecomb.farm.checking import retry
    from wavecomb.farm.folder import Folder
    from wavecomb.farm.spec import Task

    folder, who = Folder(job), chosen_engine(engine, tls_ca, tls_cert, tls_key)
    again = retry(folder, [Task.of(task) for task in tasks] or None)
    if not again:
        raise WavecombError(f"{job}: no task failed")
    _go_on(folder, who, page=page, quiet=quiet, as_json=as_json)


@farm_command.command("cancel")
@JOB
@AS_JSON
def cancel_command(job: str, as_json: bool) -> None:
    """Stop all workers of JOB, wherever they are; `farm resume` goes on.

    They see it within a second, and keep what was done of their tasks.
    """
    from wavecomb.farm.folder import Folder, say

    folder = Folder(job)
    (folder.path / "cancel").touch()
    if as_json:
        click.echo(say({"job": str(folder.path), "cancelled": True}))
        return
    click.echo(f"cancelled; `wavecomb farm resume {job}` goes on")


@farm_command.command("resume")
@JOB
@engine_options
@click.option("--threads", type=click.IntRange(min=0), default=0, metavar="N",
              help="Of each worker.  [default: as the job says, else its share]")  # fmt: skip
@PAGE
@click.option("--quiet", is_flag=True, help="Only errors.")
@AS_JSON
def resume_command(
    job: str,
    engine: str,
    tls_ca: str | None,
    tls_cert: str | None,
    tls_key: str | None,
    threads: int,
    page: str | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Go on with JOB: render what is missing, and nothing else.

    A picture or tile that is said to be done and is not there is rendered again.
    """
    from wavecomb.farm.folder import Folder

    who = chosen_engine(engine, tls_ca, tls_cert, tls_key)
    _go_on(Folder(job), who, threads=threads, page=page, quiet=quiet, as_json=as_json)


def _go_on(
    folder: Any, who: Engine, *, threads: int = 0, page: str | None, quiet: bool, as_json: bool
) -> None:
    from wavecomb.farm.checking import repair
    from wavecomb.farm.folder import say

    if who.kind == "none":
        again = repair(folder)
        (folder.path / "cancel").unlink(missing_ok=True)
        told = {"job": str(folder.path), "again": [task.id for task in again]}
        click.echo(say(told) if as_json else f"{len(again)} tasks are to be done again")
        return
    wanted = threads or int(folder.spec.shots[0].settings.get("threads") or 0)
    run_local(folder, who, wanted, page=page, as_json=as_json, quiet=quiet)


@farm_command.command("assemble")
@JOB
@AS_JSON
def assemble_command(job: str, as_json: bool) -> None:
    """Put tiles of JOB together to pictures, here; workers do it by themselves.

    A picture that lacks tiles is an error that names them.
    """
    from wavecomb.farm.assembling import assemble_all
    from wavecomb.farm.folder import Folder, say

    written = assemble_all(Folder(job))
    if as_json:
        click.echo(say({"files": written}))
        return
    click.echo(f"wrote {', '.join(written)}" if written else "all pictures are there")


@farm_command.command(
    "assets",
    epilog=examples("wavecomb farm assets shot.usd", "wavecomb farm assets shot.usd --json"),
)
@click.argument("stage", type=click.Path())
@click.option("--variant", "variants", multiple=True, metavar="SET=NAME",
              help="As of `wavecomb render`.")  # fmt: skip
@click.option("--session-layer", type=click.Path(), metavar="FILE", help="Likewise.")
@isolation_options
@AS_JSON
def assets_command(
    stage: str, variants: tuple[str, ...], session_layer: str | None, as_json: bool
) -> None:
    """List all files that STAGE resolves to, with sizes and hashes, and those that are missing.

    Layers in all variants, textures, all tiles of UDIM textures, IES profiles, images that
    MaterialX files name. Exit code 2 where something is missing, unless with --json.
    """
    from wavecomb.farm.assets import list_assets
    from wavecomb.load_options import selections
    from wavecomb.run.isolate.outputs import Outputs
    from wavecomb.run.isolate.supervisor import enter

    chosen = selections(variants) if variants else None
    enter(Outputs())
    found = list_assets(stage, chosen, session_layer)
    if as_json:
        click.echo(json.dumps(found))
        return
    for one in found["files"]:
        click.echo(f"{one['sha256'][:16]} {one['bytes']:>12} {one['path']}")
    for line in found["missing"]:
        click.echo(f"missing: {line}", err=True)
    if found["missing"]:
        raise WavecombError(f"{stage}: {len(found['missing'])} files are missing")


@farm_command.command(
    "export",
    epilog=examples(
        "wavecomb farm export shot.farm --openjd shot.job.yaml --workers 8",
        "wavecomb farm export shot.farm --slurm shot.sh --workers 8 && sbatch shot.sh",
    ),
)
@JOB
@click.option("--openjd", type=click.Path(), metavar="FILE", help="Open Job Description, as JSON.")
@click.option("--slurm", type=click.Path(), metavar="FILE.sh", help="Script for sbatch.")
@click.option("--workers", type=click.IntRange(1, 10_000), default=4, metavar="N",
              help="How many are started.  [default: 4]")  # fmt: skip
def export_command(job: str, openjd: str | None, slurm: str | None, workers: int) -> None:
    """Write what other schedulers take: they start workers of JOB, which do the same as here."""
    from wavecomb.farm.export import write_openjd, write_slurm
    from wavecomb.farm.folder import Folder

    if openjd is None and slurm is None:
        raise WavecombError("farm export: give --openjd FILE, or --slurm FILE.sh")
    folder = Folder(job)
    for name, write in ((openjd, write_openjd), (slurm, write_slurm)):
        if name is not None:
            write(name, folder, workers)
            click.echo(f"wrote {name}")


@farm_command.command(
    "certificates",
    epilog=examples(
        "wavecomb farm certificates tls",
        "dask scheduler --tls-ca-file tls/ca.pem --tls-cert tls/scheduler.pem "
        "--tls-key tls/scheduler.key --protocol tls",
        "wavecomb farm submit shot.usd -o shot.exr --on dask:tls://HOST:8786 "
        "--tls-ca tls/ca.pem --tls-cert tls/client.pem --tls-key tls/client.key",
    ),
)
@click.argument("folder", type=click.Path(), metavar="FOLDER")
@click.option("--days", type=click.IntRange(1, 3650), default=30, metavar="N",
              help="That they are good for.  [default: 30]")  # fmt: skip
def certificates_command(folder: str, days: int) -> None:
    """Make certificates in FOLDER for a Dask scheduler, its workers and clients.

    Who has none of them cannot talk to the scheduler; who has one runs code on its machines, so
    keys are readable by their owner alone. The key that signed them is kept nowhere.
    """
    from wavecomb.farm.certificates import make_certificates

    for path in make_certificates(folder, days):
        click.echo(f"wrote {path}")
