# SPDX-License-Identifier: Apache-2.0
"""Adds instances of groups and volumes to groups, with names, materials and motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb import _core
from wavecomb.usd.cameras import framing
from wavecomb.usd.geometry.curves import CurveArrays
from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.geometry.subdivision import SubdivisionSurfaces
from wavecomb.usd.instances.group import (
    AnimatedTransform,
    Group,
    Matrices,
    Scope,
    middle_transforms,
    placed_volumes,
)
from wavecomb.usd.instances.point_instancer import are_valid
from wavecomb.usd.lights.mesh_light import MeshLights
from wavecomb.usd.materials.draw_item import DrawItem, Parent
from wavecomb.usd.materials.texture import MEGABYTE
from wavecomb.usd.stage.collections import Assets
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.grids import GridFacts, VolumeFacts
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
    """Adds all volumes to the scene; returns a description of each volume prim."""
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
    """Reports if the volumes' grids exceed ``--texture-limit`` (in MB) even without textures."""
    taken = sum(grid.bytes for grid in {grid for volume in volumes for grid in volume.grids})
    if limit is not None and taken > limit * MEGABYTE:
        report.warn(
            f"texture limit {limit:g} MB: grids of volumes take {taken / MEGABYTE:,.1f} MB, all of "
            "which is in memory; textures get a few tiles at a time: give more, or coarser grids"
        )


def report_ignored_volumes(
    volumes: tuple[VolumeFacts, ...], materials: list[str], report: LoadReport
) -> None:
    """Reports that light scattered inside the given materials ignores volumes."""
    for name in materials if volumes else ():
        what = "volumes inside refracting, scattering materials: light scattered there ignores them"
        report.note(what, name)


def _facts(
    name: str, corners: list[NDArray[np.float64]], grids: tuple[GridFacts, ...]
) -> VolumeFacts:
    points = np.concatenate(corners)
    low, high = (tuple(map(float, end)) for end in (points.min(axis=0), points.max(axis=0)))
    return VolumeFacts(name, len(corners), low, high, grids)  # type: ignore[arg-type]


class GroupInstancer:
    """Creates groups in the scene and adds instances of them."""

    def __init__(self, context: LoadContext, mesh_lights: MeshLights) -> None:
        self.builder, self.report = context.builder, context.report
        self.framed = context.framed
        self.mesh_lights = mesh_lights
        self.assets = Assets()

    def asset_length(
        self, prim: Usd.Prim, path: str, name: str, parent: Parent | None = None
    ) -> int:
        """Returns the length of the part of a prim's name that identifies its asset.

        ``path`` is the path of the prim, ``name`` its name from ``LoadReport.place``, and
        ``parent`` its parent if known.
        """
        length = self.assets.length_below(prim, path, parent)
        return length and length + len(name) - len(path)

    def number(self, group: Group) -> int:
        """Returns the id of a group in the scene; creates it on first use."""
        if group.number is None:
            group.number = self.builder.add_group(group.name, root=group.root)
            self.report.tally("groups")
        return group.number

    def add(
        self,
        parent: Group,
        child: Group,
        transforms: Matrices,
        materials: NDArray[np.uint32],
        prims: Sequence[Usd.Prim],
        numbers: NDArray[np.uint32] | None = None,
        motion: Matrices | None = None,
    ) -> None:
        """Adds k instances of a group: k prims, or numbered instances of a point instancer.

        ``motion`` holds (k, s, 4, 4) transforms at equal steps over the shutter.
        """
        usable = are_valid(transforms)
        if motion is not None:
            usable &= are_valid(motion.reshape(-1, 4, 4)).reshape(motion.shape[:2]).all(axis=1)
        if not usable.all():
            what = "instances left out: transform without an inverse"
            self.report.warn(what, prims[0].GetPath(), int((~usable).sum()))
            transforms, materials = transforms[usable], materials[usable]
            motion = None if motion is None else motion[usable]
            if numbers is None:
                prims = [prim for prim, good in zip(prims, usable, strict=True) if good]
            else:
                numbers = numbers[usable]
        if len(transforms) == 0:
            return
        if child.sampled_light is not None:
            parent.sampled_light = child.sampled_light
            if motion is not None:
                self.mesh_lights.report_motion(child.sampled_light)
        if child.has_lights_or_volumes:
            middle = transforms if motion is None else middle_transforms(motion)
            places = [
                AnimatedTransform(matrix, None if motion is None else motion[k])
                for k, matrix in enumerate(middle)
            ]
            parent.children.append((child, places))
            parent.has_lights_or_volumes = True
        if child.has_surfaces:
            parent.surfaced.append((child, transforms))
            parent.has_surfaces = True
        if child.number is not None:
            self._add_instances(parent, child, transforms, materials, prims, numbers, motion)
        self._grow(parent, child, transforms if motion is None else motion.reshape(-1, 4, 4))

    def _add_instances(
        self,
        parent: Group,
        child: Group,
        transforms: Matrices,
        materials: NDArray[np.uint32],
        prims: Sequence[Usd.Prim],
        numbers: NDArray[np.uint32] | None,
        motion: Matrices | None,
    ) -> None:
        paths = [str(prim.GetPath()) for prim in prims]
        names = [self.report.place(path) for path in paths]
        lengths = [self.asset_length(*each) for each in zip(prims, paths, names, strict=True)]
        self.builder.add_instances(
            self.number(parent),
            self.number(child),
            transforms,
            materials,
            names=names,
            numbers=numbers,
            asset_lengths=lengths,
            **({} if motion is None else {"motion": motion}),
        )

    def _grow(self, parent: Group, child: Group, transforms: Matrices) -> None:
        """Extends the bounds and outline of a group to contain the instances of a child group."""
        if child.bounds is None:
            return
        if self.framed is not None and (inner := framing.joined(child.outlines)) is not None:
            child.outlines = [inner]
            more = self.framed if parent.number == 0 else None
            parent.reach(framing.placed(inner, transforms, more), more)
        lo, hi = child.bounds
        centre, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
        linear = transforms[:, :3, :3]
        middle = centre @ linear + transforms[:, 3, :3]
        reach = half @ np.abs(linear)
        parent.grow(np.array([(middle - reach).min(axis=0), (middle + reach).max(axis=0)]))


def outline_of(
    shape: MeshArrays | CurveArrays, surfaces: SubdivisionSurfaces, more: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Returns the extreme points of a shape in world space or prototype space."""
    points = shape.positions.reshape(-1, 3)
    if isinstance(shape, CurveArrays):
        radii = np.tile(shape.radii, len(points) // len(shape.radii))
        return framing.outline_of_balls(points, radii, more)
    smooth = None if shape.cage is None else surfaces.limit_points(shape.cage)
    if smooth is not None:
        return framing.outline(smooth, more)
    return outline_of_points(shape.positions, shape.triangles, more)


def outline_of_points(
    points: NDArray[Any], triangles: NDArray[np.uint32] | None, more: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Returns the outline of the points (..., n, 3) that triangles use; None means all points."""
    used = None if triangles is None else _core.used_points(triangles, points.shape[-2])
    points = points if used is None else points[..., used, :]
    return framing.outline(points.reshape(-1, 3), more)
