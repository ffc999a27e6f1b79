# SPDX-License-Identifier: Apache-2.0
"""Adds the volumes of a stage to its scene, wherever they are placed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.stage.group import Group, placed_volumes
from wavecomb.usd.stage.instancing import sound
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.info import GridFacts, VolumeFacts

if TYPE_CHECKING:
    from wavecomb import _core

MAX_VOLUMES = 4096
"""Volumes that are placed; instances may multiply them."""


def add_volumes(
    world: Group, builder: _core.SceneBuilder, report: LoadReport
) -> tuple[VolumeFacts, ...]:
    """Adds all volumes; says what each is, once for all its places."""
    volumes = placed_volumes(world, MAX_VOLUMES + 1)
    if len(volumes) > MAX_VOLUMES:
        report.warn(f"more than {MAX_VOLUMES} volumes: the rest is left out")
        volumes = volumes[:MAX_VOLUMES]
    places: dict[str, list[NDArray[np.float64]]] = {}
    grids: dict[str, tuple[GridFacts, ...]] = {}
    for volume, transform in volumes:
        name = volume.options["name"]
        if not bool(sound(transform[None])[0]):
            report.warn("volume left out: its transform has no inverse", name)
            continue
        builder.add_volume(**volume.options, to_world=transform)
        corners = volume.corners @ transform[:3, :3] + transform[3, :3]
        places.setdefault(name, []).append(corners)
        grids[name] = volume.grids
    return tuple(_facts(name, corners, grids[name]) for name, corners in places.items())


def _facts(
    name: str, corners: list[NDArray[np.float64]], grids: tuple[GridFacts, ...]
) -> VolumeFacts:
    points = np.concatenate(corners)
    low, high = (tuple(map(float, end)) for end in (points.min(axis=0), points.max(axis=0)))
    return VolumeFacts(name, len(corners), low, high, grids)  # type: ignore[arg-type]
