# SPDX-License-Identifier: Apache-2.0
"""Puts pictures together in this process, where no worker did."""

from __future__ import annotations

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import DONE, TODO, Folder
from wavecomb.farm.leases import Beat
from wavecomb.farm.rendering import Renderer


def assemble_all(folder: Folder) -> list[str]:
    """Assembles each picture whose assembly is to be done; the files.

    Raises:
        WavecombError: Tiles are missing; those pictures that lack none are written.
    """
    spec, written, lacking = folder.spec, [], []
    done = folder.ids(DONE)
    beat = Beat(folder, {"threads": 0})
    renderer = Renderer(folder)
    try:
        for entry in folder.entries(TODO):
            if not entry.task.is_join:
                continue
            missing = [t for t in spec.parts_of(entry.task.picture) if t.id not in done]
            if missing:
                more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
                lacking.append(f"{spec.title(missing[0])}{more}")
                continue
            mine = folder.claim(entry, beat.name)
            if mine is None:
                continue
            try:
                result = renderer.do(mine.task)
            except BaseException:
                folder.give_back(mine)
                raise
            folder.finish(mine, {**result, "worker": beat.name})
            written += result["files"]
    finally:
        beat.end("it was done")
    if lacking:
        raise WavecombError(f"not assembled, since tiles are missing: {'; '.join(lacking[:3])}")
    return written
