# SPDX-License-Identifier: Apache-2.0
"""Whether what is said to be done is there; what is not is done again."""

from __future__ import annotations

import contextlib
import os

from wavecomb.farm.folder import DONE, FAILED, TODO, Entry, Folder
from wavecomb.farm.leases import take_back
from wavecomb.farm.part import DamagedPart, load_part
from wavecomb.farm.spec import Task
from wavecomb.farm.sweeping import sweep


def damaged_tiles(folder: Folder, picture: int) -> list[Task]:
    """Tiles of a picture that are done and whose files are absent or damaged."""
    found = []
    for task in folder.spec.parts_of(picture):
        if not (folder.path / DONE / task.id).exists():
            continue
        try:
            load_part(folder.part(task), folder.spec.id, task)
        except DamagedPart:
            found.append(task)
    return found


def is_written(folder: Folder, picture: int) -> bool:
    """Whether all files of a picture are there."""
    names = folder.spec.names(picture).values()
    return all(os.path.exists(folder.spec.place(name)) for name in names)


def repair(folder: Folder) -> list[Task]:
    """Has done again what is said to be done and is not there; tasks that are nowhere, too.

    Contract: nobody works on the job, or only those whose work this leaves alone.

    Returns:
        Tasks that are to be done again.
    """
    spec = folder.spec
    # Who goes on with a job whose engine was killed does not pay for it with tries.
    take_back(folder, counts=False)
    done, again = folder.ids(DONE), []
    known = done.union(*(folder.ids(state) for state in ("busy", TODO, FAILED)))
    for picture in range(len(spec.pictures)):
        tiles = spec.parts_of(picture)
        last = spec.last_of(picture)
        if last.id in done:
            if is_written(folder, picture):
                continue
            again += [task for task in {*tiles, last} if folder.put_back(DONE, task)]
        elif spec.is_tiled:
            again += [t for t in damaged_tiles(folder, picture) if folder.put_back(DONE, t)]
        for task in (*tiles, last):
            if task.id not in known:
                with contextlib.suppress(FileExistsError):
                    (folder.path / TODO / Entry(task, 1).name).touch(exist_ok=False)
                    again.append(task)
    sweep(folder)
    return sorted(dict.fromkeys(again), key=lambda task: task.id)


def retry(folder: Folder, wanted: list[Task] | None = None) -> list[Task]:
    """Has tasks done again that failed; None: all of them.

    Raises:
        WavecombError: One did not fail.
    """
    from wavecomb.errors import WavecombError

    failed = folder.ids(FAILED)
    for task in wanted or []:
        if task.id not in failed:
            raise WavecombError(f"task {task.id}: did not fail")
    tasks = [Task.of(name) for name in sorted(failed)] if wanted is None else wanted
    return [task for task in tasks if folder.put_back(FAILED, task)]
