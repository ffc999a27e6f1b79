# SPDX-License-Identifier: Apache-2.0
"""Python functions that submit, run and assemble farm jobs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import Folder
from wavecomb.farm.job import Job, Task
from wavecomb.farm.planning import complete, default_folder, shot_of
from wavecomb.farm.tiling import parse_tile, parse_tiles
from wavecomb.load_options import LoadOptions, split
from wavecomb.path_maps import parse_maps


def submit(
    stage: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    frames: str | Iterable[float] | None = None,
    tiles: str = "auto",
    job: str | os.PathLike[str] | None = None,
    workers: int = 0,
    size: tuple[int, int] | None = None,
    spp: int = 64,
    aovs: Iterable[str] | None = None,
    png: str | None = None,
    stats: str | None = None,
    denoise: bool = False,
    file: dict[str, Any] | None = None,
    strict: bool = True,
    maps: Iterable[str] = (),
    tries: int = 3,
    hang_s: float = 1800.0,
    **options: Any,
) -> Folder:
    """Creates the folder of a job, which ``run`` or `wavecomb farm resume` renders.

    Args:
        stage: File of the stage.
        output: File of the image. For several frames, the name has a placeholder: shot.####.exr.
        frames: Frames, as in ``render_frames``; None renders a single image.
        tiles: "auto", or columns and rows such as "4x3".
        job: Folder to create; None puts it beside the output.
        workers: Expected number of workers; 0 means unknown.
        size: As in ``render``.
        spp: As in ``render``.
        aovs: As in ``render``.
        png: File of a PNG for display.
        stats: File of the statistics, as JSON.
        denoise: Whether images get the layer ``denoised``.
        file: Arguments half, compression, tile and split of ``Picture.save``.
        strict: Whether a missing file is an error.
        maps: Texts "FROM=TO". Workers that lack the folder FROM look for its files in TO.
        tries: Number of attempts for each task.
        hang_s: Time in seconds without progress after which a worker is restarted.
        **options: Fields of ``LoadOptions`` and of ``wavecomb.Settings``.

    Raises:
        WavecombError: An option is invalid, or a farm cannot render the stage with it.
    """
    from wavecomb.api import _asked_for
    from wavecomb.run import aovs as aov_names
    from wavecomb.run.frame_names import has_place, parse_frames
    from wavecomb.run.settings import DEFAULT_SIZE, prepare

    name, stage = os.fspath(output), os.fspath(stage)
    numbers = [None] if frames is None else list(parse_frames(frames))
    for one in (name, png, stats):
        if one is not None and len(numbers) > 1 and not has_place(one):
            raise WavecombError(f"{one}: would be written {len(numbers)} times; write .####.")
    loading, settings = split(options, without=("size", "threads"))
    frame = loading.pop("frame", None)
    if frame is not None and frames is not None:
        raise WavecombError("frame and frames exclude each other; give one of them")
    size, aovs = _asked_for(stage, size, aovs, settings, loading)
    policy, costs = settings.pop("policy", None), settings.pop("costs", None)
    guides = aov_names.GUIDES if denoise else ()
    own, profile, names, chosen = prepare(
        size or DEFAULT_SIZE, spp, policy, costs,
        aov_names.with_others(tuple(aovs or aov_names.DEFAULT), guides), settings,
    )  # fmt: skip
    if own is not None:
        raise WavecombError("policy: a farm needs the name of a policy, not an object")
    LoadOptions.of(None, loading).check()
    kept = names if not denoise else aov_names.expand(tuple(aovs or aov_names.DEFAULT))
    done = Job(
        stage=stage, folder=os.getcwd(),
        shots=(shot_of(chosen.to_dict(), kept, loading, name, png, stats),),
        images=tuple((0, frame if number is None else number) for number in numbers),
        file=file or {}, denoise=denoise, costs=profile, strict=strict, maps=parse_maps(maps),
        tries=tries, hang_s=hang_s,
    )  # fmt: skip
    done = complete(done, tiles=parse_tiles(tiles), workers=workers)
    return Folder.create(os.fspath(job or default_folder(name, stage)), done)


def run(
    job: Folder | str | os.PathLike[str],
    workers: int = 1,
    *,
    on: str | None = None,
    threads: int = 0,
    progress: Callable[[], bool | None] = lambda: None,
) -> list[Path]:
    """Renders the missing tiles and images of a job.

    Args:
        job: Result of ``submit``, or the job's folder.
        workers: Number of worker processes on this machine.
        on: Cluster to use instead of local ``workers``, a value of `--on` such as
            "dask:tls://HOST:8786".
        threads: Threads of each process; 0 uses the job's value, else an equal share of the cores.
        progress: Function that is called regularly; the run stops if it returns True.

    Returns:
        Files of the images.

    Raises:
        WavecombError: Some tasks failed. All other tasks are finished.
        KeyboardInterrupt: ``progress`` stopped the run. Finished tiles are kept.
    """
    from wavecomb.farm.client import run as run_job
    from wavecomb.farm.clusters import parse_cluster

    folder = job if isinstance(job, Folder) else Folder(job)
    where = parse_cluster(on or f"local:{workers}")
    stopped = [False]

    def is_stopped() -> bool:
        stopped[0] = stopped[0] or progress() is True
        return stopped[0]

    out = run_job(folder, where, threads=threads, is_stopped=is_stopped)
    if out.failed:
        title, line = out.failed[0]
        raise WavecombError(f"{title}: {line}")
    if out.stopped:
        raise KeyboardInterrupt
    of = folder.job
    return [Path(of.place(of.names(image)["output"])) for image in range(len(of.images))]


def render_task(folder: Folder, image: int, tile: str) -> list[str]:
    """Renders one tile of a job in this process, unless it is finished.

    Args:
        folder: Folder of the job.
        image: Number of the image, from 1.
        tile: Number and count, such as "3/8" for the third of eight tiles.

    Returns:
        Warnings about the stage.

    Raises:
        WavecombError: There is no such task, or it cannot be rendered.
    """
    from wavecomb.api import import_usd
    from wavecomb.farm.machine_class import machine_class
    from wavecomb.farm.rendering import Renderer, check_files, error_checks_for, use_job_maps
    from wavecomb.farm.tile_file import has_tile

    job = folder.job
    number, count = parse_tile(tile)
    if image > len(job.images):
        raise WavecombError(f"--image {image}: the job has {len(job.images)}")
    if count != job.tile_count(image - 1):
        raise WavecombError(f"--tile {tile}: images of this job have {job.tile_count(image - 1)}")
    task, machine = Task(image - 1, number), machine_class()
    rectangle = job.rectangles(task.image)[number]
    checks = error_checks_for(job.shot(task.image)) if count > 1 else 0
    key = job.tile_key(task, machine)
    if has_tile(folder.part(task), key, rectangle, checks):
        return []
    import_usd()
    use_job_maps(job)
    check_files(job)
    renderer = Renderer(job, learned=folder.learned())
    renderer.render(task, folder.part(task), machine, checks, plan=folder.plan(task.image))
    return list(renderer.warnings)


def assemble_job(folder: Folder) -> tuple[list[str], list[str]]:
    """Joins the tiles of all unfinished images in this process.

    Returns:
        Files that were written, and a line of text for each image with missing tiles.
    """
    from wavecomb.farm.assembly import finish_image, is_finished, machine_of

    job, written, lacking = folder.job, [], []
    for image in range(len(job.images)):
        if is_finished(folder, image):
            continue
        machines = [machine_of(folder, task) for task in job.tasks_of(image)]
        best = max(machines, key=machines.count)
        missing = [tile for tile, machine in enumerate(machines) if machine != best or not machine]
        if missing:
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            lacking.append(
                f"{job.title(image, missing[0])}{more}: not rendered, damaged, or of another "
                "class of machines"
            )
            continue
        found = finish_image(folder, image, best)
        if found.get("again"):
            lacking.append(f"{job.title(image)}: tiles must be rendered again: resume the job")
        written += found.get("files", [])
    return written, lacking
