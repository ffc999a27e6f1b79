# SPDX-License-Identifier: Apache-2.0
"""``wavecomb farm submit``."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.farm_run import PAGE, chosen_engine, engine_options, run_local
from wavecomb.cli.frames import frame_options
from wavecomb.cli.options import StageOptions, examples, stage_options
from wavecomb.cli.planning import Asked, Prepared, prepare
from wavecomb.cli.render import picture_options
from wavecomb.cli.row_options import Real
from wavecomb.cli.setting_options import SettingCommand
from wavecomb.errors import WavecombError
from wavecomb.run.learned import BEFORE

if TYPE_CHECKING:
    from wavecomb.farm.spec import Spec


@click.command(
    "submit",
    cls=SettingCommand,
    epilog=examples(
        "wavecomb farm submit shot.usd -o out/shot.####.exr --frames 1-48 --on local:4",
        "wavecomb farm submit shot.usd -o shot.exr --size 3840 2160 --tiles 8x4 --on local:4",
        "wavecomb farm submit shot.usd -o /share/shot.exr --job /share/shot.farm --on none",
    ),
)
@stage_options
@frame_options
@engine_options
@click.option(
    "--tiles",
    default="auto",
    metavar="auto|NxM",
    help="Columns and rows of pixels that each picture is cut into.  [default: auto: whole "
    "pictures where there are enough of them]",
)
@click.option(
    "--chunk",
    type=click.IntRange(min=1),
    metavar="N",
    help="Pictures that a worker takes one after another, with the stage open.  [default: auto]",
)
@click.option("--job", metavar="DIR", help="The job's folder.  [default: NAME.farm beside -o]")
@click.option(
    "--tries", type=click.IntRange(1, 100), default=3, metavar="N",
    help="Of a task that fails.  [default: 3]",
)  # fmt: skip
@click.option(
    "--lease", type=Real(1), default=60.0, metavar="S",
    help="A worker without a sign of life for so long loses its task.  [default: 60]",
)  # fmt: skip
@click.option(
    "--hang", type=Real(1), default=1800.0, metavar="S",
    help="A render that says nothing for so long is ended.  [default: 1800]",
)  # fmt: skip
@click.option(
    "--slow", type=Real(0), default=3.0, metavar="X",
    help="A task that takes X times as long as others is begun elsewhere, too, where nothing else "
    "is left to do; 0: never.  [default: 3]",
)  # fmt: skip
@click.option(
    "--strict/--no-strict",
    default=True,
    help="Whether a texture or layer that is missing is an error.  [default: strict]",
)
@click.option(
    "--assets",
    type=click.Choice(["shared", "copy"]),
    default="shared",
    help="Whether workers see the files of the stage, or those that lack them get copies through "
    "the job's folder.  [default: shared]",
)
@click.option(
    "--map", "maps", multiple=True, metavar="FROM=TO",
    help="A folder that lies elsewhere for workers that do not have it: of the stage and all files "
    "that it names, and of the pictures.",
)  # fmt: skip
@click.option(
    "--isa",
    metavar="NAME",
    help="Library that all workers use (x86-64-v3 ...): machines of several kinds are one class "
    "then, if their probe pictures agree.",
)
@PAGE
@click.option("--json", "as_json", is_flag=True, help="For programs.")
@picture_options
def submit_command(
    engine: str,
    tls_ca: str | None,
    tls_cert: str | None,
    tls_key: str | None,
    tiles: str,
    chunk: int | None,
    job: str | None,
    tries: int,
    lease: float,
    hang: float,
    slow: float,
    strict: bool,
    assets: str,
    maps: tuple[str, ...],
    isa: str | None,
    page: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Write a folder with tasks that render STAGE, and work on it.

    Options are those of `wavecomb render`. Pictures are, bit for bit, those of one process. Ctrl-C
    keeps what is done, and `wavecomb farm resume` goes on. docs/farm.md says more.
    """
    from wavecomb.farm.assets import ask_assets
    from wavecomb.farm.maps import parse_maps
    from wavecomb.farm.server import parse_address
    from wavecomb.farm.submitting import complete, create, default_folder
    from wavecomb.farm.tiling import parse_tiles

    who = chosen_engine(engine, tls_ca, tls_cert, tls_key)
    if page is not None:
        parse_address(page)
        if who.kind == "none":
            raise WavecombError("--page: is for who works here; `wavecomb farm status --serve`")
    cut = parse_tiles(tiles)
    every = options["every"]
    options["every"] = None
    asked = Asked.take(options)
    _check_options(asked)
    if isa is not None:
        from wavecomb.isa import ISAS

        if isa not in ISAS:
            raise WavecombError(f"--isa {isa}: there are {', '.join(ISAS)}")
    prepared = prepare(asked)
    asked = prepared.asked
    spec = _spec(
        prepared, asked, every=every or 120.0, tries=tries, lease_s=lease, hang_s=hang,
        slow=slow, strict=strict, assets=assets, maps=parse_maps(maps), isa=isa,
    )  # fmt: skip
    learned = prepared.learning.given
    spec = complete(spec, tiles=cut, workers=who.count, chunk=chunk, is_taught=learned is not None)
    listed = ask_assets(asked.stage, _stage_words(asked.source)) if strict else None
    path = job or default_folder(asked.output, asked.stage, asked.output_dir)
    folder = create(spec, path, listed, learned=learned)
    threads = int(spec.shots[0].settings.get("threads") or 0)
    if who.kind == "none":
        _say_folder(folder, as_json)
        return
    run_local(folder, who, threads, page=page, as_json=as_json, quiet=asked.quiet)


def _check_options(asked: Asked) -> None:
    """Raises WavecombError for options of ``render`` that a farm does without."""
    purpose = asked.purpose
    for option, given, instead in (
        ("--checkpoint", purpose.checkpoint, "a job keeps checkpoints of its own (--every)"),
        ("--resume", purpose.resume, "`wavecomb farm resume` goes on with a job"),
        ("--preview", purpose.preview, "`wavecomb farm status` shows how far it is"),
        ("--costs", asked.costs_file, "a file would be written by all workers; give --costs model"),
        (
            "--learn-from",
            asked.learn_from if asked.learn_from == BEFORE else None,
            "frames go to any worker in any order; give a file",
        ),
        (
            "--learn-to",
            asked.learn_to,
            "a render keeps it, of one picture, and --learn-from gives it to the job",
        ),
        ("--deep", asked.deep, "tiles of deep pictures are not put together; give it to render"),
        ("--film-memory", asked.film_memory, "--tiles say what a worker holds"),
        ("--progress", purpose.progress if purpose.progress == "json" else None, "give --json"),
    ):
        if given is not None:
            raise WavecombError(f"{option}: is not for a farm: {instead}")


def _stage_words(source: StageOptions) -> list[str]:
    """Options of ``farm assets`` that open the stage in the same way."""
    words = []
    for variant in source["variants"]:
        words += ["--variant", variant]
    if source["session_layer"] is not None:
        words += ["--session-layer", source["session_layer"]]
    return words


def _spec(prepared: Prepared, asked: Asked, **more: Any) -> Spec:
    """The job, still without tiles and chunks."""
    from wavecomb.farm.spec import Spec
    from wavecomb.farm.submitting import new_id, shot_of

    shots, pictures = [], []
    for index, (plan, numbers, job) in enumerate(prepared.jobs):
        source = plan.source(prepared.source)
        loading = source.for_load(None)
        shots.append(
            shot_of(
                job.settings.to_dict(), job.aovs, loading, plan.names.output, plan.names.png,
                plan.names.stats,
            )
        )  # fmt: skip
        for frame in (source.frame,) if numbers is None else numbers:
            names = plan.names if numbers is None else plan.names.at(frame or 0.0)
            if not (asked.skip_existing and all(map(os.path.exists, names.all()))):
                pictures.append((index, frame))
    first = prepared.jobs[0][2]
    return Spec(
        id=new_id(), stage=asked.stage, folder=os.getcwd(), shots=tuple(shots),
        pictures=tuple(pictures), file=asked.layers.file_options(), exposure=asked.exposure,
        tone_map=asked.tone_map, denoise=asked.purpose.denoise, costs=first.profile,
        command=("wavecomb", *sys.argv[1:]), **more,
    )  # fmt: skip


def _say_folder(folder: Any, as_json: bool) -> None:
    from wavecomb.farm.folder import say

    tasks = sum(folder.counts().values())
    if as_json:
        click.echo(say({"job": str(folder.path), "tasks": tasks}))
        return
    click.echo(f"job {folder.path}: {tasks} tasks")
    click.echo(f"work on it with: wavecomb farm worker {folder.path}")
