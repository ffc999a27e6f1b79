# SPDX-License-Identifier: Apache-2.0
"""Triangulates polygons and computes smooth normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb import _core

_CHUNK = 1 << 17
"""Number of polygons that are split together, which bounds the memory used."""

_EAR_STEPS = 1 << 26
"""Maximum number of ear clipping steps for one polygon, about one second of work.

The slowest known polygon with 100,000 corners takes two thirds of these steps.
"""


class MeshError(ValueError):
    """Raised if a mesh is invalid; the message gives the reason."""


# The dataclass is not frozen, since creating an object of a frozen dataclass takes three times as
# long.
@dataclass(slots=True, eq=False)
class Topology:
    """Triangulation of a mesh, with the corners and faces that the triangles come from.

    Contract: the topology is not modified after creation.

    Attributes:
        triangles: (m, 3) point indices, uint32.
        corners: (m, 3) positions in faceVertexIndices; None if triangle i has the positions 3i,
            3i+1 and 3i+2.
        faces: (m,) index of the face of each triangle; None if every face has ``per_face``
            triangles.
        indices: (corner_count,) faceVertexIndices.
        point_count: Number of points.
        face_count: Number of faces of the mesh, including holes.
        per_face: Number of triangles of each face if ``faces`` is None.
        hurried: Number of faces that cross themselves so often that their triangulation is
            approximate.
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
        """Returns the positions (m, 3) in faceVertexIndices of the triangles' corners."""
        if self.corners is None:
            return np.arange(3 * self.count).reshape(-1, 3)
        return self.corners

    def face_ids(self) -> NDArray[np.intp]:
        """Returns the face (m,) of each triangle."""
        return np.arange(self.count) // self.per_face if self.faces is None else self.faces


def triangulate(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    holes: NDArray[np.int32] | None = None,
    flip: bool = False,
) -> Topology:
    """Triangulates polygons.

    Quads are split along the better diagonal, convex polygons into fans, and other polygons by ear
    clipping.

    Args:
        points: (n, 3).
        counts: (faces,) number of corners of each face; faces with fewer than 3 are dropped.
        indices: (corners,) point index of each corner.
        holes: Indices of faces that are not drawn.
        flip: Whether to reverse the winding of every triangle.

    Raises:
        MeshError: Counts and indices are inconsistent.
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
    # Read as unsigned integers, negative indices are large, so one comparison finds all invalid
    # indices.
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
    """Returns the corners (m, 3) and faces (m,) of the triangles of given faces, in face order.

    The third result is the number of faces whose triangulation is approximate.
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
    """Returns the corners (m, 3) and point indices (m, 3) of the triangles of a mesh of quads."""
    corners = _core.split_quads(points, indices)
    if flip:
        corners = np.ascontiguousarray(corners[:, ::-1])
    return corners, indices.take(corners).view(np.uint32)


def _split_rings(
    points: NDArray[np.float32], indices: NDArray[np.int32], ring: NDArray[np.intp]
) -> tuple[NDArray[np.intp], int]:
    """Splits polygons with k corners each, (faces, k), into triangles (faces, k - 2, 3).

    The second result is the number of polygons whose triangulation is approximate.
    """
    size = ring.shape[1]
    if size == 3:
        return ring[:, None, :], 0
    if size == 4:
        pairs = _core.split_quads(points, indices, np.ascontiguousarray(ring[:, 0]))
        return pairs.reshape(-1, 2, 3), 0
    p = points.take(indices[ring], axis=0).astype(np.float64)
    p -= p[:, :1]
    # Compute the face's normal by Newell's method. A triangle fan is valid if all of its triangles
    # have the orientation of this normal.
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
    """Returns the cross product along the last axis, faster than np.cross for small arrays."""
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
    """Splits one simple polygon (k, 3) into triangles (k - 2, 3) by clipping ears.

    A polygon that crosses itself is split into overlapping triangles. After ``_EAR_STEPS`` steps,
    corners are cut off without a check; the second result is the number of these corners.
    """
    drop = int(np.argmax(np.abs(normal)))
    axes = [(drop + 1) % 3, (drop + 2) % 3]
    flat = points[:, axes] * (1.0 if normal[drop] >= 0 else -1.0, 1.0)
    return _core.clip_ears(np.ascontiguousarray(flat), _EAR_STEPS)


Ints = NDArray[np.int32]


_TRIANGLES = 1 << 16
"""Number of triangles whose normals are added together, which bounds the memory used."""


def _unit(total: NDArray[np.float64]) -> NDArray[np.float32]:
    """Normalises rows; rows of length 0 become (0, 0, 1)."""
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
    """Computes area-weighted normals, (n, 3) per point or, with hard edges, (m, 3, 3) per corner.

    Args:
        points: (n, 3).
        topology: The triangles; their winding defines the outside.
        creases: (k, 2) end points of the hard edges.
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
            # Add the normals in the order of the triangles, so that the rounded sums do not depend
            # on the block size.
            np.add.at(total[axis], where, np.repeat(face[:, axis], 3))
    normals = _unit(np.ascontiguousarray(total.T))
    return normals[index].reshape(-1, 3, 3) if sharp else normals


def _smoothing_groups(
    triangles: NDArray[np.int64], creases: NDArray[np.int64], point_count: int
) -> NDArray[np.int64]:
    """Returns corner labels (3 m,); corners of a point with equal labels share a normal."""
    # Each half-edge has a corner at the end with the lower point index and a corner at the end with
    # the higher point index.
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
