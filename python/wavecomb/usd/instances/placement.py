# SPDX-License-Identifier: Apache-2.0
"""Adds groups to other groups as instances, with names, materials and motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb import _core
from wavecomb.usd.cameras import framing
from wavecomb.usd.geometry.curves import CurveArrays
from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.geometry.subdivision import SubdivisionSurfaces
from wavecomb.usd.instances.group import AnimatedTransform, Group, Matrices, middle_transforms
from wavecomb.usd.instances.point_instancer import are_valid
from wavecomb.usd.lights.mesh_light import MeshLights
from wavecomb.usd.materials.assignment import Parent
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.identity import Assets


class GroupInstancer:
    """Factory of the scene's groups that also instances them."""

    def __init__(self, context: LoadContext, mesh_lights: MeshLights) -> None:
        self.builder, self.report = context.builder, context.report
        self.framed = context.framed
        self.mesh_lights = mesh_lights
        self.assets = Assets()

    def asset_length(
        self, prim: Usd.Prim, path: str, name: str, parent: Parent | None = None
    ) -> int:
        """Returns the length of the asset part of a prim's name (``LoadReport.place``).

        ``path`` is the path of the prim, and ``parent`` its parent if known.
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
        """Adds k instances of a group, from k prims or from numbered instances of one instancer.

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
        """Extends the bounds and outline of a group by the instances of a child group."""
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
    """Returns the extreme points of a shape in the space of its group."""
    points = shape.positions.reshape(-1, 3)
    if isinstance(shape, CurveArrays):
        radii = np.tile(shape.radii, len(points) // len(shape.radii))
        return framing.outline_of_balls(points, radii, more)
    smooth = None if shape.cage is None else surfaces.limit_points(shape.cage)
    if smooth is not None:
        return framing.outline(smooth, more)
    used = _core.used_points(shape.triangles, shape.positions.shape[-2])
    points = shape.positions if used is None else shape.positions[..., used, :]
    return framing.outline(points.reshape(-1, 3), more)
