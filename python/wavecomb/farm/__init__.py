# SPDX-License-Identifier: Apache-2.0
"""A job on many workers: one picture, the same bits (docs/farm.md).

>>> from wavecomb import farm
>>> job = farm.submit("shot.usd", "out/shot.####.exr", frames="1-48")  # doctest: +SKIP
>>> farm.run(job, workers=4)  # doctest: +SKIP
>>> farm.status(job)["state"]  # doctest: +SKIP
'done'
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavecomb.farm.api import run, submit
    from wavecomb.farm.checking import repair, retry
    from wavecomb.farm.folder import Folder
    from wavecomb.farm.state import status

__all__ = ["Folder", "repair", "retry", "run", "status", "submit"]

_HOMES = {
    "Folder": "wavecomb.farm.folder",
    "repair": "wavecomb.farm.checking",
    "retry": "wavecomb.farm.checking",
    "run": "wavecomb.farm.api",
    "status": "wavecomb.farm.state",
    "submit": "wavecomb.farm.api",
}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'wavecomb.farm' has no attribute {name!r}")
