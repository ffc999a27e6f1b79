# SPDX-License-Identifier: Apache-2.0
"""Jobs from Python."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.engines import Engine
from wavecomb.farm.folder import Folder
from wavecomb.farm.maps import parse_maps
from wavecomb.farm.spec import Spec
from wavecomb.farm.submitting import complete, create, default_folder, new_id, shot_of
from wavecomb.farm.tiling import parse_tiles
from wavecomb.load_options import LoadOptions, split


def submit(
    stage: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    frames: str | Iterable[float] | None = None,
    tiles: str = "auto",
    job: str | os.PathLike[str] | None = None,
    workers: int = 0,
    chunk: int | None = None,
    size: tuple[int, int] | None = None,
    spp: int = 64,
    aovs: Iterable[str] | None = None,
    png: str | None = None,
    stats: str | None = None,
    denoise: bool = False,
    file: dict[str, Any] | None = None,
    strict: bool = True,
    assets: str = "shared",
    maps: Iterable[str] = (),
    **options: Any,
) -> Folder:
    """Writes the folder of a job. ``run``, or `wavecomb farm worker`, works on it.

    Args:
        stage: A file.
        output: The picture's file, for frames with a place for them: shot.####.exr.
        frames: As of ``render_frames``; None: one picture.
        tiles: "auto", or columns and rows such as "4x3".
        job: The folder; None: beside the output.
        workers: That are expected; 0: nobody knows.
        chunk: Pictures that a worker takes one after another; None: as is best.
        size: As of ``render``, like spp and aovs.
        spp: Likewise.
        aovs: Likewise.
        png: Picture for display, too.
        stats: Statistics as JSON, too.
        denoise: Whether pictures get the layer ``denoised``.
        file: half, compression, tile and split of ``Picture.save``.
        strict: Whether a file that is missing is an error.
        assets: "shared", or "copy": workers that lack files of the stage get them from the folder.
        maps: "FROM=TO": folders that lie elsewhere for workers that do not have them.
        **options: Fields of ``LoadOptions`` and of ``wavecomb.Settings``.

    >>> job = submit("shot.usd", "shot.exr", tiles="8x4", spp=256)  # doctest: +SKIP
    >>> run(job, workers=4)  # doctest: +SKIP

    Raises:
        WavecombError: Something is no good, or cannot be rendered on a farm.
    """
    from wavecomb.api import _asked_for
    from wavecomb.farm.assets import ask_assets
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
        raise WavecombError("frame is one frame and frames are several; give one of them")
    size, aovs = _asked_for(stage, size, aovs, settings, loading)
    policy, costs = settings.pop("policy", None), settings.pop("costs", None)
    guides = aov_names.GUIDES if denoise else ()
    own, profile, names, chosen = prepare(
        size or DEFAULT_SIZE, spp, policy, costs,
        aov_names.with_others(tuple(aovs or aov_names.DEFAULT), guides), settings,
    )  # fmt: skip
    if own is not None:
        raise WavecombError("policy: a farm takes the name of one, not an object of this process")
    LoadOptions.of(None, loading).check()
    kept = names if not denoise else aov_names.expand(tuple(aovs or aov_names.DEFAULT))
    shot = shot_of(chosen.to_dict(), kept, loading, name, png, stats)
    spec = Spec(
        id=new_id(), stage=stage, folder=os.getcwd(), shots=(shot,),
        pictures=tuple((0, frame if number is None else number) for number in numbers),
        file=file or {}, denoise=denoise, costs=profile, strict=strict, command=("wavecomb.farm",),
        assets=assets, maps=parse_maps(maps),
    )  # fmt: skip
    spec = complete(spec, tiles=parse_tiles(tiles), workers=workers, chunk=chunk)
    if assets not in ("shared", "copy"):
        raise WavecombError(f"assets: must be shared or copy, not {assets}")
    listed = ask_assets(stage, _words(loading)) if strict else None
    return create(spec, os.fspath(job or default_folder(name, stage)), listed)


def _words(loading: dict[str, Any]) -> list[str]:
    words = []
    for key, value in (loading.get("variants") or {}).items():
        words += ["--variant", f"{key}={value}"]
    if loading.get("session_layer") is not None:
        words += ["--session-layer", os.fspath(loading["session_layer"])]
    return words


def run(
    job: Folder | str | os.PathLike[str],
    workers: int = 1,
    *,
    threads: int = 0,
    progress: Callable[[], None] = lambda: None,
) -> list[Path]:
    """Works on a job with processes of this machine until nothing is left to do.

    Args:
        job: Of ``submit``, or a folder.
        workers: How many processes.
        threads: Of each; 0: as the job says, else its share of the cores.
        progress: Called now and then.

    Returns:
        The pictures' files.

    Raises:
        WavecombError: Tasks failed; the others are done.
        KeyboardInterrupt: Somebody stopped it; what was done is kept.
    """
    from wavecomb.farm.state import status

    folder = job if isinstance(job, Folder) else Folder(job)
    wanted = threads or int(folder.spec.shots[0].settings.get("threads") or 0)
    engine = Engine("local", workers).runner(folder, wanted)
    engine.run(progress)
    if engine.stopped is not None:
        raise KeyboardInterrupt
    found = status(folder, tasks=False)
    if found["failed"]:
        one = found["failed"][0]
        raise WavecombError(f"{one['title']}: {one['error']}")
    if found["state"] != "done":
        raise WavecombError(engine.errors[0] if engine.errors else "nobody works on the job")
    spec = folder.spec
    return [Path(spec.place(spec.names(i)["output"])) for i in range(len(spec.pictures))]
