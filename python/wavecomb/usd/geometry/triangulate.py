# SPDX-License-Identifier: Apache-2.0
"""Polygons as triangles, and their smooth normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb import _core

_CHUNK = 1 << 17
"""Polygons split at once: bounds the memory in use."""

_EAR_STEPS = 1 << 26
"""Work that one polygon gets, about a second: one of 100,000 corners takes two thirds at the worst
that is known."""


class MeshError(ValueError):
    """A mesh that cannot be drawn; says why in a few words."""


@dataclass(frozen=True)
class Topology:
    """Triangles and where their corners and faces come from.

    Attributes:
        triangles: (m, 3) points of each triangle, uint32.
        corners: (m, 3) positions in faceVertexIndices, or None where triangle i has 3i, 3i+1, 3i+2.
        faces: (m,) face of each triangle, or None where every face has ``per_face`` triangles.
        indices: (corner_count,) faceVertexIndices.
        point_count: Number of points.
        face_count: Number of faces, holes included.
        per_face: Triangles of each face where ``faces`` is None.
        hurried: Faces that cross themselves too often to be split with care.
    """

    triangles: NDArray[np.uint32]
    corners: NDArray[np.intp] | None
    faces: NDArray[np.intp] | None
    indices: NDArray[np.int32]
    point_count: int
    face_count: int
    per_face: int = 1
    hurried: int = 0

    @property
    def count(self) -> int:
        """Number of triangles, m."""
        return len(self.triangles)

    def corner_ids(self) -> NDArray[np.intp]:
        """(m, 3) positions in faceVertexIndices."""
        if self.corners is None:
            return np.arange(3 * self.count).reshape(-1, 3)
        return self.corners

    def face_ids(self) -> NDArray[np.intp]:
        """(m,) face of each triangle."""
        return np.arange(self.count) // self.per_face if self.faces is None else self.faces


def triangulate(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    holes: NDArray[np.int32] | None = None,
    flip: bool = False,
) -> Topology:
    """Splits polygons: quads along the better diagonal, convex ones as fans, others by their ears.

    Args:
        points: (n, 3).
        counts: (faces,) corners of each face; faces of fewer than 3 corners are dropped.
        indices: (corners,) points of each corner.
        holes: Faces that are not drawn.
        flip: Turn every triangle round.

    Raises:
        MeshError: Counts and indices do not fit together.
    """
    if len(counts) == 0:
        raise MeshError("no faces")
    low, high = int(np.minimum.reduce(counts)), int(np.maximum.reduce(counts))
    if low < 0:
        raise MeshError("a face has a negative number of corners")
    total = low * len(counts) if low == high else int(counts.sum(dtype=np.int64))
    if total != len(indices):
        raise MeshError(
            f"the face counts add up to {total}, but there are {len(indices)} face indices"
        )
    # Negative ones are large as unsigned.
    if total and int(np.maximum.reduce(indices.view(np.uint32))) >= len(points):
        raise MeshError("a face index is out of range")
    has_holes = holes is not None and len(holes) > 0
    if low == 3 and high == 3 and not has_holes:
        triangles: NDArray[Any] = np.ascontiguousarray(indices.reshape(-1, 3))
        if not flip:
            unsigned = triangles.view(np.uint32)
            return Topology(unsigned, None, None, indices, len(points), len(counts))
        corners = np.arange(total).reshape(-1, 3)[:, ::-1]
        turned = np.ascontiguousarray(triangles[:, ::-1]).view(np.uint32)
        return Topology(turned, corners, None, indices, len(points), len(counts))
    if low == 4 and high == 4 and not has_holes:
        corners, turned = _quads(points, indices, flip)
        return Topology(turned, corners, None, indices, len(points), len(counts), 2)
    keep = counts >= 3
    if has_holes and holes is not None:
        inside = holes[(holes >= 0) & (holes < len(counts))]
        keep[inside] = False
    faces = np.flatnonzero(keep)
    if len(faces) == 0:
        raise MeshError("no faces")
    corners, owners, hurried = _split(points, counts, indices, faces)
    if flip:
        corners = corners[:, ::-1]
    triangles = np.ascontiguousarray(indices[corners]).view(np.uint32)
    return Topology(triangles, corners, owners, indices, len(points), len(counts), hurried=hurried)


def _split(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    faces: NDArray[np.intp],
) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Corners (m, 3) and faces (m,) of the triangles of some faces, in face order.

    Then how many of the faces were split in a hurry.
    """
    starts = np.cumsum(counts, dtype=np.intp) - counts
    sizes = counts[faces]
    corners: list[NDArray[np.intp]] = []
    owners: list[NDArray[np.intp]] = []
    hurried = 0
    for size in np.unique(sizes):
        group = faces[sizes == size]
        step = max(1, _CHUNK * 4 // int(size))
        for first in range(0, len(group), step):
            part = group[first : first + step]
            ring = starts[part][:, None] + np.arange(size)
            local, rough = _split_rings(points, indices, ring)
            hurried += rough
            corners.append(local.reshape(-1, 3))
            owners.append(np.repeat(part, size - 2))
    all_corners, all_owners = np.concatenate(corners), np.concatenate(owners)
    if len(corners) > 1:
        order = np.argsort(all_owners, kind="stable")
        all_corners, all_owners = all_corners[order], all_owners[order]
    return all_corners, all_owners, hurried


def _quads(
    points: NDArray[np.float32], indices: NDArray[np.int32], flip: bool
) -> tuple[NDArray[np.intp], NDArray[np.uint32]]:
    """Corners and points (m, 3) of the triangles of a mesh of quads alone."""
    corners = _core.split_quads(points, indices)
    if flip:
        corners = np.ascontiguousarray(corners[:, ::-1])
    return corners, indices.take(corners).view(np.uint32)


def _split_rings(
    points: NDArray[np.float32], indices: NDArray[np.int32], ring: NDArray[np.intp]
) -> tuple[NDArray[np.intp], int]:
    """Triangles (faces, k - 2, 3) of polygons of k corners each, ring (faces, k).

    Then how many of the polygons were split in a hurry.
    """
    size = ring.shape[1]
    if size == 3:
        return ring[:, None, :], 0
    if size == 4:
        pairs = _core.split_quads(points, indices, np.ascontiguousarray(ring[:, 0]))
        return pairs.reshape(-1, 2, 3), 0
    p = points.take(indices[ring], axis=0).astype(np.float64)
    p -= p[:, :1]
    # Newell's normal; the fan is right where each of its triangles turns the same way.
    normal = cross(p, np.roll(p, -1, axis=1)).sum(axis=1)
    areas = np.einsum("fkc,fc->fk", cross(p[:, 1:-1], p[:, 2:]), normal)
    bad = areas.min(axis=1) < -1e-9 * np.einsum("ij,ij->i", normal, normal)
    fan = np.stack(
        [np.zeros(size - 2, np.intp), np.arange(1, size - 1), np.arange(2, size)], axis=1
    )
    out = ring[:, fan]
    hurried = 0
    for face in np.flatnonzero(bad):
        ears, cuts = clip_ears(p[face], normal[face])
        out[face] = ring[face][ears]
        hurried += cuts > 0
    return out, hurried


def cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Cross product along the last axis; np.cross is slow on small arrays."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(a.shape, a.dtype)
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


def clip_ears(
    points: NDArray[np.float64], normal: NDArray[np.float64]
) -> tuple[NDArray[np.intp], int]:
    """Triangles (k - 2, 3) of one simple polygon, points (k, 3), by clipping ears.

    One that crosses itself is split, too, whichever way. Then the corners that were cut without a
    look, after ``_EAR_STEPS``.
    """
    drop = int(np.argmax(np.abs(normal)))
    axes = [(drop + 1) % 3, (drop + 2) % 3]
    flat = points[:, axes] * (1.0 if normal[drop] >= 0 else -1.0, 1.0)
    return _core.clip_ears(np.ascontiguousarray(flat), _EAR_STEPS)


Ints = NDArray[np.int32]


_TRIANGLES = 1 << 16
"""Triangles whose normals are added at once: bounds the memory in use."""


def _unit(total: NDArray[np.float64]) -> NDArray[np.float32]:
    """Rows of length 1; (0, 0, 1) for those of length 0."""
    out = np.empty(total.shape, np.float32)
    for first in range(0, len(total), _TRIANGLES):
        part = total[first : first + _TRIANGLES]
        length = np.sqrt(np.einsum("ij,ij->i", part, part))
        out[first : first + _TRIANGLES] = part / np.where(length > 0, length, 1)[:, None]
        out[first : first + _TRIANGLES][length == 0] = (0, 0, 1)
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
    for first in range(0, len(triangles), _TRIANGLES):
        p = points[triangles[first : first + _TRIANGLES]].astype(np.float64)
        face = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        where = index[3 * first : 3 * (first + _TRIANGLES)]
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
