# SPDX-License-Identifier: Apache-2.0
"""Where a stage's files lie on this machine: where they are named, mapped, or fetched."""

from __future__ import annotations

import json
import os

from wavecomb.farm.assets import differences
from wavecomb.farm.fetching import fetch
from wavecomb.farm.folder import Folder
from wavecomb.farm.hashes import Hashes
from wavecomb.farm.maps import here

_VARIABLE = "WAVECOMB_PATH_MAPS"
"""Of ``usd.stage.path_maps``, which this process need not import for it."""


def files_at_hand(folder: Folder) -> list[str]:
    """Has this process, and those that it starts, find the files of a job.

    Returns:
        Lines on files that are not to be found, or are others; only where the job is strict.
    """
    spec, files = folder.spec, folder.assets()
    pairs = here(spec.maps)
    if pairs:
        os.environ[_VARIABLE] = json.dumps(pairs)
    if not spec.strict:
        return []
    hashes = Hashes(folder.path)
    lacking = differences(files, spec.place, hashes.of)
    hashes.save()
    if lacking and spec.assets == "copy":
        tree = fetch(folder.path, spec.id, files)
        os.environ[_VARIABLE] = json.dumps([("/", str(tree))])
        return []
    return lacking


def stage_place(folder: Folder, name: str) -> str:
    """Where the stage, or another file that is read with it, lies on this machine."""
    from wavecomb.usd.stage.path_maps import mapped, maps

    return mapped(os.path.join(folder.spec.folder, name), maps())
