# SPDX-License-Identifier: Apache-2.0
"""Reads many small, simple meshes of a group and adds them to the scene together.

The result is the same as adding each mesh separately, but takes much less time for stages with
thousands of meshes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, Vt

from wavecomb import _core
from wavecomb.run.isolation import progress_notes
from wavecomb.usd.geometry.gprims import COUNTS, GprimReader
from wavecomb.usd.geometry.mesh_arrays import LIMIT, check_matrix
from wavecomb.usd.geometry.triangulate import MeshError
from wavecomb.usd.instances.group import Group, Scope
from wavecomb.usd.instances.placement import GroupInstancer, outline_of_points
from wavecomb.usd.lights.mesh_light import is_mesh_light
from wavecomb.usd.materials.assignment import Assigner
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.stage.context import LoadContext, may_be_coarse, problem_of

_NEEDED = frozenset(("points", "faceVertexCounts", "faceVertexIndices", "subdivisionScheme"))
_COMPLEX = frozenset(
    (
        "velocities", "holeIndices", "orientation", "normals", "primvars:normals",
        "tetVertexIndices", "surfaceFaceVertexIndices",
    )
)  # fmt: skip
"""Properties of meshes that must be read separately."""

_SMALL = 1024
"""Maximum number of points of a mesh, since the arrays of a batch are copied."""

_MOST = 1024
"""Maximum number of meshes in a batch."""

_FEW = 4
"""Smallest number of meshes that are added together; fewer meshes are added separately."""

_APART = 16
"""Number of meshes that are added separately, starting with one that is not simple, since such
meshes often follow each other."""


LoadProgress = Callable[[int, int], None]
"""Progress callback: progress(prims drawn, prims found so far)."""

_STEP = 512
"""Number of prims between two calls of the progress callback."""


class DrawCount:
    """Counter of the gprims that were found and drawn.

    Attributes:
        found: Number of gprims found so far.
    """

    def __init__(self, progress: LoadProgress | None) -> None:
        self.found = 0
        self._drawn = 0
        self._progress = progress

    def add(self, number: int) -> None:
        """Counts drawn gprims and calls the progress callback for each ``_STEP`` of them."""
        before, self._drawn = self._drawn // _STEP, self._drawn + number
        if self._progress is not None:
            for step in range(before + 1, self._drawn // _STEP + 1):
                self._progress(step * _STEP, self.found)


@dataclass(slots=True)
class _Row:
    """A mesh that was read, with its arrays as authored."""

    draw: DrawItem
    path: str
    points: NDArray[np.float32]
    counts: NDArray[np.int32]
    indices: NDArray[np.int32]
    asset_length: int


class MeshBatches:
    """Reader of the meshes of one group, which adds simple ones together and others separately."""

    def __init__(
        self,
        context: LoadContext,
        group: Group,
        scope: Scope,
        gprims: GprimReader,
        assigner: Assigner,
        instancer: GroupInstancer,
        *,
        draw: Callable[[Group, DrawItem, Scope], None],
        count: Callable[[int], None],
    ) -> None:
        """``draw`` adds a gprim separately. ``count`` is called with the number of added gprims."""
        self._context, self._group, self._scope = context, group, scope
        self._time, self._report = context.time, context.report
        self._gprims, self._assigner, self._instancer = gprims, assigner, instancer
        self._draw, self._count = draw, count

    def draw(self, draws: Sequence[DrawItem]) -> None:
        """Adds gprims to the group in order."""
        run: list[DrawItem] = []
        for draw in draws:
            if self._fits(draw):
                run.append(draw)
                continue
            self._draw_run(run)
            # Drawing a gprim may make the next ones fit, since its material is in use from then on.
            self._draw_one(draw)
            run = []
        self._draw_run(run)

    def _draw_one(self, draw: DrawItem) -> None:
        self._draw(self._group, draw, self._scope)
        self._count(1)

    def _draw_run(self, draws: Sequence[DrawItem]) -> None:
        """Adds gprims for which ``_fits`` holds."""
        start = 0
        while start < len(draws):
            rows: list[_Row] = []
            end = min(len(draws), start + _MOST)
            while start < end and (row := self._read(draws[start])) is not None:
                rows.append(row)
                start += 1
            apart = 0 if start == end else 1 if len(rows) >= _FEW else _APART
            while rows:
                added = self._add(rows) if len(rows) >= _FEW else 0
                for row in rows[added : added + _APART]:
                    self._draw_one(row.draw)
                rows = rows[added + _APART :]
            for draw in draws[start : start + apart]:
                self._draw_one(draw)
            start += apart

    def _fits(self, draw: DrawItem) -> bool:
        """Returns whether a gprim is probably a simple mesh, without reading attribute values."""
        if draw.kind != "mesh" or draw.track is not None or draw.subsets:
            return False
        if not (draw.names >= _NEEDED and draw.names.isdisjoint(_COMPLEX)):
            return False
        scope = self._scope
        if scope.override or (draw.material is None and (scope.inside or scope.bound)):
            return False
        return self._gprims.cache is None and self._assigner.shared_material(draw) is not None

    def _read(self, draw: DrawItem) -> _Row | None:
        """Reads a mesh; returns None if it must be added separately."""
        prim, time = draw.prim, self._time
        path = str(prim.GetPath())
        progress_notes.note("reading", path)
        try:
            if check_matrix(draw.matrix) or is_mesh_light(prim) or not self._is_static(prim):
                return None
            if prim.GetAttribute("subdivisionScheme").Get(time) != "none":
                return None
            counts = prim.GetAttribute("faceVertexCounts").Get(time)
            indices = prim.GetAttribute("faceVertexIndices").Get(time)
            if type(counts) is not Vt.IntArray or type(indices) is not Vt.IntArray:
                return None
            # Faces with different numbers of corners are not plain.
            if len(counts) == 0 or len(indices) != len(counts) * counts[0]:
                return None
            points = prim.GetAttribute("points").Get(time)
            if type(points) is not Vt.Vec3fArray or not 0 < len(points) <= _SMALL:
                return None
        # The mesh is read again separately, which reports the error.
        except (Tf.ErrorException, MemoryError, MeshError):
            return None
        name = self._report.place(path)
        length = self._instancer.asset_length(prim, path, name, draw.parent)
        return _Row(draw, path, np.asarray(points), np.asarray(counts), np.asarray(indices), length)

    def _is_static(self, prim: Usd.Prim) -> bool:
        return not self._gprims.deforms("mesh", prim) and self._gprims.skeletons.of(prim) is None

    def _add(self, rows: Sequence[_Row]) -> int:
        """Adds the meshes before the first one that is not plain; returns how many were added."""
        sizes = np.array(
            [(len(row.points), len(row.counts), len(row.indices)) for row in rows], np.uint32
        )
        matrices = np.asarray(Vt.Matrix4dArray([row.draw.matrix for row in rows]))
        positions, triangles, triangle_counts, boxes, uses_all = _core.plain_meshes(
            np.concatenate([row.points for row in rows]),
            np.concatenate([row.counts for row in rows]),
            np.concatenate([row.indices for row in rows]),
            sizes,
            matrices,
            limit=LIMIT,
        )
        number = len(triangle_counts)
        if number == 0:
            return 0
        rows, bounds, in_world = rows[:number], boxes.reshape(-1, 2, 3), self._group.number == 0
        for i in may_be_coarse(bounds, matrices[:number], in_world=in_world):
            what = problem_of(bounds[i], rows[i].draw.matrix, in_world=in_world)
            if what is not None:
                self._report.warn(what, rows[i].path)
        materials = [self._assigner.shared_material(row.draw) for row in rows]
        self._context.builder.add_meshes(
            positions,
            triangles,
            sizes[:number, 0].copy(),
            triangle_counts,
            np.array(materials, np.uint32),
            np.array([row.asset_length for row in rows], np.uint32),
            np.full(number, self._instancer.number(self._group), np.uint32),
            [self._report.place(row.path) for row in rows],
        )
        self._group.grow_by(bounds)
        if self._context.framed is not None:
            self._reach(positions, triangles, sizes[:number, 0], triangle_counts, uses_all)
        self._report.tally(COUNTS["mesh"], number)
        self._count(number)
        return number

    def _reach(
        self,
        positions: NDArray[np.float32],
        triangles: NDArray[np.uint32],
        point_counts: NDArray[np.uint32],
        triangle_counts: NDArray[np.uint32],
        uses_all: NDArray[np.uint8],
    ) -> None:
        """Adds the points of each mesh to the group's outline."""
        more = self._context.framed if self._group.number == 0 else None
        points = np.split(positions, np.cumsum(point_counts)[:-1])
        faces = np.split(triangles, np.cumsum(triangle_counts)[:-1])
        for own, corners, whole in zip(points, faces, uses_all, strict=True):
            self._group.reach(outline_of_points(own, None if whole else corners, more), more)
