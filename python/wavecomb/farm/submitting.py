# SPDX-License-Identifier: Apache-2.0
"""Makes a job of what is to be rendered."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.fetching import pack
from wavecomb.farm.folder import LEARNED, Folder
from wavecomb.farm.refusals import check_reproducible, check_tiles, is_better_whole, needs_whole
from wavecomb.farm.spec import MAX_TASKS, Shot, Spec
from wavecomb.farm.tiling import choose_tiles
from wavecomb.run.learned import save_learned

FEWEST_CHUNKS = 4
"""For each worker, so that they end at about the same time."""
MOST_IN_CHUNK = 16
UNKNOWN_WORKERS = 4
"""How many are expected where nobody says."""


def new_id() -> str:
    """Of a job."""
    return secrets.token_hex(8)


def default_folder(output: str | None, stage: str, output_dir: str | None = None) -> str:
    """The folder of a job whose name nobody gave: beside its pictures.

    >>> default_folder("out/shot.####.exr", "shot.usd")
    'out/shot.farm'
    """
    if output is None:
        stem = os.path.splitext(os.path.basename(stage))[0]
        return os.path.join(output_dir or "", f"{stem}.farm")
    folder, name = os.path.split(output)
    stem = re.sub(r"[._-]*(#+|%0?\d*d|<frame>)", "", os.path.splitext(name)[0])
    return os.path.join(folder, f"{stem or 'pictures'}.farm")


def complete(
    spec: Spec,
    *,
    tiles: tuple[int, int] | None,
    workers: int,
    chunk: int | None,
    is_taught: bool = False,
) -> Spec:
    """A job with its tiles and chunks.

    Args:
        spec: The job.
        tiles: Columns and rows; None: as is best.
        workers: That are expected; 0: nobody knows.
        chunk: Pictures of a chunk; None: as is best.
        is_taught: Whether its pictures are given what guides them.

    Raises:
        WavecombError: A farm cannot render it.
    """
    for shot in spec.shots:
        check_reproducible(shot.settings)
        if tiles is not None:
            check_tiles(shot.settings, tiles)
    count, workers = len(spec.pictures), workers or UNKNOWN_WORKERS
    if tiles is None:
        whole = any(
            needs_whole(shot.settings) or is_better_whole(shot.settings, is_taught)
            for shot in spec.shots
        )
        tiles = choose_tiles([shot.region for shot in spec.shots], count, workers, whole)
    if chunk is None:
        each = count // (FEWEST_CHUNKS * workers)
        chunk = 1 if tiles != (1, 1) else max(1, min(MOST_IN_CHUNK, each))
    done = replace(spec, tiles=tiles, chunk=chunk)
    tasks = sum(done.tile_count(picture) + done.is_tiled for picture in range(count))
    if tasks > MAX_TASKS:
        raise WavecombError(
            f"{tasks:,} tasks: a job has at most {MAX_TASKS:,}; give fewer tiles or frames"
        )
    return done


def create(
    spec: Spec,
    path: str,
    assets: Mapping[str, Any] | None,
    stage: str | None = None,
    learned: bytes | None = None,
) -> Folder:
    """Writes the folder of a job.

    Args:
        spec: The job, complete.
        path: Of the folder.
        assets: Of ``list_assets``; None: nobody looked.
        stage: Its name in errors.
        learned: What guides all pictures; None: each learns for itself.

    Raises:
        WavecombError: Files are missing; there are no pictures; the folder is there.
    """
    if not spec.pictures:
        raise WavecombError("all pictures are there; nothing is to be done")
    missing: Sequence[str] = (assets or {}).get("missing", ())
    if spec.strict and missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise WavecombError(f"{stage or spec.stage}: {missing[0]}{more} (--no-strict goes on)")
    files = {} if assets is None else {"assets.json": dict(assets)}
    copied = spec.assets == "copy"
    if copied and assets is None:
        raise WavecombError("--assets copy: needs to know all files: leave out --no-strict")

    def fill(folder: Path) -> None:
        if learned is not None:
            save_learned(folder / LEARNED, learned)
        if copied and assets is not None:
            pack(folder, assets["files"])

    return Folder.create(path, spec, files, fill)


def shot_of(
    settings: Mapping[str, Any],
    aovs: Sequence[str],
    loading: Mapping[str, Any],
    output: str,
    png: str | None = None,
    stats: str | None = None,
) -> Shot:
    """A shot of what ``Settings.to_dict`` and ``LoadOptions`` have, as JSON has it."""
    from wavecomb.run.stats import plain

    return Shot(plain(settings), tuple(aovs), plain(loading), output, png, stats)
