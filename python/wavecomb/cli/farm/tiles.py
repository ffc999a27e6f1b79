# SPDX-License-Identifier: Apache-2.0
"""Rendering single tiles with ``wavecomb render --tile``, for sites with their own job queue.

This module also converts the options of ``render`` to a farm job.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.cli.options import warn
from wavecomb.cli.render_options import RenderOptions
from wavecomb.cli.sandbox import enter_to_render
from wavecomb.errors import WavecombError
from wavecomb.run.guiding_file import BEFORE
from wavecomb.terminal import say

if TYPE_CHECKING:
    from wavecomb.cli.planning import Prepared
    from wavecomb.farm.job import Job

_TILE = "tile-{}-of-{}"


def tile_name(output: str, index: int, count: int) -> str:
    """Returns the file name of a tile, which is stored beside its image.

    >>> tile_name("out/shot.0012.exr", 2, 8)
    'out/shot.0012.tile-3-of-8.exr'
    """
    stem, ending = os.path.splitext(output)
    return f"{stem}.{_TILE.format(index + 1, count)}{ending}"


def tile_names(output: str) -> list[str]:
    """Returns the existing tile files beside an image, sorted."""
    stem, ending = os.path.splitext(output)
    found = glob.glob(f"{glob.escape(stem)}.{_TILE.format('*', '*')}{glob.escape(ending)}")
    end = re.compile(re.escape(f"{stem}.") + r"tile-\d+-of-\d+" + re.escape(ending), re.DOTALL)
    return sorted(name for name in found if end.fullmatch(name))


def check_options(options: Mapping[str, Any], what: str = "a farm") -> None:
    """Raises WavecombError for options of ``render`` that do not apply to a farm.

    Args:
        options: Values of the options.
        what: Name, for the error message, of the feature that does not support the options.
    """
    learn_from = options["learn_from"] if options["learn_from"] == BEFORE else None
    for option, given, instead in (
        ("--resume", options["resume"], "`wavecomb farm resume` continues a job"),
        ("--checkpoint", options["checkpoint"], "finished tiles are kept"),
        ("--preview", options["preview"], "`wavecomb farm status` shows how far a job is"),
        ("--learn-from", learn_from, "frames are rendered in any order; give a file"),
        ("--learn-to", options["learn_to"],
         "a render of one image writes it, and --learn-from gives it to the job"),
        ("--deep", options["deep"], "tiles of deep images cannot be joined; use `wavecomb render`"),
        ("--film-memory", options["film_memory"], "tiles limit the memory of a worker"),
        ("--progress", "json" if options["progress"] == "json" else None, "give --json"),
    ):  # fmt: skip
        if given is not None:
            raise WavecombError(f"{option}: is not for {what}: {instead}")


def _check_tile(text: str, options: RenderOptions) -> tuple[int, int]:
    """Parses --tile to (index, count). Raises WavecombError if other options contradict --tile."""
    from wavecomb.farm.tiling import parse_tile

    if text.isdecimal():
        raise WavecombError(f"--tile {text}: must be I/N; tiles inside the file are --exr-tile")
    found = parse_tile(text)
    check_options(vars(options), "--tile")
    if options.output is None:
        raise WavecombError("--tile: needs -o FILE.exr, because the tile is written beside it")
    return found


def job_of(prepared: Prepared, **more: Any) -> Job:
    """Builds a farm job from a command's options, without tiles and files, which are set later.

    Raises:
        WavecombError: --costs names a file.
    """
    from wavecomb.farm.job import Job
    from wavecomb.farm.planning import shot_of

    options = prepared.options
    if options.costs is not None:
        raise WavecombError(
            "--costs: is not for a farm: all workers would write the file; give --costs model"
        )
    shots, images = [], []
    for index, job in enumerate(prepared.jobs):
        here = job.options
        if here.output is None:
            raise WavecombError(f"{here.image}: a farm writes EXR files; give -o FILE.exr")
        loading = {name: value for name, value in job.loading.items() if name != "frame"}
        shots.append(
            shot_of(
                job.settings.to_dict(), job.aovs, loading, here.output, here.png, here.stats_file
            )
        )
        for frame in (here.source.values["frame"],) if job.frames is None else job.frames:
            filled = here if job.frames is None else here.at(frame or 0.0)
            if not (options.skip_existing and filled.exist()):
                images.append((index, frame))
    return Job(
        stage=options.stage, folder=os.getcwd(), shots=tuple(shots), images=tuple(images),
        file=options.file_options(), exposure=options.exposure, tone_map=options.tone_map,
        denoise=options.denoise, costs=prepared.jobs[0].profile, **more,
    )  # fmt: skip


def render_tile(options: RenderOptions, tile: str) -> None:
    """Renders tile I/N of each frame to a file beside the image.

    Raises:
        WavecombError: A farm cannot render this stage.
    """
    index, count = _check_tile(tile, options)
    enter_to_render(options, [tile_name(str(options.output), index, count)])
    from wavecomb.cli.planning import prepare
    from wavecomb.farm.job import Task
    from wavecomb.farm.machine_class import machine_class
    from wavecomb.farm.planning import complete
    from wavecomb.farm.rendering import Renderer
    from wavecomb.farm.tiling import layout
    from wavecomb.image.files.output_file import replacing

    prepared = prepare(options)
    learned = prepared.jobs[0].learning.given
    job = job_of(prepared)
    if len(job.shots) > 1:
        raise WavecombError("--tile: the stage has several render products; give --product")
    if not job.images:
        if not options.quiet:
            say("all images exist")
        return
    job = complete(job, tiles=layout(count, job.shots[0].region), learned=learned)
    renderer, written = Renderer(job, learned=learned), []
    for image in range(len(job.images)):
        name = tile_name(job.names(image)["output"], index, count)
        renderer.render(
            Task(image, index), Path(name), machine_class(), with_job=True, replacing=replacing
        )
        written.append(name)
    warn(list(renderer.warnings))
    if not options.quiet:
        say(f"wrote {', '.join(written)}")


def assemble_tiles(output: str) -> list[str]:
    """Joins the tiles beside an image, writes the image's files and removes the tiles.

    Returns:
        The files that were written.

    Raises:
        WavecombError: Tiles are missing or damaged, or differ in settings, files or machines.
    """
    from wavecomb.farm.assembly import NarrowBorder, join, write_image
    from wavecomb.farm.job import Job, Task
    from wavecomb.farm.tile_file import InvalidTile, read_tile

    names = tile_names(output)
    if not names:
        raise WavecombError(
            f"{output}: has no tiles beside it; `wavecomb render -o {output} --tile I/N` makes them"
        )
    try:
        first = read_tile(names[0])
        job = Job.of(first.job, names[0])
        same = [i for i in range(len(job.images))
                if job.tile_key(Task(i, first.number), first.machine) == first.key]  # fmt: skip
        if not same:
            raise WavecombError(f"{names[0]}: does not belong to the job in its header")
        image, count = same[0], job.tile_count(same[0])
        wanted = [tile_name(output, index, count) for index in range(count)]
        lacking = [name for name in wanted if name not in names]
        if lacking:
            more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
            raise WavecombError(f"{output}: tiles are missing: {lacking[0]}{more}")

        def parts() -> Any:
            for index, name in enumerate(wanted):
                part = read_tile(name)
                if part.key != job.tile_key(Task(image, index), first.machine):
                    raise WavecombError(
                        f"{name}: is of other settings, files or machines than {names[0]}: render "
                        "it again"
                    )
                yield part

        picture = join(job, image, parts())
    except NarrowBorder as error:
        raise WavecombError(
            f"{error}: give --tile 1/1, or --on local to `wavecomb farm submit`, which does that"
        ) from None
    except InvalidTile as error:
        raise WavecombError(str(error)) from None
    where = os.path.dirname(os.path.abspath(output))
    if os.path.realpath(job.place(job.names(image)["output"])) != os.path.realpath(output):
        raise WavecombError(f"{output}: the tiles in {where} are of {job.names(image)['output']}")
    written = write_image(job, image, picture, 0)
    for name in wanted:
        os.unlink(name)
    return written
