# SPDX-License-Identifier: Apache-2.0
"""Reads gprims of every kind into arrays, and hands those to the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pxr import Usd

from wavecomb.usd.geometry.curves import CurveArrays, CurveReader, over_shutter
from wavecomb.usd.geometry.deforming import deforms
from wavecomb.usd.geometry.mesh import MeshReader
from wavecomb.usd.geometry.mesh_arrays import UV_NAMES, MeshArrays
from wavecomb.usd.geometry.nurbs_patch import PatchReader
from wavecomb.usd.geometry.points import PointReader
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.geometry.skeleton import Skeletons
from wavecomb.usd.geometry.splats import SplatArrays, SplatReader
from wavecomb.usd.geometry.strand_detail import StrandDetail
from wavecomb.usd.geometry.surfaces import Surfaces
from wavecomb.usd.looks.assign import Draw
from wavecomb.usd.stage.frame_cache import MeshCache
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core


class GprimReader:
    """Reads the gprims of one stage at one time."""

    def __init__(
        self,
        time: Usd.TimeCode,
        report: LoadReport,
        surfaces: Surfaces,
        skeletons: Skeletons,
        motion: Motion | None = None,
        cache: MeshCache | None = None,
    ) -> None:
        """Reads at ``time``.

        Args:
            time: The frame.
            report: For what is odd.
            surfaces: Say what is subdivided or displaced.
            skeletons: Deform what is bound to them.
            motion: Shapes are taken over its shutter; None: at ``time`` only.
            cache: Arrays to take from and leave there.
        """
        self.time = time
        self.report = report
        self.surfaces = surfaces
        self.skeletons = skeletons
        self.motion = motion
        self.cache = cache
        self._meshes = self._mesh_reader(report)

    def _mesh_reader(self, report: LoadReport) -> MeshReader:
        return MeshReader(self.time, report, self.surfaces.subdivide, self.skeletons, self.motion)

    def deforms(self, kind: str, prim: Usd.Prim) -> bool:
        """Whether the shape of a gprim may change while the shutter is open."""
        return self.motion is not None and self._changes(kind, prim)

    def _changes(self, kind: str, prim: Usd.Prim) -> bool:
        """Whether the shape of a gprim may change over time."""
        return kind not in ("shape", "splats") and deforms(prim, self.skeletons.of(prim))

    def read(
        self,
        kind: str,
        draw: Draw,
        names: Sequence[str],
        detail: StrandDetail | None = None,
    ) -> MeshArrays | CurveArrays | None:
        """The arrays of a gprim in its group's space; None where there is nothing to draw.

        Those of the frame before where they are the same.

        Args:
            kind: mesh, patch, shape, curves, points or splats.
            draw: The gprim.
            names: Primvars to take texture coordinates from, the first there is.
            detail: Of curves; what it makes of them is of one view, and not kept.

        Raises:
            MeshError: It cannot be drawn.
        """
        displaced = kind == "mesh" and self.surfaces.is_displaced(draw)

        def read(report: LoadReport) -> MeshArrays | CurveArrays | None:
            strands: CurveArrays | None
            if kind == "splats":
                return SplatReader(self.time, report).splats(draw.prim, draw.matrix)
            if kind in ("curves", "points"):
                if kind == "curves":
                    curves = CurveReader(self.time, report)
                    strands = curves.curves(draw.prim, draw.matrix, names, draw.inherited, detail)
                else:
                    points = PointReader(self.time, report)
                    strands = points.points(draw.prim, draw.matrix, names, draw.inherited)
                if (
                    strands is not None
                    and self.motion is not None
                    and self._changes(kind, draw.prim)
                ):
                    return over_shutter(draw.prim, strands, draw.matrix, self.motion, report)
                return strands
            if kind == "patch":
                patches = PatchReader(self.time, report)
                motion = self.motion if self._changes(kind, draw.prim) else None
                return patches.patch(draw.prim, draw.matrix, names, draw.inherited, motion)
            meshes = self._meshes if report is self.report else self._mesh_reader(report)
            if kind == "shape":
                return meshes.shape(draw.prim, draw.matrix, draw.names)
            mesh = meshes.mesh(draw.prim, draw.matrix, names, draw.names, draw.inherited, displaced)
            if mesh is not None and self.deforms(kind, draw.prim):
                return meshes.over_shutter(draw.prim, mesh, draw.matrix, draw.track)
            return mesh

        if self.cache is None or detail is not None or self._changes(kind, draw.prim):
            return read(self.report)
        options = (tuple(names), names is UV_NAMES, displaced)
        return self.cache.get(read, draw.prim, draw.matrix, options, draw.inherited, self.report)


_OPTIONS: dict[str, Any] = {
    "face_materials": None, "attributes": {}, "light_group": "", "asset_length": 0,
}  # fmt: skip


def add_shape(
    builder: _core.SceneBuilder, shape: MeshArrays | CurveArrays, options: dict[str, Any]
) -> int:
    """Adds arrays to the scene; gives their number there.

    ``options``: Keyword arguments that ``add_mesh``, ``add_curves`` and ``add_points`` all take; of
    splats those of ``add_splats``.
    """
    # What is not there is not said: a stage may have a hundred thousand of them.
    if isinstance(shape, MeshArrays):
        if shape.normals is not None:
            options["normals"] = shape.normals
        if shape.uvs is not None:
            options["uvs"] = shape.uvs
        return builder.add_mesh(shape.positions, shape.triangles, **options)
    if isinstance(shape, SplatArrays):
        return builder.add_splats(
            shape.positions,
            shape.scales,
            shape.orientations,
            shape.opacities,
            shape.harmonics,
            **options,
        )
    options = {**_OPTIONS, **options}
    if shape.segments is None:
        return builder.add_points(shape.positions, shape.radii, uvs=shape.uvs, **options)
    return builder.add_curves(
        shape.kind,
        shape.positions,
        shape.segments,
        shape.radii,
        normals=shape.normals,
        uvs=shape.uvs,
        **options,
    )
