# SPDX-License-Identifier: Apache-2.0
"""Completes a job before submission by adding its tiles, and its files with their hashes."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import Folder
from wavecomb.farm.job import MAX_TASKS, Job, Shot
from wavecomb.farm.tiling import (
    check_reproducible,
    check_tiles,
    choose_tiles,
    is_better_whole,
    needs_whole,
)

_UNKNOWN_WORKERS = 4
"""Number of workers assumed if the real number is unknown."""


def default_folder(output: str | None, stage: str, output_dir: str | None = None) -> str:
    """Returns the default folder of a job, which is beside the images.

    >>> default_folder("out/shot.####.exr", "shot.usd")
    'out/shot.farm'
    """
    if output is None:
        stem = os.path.splitext(os.path.basename(stage))[0]
        return os.path.join(output_dir or "", f"{stem}.farm")
    folder, name = os.path.split(output)
    stem = re.sub(r"[._-]*(#+|%0?\d*d|<frame>)", "", os.path.splitext(name)[0])
    return os.path.join(folder, f"{stem or 'images'}.farm")


def complete(
    job: Job, *, tiles: tuple[int, int] | None, workers: int = 0, learned: bytes | None = None
) -> Job:
    """Returns a job with its tiles and files filled in.

    Args:
        job: The job.
        tiles: Columns and rows; None means that this function chooses them.
        workers: Expected number of workers; 0 means unknown.
        learned: Guiding field for all images, or None.

    Raises:
        WavecombError: A farm cannot render the job, or files are missing.
    """
    if not job.images:
        raise WavecombError("all images exist; nothing is left to render")
    for shot in job.shots:
        check_reproducible(shot.settings)
        if tiles is not None:
            check_tiles(shot.settings, tiles)
    if tiles is None:
        whole = any(
            needs_whole(shot.settings) or is_better_whole(shot.settings) for shot in job.shots
        )
        regions = [shot.region for shot in job.shots]
        tiles = choose_tiles(regions, len(job.images), workers or _UNKNOWN_WORKERS, whole)
    field = None if learned is None else hashlib.sha256(learned).hexdigest()
    done = replace(job, tiles=tiles, learned=field)
    if done.task_count() > MAX_TASKS:
        raise WavecombError(
            f"{done.task_count():,} tasks: a job has at most {MAX_TASKS:,}; give fewer tiles or "
            "frames"
        )
    return with_files(done)


def with_files(job: Job) -> Job:
    """Returns a job with the files that its stage needs now, and their hashes.

    Raises:
        WavecombError: The stage cannot be opened, or a file is missing.
    """
    from wavecomb.farm.rendering import list_files, use_job_maps

    use_job_maps(job)
    files, missing = {}, {}
    wanted = {(_text(shot, "variants"), shot.loading.get("session_layer")) for shot in job.shots}
    for text, session in sorted(wanted, key=str):
        variants = dict(text) or None
        here = None if session is None else job.place(session)
        found, lacking = list_files(job.place(job.stage), variants, here)
        files.update({one.path: one for one in found})
        missing.update(dict.fromkeys(lacking))
    if missing and job.strict:
        first = next(iter(missing))
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise WavecombError(f"{job.stage}: {first}{more} (--no-strict renders without)")
    return replace(job, files=tuple(files[path] for path in sorted(files)))


def _text(shot: Shot, name: str) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((shot.loading.get(name) or {}).items()))


def shot_of(
    settings: Mapping[str, Any],
    aovs: Sequence[str],
    loading: Mapping[str, Any],
    output: str,
    png: str | None = None,
    stats: str | None = None,
) -> Shot:
    """Builds a shot from ``Settings.to_dict`` and fields of ``LoadOptions``, as JSON values."""
    from wavecomb.run.stats import plain

    return Shot(plain(settings), tuple(aovs), plain(loading), output, png, stats)


def refresh(folder: Folder, job: Job) -> int:
    """Rewrites a job if files of its stage have changed. Returns the number of changed files."""
    before = {one.path: one.sha256 for one in folder.job.files}
    after = {one.path: one.sha256 for one in job.files}
    changed = sum(before.get(path) != after.get(path) for path in before.keys() | after.keys())
    if changed:
        folder.replace(job)
    return changed
