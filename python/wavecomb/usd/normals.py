# SPDX-License-Identifier: Apache-2.0
"""Smooth normals of polygon meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.triangulate import Topology, cross

SHARP = 1.0
"""Crease sharpness from which an edge is drawn as an edge."""


def _scatter(index: NDArray[Any], values: NDArray[Any], count: int) -> NDArray[np.float32]:
    """Sums of rows of values (k, 3) by index (k,), made unit length: (count, 3)."""
    total: NDArray[np.float64] = np.stack(
        [np.bincount(index, weights=values[:, axis], minlength=count) for axis in range(3)], axis=1
    )
    length = np.sqrt(np.einsum("ij,ij->i", total, total))
    total /= np.where(length > 0, length, 1)[:, None]
    total[length == 0] = (0, 0, 1)
    return total.astype(np.float32)


def smooth_normals(
    points: NDArray[np.float32],
    topology: Topology,
    creases: NDArray[np.int64] | None = None,
) -> NDArray[np.float32]:
    """Area-weighted normals: (n, 3) per point, or (m, 3, 3) per corner where edges are sharp.

    Args:
        points: (n, 3).
        topology: The triangles, turned the way that is outside.
        creases: (k, 2) points of the sharp edges.
    """
    triangles = topology.triangles.astype(np.int64)
    p = points[triangles].astype(np.float64)
    face = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    spread = np.repeat(face, 3, axis=0)
    if creases is None or len(creases) == 0:
        return _scatter(triangles.ravel(), spread, len(points))
    labels = _smoothing_groups(triangles, creases, len(points))
    groups, index = np.unique(labels, return_inverse=True)
    return _scatter(index.ravel(), spread, len(groups))[index.ravel()].reshape(-1, 3, 3)


def _smoothing_groups(
    triangles: NDArray[np.int64], creases: NDArray[np.int64], point_count: int
) -> NDArray[np.int64]:
    """(3 m,) label of each corner: equal where one point's corners meet across smooth edges."""
    # Both ends of every half edge: corners (at the lower point, at the higher point).
    corner = np.arange(triangles.size).reshape(-1, 3)
    a, b = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    ca, cb = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    swap = a > b
    key = np.where(swap, b, a) * point_count + np.where(swap, a, b)
    low, high = np.where(swap, cb, ca), np.where(swap, ca, cb)
    sharp = np.sort(creases, axis=1)
    smooth = ~np.isin(key, sharp[:, 0] * point_count + sharp[:, 1])
    order = np.argsort(key[smooth], kind="stable")
    key, low, high = key[smooth][order], low[smooth][order], high[smooth][order]
    same = key[1:] == key[:-1]
    left = np.concatenate([low[:-1][same], high[:-1][same]])
    right = np.concatenate([low[1:][same], high[1:][same]])
    labels = np.arange(triangles.size)
    while True:
        lowest = np.minimum(labels[left], labels[right])
        before = labels.copy()
        np.minimum.at(labels, left, lowest)
        np.minimum.at(labels, right, lowest)
        labels = labels[labels]
        if np.array_equal(labels, before):
            return labels


def crease_edges(
    indices: NDArray[np.int32], lengths: NDArray[np.int32], sharpness: NDArray[np.float32]
) -> NDArray[np.int64]:
    """(k, 2) points of the creases of a UsdGeomMesh from ``SHARP`` on; none where data is bad."""
    none = np.empty((0, 2), np.int64)
    if len(lengths) == 0 or lengths.min() < 2 or lengths.sum(dtype=np.int64) != len(indices):
        return none
    last = np.zeros(len(indices), bool)
    last[np.cumsum(lengths) - 1] = True
    first = np.flatnonzero(~last)
    if len(sharpness) == len(lengths):
        sharp = np.repeat(sharpness, lengths - 1)
    elif len(sharpness) == len(first):
        sharp = sharpness
    else:
        return none
    edges = np.stack([indices[first], indices[first + 1]], axis=1).astype(np.int64)
    return edges[sharp >= SHARP]
