# SPDX-License-Identifier: Apache-2.0
"""Finds the outlines (extreme points) of geometry, and camera positions that frame them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Matrices = NDArray[np.float64]

FILLED = 0.9
"""Fraction of the image width or height that the geometry spans, whichever is the larger
fraction."""

_DIRECTIONS = 162
"""Number of directions in which outlines are exact; the error for a sphere is at most 1.5 %."""

_BLOCK = 1 << 15
"""Number of points that are processed together, which bounds the memory used."""

_RUN = 256
_SAMPLE = 4096

_FEW_POINTS = 200
"""Number of points up to which an outline keeps all points."""

MANY_POINTS = 1 << 16
"""Number of points above which a point set is reduced to its outline before points are added."""

_FEW_PLACES = 512
"""Number of instances above which only the outermost instances contribute to an outline."""


def _spread(count: int) -> Points:
    """Returns (count, 3) unit vectors, evenly distributed over the sphere (Fibonacci lattice)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


DIRECTIONS = np.concatenate([np.eye(3), -np.eye(3), _spread(_DIRECTIONS - 6)])
"""Directions in which outlines are exact; the six axis directions make the framing of boxes
exact."""


def with_directions(more: Points | None) -> Points:
    """Returns ``DIRECTIONS``, followed by the directions (k, 3) in ``more``."""
    return DIRECTIONS if more is None else np.concatenate([DIRECTIONS, more])


def outline(points: NDArray[Any], more: Points | None = None) -> Points:
    """Returns the points among ``points`` (n, 3) that are extreme in at least one direction."""
    if len(points) <= _FEW_POINTS:
        return np.asarray(points, np.float64)
    directions = with_directions(more).astype(np.float32)
    some = np.asarray(points, np.float32)
    return some[np.unique(_farthest(some, None, directions))].astype(np.float64)


def outline_of_balls(
    points: NDArray[Any], radii: NDArray[Any], more: Points | None = None
) -> Points:
    """Returns the outline of balls with centres (n, 3) and radii (n,)."""
    directions = with_directions(more)
    directions = directions / np.linalg.norm(directions, axis=1)[:, None]
    some, size = np.asarray(points, np.float32), np.asarray(radii, np.float32)
    best = _farthest(some, size, directions.astype(np.float32))
    return np.asarray(some[best] + size[best, None] * directions, np.float64)


def _farthest(
    points: NDArray[np.float32], radii: NDArray[np.float32] | None, directions: NDArray[np.float32]
) -> NDArray[np.intp]:
    """Returns the index of the point or ball that is extreme in each of the directions (k, 3)."""
    chosen = np.arange(len(points))
    if len(points) > _BLOCK:
        chosen = _near_the_outside(points, radii, directions)
    most = np.full(len(directions), -np.inf, np.float32)
    best = np.zeros(len(directions), np.intp)
    for first in range(0, len(chosen), _BLOCK):
        these = chosen[first : first + _BLOCK]
        along = directions @ points[these].T
        if radii is not None:
            along += radii[these]
        at = np.argmax(along, axis=1)
        reach = along[np.arange(len(at)), at]
        farther = reach > most
        most[farther], best[farther] = reach[farther], these[at[farther]]
    return best


def _near_the_outside(
    points: NDArray[np.float32], radii: NDArray[np.float32] | None, directions: NDArray[np.float32]
) -> NDArray[np.intp]:
    """Returns indices of points that may be extreme.

    Runs of consecutive points are left out if their bounds lie inside the outline of a subset of
    all points. Consecutive points of a mesh are mostly close to each other, so runs have small
    bounds.
    """
    step = max(1, len(points) // _SAMPLE)
    reached = directions @ points[::step].T
    if radii is not None:
        reached += radii[::step]
    whole = len(points) // _RUN * _RUN
    # Transpose the points, since NumPy computes minima and maxima fastest over the last axis.
    runs = np.ascontiguousarray(points[:whole].T).reshape(3, -1, _RUN)
    low, high = runs.min(axis=2), runs.max(axis=2)
    most = 0.5 * (directions @ (low + high) + np.abs(directions) @ (high - low))
    if radii is not None:
        most += radii[:whole].reshape(-1, _RUN).max(axis=1)
    outside = np.flatnonzero((most >= reached.max(axis=1)[:, None]).any(axis=0))
    every = (outside[:, None] * _RUN + np.arange(_RUN)).reshape(-1)
    return np.concatenate([every, np.arange(whole, len(points))])


def corners(bounds: NDArray[Any]) -> Points:
    """Returns the eight corners (8, 3) of a box (2, 3)."""
    return np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i, j, k in np.ndindex(2, 2, 2)])


def placed(points: Points, transforms: Matrices, more: Points | None = None) -> Points:
    """Returns the outline of points (n, 3) that are instanced with transforms (k, 4, 4)."""
    if len(transforms) > _FEW_PLACES:
        centre = points.mean(axis=0)
        radius = float(np.linalg.norm(points - centre, axis=1).max())
        linear = transforms[:, :3, :3]
        middle = centre @ linear + transforms[:, 3, :3]
        size = radius * np.sqrt(np.einsum("kij,kij->ki", linear, linear).max(axis=1))
        directions = with_directions(more)
        bare = _farthest_places(middle, np.zeros(1), directions)
        whole = _farthest_places(middle, size, directions)
        transforms = transforms[np.unique(np.concatenate([bare, whole]))]
    moved = points @ transforms[:, :3, :3] + transforms[:, 3:, :3]
    return outline(moved.reshape(-1, 3), more)


def _farthest_places(
    middles: Points, sizes: NDArray[np.float64], directions: Points
) -> NDArray[np.intp]:
    """Returns the index of the ball that is extreme in each direction.

    ``middles`` are (k, 3) centres; ``sizes`` are (k,) radii, or (1,) for a common radius. The balls
    are processed in blocks, since all distances of millions of balls would take gigabytes.
    """
    columns = np.arange(len(directions))
    best, found = np.full(len(directions), -np.inf), np.zeros(len(directions), np.intp)
    for start in range(0, len(middles), _BLOCK):
        few = slice(start, start + _BLOCK)
        reach = middles[few] @ directions.T + (sizes if len(sizes) == 1 else sizes[few])[:, None]
        at = np.argmax(reach, axis=0)
        farther = reach[at, columns] > best
        best[farther] = reach[at, columns][farther]
        found[farther] = start + at[farther]
    return found


def joined(parts: Iterable[Points], more: Points | None = None) -> Points | None:
    """Returns the outline of the union of point sets, or None if there are no sets."""
    known = list(parts)
    return outline(np.concatenate(known), more) if known else None


def planes(axes: Matrices, half: tuple[float, float] | None) -> Points:
    """Returns the normals (4, 3) of the four planes through the camera and the image edges."""
    return np.array(
        [
            sign * axes[axis] + (0.0 if half is None else FILLED * half[axis]) * axes[2]
            for axis in (0, 1)
            for sign in (1.0, -1.0)
        ]
    )


def fit(
    points: Points, axes: Matrices, half: tuple[float, float], margin: float = FILLED
) -> Points:
    """Computes the position from which a pinhole camera frames the points.

    A point (x, y, z) in camera axes is inside the image if |x - cx| <= half (cz - z), and the same
    holds for y. The four edges of the image are planes through the camera. The points touch the
    pair of opposite planes that is tighter, and are centred between the planes of each pair.

    Args:
        points: (n, 3).
        axes: (3, 3); the rows are right, up and back.
        half: Half the image's width and height on the plane z = -1.
        margin: Fraction of the image that the points span.

    Returns:
        (3,) camera position in the space of the points.
    """
    local = points @ axes.T
    place = np.zeros(3)
    for axis in (0, 1):
        slope = margin * half[axis]
        ahead = float((local[:, axis] + slope * local[:, 2]).max())
        behind = float((-local[:, axis] + slope * local[:, 2]).max())
        place[axis] = 0.5 * (ahead - behind)
        depth = 0.5 * (ahead + behind) / slope
        place[2] = depth if axis == 0 else max(place[2], depth)
    size = float(np.linalg.norm(np.ptp(local, axis=0)))
    place[2] = max(place[2], float(local[:, 2].max()) + (1e-3 * size or 1.0))
    return np.asarray(place @ axes)


def fit_flat(
    points: Points, axes: Matrices, half: tuple[float, float], margin: float = FILLED
) -> tuple[Points, float]:
    """Returns the centre (3,) and the window scale that frame points orthographically."""
    local = points @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    place = 0.5 * (low + high)
    scale = max(0.5 * float(high[i] - low[i]) / (margin * half[i]) for i in (0, 1))
    return np.asarray(place @ axes), scale or 1.0
