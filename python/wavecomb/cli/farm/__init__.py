# SPDX-License-Identifier: Apache-2.0
"""Commands ``wavecomb farm ...``, which render one job with many workers."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.farm.run import DASHBOARD, ON, how_far, run_job
from wavecomb.cli.farm.submit import ask_plan, plan_command, submit_command
from wavecomb.cli.farm.tiles import assemble_tiles
from wavecomb.cli.options import examples
from wavecomb.errors import WavecombError
from wavecomb.terminal import say

if TYPE_CHECKING:
    from wavecomb.farm.folder import Folder

JOB = click.argument("job", type=click.Path(), metavar="JOB")
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
MAP = click.option(
    "--map", "maps", multiple=True, metavar="FROM=TO",
    help="On this machine, replace folder FROM by folder TO in the paths of the job, its stage and "
    "its images.",
)  # fmt: skip


@click.group(
    "farm",
    epilog=examples(
        "wavecomb farm submit shot.usd -o out/shot.####.exr --frames 1-48 --on local:4",
        "wavecomb farm status out/shot.farm",
        "wavecomb farm resume out/shot.farm --on local:4",
    ),
)
def farm_command() -> None:
    """Render on several processes or machines, bit-identically to one process.

    Dask distributes the tasks of a job. The job's folder keeps finished tiles. See docs/farm.md.
    """


farm_command.add_command(submit_command)
farm_command.add_command(plan_command)


def opened(job: str, maps: tuple[str, ...] = ()) -> Folder:
    """Opens the folder of a job and applies the path maps of this machine."""
    from wavecomb.farm.folder import Folder

    opened_maps(maps)
    return Folder(job)


@farm_command.command("resume")
@JOB
@ON
@click.option("--threads", type=click.IntRange(min=0), default=0, metavar="N",
              help="Number of render threads of each local worker.  [default: the job's number, "
                   "else an equal share of the cores]")  # fmt: skip
@MAP
@DASHBOARD
@click.option("--quiet", is_flag=True, help="Print only warnings and errors.")
@AS_JSON
def resume_command(
    job: str,
    on: str,
    threads: int,
    maps: tuple[str, ...],
    dashboard: int | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Continue JOB by rendering only missing or damaged tiles.

    If files of the stage have changed since, all images are rendered again.
    """
    from wavecomb.farm.clusters import parse_cluster
    from wavecomb.farm.job import Job
    from wavecomb.farm.planning import refresh

    where = parse_cluster(on)
    folder = opened(job, maps)
    short = replace(folder.job, files=(), images=folder.job.images[:1])
    found = Job.of(ask_plan({"again": short.as_json()})["job"], job)
    changed = refresh(folder, replace(folder.job, files=found.files))
    if changed and not (quiet or as_json):
        say(f"{changed} files of the stage have changed, so all images are rendered again")
    if where.kind == "none":
        raise WavecombError("--on none: renders nothing; give local:N, dask:ADDRESS or slurm:N")
    run_job(folder, where, threads=threads, dashboard=dashboard, as_json=as_json, quiet=quiet)


@farm_command.command("status")
@JOB
@MAP
@AS_JSON
def status_command(job: str, maps: tuple[str, ...], as_json: bool) -> None:
    """Report how many tiles and images of JOB are finished. Reads and verifies each file."""
    from wavecomb.farm.assembly import status

    folder = opened(job, maps)
    out = status(folder)
    if as_json:
        click.echo(json.dumps({"job": str(folder.path), **out.as_dict()}))
        return
    say(f"{folder.job.stage}: {out.state}: {how_far(out)}")


@farm_command.command(
    "task", epilog=examples("wavecomb farm task /share/shot.farm --image 12 --tile 3/8")
)
@JOB
@click.option("--image", type=click.IntRange(1), default=1, metavar="I",
              help="Index of the image in the job; the first is 1.  [default: 1]")  # fmt: skip
@click.option(
    "--tile",
    default="1/1",
    metavar="I/N",
    help="Render tile I of the N tiles of an image.  [default: 1/1]",
)
@MAP
def task_command(job: str, image: int, tile: str, maps: tuple[str, ...]) -> None:
    """Render one tile of JOB in this process, unless it is finished.

    This command is for sites whose own queue starts the tasks. `wavecomb farm assemble JOB` joins
    the tiles.
    """
    from wavecomb.farm.api import render_task

    for line in render_task(opened(job, maps), image, tile):
        say(f"warning: {line}", err=True)


@farm_command.command(
    "assemble",
    epilog=examples(
        "wavecomb farm assemble out/shot.farm",
        "wavecomb farm assemble out/shot.0012.exr",
    ),
)
@click.argument("names", nargs=-1, required=True, type=click.Path(), metavar="JOB|IMAGE.exr ...")
@MAP
@AS_JSON
def assemble_command(names: tuple[str, ...], maps: tuple[str, ...], as_json: bool) -> None:
    """Join the tiles of a JOB, or the tiles beside an IMAGE, to images in this process.

    Applies path maps to this process. An image with missing tiles is an error that names them; all
    other images are written.
    """
    from wavecomb.farm.api import assemble_job

    written: list[str] = []
    wrong: list[str] = []
    for name in names:
        try:
            if name.lower().endswith(".exr") and not os.path.isdir(name):
                opened_maps(maps)
                written += assemble_tiles(name)
            else:
                files, lacking = assemble_job(opened(name, maps))
                written += files
                wrong += lacking
        except WavecombError as error:
            wrong.append(str(error))
    if as_json:
        click.echo(json.dumps({"files": written}))
    elif written:
        say(f"wrote {', '.join(written)}")
    elif not wrong:
        say("all images are finished")
    if wrong:
        more = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        raise WavecombError(f"{wrong[0]}{more}")


def opened_maps(maps: tuple[str, ...]) -> None:
    """Applies path maps to this process."""
    from wavecomb.path_maps import parse_maps, use_maps

    use_maps(parse_maps(maps))


@farm_command.command(
    "export", epilog=examples("wavecomb farm export shot.farm --openjd shot.job.json")
)
@JOB
@click.option("--openjd", type=click.Path(), required=True, metavar="FILE.json",
              help="Write a job template in the Open Job Description format.")  # fmt: skip
def export_command(job: str, **options: Any) -> None:
    """Write JOB for schedulers that run Open Job Description, with one task for each tile."""
    from wavecomb.farm.openjd import write_template

    write_template(options["openjd"], opened(job))
    say(f"wrote {options['openjd']}")
