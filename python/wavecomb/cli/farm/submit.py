# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb farm submit``, and the hidden command ``farm plan``, which reads its stage."""

from __future__ import annotations

import base64
import json
import os
import subprocess
from typing import Any

import click

from wavecomb import processes
from wavecomb.cli.command import SettingCommand
from wavecomb.cli.farm.run import DASHBOARD, ON, run_job
from wavecomb.cli.farm.tiles import check_options, job_of
from wavecomb.cli.options import examples, isolation_options, stage_options
from wavecomb.cli.render_options import RenderOptions, render_options
from wavecomb.cli.sandbox import enter_to_read, enter_to_render
from wavecomb.cli.setting_options import Real, SizeType
from wavecomb.errors import WavecombError
from wavecomb.terminal import say

_PLAN_S = 4 * 3600.0
"""Time limit, in seconds, for reading and hashing all files of a stage."""


@click.command(
    "submit",
    cls=SettingCommand,
    epilog=examples(
        "wavecomb farm submit shot.usd -o out/shot.####.exr --frames 1-48 --on local:4",
        "wavecomb farm submit shot.usd -o shot.exr --size 3840x2160 --tiles 8x4 --on local:4",
        "wavecomb farm submit /share/shot.usd -o /share/shot.exr --on dask:tls://HOST:8786",
    ),
)
@stage_options
@ON
@click.option(
    "--tiles",
    default="auto",
    metavar="auto|NxM",
    help="Number of tile columns and rows in each image.  [default: auto, one tile if there are "
    "two or more images per worker]",
)
@click.option(
    "--job", metavar="DIR", help="Folder to write the job to.  [default: NAME.farm beside -o]"
)
@click.option(
    "--tries", type=click.IntRange(1, 100), default=3, metavar="N",
    help="Maximum number of attempts to run a task that fails.  [default: 3]",
)  # fmt: skip
@click.option(
    "--hang", "hang_s", type=Real(1), default=1800.0, metavar="S",
    help="Restart a worker that makes no progress for S seconds.  [default: 1800]",
)  # fmt: skip
@click.option(
    "--strict/--no-strict",
    default=True,
    help="Whether a missing texture or layer is an error.  [default: strict]",
)
@click.option(
    "--map", "maps", multiple=True, metavar="FROM=TO",
    help="Workers that lack folder FROM use folder TO for the stage, its files and the images.",
)  # fmt: skip
@click.option(
    "--isa",
    metavar="NAME",
    help="CPU instruction set of all workers, such as x86-64-v3, so that their images agree bit "
    "for bit.  [default: the best of each machine]",
)
@DASHBOARD
@click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
@render_options
def submit_command(
    on: str, job: str | None, dashboard: int | None, as_json: bool, **options: Any
) -> None:
    """Render STAGE on a Dask cluster, or on several processes of this machine.

    The command takes the options of `wavecomb render`. Images equal those of one process bit for
    bit. Ctrl-C keeps finished tiles, and `wavecomb farm resume` continues. See docs/farm.md.
    """
    from wavecomb.farm.clusters import parse_cluster
    from wavecomb.farm.folder import Folder
    from wavecomb.farm.job import Job
    from wavecomb.farm.planning import default_folder
    from wavecomb.farm.tiling import parse_tiles
    from wavecomb.path_maps import parse_maps

    where = parse_cluster(on)
    parse_tiles(options["tiles"])
    parse_maps(options["maps"])
    if options["isa"] is not None:
        from wavecomb.isa import ISAS

        if options["isa"] not in ISAS:
            raise WavecombError(f"--isa {options['isa']}: there are {', '.join(ISAS)}")
    check_options(options)
    path = job or default_folder(options["output"], options["stage"], options["output_dir"])
    if os.path.lexists(path):
        raise WavecombError(
            f"{path}: already exists: `wavecomb farm resume` continues a job, and --job names "
            "another folder"
        )
    told = ask_plan({**options, "workers": where.workers})
    learned = None if told["learned"] is None else base64.b64decode(told["learned"])
    folder = Folder.create(path, Job.of(told["job"], path), learned)
    if where.kind == "none":
        tasks = folder.job.task_count()
        if as_json:
            click.echo(json.dumps({"job": str(folder.path), "tasks": tasks}))
        else:
            say(f"job {folder.path}: {tasks} tasks")
        return
    run_job(folder, where, dashboard=dashboard, as_json=as_json, quiet=options["quiet"])


def ask_plan(request: dict[str, Any]) -> dict[str, Any]:
    """Reads the stage in a child process, so that a library crash becomes a one-line error.

    Args:
        request: Options of ``farm submit``, or {"again": JOB} to plan an existing job again. The
            request must be short, because it is passed as a command-line argument.

    Returns:
        A dictionary with ``job``, as JSON, and ``learned``, the guiding data in base64 or None.

    Raises:
        WavecombError: The child reported an error, or did not finish in time.
    """
    words = processes.command(
        "wavecomb", "farm", "plan", json.dumps(request, default=str), parent=0
    )
    process = processes.popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        out, said = process.communicate(timeout=_PLAN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        raise WavecombError(
            f"the files of the stage were not read within {_PLAN_S / 3600:.0f} hours"
        ) from None
    lines = said.strip().splitlines()
    if process.returncode:
        raise WavecombError((lines[-1] if lines else "the stage was not read")[len("error: ") :])
    for line in lines:
        say(line, err=True)
    found: dict[str, Any] = json.loads(out)
    return found


@click.command("plan", hidden=True)
@click.argument("text", metavar="REQUEST")
@isolation_options
def plan_command(text: str) -> None:
    """Answer a request of ``ask_plan`` on standard output."""
    from wavecomb.farm.job import Job
    from wavecomb.farm.planning import complete, with_files
    from wavecomb.farm.tiling import parse_tiles
    from wavecomb.path_maps import parse_maps

    request = _tuples(json.loads(text))
    if "again" in request:
        enter_to_read(())
        job = with_files(Job.of(request["again"], "the job"))
        click.echo(json.dumps({"job": job.as_json(), "learned": None}))
        return
    own = {
        name: request.pop(name)
        for name in ("tiles", "tries", "hang_s", "strict", "maps", "isa", "workers")
    }
    if isinstance(request["size"], str):
        request["size"] = SizeType().convert(request["size"], None, None)
    options = RenderOptions.parse(request)
    enter_to_render(options, gpu=False)
    from wavecomb.cli.planning import prepare

    prepared = prepare(options)
    learned = prepared.jobs[0].learning.given
    job = job_of(
        prepared, tries=own["tries"], hang_s=own["hang_s"], strict=own["strict"],
        maps=parse_maps(own["maps"]), isa=own["isa"],
    )  # fmt: skip
    job = complete(job, tiles=parse_tiles(own["tiles"]), workers=own["workers"], learned=learned)
    field = None if learned is None else base64.b64encode(learned).decode()
    click.echo(json.dumps({"job": job.as_json(), "learned": field}))


def _tuples(value: Any) -> Any:
    """Converts lists in parsed JSON to tuples, because click uses tuples for repeated options.

    The entry "again" holds a job and is not converted.
    """
    if isinstance(value, dict):
        return {key: v if key == "again" else _tuples(v) for key, v in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
