# SPDX-License-Identifier: Apache-2.0
"""Reads gprims into arrays, checks that they fit into memory, and adds them to the scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from pxr import Tf, Usd

from wavecomb.errors import WavecombError
from wavecomb.run.isolation import memory, progress_notes, time_limit
from wavecomb.usd.geometry.curves import CurveArrays, CurveReader, over_shutter
from wavecomb.usd.geometry.mesh import MeshReader
from wavecomb.usd.geometry.mesh_arrays import UV_NAMES, MeshArrays
from wavecomb.usd.geometry.nurbs_patch import PatchReader
from wavecomb.usd.geometry.skeleton import Skeletons, deforms
from wavecomb.usd.geometry.splats import PointReader, SplatArrays, SplatReader
from wavecomb.usd.geometry.strands import StrandDetail
from wavecomb.usd.geometry.subdivision import SubdivisionSurfaces
from wavecomb.usd.geometry.triangulate import MeshError
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.stage.context import LoadContext, problem_of
from wavecomb.usd.stage.frame_cache import MeshCache
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

MIN_BYTES = 20
"""Lower bound of the memory per mesh point, in bytes.

A mesh has about half a triangle per point; a triangle has 12 bytes of indices and takes about 32
bytes of the acceleration structure.
"""

_SHARE = 8
"""The memory check is skipped if the layers are smaller than 1 / ``_SHARE`` of the available
memory."""


class MemoryCheck:
    """Check that the meshes of one stage fit into memory.

    Points of a .usdc file are loaded only when they are read, so that a loaded stage may still turn
    out too large.
    """

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode) -> None:
        layer = stage.GetRootLayer()
        self.file = layer.realPath or layer.identifier
        self.time = time
        self.is_enabled = time_limit.loaded_layers()[1] > memory.available_bytes() // _SHARE

    def check(self, draws: Iterable[DrawItem]) -> None:
        """Raises WavecombError if meshes that will be read need more memory than available."""
        if not self.is_enabled:
            return
        points = 0
        for draw in draws:
            if draw.kind == "mesh":
                points += len(draw.prim.GetAttribute("points").Get(self.time) or ())
        needed, there = points * MIN_BYTES, memory.available_bytes()
        if needed > there:
            raise WavecombError(
                f"{self.file}: meshes of {points:,} points need at least "
                f"{needed / memory.MEGABYTE:,.0f} MB where {there / memory.MEGABYTE:,.0f} MB are "
                f"left{memory.describe_limit()}; give more memory, or leave parts out by --mask or "
                "--payloads"
            )


WORDS = {
    "mesh": "mesh", "patch": "NURBS patch", "shape": "mesh", "curves": "curves", "points": "points",
    "splats": "splats",
}  # fmt: skip
"""Names of the kinds of gprims in messages, by ``DrawItem.kind``."""
COUNTS = {
    "mesh": "meshes", "patch": "patches", "shape": "shapes", "curves": "curves", "points": "points",
    "splats": "splats",
}  # fmt: skip
"""Names under which ``LoadReport`` counts gprims, by ``DrawItem.kind``."""


class GprimReader:
    """Reader of the gprims of one stage at one time code."""

    def __init__(
        self,
        context: LoadContext,
        surfaces: SubdivisionSurfaces,
        skeletons: Skeletons,
        cache: MeshCache | None = None,
    ) -> None:
        """``surfaces`` handles subdivision and displacement, ``skeletons`` handles skinning.

        ``cache`` stores the arrays of gprims between frames.
        """
        self.time, self.report, self.motion = context.time, context.report, context.motion
        self.surfaces = surfaces
        self.skeletons = skeletons
        self.cache = cache
        self._meshes = self._mesh_reader(self.report)

    def _mesh_reader(self, report: LoadReport) -> MeshReader:
        return MeshReader(self.time, report, self.surfaces.subdivide, self.skeletons, self.motion)

    def deforms(self, kind: str, prim: Usd.Prim) -> bool:
        """Returns whether the shape of a gprim may change while the shutter is open."""
        return self.motion is not None and self._changes(kind, prim)

    def _changes(self, kind: str, prim: Usd.Prim) -> bool:
        """Returns whether the shape of a gprim may change over time."""
        return kind not in ("shape", "splats") and deforms(prim, self.skeletons.of(prim))

    def read(
        self,
        draw: DrawItem,
        names: Sequence[str],
        in_world: bool,
        detail: StrandDetail | None = None,
    ) -> MeshArrays | CurveArrays | None:
        """Reads a gprim in the space of its group; returns None if the gprim is not drawn.

        Returns the cached arrays of the previous frame if the gprim has not changed.

        Args:
            draw: The gprim.
            names: Names of primvars for texture coordinates; the first primvar that exists is used.
            in_world: Whether the group of the gprim is the world.
            detail: Simplification of curves; the result depends on the view and is not cached.

        Raises:
            MemoryError: The process is out of memory, so that reading further prims would fail as
                well.
        """
        kind, path = draw.kind, str(draw.prim.GetPath())
        progress_notes.note("reading", path)
        try:
            shape = self._read(kind, draw, names, detail if kind == "curves" else None)
        except MeshError as error:
            self.report.warn(f"{WORDS[kind]} left out: {error}", path)
            return None
        except (Tf.ErrorException, MemoryError) as error:
            if memory.is_exhausted(error, lambda: time_limit.loaded_layers()[1]):
                raise MemoryError from error
            what = "out of memory" if isinstance(error, MemoryError) else "USD cannot read it"
            self.report.warn(f"{WORDS[kind]} left out: {what}", path)
            return None
        if shape is None:
            what = "mesh without faces" if kind == "mesh" else f"{kind} without points"
            self.report.note(what, path)
            return None
        coarse = problem_of(shape.bounds, draw.matrix, in_world=in_world)
        if coarse is not None:
            self.report.warn(coarse, path)
        return shape

    def _read(
        self, kind: str, draw: DrawItem, names: Sequence[str], detail: StrandDetail | None
    ) -> MeshArrays | CurveArrays | None:
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
    """Adds the arrays of a gprim to the scene and returns the id of the new object.

    ``options`` are keyword arguments for ``add_splats`` if the gprim is splats. Otherwise,
    ``options`` are keyword arguments that ``add_mesh``, ``add_curves`` and ``add_points`` share.
    """
    # Pass only the arrays that exist. This saves time on stages with a hundred thousand gprims.
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
