# SPDX-License-Identifier: Apache-2.0
"""Smooth normals of polygon meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.geometry.triangulate import Topology, cross

_CHUNK = 1 << 16
"""Triangles whose normals are added at once: bounds the memory in use."""


def _unit(total: NDArray[np.float64]) -> NDArray[np.float32]:
    """Rows of length 1; (0, 0, 1) for those of length 0."""
    out = np.empty(total.shape, np.float32)
    for first in range(0, len(total), _CHUNK):
        part = total[first : first + _CHUNK]
        length = np.sqrt(np.einsum("ij,ij->i", part, part))
        out[first : first + _CHUNK] = part / np.where(length > 0, length, 1)[:, None]
        out[first : first + _CHUNK][length == 0] = (0, 0, 1)
    return out


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
    triangles = topology.triangles
    sharp = creases is not None and len(creases) > 0
    index: NDArray[Any] = triangles.reshape(-1)
    count = len(points)
    if sharp and creases is not None:
        labels = _smoothing_groups(triangles.astype(np.int64), creases, len(points))
        groups, index = np.unique(labels, return_inverse=True)
        index, count = index.reshape(-1), len(groups)
    total = np.zeros((3, count))
    for first in range(0, len(triangles), _CHUNK):
        p = points[triangles[first : first + _CHUNK]].astype(np.float64)
        face = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        where = index[3 * first : 3 * (first + _CHUNK)]
        for axis in range(3):
            # In order of triangles, however they are cut.
            np.add.at(total[axis], where, np.repeat(face[:, axis], 3))
    normals = _unit(np.ascontiguousarray(total.T))
    return normals[index].reshape(-1, 3, 3) if sharp else normals


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
