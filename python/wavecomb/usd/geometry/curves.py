# SPDX-License-Identifier: Apache-2.0
"""Reads UsdGeomBasisCurves, NURBS curves and Hermite curves as arrays for the core."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd

from wavecomb.usd.geometry.mesh_arrays import (
    IDENTITY,
    UV_NAMES,
    WHY,
    bake,
    bake_normals,
    check_matrix,
    extent,
    invalid_point_mask,
    replace_invalid_steps,
)
from wavecomb.usd.geometry.nurbs_curves import hermite_strands, nurbs_strands
from wavecomb.usd.geometry.primvar import (
    Primvar,
    PrimvarError,
    as_array,
    finite_uvs,
    first_primvar,
    plain_attribute,
    read_primvar,
)
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.geometry.skeleton import points_at, points_at_time, step_times
from wavecomb.usd.geometry.strands import StrandDetail, Strands, lay_out
from wavecomb.usd.geometry.triangulate import MeshError
from wavecomb.usd.stage.report import LoadReport

Array = NDArray[np.float32]

BASES = ("bezier", "bspline", "catmullRom")
WRAPS = ("nonperiodic", "periodic", "pinned")
_OTHERS: dict[str, Callable[..., Strands]] = {
    "NurbsCurves": nurbs_strands,
    "HermiteCurves": hermite_strands,
}


@dataclass
class CurveArrays:
    """Curves or points in the space of their group (the world or a prototype).

    Attributes:
        kind: "linear-tube", "cubic-tube", "linear-ribbon" or "cubic-ribbon" for curves; "sphere"
            for points.
        positions: (n, 3) control points of curves, or points; (s, n, 3) at s steps over the shutter
            if animated.
        segments: (m,) segments as 32-bit words for ``SceneBuilder.add_curves``; None for points.
        radii: (n,) radii at control points, or radii of points.
        normals: (n, 3) or (s, n, 3) normals of ribbons; None for tubes and points.
        uvs: (m, 2, 2) texture coordinates at both ends of segments, or (n, 2) at points; None if
            not needed.
        bounds: (2, 3) lowest and highest coordinates.
        topology: Layout of the curves, which maps primvars to segments.
    """

    kind: str
    positions: Array
    segments: NDArray[np.uint32] | None
    radii: Array
    normals: Array | None
    uvs: Array | None
    bounds: Array
    topology: Strands


def uniform_scale(matrix: Gf.Matrix4d) -> float | None:
    """Returns the scale of a transform that scales uniformly; None for other transforms."""
    if matrix == IDENTITY:
        return 1.0
    linear = np.array(matrix)[:3, :3]
    product = linear @ linear.T
    square = float(np.trace(product)) / 3.0
    if not np.allclose(product, square * np.eye(3), rtol=0.0, atol=1e-4 * square):
        return None
    return float(np.sqrt(square))


class CurveReader:
    """Reader of the curves of one stage."""

    def __init__(self, time: Usd.TimeCode, report: LoadReport) -> None:
        self.time = time
        self.report = report

    def curves(
        self,
        prim: Usd.Prim,
        matrix: Gf.Matrix4d,
        uv_names: Sequence[str],
        inherited: Sequence[Any] = (),
        detail: StrandDetail | None = None,
    ) -> CurveArrays | None:
        """Reads curves in the space of their group; returns None if the prim has no curves.

        Args:
            prim: A UsdGeomCurves.
            matrix: Transform from the prim to its group (the world or a prototype), with uniform
                scale.
            uv_names: Names of primvars for texture coordinates; the first primvar that exists is
                used. Empty if texture coordinates are not needed.
            inherited: Constant primvars of the prim's ancestors.
            detail: Simplification that removes some thin strands and widens the remaining ones. The
                group must be the world.

        Raises:
            MeshError: The curves are invalid.
        """
        check_matrix(matrix)
        points = read_points(prim, self.time)
        counts = as_array(prim.GetAttribute("curveVertexCounts").Get(self.time))
        if points is None or counts is None or len(counts) == 0:
            return None
        strands = self._layout(prim, counts[:, 0].astype(np.intp), len(points))
        if strands is None:
            return None
        bad = invalid_point_mask(points)
        if bad.any():
            strands = self._without(bad, strands, prim)
        widths, kind = read_widths(prim, strands, self.time, self.report)
        wider = None
        if detail is not None:
            greatest = strands.greatest(widths, kind)
            strands, wider = detail.thin(prim.GetPath(), strands, points, greatest, matrix)
        positions = strands.controls(points, "vertex")
        if matrix != IDENTITY:
            positions = bake(positions, matrix)
        scale = 0.5 * (uniform_scale(matrix) or 1.0)
        radii = np.maximum(strands.controls(widths, kind)[:, 0] * np.float32(scale), 0)
        if wider is not None:
            radii *= strands.at_controls(wider)
        bounds = thick_extent(positions, radii)
        normals = self.normals(prim, strands)
        if normals is not None and matrix != IDENTITY:
            normals = bake_normals(normals, matrix)
        shape = ("cubic-" if strands.cubic else "linear-") + (
            "tube" if normals is None else "ribbon"
        )
        uvs = self._uvs(prim, strands, uv_names, inherited) if uv_names else None
        return CurveArrays(
            shape, positions, strands.segment_words(), radii, normals, uvs, bounds, strands
        )

    def _without(self, bad: NDArray[np.bool_], strands: Strands, prim: Usd.Prim) -> Strands:
        """Returns the layout of the curves that have no invalid points."""
        kept = strands.over_each(np.maximum, bad) == 0
        if not kept.any():
            raise MeshError("their points are not finite or too far away")
        if not kept.all():
            what = f"{int((~kept).sum())} of {len(kept)} curves left out: {WHY}"
            self.report.warn(what, prim.GetPath())
        return strands.only(kept)

    def _layout(self, prim: Usd.Prim, counts: NDArray[np.intp], points: int) -> Strands | None:
        if (counts < 0).any() or int(counts.sum()) != points:
            raise MeshError(
                f"curveVertexCounts ask for {int(counts.sum())} points, and there are {points}"
            )
        if (kind := prim.GetTypeName()) in _OTHERS:
            return self._other(prim, _OTHERS[kind], counts)
        basis = self._token(prim, "type", ("cubic", "linear"))
        if basis == "cubic":
            basis = self._token(prim, "basis", BASES)
        strands = lay_out(counts, basis, self._token(prim, "wrap", WRAPS))
        bad = len(counts) - len(strands.kept)
        if bad:
            what = f"curves left out: their number of points does not fit {basis} {strands.wrap}"
            self.report.warn(what, prim.GetPath(), bad)
        return strands if len(strands.kept) else None

    def _other(
        self, prim: Usd.Prim, layout: Callable[..., Strands], counts: NDArray[np.intp]
    ) -> Strands | None:
        """Returns the layout of NURBS or Hermite curves."""
        if (counts < 2).any():
            raise MeshError("a curve has less than two points")
        return layout(prim, counts, self.time, self.report)

    def _token(self, prim: Usd.Prim, name: str, known: tuple[str, ...]) -> str:
        value = str(prim.GetAttribute(name).Get(self.time) or known[0])
        if value not in known:
            raise MeshError(f"its {name} is {value!r}; there are {', '.join(known)}")
        return value

    def normals(self, prim: Usd.Prim, strands: Strands) -> Array | None:
        """Returns the normals at the control points of ribbons; None for tubes."""
        primvar = authored(prim, "normals", self.time)
        if primvar is None:
            return None
        try:
            values, kind = strands.fit(primvar, 3)
        except PrimvarError as error:
            self.report.warn(f"{error}: drawn as tubes", prim.GetPath())
            return None
        normals = strands.controls(values, kind)
        length = np.einsum("ij,ij->i", normals, normals)
        # Comparisons with NaN are false, so NaN counts as invalid.
        if not (float(length.min(initial=1.0)) > 0 and float(length.max(initial=0.0)) < 1e30):
            what = "normals of length zero or not finite: curves drawn as tubes"
            self.report.warn(what, prim.GetPath())
            return None
        return normals

    def _uvs(
        self, prim: Usd.Prim, strands: Strands, names: Sequence[str], inherited: Sequence[Any]
    ) -> Array:
        """Returns authored texture coordinates at both ends of segments, or u along curves."""
        found = read_uvs(prim, strands, names, inherited, self.time, self.report)
        if found is None:
            values = np.zeros((strands.sizes["varying"], 2))
            size = strands.segments + (0 if strands.periodic else 1)
            owner = np.repeat(np.arange(len(size)), size)
            at = np.arange(len(owner)) - (np.cumsum(size) - size)[owner]
            values[:, 0] = at / strands.segments[owner]
            first, last = strands.ends(values, "varying")
            if strands.periodic:
                last[np.cumsum(strands.segments) - 1, 0] = 1.0
        else:
            first, last = strands.ends(*found)
        return np.ascontiguousarray(np.stack([first, last], axis=1), np.float32)


def over_shutter(
    prim: Usd.Prim, shape: CurveArrays, matrix: Gf.Matrix4d, motion: Motion, report: LoadReport
) -> CurveArrays:
    """Returns curves or points with their positions and normals at the shutter steps.

    Widths and texture coordinates are read at the time of the frame.

    Args:
        prim: Prim whose points are animated.
        shape: Arrays of the prim at the time of the frame.
        matrix: Transform from the prim to its group (the world or a prototype).
        motion: The shutter.
        report: Collects warnings.
    """
    times = step_times(prim, None, motion)
    found = points_at(prim, None, times, motion.frame, report)
    layout = shape.topology
    if found is None or len(found[0]) != layout.sizes["vertex"]:
        return shape
    found = replace_invalid_steps(found)
    if all(np.array_equal(points, found[0]) for points in found):
        return shape
    steps, normals = [], []
    for points, time in zip(found, times, strict=True):
        controls = points if shape.segments is None else layout.controls(points, "vertex")
        steps.append(bake(controls, matrix))
        if shape.normals is not None:
            then = CurveReader(Usd.TimeCode(time), LoadReport()).normals(prim, layout)
            normals.append(shape.normals if then is None else bake_normals(then, matrix))
    positions = np.stack(steps)
    bounds = thick_extent(positions.reshape(-1, 3), shape.radii)
    together = np.stack(normals) if normals else None
    return replace(shape, positions=positions, normals=together, bounds=bounds)


def thick_extent(positions: Array, radii: Array) -> Array:
    """Returns the bounds (2, 3) of the positions, padded by the largest radius."""
    reach = float(radii.max(initial=0.0))
    return extent(positions) + np.array([[-reach], [reach]], np.float32)


def read_points(prim: Usd.Prim, time: Usd.TimeCode) -> Array | None:
    """Returns the points (n, 3) of a prim; None if the prim has no points.

    Raises:
        MeshError: The points do not have three components each.
    """
    points = as_array(points_at_time(prim, time))
    if points is None or len(points) == 0:
        return None
    if points.shape[1] != 3:
        raise MeshError("points are not triples")
    return np.ascontiguousarray(points, np.float32)


def authored(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> Primvar | None:
    """Returns the primvar ``name`` or else the attribute ``name``; None if both have no values."""
    primvar = None
    with contextlib.suppress(PrimvarError):
        primvar = read_primvar(prim, name, time)
    if primvar is None:
        return plain_attribute(prim, name, time)
    return primvar if len(primvar.values) else None


def read_widths(
    prim: Usd.Prim, strands: Strands, time: Usd.TimeCode, report: LoadReport
) -> tuple[NDArray[Any], str]:
    """Returns widths (n, 1) and their interpolation; a single width of 1 if they are not valid."""
    one = np.ones((1, 1))
    primvar = authored(prim, "widths", time)
    if primvar is None:
        report.note("curves or points without widths: drawn 1 wide", prim.GetPath())
        return one, "constant"
    try:
        widths, kind = strands.fit(primvar, 1)
    except PrimvarError as error:
        report.warn(f"{error}: drawn 1 wide", prim.GetPath())
        return one, "constant"
    bad = ~((widths >= 0) & (widths < 1e18))
    if bad.any():
        what = "widths that are negative or not finite: set to 0"
        report.warn(what, prim.GetPath(), int(bad.sum()))
        widths = np.where(bad, 0, widths)
    return widths, kind


def read_uvs(
    prim: Usd.Prim,
    strands: Strands,
    names: Sequence[str],
    inherited: Sequence[Any],
    time: Usd.TimeCode,
    report: LoadReport,
) -> tuple[NDArray[Any], str] | None:
    """Returns texture coordinates (n, 2) and their interpolation; None if they are not valid."""
    try:
        primvar = first_primvar(prim, names, inherited, time)
        if primvar is None:
            if names is not UV_NAMES:
                what = f"no primvar {names[0]!r} for the textures of curves: generated"
                report.warn(what, prim.GetPath())
            return None
        values, kind = strands.fit(primvar, 2)
    except PrimvarError as error:
        report.warn(f"{error}: ignored", prim.GetPath())
        return None
    return finite_uvs(values, report, prim.GetPath()), kind
