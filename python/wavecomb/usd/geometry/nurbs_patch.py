# SPDX-License-Identifier: Apache-2.0
"""Converts UsdGeomNurbsPatch to triangles whose corners have exact points and normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd

from wavecomb.usd.geometry.mesh_arrays import (
    UV_NAMES,
    Array,
    MeshArrays,
    bake,
    bake_normals,
    check_matrix,
    extent,
)
from wavecomb.usd.geometry.nurbs_curves import Floats, Spline
from wavecomb.usd.geometry.primvar import PrimvarError, as_array, first_primvar
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.geometry.skeleton import points_at, points_at_time, step_times
from wavecomb.usd.geometry.triangulate import MeshError, Topology, smooth_normals
from wavecomb.usd.materials.network import number, word
from wavecomb.usd.stage.report import LoadReport

PARTS = 8
"""Number of quads along each direction of a knot span."""

MAX_QUADS = 1 << 24
"""Maximum number of quads of a patch; in larger patches, knot spans get fewer quads."""


@dataclass(frozen=True)
class _Axis:
    """One parametric direction of a patch and the parameters at which the patch is sampled.

    Attributes:
        spline: B-spline basis in this direction.
        closed: Whether the patch closes on itself in this direction.
        span: (m,) knot span of each sample.
        at: (m,) parameter of each sample.
        joined: (m,) whether quads connect a sample to the next one.
    """

    spline: Spline
    closed: bool
    span: NDArray[np.intp]
    at: Floats
    joined: NDArray[np.bool_]

    @property
    def place(self) -> Floats:
        """(m,) parameters of the samples, normalised to the range 0 to 1."""
        low, high = self.spline.ends[0, 0], self.spline.ends[-1, 1]
        return (self.at - low) / (high - low)


def _axis(spline: Spline, closed: bool, parts: int) -> _Axis:
    """Chooses samples along one parametric direction of a patch.

    Adjacent spans share a sample unless the surface may have a hard edge between them.
    """
    span, at, joined = [], [], []
    step = np.arange(parts) / parts
    for i, (number_, (low, high)) in enumerate(zip(spline.spans, spline.ends, strict=True)):
        rows = low + (high - low) * step
        last = i + 1 == len(spline.spans)
        edge = not last and spline.spans[i + 1] - number_ >= spline.order - 1
        if last or edge:
            rows = np.append(rows, high)
        span.append(np.repeat(number_, len(rows)))
        at.append(rows)
        joined.append(np.arange(len(rows)) < (len(rows) - 1 if last or edge else len(rows)))
    return _Axis(spline, closed, np.concatenate(span), np.concatenate(at), np.concatenate(joined))


class PatchReader:
    """Reader of the NURBS patches of one stage."""

    def __init__(self, time: Usd.TimeCode, report: LoadReport) -> None:
        self.time = time
        self.report = report

    def patch(
        self,
        prim: Usd.Prim,
        matrix: Gf.Matrix4d,
        uv_names: Sequence[str],
        inherited: Sequence[Any] = (),
        motion: Motion | None = None,
    ) -> MeshArrays | None:
        """Reads a patch in the space of its group; returns None if the patch has no points.

        Args:
            prim: A UsdGeomNurbsPatch.
            matrix: Transform from the patch to its group (the world or a prototype).
            uv_names: Names of primvars for texture coordinates; if none exists, u and v run from 0
                to 1.
            inherited: Constant primvars of the patch's ancestors.
            motion: Shutter over which points are read; None reads the points at the time of the
                frame.

        Raises:
            MeshError: The patch is invalid.
        """
        mirrored = check_matrix(matrix)
        points = as_array(points_at_time(prim, self.time))
        if points is None or len(points) == 0:
            return None
        if points.shape[1] != 3:
            raise MeshError("points are not triples")
        axes = self._axes(prim, len(points))
        weights = as_array(prim.GetAttribute("pointWeights").Get(self.time))
        if weights is not None and weights.shape != (len(points), 1):
            raise MeshError(f"{len(points)} points have {len(weights)} pointWeights")
        heavy = np.ones((len(points), 1)) if weights is None else weights.astype(np.float64)
        self._report_unsupported(prim, uv_names)
        flip = word(prim.GetAttribute("orientation").Get(self.time)) == "leftHanded"
        topology = _triangles(*axes, flip)
        shapes = [points]
        if motion is not None:
            times = step_times(prim, None, motion)
            shapes = points_at(prim, None, times, motion.frame, self.report) or shapes
            if len(shapes[0]) != len(points):
                shapes = [points]
        made = [_surface(axes, heavy, np.asarray(p, np.float64), flip, topology) for p in shapes]
        positions = np.stack([bake(p.astype(np.float32), matrix) for p, _ in made])
        normals = np.stack([bake_normals(n, matrix) for _, n in made])
        bounds = extent(positions.reshape(-1, 3))
        triangles = topology.triangles
        if mirrored:
            triangles = np.ascontiguousarray(triangles[:, ::-1])
        uvs = self._uvs(prim, axes, heavy, uv_names, inherited)
        arrays = MeshArrays(positions, triangles, normals, uvs, bounds)
        if len(made) == 1:
            return replace(arrays, positions=positions[0], normals=normals[0])
        return arrays

    def _axes(self, prim: Usd.Prim, points: int) -> tuple[_Axis, _Axis]:
        """Returns both parametric directions of a patch, u and v."""
        time, get = self.time, prim.GetAttribute
        splines = []
        counts = [int(number(get(f"{c}VertexCount").Get(time), 0)) for c in "uv"]
        if counts[0] * counts[1] != points:
            raise MeshError(f"{counts[0]} x {counts[1]} control points, and there are {points}")
        for c, count in zip("uv", counts, strict=True):
            knots = as_array(get(f"{c}Knots").Get(time))
            flat = np.empty(0) if knots is None else knots[:, 0].astype(np.float64)
            limits = as_array(get(f"{c}Range").Get(time))
            order = int(number(get(f"{c}Order").Get(time), 0))
            ends = limits[0] if limits is not None and limits.shape == (1, 2) else None
            splines.append(Spline.of(flat, order, count, ends))
        parts = PARTS
        while parts > 1 and len(splines[0].spans) * len(splines[1].spans) * parts**2 > MAX_QUADS:
            parts //= 2
        if len(splines[0].spans) * len(splines[1].spans) > MAX_QUADS:
            raise MeshError(f"more than {MAX_QUADS} pieces between its knots")
        closed = [word(get(f"{c}Form").Get(time)) in ("closed", "periodic") for c in "uv"]
        u, v = (_axis(s, c, parts) for s, c in zip(splines, closed, strict=True))
        return u, v

    def _report_unsupported(self, prim: Usd.Prim, uv_names: Sequence[str]) -> None:
        trims = as_array(prim.GetAttribute("trimCurve:counts").Get(self.time))
        if trims is not None and len(trims):
            what = "trim curves of NURBS patches (drawn whole)"
            self.report.missing(what, prim.GetPath())
        for attribute in prim.GetAuthoredAttributes():
            name = attribute.GetName().removeprefix("primvars:")
            if name == attribute.GetName() or ":" in name or name in (*uv_names, *UV_NAMES):
                continue
            values = as_array(attribute.Get(self.time))
            if values is not None and len(values) > 1:
                what = "primvars over NURBS patches, but texture coordinates (first value for all)"
                self.report.missing(what, prim.GetPath())
                return

    def _uvs(
        self,
        prim: Usd.Prim,
        axes: tuple[_Axis, _Axis],
        heavy: Floats,
        names: Sequence[str],
        inherited: Sequence[Any],
    ) -> Array:
        """Returns texture coordinates (n, 2) from a primvar of control points or from u and v."""
        u, v = axes
        try:
            primvar = first_primvar(prim, names, inherited, self.time)
            if primvar is not None:
                values = primvar.values[:, :2]
                if values.shape == (len(heavy), 2) and np.isfinite(values).all():
                    at = _blend(axes, np.concatenate([values * heavy, heavy], axis=1))[0]
                    return np.ascontiguousarray(at[..., :2] / at[..., 2:], np.float32)
                if len(values) != 1:
                    what = (
                        f"{primvar.name} is not of its control points, finite: u and v in its place"
                    )
                    self.report.warn(what, prim.GetPath())
        except PrimvarError as error:
            self.report.warn(f"{error}: ignored", prim.GetPath())
        grid = np.stack(np.meshgrid(u.place, v.place), axis=-1)
        return np.ascontiguousarray(grid.reshape(-1, 2), np.float32)


def _triangles(u: _Axis, v: _Axis, flip: bool) -> Topology:
    """Returns two triangles per quad, whose outside faces the direction du x dv."""
    width = len(u.at)
    rows, columns = np.flatnonzero(v.joined), np.flatnonzero(u.joined)
    a = (rows[:, None] * width + columns).ravel()
    quads = np.stack([a, a + 1, a + width + 1, a, a + width + 1, a + width], axis=1)
    triangles = quads.reshape(-1, 3).astype(np.uint32)
    if flip:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    none = np.empty(0, np.int32)
    return Topology(triangles, None, None, none, width * len(v.at), len(triangles))


def _blend(axes: tuple[_Axis, _Axis], values: Floats) -> tuple[Floats, Floats, Floats]:
    """Evaluates control point values (n, c) on the surface, and their derivatives by u and v."""
    u, v = axes
    grid = values.reshape(v.spline.count, u.spline.count, -1)
    along = [spline_sum(v, part, grid) for part in (0, 1)]
    turned = [np.ascontiguousarray(np.swapaxes(one, 0, 1)) for one in along]

    def across(one: Floats, part: int) -> Floats:
        out = np.swapaxes(spline_sum(u, part, one), 0, 1)
        return np.ascontiguousarray(out).reshape(-1, values.shape[1])

    return across(turned[0], 0), across(turned[0], 1), across(turned[1], 0)


def spline_sum(axis: _Axis, part: int, grid: Floats) -> Floats:
    """Sums a grid over its first index, with basis functions or their derivatives as weights.

    ``part`` is 0 for basis functions and 1 for their derivatives.
    """
    shares, columns = axis.spline.weights(axis.span, axis.at)[part], axis.spline.columns(axis.span)
    out = np.zeros((len(axis.at), *grid.shape[1:]))
    for k in range(axis.spline.order):
        out += shares[:, k, None, None] * grid[columns[:, k]]
    return out


def _surface(
    axes: tuple[_Axis, _Axis], heavy: Floats, points: Floats, flip: bool, topology: Topology
) -> tuple[Floats, Array]:
    """Evaluates points (n, 3) and unit normals (n, 3) on the surface.

    Raises:
        MeshError: The weighted sum of the basis functions is 0 at some point.
    """
    at, by_u, by_v = _blend(axes, np.concatenate([points * heavy, heavy], axis=1))
    total = at[:, 3:]
    # Comparisons with NaN are false, so NaN counts as invalid.
    if not bool((np.abs(total) > 1e-30).all()):
        raise MeshError("its pointWeights add up to 0")
    place = at[:, :3] / total
    normals = np.cross(
        by_u[:, :3] - place * by_u[:, 3:], by_v[:, :3] - place * by_v[:, 3:]
    ) / np.square(total)
    place = _joined(axes, place)
    length = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    flat = ~(length > 1e-6 * length.max(initial=0.0))
    normals = normals / np.where(flat, 1.0, length)[:, None] * (-1.0 if flip else 1.0)
    # At poles of the surface, one of the derivatives is 0, so compute smooth normals there.
    if flat.any():
        around = smooth_normals(place.astype(np.float32), topology)[flat]
        normals[flat] = _together(place[flat], around, 1e-6 * float(np.abs(place).max()))
    return place, np.ascontiguousarray(normals, np.float32)


def _together(points: Floats, normals: Array, near: float) -> Floats:
    """Averages and normalises the normals of coincident points."""
    cells = np.round(points / (near or 1.0))
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    total = np.zeros((len(points), 3))
    np.add.at(total, cell.reshape(-1), normals)
    mean = total[cell.reshape(-1)]
    length = np.sqrt(np.einsum("ij,ij->i", mean, mean))[:, None]
    return np.where(length > 1e-6, mean / np.where(length > 1e-6, length, 1.0), normals)


def _joined(axes: tuple[_Axis, _Axis], place: Floats) -> Floats:
    """Makes points bit-identical on both sides of hard edges and of the seams of closed patches."""
    u, v = axes
    grid = place.reshape(len(v.at), len(u.at), 3)
    for axis, view in ((v, grid), (u, np.swapaxes(grid, 0, 1))):
        for row in np.flatnonzero(~axis.joined[:-1]):
            view[row + 1] = view[row]
        if axis.closed:
            view[-1] = view[0]
    return grid.reshape(-1, 3)
