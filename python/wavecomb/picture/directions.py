# SPDX-License-Identifier: Apache-2.0
"""Distributions of directions, as the core keeps them, and as maps of all directions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def square_points(directions: NDArray[Any]) -> NDArray[np.float64]:
    """Points (u, v) in [0, 1] of unit vectors, (..., 3) -> (..., 2).

    P. Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD", JGT 13(3) 2008, as
    guiding/directions.h has it.

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
    """Unit vectors of the pixels of a map of all directions, and the axes that it is drawn by.

    Args:
        up: Unit vector; the map's top row.
        ahead: Its middle, but for the height; any direction.
        height: Rows; there are twice as many columns, and what is to the right is right of it.

    Returns:
        (height, 2 height, 3), and the rows ahead, right, up, (3, 3).
    """
    up = np.asarray(up, np.float64)
    flat = np.asarray(ahead, np.float64) - up * (np.asarray(ahead, np.float64) @ up)
    if np.linalg.norm(flat) < 1e-6:  # straight up or down: any will do
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
    """Where a unit vector is on the map of ``axes``: x from 0 (left) to 1, y from 0 (top) to 1."""
    ahead, right, up = axes @ np.asarray(direction, np.float64)
    return (
        float(0.5 + np.arctan2(right, ahead) / (2.0 * np.pi)),
        float(0.5 - np.arcsin(np.clip(up, -1.0, 1.0)) / np.pi),
    )


def density_map(
    density: NDArray[Any], up: NDArray[Any], ahead: NDArray[Any], height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A distribution over the bins of the square as a map of all directions, and its axes.

    Args:
        density: (n, n), of bins, rows by v.
        up: As ``map_directions``, like the others.
        ahead: Likewise.
        height: Likewise.
    """
    vectors, axes = map_directions(up, ahead, height)
    side = len(density)
    bins = np.minimum((square_points(vectors) * side).astype(np.intp), side - 1)
    return np.asarray(density, np.float64)[bins[..., 1], bins[..., 0]], axes
