# SPDX-License-Identifier: Apache-2.0
"""Adds the volumes of a stage to groups, and instances them in the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.instances.group import Group, Scope, placed_volumes
from wavecomb.usd.instances.point_instancer import are_valid
from wavecomb.usd.materials.assignment import DrawItem
from wavecomb.usd.materials.texture import MEGABYTE
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.info import GridFacts, VolumeFacts
from wavecomb.usd.volumes.volume import VolumeReader

MAX_VOLUMES = 4096
"""Maximum number of volumes in a scene, since instancing can multiply them."""


class VolumeInstancer:
    """Reader of volumes that adds them to groups."""

    def __init__(self, context: LoadContext) -> None:
        self._reader = VolumeReader(context)
        self._report, self._framed = context.report, context.framed

    @property
    def may_light(self) -> bool:
        """Whether a volume may emit light."""
        return self._reader.may_light

    def add(self, group: Group, draw: DrawItem, scope: Scope) -> None:
        """Adds a prim's volume to a group; reports volumes that are left out.

        Raises:
            WavecombError: A file is corrupt or contains values that are invalid for a volume.
        """
        path = draw.prim.GetPath()
        if scope.override or (scope.bound and draw.material is None):
            what = "materials of instances on volumes in them (left out)"
            self._report.missing(what, path)
        volume = self._reader.read(draw)
        if volume is None:
            return
        matrix = np.array(draw.matrix)
        if not bool(are_valid(matrix[None])[0]):
            self._report.warn("volume left out: its transform has no inverse", path)
            return
        corners = volume.corners @ matrix[:3, :3] + matrix[3, :3]
        group.volumes.append((volume, matrix))
        group.grow(np.array([corners.min(axis=0), corners.max(axis=0)]))
        if self._framed is not None:
            group.reach(corners, self._framed if group.number == 0 else None)
        self._report.tally("volumes")


def add_volumes(world: Group, context: LoadContext) -> tuple[VolumeFacts, ...]:
    """Adds all volumes to the scene; returns one description per volume prim."""
    report = context.report
    volumes = placed_volumes(world, MAX_VOLUMES + 1)
    if len(volumes) > MAX_VOLUMES:
        report.warn(f"more than {MAX_VOLUMES} volumes: the rest is left out")
        volumes = volumes[:MAX_VOLUMES]
    places: dict[str, list[NDArray[np.float64]]] = {}
    grids: dict[str, tuple[GridFacts, ...]] = {}
    for volume, transform in volumes:
        name = volume.options["name"]
        if not bool(are_valid(transform[None])[0]):
            report.warn("volume left out: its transform has no inverse", name)
            continue
        context.builder.add_volume(**volume.options, to_world=transform)
        corners = volume.corners @ transform[:3, :3] + transform[3, :3]
        places.setdefault(name, []).append(corners + context.origin)
        grids[name] = volume.grids
    return tuple(_facts(name, corners, grids[name]) for name, corners in places.items())


def report_grid_memory(
    volumes: tuple[VolumeFacts, ...], limit: float | None, report: LoadReport
) -> None:
    """Reports if grids alone exceed ``--texture-limit`` (in MB)."""
    taken = sum(grid.bytes for grid in {grid for volume in volumes for grid in volume.grids})
    if limit is not None and taken > limit * MEGABYTE:
        report.warn(
            f"texture limit {limit:g} MB: grids of volumes take {taken / MEGABYTE:,.1f} MB, all of "
            "which is in memory; textures get a few tiles at a time: give more, or coarser grids"
        )


def report_ignored_volumes(
    volumes: tuple[VolumeFacts, ...], materials: list[str], report: LoadReport
) -> None:
    """Reports that light scattered inside these materials does not interact with volumes there."""
    for name in materials if volumes else ():
        what = "volumes inside refracting, scattering materials: light scattered there ignores them"
        report.note(what, name)


def _facts(
    name: str, corners: list[NDArray[np.float64]], grids: tuple[GridFacts, ...]
) -> VolumeFacts:
    points = np.concatenate(corners)
    low, high = (tuple(map(float, end)) for end in (points.min(axis=0), points.max(axis=0)))
    return VolumeFacts(name, len(corners), low, high, grids)  # type: ignore[arg-type]
