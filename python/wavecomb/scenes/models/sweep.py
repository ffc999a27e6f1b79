# SPDX-License-Identifier: Apache-2.0
"""Closed tubes that are swept along cubic B-splines and form the dragon.

A tube has a centre line, an elliptic cross-section that varies along the line, and an "up"
direction that keeps the cross-section from twisting. An optional relief displaces the surface along
the radius. Tubes and reliefs are evaluated on a grid of rings x columns in NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wavecomb.scenes.models.mesh import FloatArray, Mesh, normalized

_DENSE_SAMPLES = 1024
_TEXTURE_LENGTH = 0.5
"""Length along a tube, in scene units, that one texture repeat covers."""


@dataclass(frozen=True)
class Surface:
    """Positions of the grid points at which a relief is evaluated.

    Attributes:
        along: Arc length divided by the tube's length, 0 to 1, (rings, 1).
        turns: Arc length measured in local circumferences, (rings, 1).
        around: Angle around the tube, from 0 to 1, (1, columns); 0 is the underside, 0.5 the ridge.
        radius: Mean radius of the cross-section, in scene units, (rings, 1).
        cell: Grid spacing as a fraction of the local circumference. Reliefs leave out detail finer
            than this.
    """

    along: FloatArray
    turns: FloatArray
    around: FloatArray
    radius: FloatArray
    cell: FloatArray


Relief = Callable[[Surface], FloatArray]
"""Returns the displacement as a fraction of the local radius, (rings, columns)."""


@dataclass(frozen=True)
class Tube:
    """A closed tube.

    Attributes:
        points: Control points of the centre line, (k, 3).
        width: Half width across "up", at each control point, (k,). Zero makes a tip.
        height: Half height along "up", at each control point, (k,).
        up: Direction of the ridge, at each control point, (k, 3) or (3,).
        relief: Function that computes the displacement, or None for a smooth tube.
        belly: Factor on the height of the cross-section's lower half; 1 makes a full ellipse.
        detail: Factor on the density of triangles.
    """

    points: FloatArray
    width: FloatArray
    height: FloatArray
    up: FloatArray
    relief: Relief | None = None
    belly: float = 1.0
    detail: float = 1.0


def spline(control: FloatArray, t: FloatArray) -> FloatArray:
    """Evaluates a uniform cubic B-spline through its first and last control point.

    Args:
        control: Control values, (k,) or (k, n), k at least 2.
        t: Parameters from 0 to 1, (m,).

    Returns:
        Values, (m,) or (m, n).
    """
    padded = np.concatenate(
        [2 * control[:1] - control[1:2], control, 2 * control[-1:] - control[-2:-1]]
    )
    spans = len(control) - 1
    span = np.minimum((t * spans).astype(np.int64), spans - 1)
    x = t * spans - span
    weights = (
        (1 - x) ** 3 / 6,
        (3 * x**3 - 6 * x**2 + 4) / 6,
        (-3 * x**3 + 3 * x**2 + 3 * x + 1) / 6,
        x**3 / 6,
    )
    shape = (-1,) + (1,) * (control.ndim - 1)
    total = weights[0].reshape(shape) * padded[span]
    for k in range(1, 4):
        total = total + weights[k].reshape(shape) * padded[span + k]
    return total


@dataclass(frozen=True)
class _Profile:
    """Dense samples along a tube; each array has shape (n,)."""

    t: FloatArray
    arc: FloatArray
    length: FloatArray
    width: FloatArray
    height: FloatArray


def _rounding(arc: FloatArray, start: float, end: float) -> FloatArray:
    """Returns the factor (n,) on the radius that rounds both ends of a tube to ellipsoids.

    ``arc`` holds arc lengths (n,); ``start`` and ``end`` are the lengths of the caps.
    """
    total = arc[-1]
    start, end = min(start, 0.5 * total), min(end, 0.5 * total)
    factor = np.ones_like(arc)
    for distance, cap in ((arc, start), (total - arc, end)):
        if cap > 0.0:
            x = np.clip(1.0 - distance / cap, 0.0, 1.0)
            factor = factor * np.sqrt(np.maximum(1.0 - x * x, 0.0))
    return factor


def _profile(tube: Tube) -> _Profile:
    t = np.linspace(0.0, 1.0, _DENSE_SAMPLES)
    centre = spline(tube.points, t)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centre, axis=0), axis=1))])
    caps = [0.5 * (tube.width[k] + tube.height[k]) for k in (0, -1)]
    factor = _rounding(arc, *caps)
    width = np.maximum(spline(tube.width, t), 0.0) * factor
    height = np.maximum(spline(tube.height, t), 0.0) * factor
    radius = 0.5 * (width + height)
    step = np.hypot(np.diff(arc), np.diff(radius))
    return _Profile(t, arc, np.concatenate([[0.0], np.cumsum(step)]), width, height)


def _perimeter(profile: _Profile) -> FloatArray:
    return 2.0 * np.pi * np.sqrt(0.5 * (profile.width**2 + profile.height**2))


@dataclass(frozen=True)
class Extent:
    """Size of a tube, from which its number of triangles is chosen.

    Attributes:
        length: Arc length of the tube's profile, in scene units.
        perimeter: Mean perimeter, in scene units.
        detail: Factor on the density of triangles.
    """

    length: float
    perimeter: float
    detail: float

    @property
    def weight(self) -> float:
        """Surface area of the tube without relief, times ``detail``."""
        return self.length * self.perimeter * self.detail

    def grid(self, density: float) -> tuple[int, int]:
        """Returns the counts of rings and columns for ``density`` triangles per unit of ``weight``.

        The tube has ``2 * rings * columns`` triangles.
        """
        spacing = math.sqrt(2.0 / (density * self.detail))
        columns = max(5, round(self.perimeter / spacing))
        rings = max(4, round(self.length * self.perimeter / (spacing * spacing * columns)))
        return rings, columns


def tube_extent(tube: Tube) -> Extent:
    """Measures a tube."""
    profile = _profile(tube)
    length = float(profile.length[-1])
    area = float(np.trapezoid(_perimeter(profile), profile.length))
    return Extent(length, area / length, tube.detail)


def _tube_faces(rings: int, columns: int) -> np.ndarray:
    """Returns the faces of a grid of rings + 2 rows and columns + 1 columns.

    The first and last row are poles.
    """
    stride = columns + 1
    faces = np.empty((2 * rings * columns, 3), np.int32)
    j = np.arange(columns, dtype=np.int32)
    faces[:columns] = np.stack([j, j + stride, j + stride + 1], axis=1)
    row = (np.arange(1, rings, dtype=np.int32) * stride)[:, None] + j
    middle = faces[columns:-columns].reshape(rings - 1, columns, 2, 3)
    middle[:, :, 0, 0] = row
    middle[:, :, 0, 1] = row + stride
    middle[:, :, 0, 2] = row + stride + 1
    middle[:, :, 1, 0] = row
    middle[:, :, 1, 1] = row + stride + 1
    middle[:, :, 1, 2] = row + 1
    last = rings * stride + j
    faces[-columns:] = np.stack([last, last + stride, last + 1], axis=1)
    return faces


def tube_mesh(tube: Tube, rings: int, columns: int) -> Mesh:
    """Evaluates a tube on a grid, as a closed mesh of ``2 * rings * columns`` triangles.

    The first and last column coincide at the texture seam on the underside. The first and last row
    are poles.
    """
    profile = _profile(tube)
    radius_dense = 0.5 * (profile.width + profile.height)
    # The distance of neighbouring rings is smaller where the tube is thin. It is proportional to
    # the radius to the power of 0.4, where a radius of less than 15 % of the largest radius counts
    # as 15 %.
    thin = np.maximum(radius_dense, 0.15 * radius_dense.max()) ** -0.4
    measure = np.concatenate([[0.0], np.cumsum(np.diff(profile.length) * thin[1:])])
    targets = np.linspace(0.0, measure[-1], rings + 2)
    # The first and last ring have a distance of three quarters of a step from the poles of the
    # tube.
    targets[1:-1] = (np.arange(rings) + 0.75) / (rings + 0.5) * measure[-1]
    t = np.interp(targets, measure, profile.t)
    t[0], t[-1] = 0.0, 1.0
    arc = np.interp(t, profile.t, profile.arc)
    width = np.interp(t, profile.t, profile.width)
    height = np.interp(t, profile.t, profile.height)
    width[[0, -1]] = height[[0, -1]] = 0.0

    centre = spline(tube.points, t)
    tangent = _tangents(tube.points, t)
    hint = np.broadcast_to(tube.up, tube.points.shape)
    up = spline(np.ascontiguousarray(hint), t)
    up = normalized(up - np.einsum("ij,ij->i", up, tangent)[:, None] * tangent)
    side = np.cross(tangent, up)

    around = np.linspace(0.0, 1.0, columns + 1)
    angle = 2.0 * np.pi * around - 0.5 * np.pi
    cosine, sine = np.cos(angle), np.sin(angle)
    # The first and the last column of the grid coincide at the seam and must have bitwise equal
    # coordinates.
    cosine[-1], sine[-1] = cosine[0], sine[0]
    lower = np.where(sine < 0.0, tube.belly, 1.0)
    across = width[:, None] * cosine
    above = height[:, None] * (sine * lower)
    if tube.relief is not None:
        radius = 0.5 * (width + height)
        floor = np.maximum(radius_dense, 0.1 * radius_dense.max())
        turn_steps = np.diff(profile.arc) / (2.0 * np.pi * floor[1:])
        turns = np.interp(t, profile.t, np.concatenate([[0.0], np.cumsum(turn_steps)]))
        step = np.gradient(arc) / (2.0 * np.pi * np.maximum(radius, 0.1 * radius.max()))
        surface = Surface(
            (arc / arc[-1])[:, None],
            turns[:, None],
            around[None, :],
            radius[:, None],
            np.maximum(step, 1.0 / columns)[:, None],
        )
        swell = 1.0 + tube.relief(surface)
        swell[:, -1] = swell[:, 0]
        across *= swell
        above *= swell
    points = np.empty((rings + 2, columns + 1, 3))
    for axis in range(3):
        points[..., axis] = (
            centre[:, None, axis] + across * side[:, None, axis] + above * up[:, None, axis]
        )
    normals = _grid_normals(points, tangent)
    repeats = max(1, round(2.0 * np.pi * float(radius_dense.mean()) / _TEXTURE_LENGTH))
    uv = np.empty((rings + 2, columns + 1, 2), np.float32)
    uv[..., 0] = around * repeats
    uv[..., 1] = (arc / _TEXTURE_LENGTH)[:, None]
    return Mesh(
        points.reshape(-1, 3).astype(np.float32),
        _tube_faces(rings, columns),
        normals.reshape(-1, 3),
        uv.reshape(-1, 2),
    )


def _tangents(control: FloatArray, t: FloatArray) -> FloatArray:
    """Returns unit tangents of the spline, (m, 3), by central differences."""
    step = 1e-4
    ahead = spline(control, np.minimum(t + step, 1.0))
    return normalized(ahead - spline(control, np.maximum(t - step, 0.0)))


def _grid_normals(points: FloatArray, tangent: FloatArray) -> np.ndarray:
    """Returns unit normals of a grid, float32 (rows, columns, 3).

    ``points`` has the shape (rows, columns, 3), ``tangent`` the shape (rows, 3).
    """
    normals = np.empty(points.shape, np.float32)
    normals[0] = -tangent[0]
    normals[-1] = tangent[-1]
    along = points[2:] - points[:-2]
    ring = points[1:-1]
    around = np.empty_like(ring)
    around[:, 1:-1] = ring[:, 2:] - ring[:, :-2]
    around[:, 0] = around[:, -1] = ring[:, 1] - ring[:, -2]
    normals[1:-1] = normalized(np.cross(along, around))
    return normals
