# SPDX-License-Identifier: Apache-2.0
"""Mapping of directional distributions between the core's unit square and latlong maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def square_points(directions: NDArray[Any]) -> NDArray[np.float64]:
    """Maps unit vectors (..., 3) to points (u, v) in the unit square (..., 2).

    guiding/directions.h defines the same mapping: P. Clarberg, "Fast Equal-Area Mapping of the
    (Hemi)Sphere using SIMD", JGT 13(3) 2008.

    >>> square_points(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])).tolist()
    [[0.5, 0.5], [1.0, 0.5]]
    """
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    r = np.sqrt(np.maximum(1.0 - np.abs(z), 0.0))
    b = np.arctan2(np.abs(y), np.abs(x)) * (2.0 / np.pi) * r
    a = r - b
    a, b = np.where(z < 0.0, 1.0 - b, a), np.where(z < 0.0, 1.0 - a, b)
    return 0.5 + 0.5 * np.stack([np.copysign(a, x), np.copysign(b, y)], axis=-1)


def map_directions(
    up: NDArray[Any], ahead: NDArray[Any], height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the unit vector of each pixel of a latlong map, and the axes of the map.

    Args:
        up: Unit vector that the top row of the map shows.
        ahead: Direction that the centre column of the map shows, not necessarily orthogonal to
            ``up``.
        height: Number of rows of the map. The number of columns is twice as large. The right half
            of the map shows the directions to the right of ``ahead``.

    Returns:
        Unit vectors (height, 2 height, 3), and a matrix (3, 3) with the rows ahead, right and up.
    """
    up = np.asarray(up, np.float64)
    flat = np.asarray(ahead, np.float64) - up * (np.asarray(ahead, np.float64) @ up)
    # If the view direction is vertical, use an arbitrary horizontal direction.
    if np.linalg.norm(flat) < 1e-6:
        flat = np.eye(3)[np.argmin(np.abs(up))]
        flat = flat - up * (flat @ up)
    flat = flat / np.linalg.norm(flat)
    axes = np.stack([flat, np.cross(flat, up), up])
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    longitude = np.pi * ((np.arange(2 * height) + 0.5) / height - 1.0)[None, :]
    local = np.stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude) + 0.0 * longitude,
        ],
        axis=-1,
    )
    return local @ axes, axes


def map_point(direction: NDArray[Any], axes: NDArray[np.float64]) -> tuple[float, float]:
    """Returns the latlong map position of a unit vector, from 0 to 1 in x and y.

    The origin is at the top left.
    """
    ahead, right, up = axes @ np.asarray(direction, np.float64)
    return (
        float(0.5 + np.arctan2(right, ahead) / (2.0 * np.pi)),
        float(0.5 - np.arcsin(np.clip(up, -1.0, 1.0)) / np.pi),
    )


def density_map(
    density: NDArray[Any], up: NDArray[Any], ahead: NDArray[Any], height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Resamples a distribution over the unit square to a latlong map. Also returns the map's axes.

    Args:
        density: Values of the bins with shape (n, n), in rows along v.
        up: Unit vector that the top row of the map shows.
        ahead: Direction that the centre column of the map shows.
        height: Number of rows of the map.
    """
    vectors, axes = map_directions(up, ahead, height)
    side = len(density)
    bins = np.minimum((square_points(vectors) * side).astype(np.intp), side - 1)
    return np.asarray(density, np.float64)[bins[..., 1], bins[..., 0]], axes
