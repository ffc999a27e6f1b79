# SPDX-License-Identifier: Apache-2.0
"""Renders a job on many workers, bit-identically to one process (docs/farm.md).

>>> from wavecomb import farm
>>> job = farm.submit("shot.usd", "out/shot.####.exr", frames="1-48")  # doctest: +SKIP
>>> farm.run(job, workers=4)  # doctest: +SKIP
>>> farm.status(job).state  # doctest: +SKIP
'done'
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavecomb.farm.api import run, submit
    from wavecomb.farm.assembly import status
    from wavecomb.farm.folder import Folder

__all__ = ["Folder", "run", "status", "submit"]

_HOMES = {
    "Folder": "wavecomb.farm.folder",
    "run": "wavecomb.farm.api",
    "status": "wavecomb.farm.assembly",
    "submit": "wavecomb.farm.api",
}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'wavecomb.farm' has no attribute {name!r}")
