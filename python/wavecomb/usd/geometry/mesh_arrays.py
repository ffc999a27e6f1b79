# SPDX-License-Identifier: Apache-2.0
"""Mesh arrays in the space of the world or a prototype: transforms, removal of invalid points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from wavecomb import _core
from wavecomb.usd.geometry.cage import Cage
from wavecomb.usd.geometry.primvar import as_array, as_integers
from wavecomb.usd.geometry.triangulate import MeshError, Topology

Array = NDArray[np.float32]

IDENTITY = Gf.Matrix4d(1.0)

LIMIT = 1e18
"""Largest valid coordinate of a point; Embree's limit is 1.8e18."""

UV_NAMES = ("st", "UVMap", "st0", "st1", "uv", "map1")
"""Names of primvars that are tried as texture coordinates if no material names a primvar."""

_CHUNK = 1 << 18
_NO_TURN = Gf.Matrix3d(1.0)

_NOWHERE = "a point is not finite or too far away"


@dataclass
class MeshArrays:
    """A mesh in the space of its group (the world or a prototype).

    Attributes:
        positions: (n, 3) points; (s, n, 3) at s steps over the shutter if animated.
        triangles: (m, 3) point indices, counter-clockwise when seen from outside.
        normals: (n, 3) per point or (m, 3, 3) per corner, with a leading axis of steps if animated;
            None for flat shading.
        uvs: (n, 2), (m, 3, 2) or None.
        bounds: (2, 3) lowest and highest coordinates.
        topology: Triangulation of the mesh's polygons; None for implicit shapes.
        cage: Control cage for subdivision or displacement, which need the view; None if the mesh
            needs neither.
    """

    positions: Array
    triangles: NDArray[np.uint32]
    normals: Array | None
    uvs: Array | None
    bounds: Array
    topology: Topology | None = None
    cage: Cage | None = None


def is_translation(matrix: Gf.Matrix4d) -> bool:
    """Returns whether a transform is a pure translation."""
    return bool(matrix.ExtractRotationMatrix() == _NO_TURN)


def check_matrix(matrix: Gf.Matrix4d) -> bool:
    """Returns whether a transform reverses the orientation of triangles.

    Raises:
        MeshError: The transform is singular or not finite.
    """
    det = matrix.GetDeterminant3()
    if not abs(det) > 1e-6:
        volume = 1.0
        for row in range(3):
            volume *= matrix.GetRow3(row).GetLength()
        if not abs(det) > 1e-9 * volume:
            raise MeshError("its transform has no inverse")
    return bool(det < 0)


def bake(points: Array, matrix: Gf.Matrix4d) -> Array:
    """Transforms points (n, 3) in double precision; returns a float32 copy."""
    m = np.array(matrix)
    linear, offset = m[:3, :3], m[3, :3]
    if len(points) <= _CHUNK:
        return (points @ linear + offset).astype(np.float32)
    out = np.empty((len(points), 3), np.float32)
    for first in range(0, len(points), _CHUNK):
        part = slice(first, first + _CHUNK)
        out[part] = points[part] @ linear + offset
    return out


def bake_and_triangulate(
    points: Array, counts: NDArray[np.int32], indices: NDArray[np.int32], matrix: Gf.Matrix4d
) -> tuple[Array, Array, Topology] | None:
    """Transforms and triangulates a mesh that has only triangles or only quads.

    Computes points, bounds and topology in one call, which saves time in stages with many meshes.
    Returns None for other meshes and for invalid ones, whose errors ``triangulate`` and ``extent``
    report.
    """
    found = _core.plain_mesh(points, counts, indices, matrix, limit=LIMIT)
    if found is None:
        return None
    size, baked, bounds, corners, triangles = found
    positions = points if baked is None else baked
    if triangles is None:
        triangles = indices.reshape(-1, 3).view(np.uint32)
    topology = Topology(triangles, corners, None, indices, len(points), len(counts), size - 2)
    return positions, bounds, topology


def transform_shape(
    points: Array, normals: Array, matrix: Gf.Matrix4d
) -> tuple[Array, Array, Array]:
    """Transforms points and normals (n, 3) of a shape and returns them with their bounds (2, 3).

    One call gives the same results as ``bake``, ``bake_normals`` and ``extent``.

    Raises:
        MeshError: A point is not finite or too far away.
    """
    placed = _core.place_shape(points, normals, matrix, matrix.GetInverse(), limit=LIMIT)
    if placed is None:
        raise MeshError(_NOWHERE)
    return placed


def bake_normals(normals: Array, matrix: Gf.Matrix4d) -> Array:
    """Transforms normals (..., 3) by the inverse transpose and normalises them."""
    linear = np.array(matrix.GetInverse())[:3, :3].T
    flat = normals.reshape(-1, 3)
    out = np.empty(flat.shape, np.float32)
    for first in range(0, len(flat), _CHUNK):
        part = slice(first, first + _CHUNK)
        turned = flat[part] @ linear
        length = np.sqrt(np.einsum("ij,ij->i", turned, turned))
        out[part] = turned / np.where(length > 0, length, 1)[:, None]
    return out.reshape(normals.shape)


def extent(positions: Array) -> Array:
    """Returns the bounds (2, 3) of points.

    Raises:
        MeshError: A point is not finite or too far away.
    """
    bounds = np.empty((2, 3), np.float32)
    np.minimum.reduce(positions, axis=0, out=bounds[0])
    np.maximum.reduce(positions, axis=0, out=bounds[1])
    (a, b, c), (x, y, z) = bounds.tolist()
    # Comparisons with NaN are false, so NaN counts as invalid.
    if not (a > -LIMIT and b > -LIMIT and c > -LIMIT and x < LIMIT and y < LIMIT and z < LIMIT):
        raise MeshError(_NOWHERE)
    return bounds


Ints = NDArray[np.int32]

TETRAHEDRA = "TetMesh"
"""Type name of prims that consist of tetrahedra."""


def read_faces(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[Ints, Ints]:
    """Returns the corner count of each face and the point index of each corner.

    ``prim`` is a Mesh or a TetMesh.

    Raises:
        MeshError: Tetrahedra refer to points that do not exist.
    """
    get = prim.GetAttribute
    if prim.GetTypeName() == TETRAHEDRA:
        indices = _surface(prim, time)
        return np.full(len(indices) // 3, 3, np.int32), indices
    counts = as_integers(get("faceVertexCounts").Get(time))
    return counts, as_integers(get("faceVertexIndices").Get(time)) if len(counts) else counts


def _surface(prim: Usd.Prim, time: Usd.TimeCode) -> Ints:
    """Returns the authored surface triangles, or else the faces of only one tetrahedron each."""
    values = as_array(prim.GetAttribute("surfaceFaceVertexIndices").Get(time))
    if values is None or len(values) == 0:
        tetrahedra = as_array(prim.GetAttribute("tetVertexIndices").Get(time))
        if tetrahedra is None or tetrahedra.shape != (len(tetrahedra), 4):
            return np.empty(0, np.int32)
        points = prim.GetAttribute("points").Get(time)
        if tetrahedra.min() < 0 or tetrahedra.max() >= len(points or ()):
            raise MeshError("tetVertexIndices name points that do not exist")
        values = as_array(UsdGeom.TetMesh.ComputeSurfaceFaces(UsdGeom.TetMesh(prim), time))
    if values is None or values.shape != (len(values), 3):
        return np.empty(0, np.int32)
    return np.ascontiguousarray(values.reshape(-1), np.int32)


Mask = NDArray[np.bool_]

WHY = "they have points that are not finite or too far away"


def invalid_point_mask(points: Array, matrix: Gf.Matrix4d = IDENTITY) -> Mask:
    """Returns a mask (n,) of the points (n, 3) that a transform makes invalid."""
    there = points if matrix == IDENTITY else bake(points, matrix)
    return np.asarray(~(np.abs(there) < LIMIT).all(axis=1))


def remove_invalid_points(
    points: Array, matrix: Gf.Matrix4d, counts: Ints, indices: Ints, holes: Ints | None
) -> tuple[Array, Ints, str]:
    """Removes the faces of a mesh that use invalid points.

    Args:
        points: (n, 3) points, some of which are invalid when transformed by ``matrix``.
        matrix: Transform from mesh space to the space of its group (the world or a prototype).
        counts: (faces,) number of corners of each face.
        indices: (corners,) point indices.
        holes: Indices of faces that are not drawn.

    Returns:
        Points with invalid points replaced, the indices of all faces that are not drawn, and a
        message (empty if no face uses an invalid point).

    Raises:
        MeshError: No face remains, or counts and indices are inconsistent.
    """
    bad = invalid_point_mask(points, matrix)
    faces = faces_with(bad, counts, indices)
    points = fill_invalid(points, bad, counts, indices)
    words = f"{len(faces)} of {len(counts)} faces: {WHY}" if len(faces) else ""
    return points, faces if holes is None else np.concatenate([holes, faces]), words


def faces_with(bad: Mask, counts: Ints, indices: Ints) -> Ints:
    """Returns indices of the faces with at least 3 corners that use an invalid point.

    Raises:
        MeshError: All faces use an invalid point, or counts and indices are inconsistent.
    """
    if len(counts) and counts.min() < 0:
        raise MeshError("a face has a negative number of corners")
    if (corners := int(counts.sum(dtype=np.int64))) != len(indices):
        raise MeshError(
            f"the face counts add up to {corners}, but there are {len(indices)} face indices"
        )
    if len(indices) and int(indices.view(np.uint32).max()) >= len(bad):
        raise MeshError("a face index is out of range")
    owner = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    hit = np.zeros(len(counts), bool)
    hit[owner[bad[indices]]] = True
    drawn = counts >= 3
    if (hit | ~drawn).all():
        raise MeshError("its points are not finite or too far away")
    return np.flatnonzero(hit & drawn).astype(np.int32)


def fill_invalid(points: Array, bad: Mask, counts: Ints, indices: Ints) -> Array:
    """Replaces each invalid point by the mean of the valid points in its adjacent faces.

    With this choice, subdivision distorts adjacent faces least.
    """
    out = points.copy()
    good = np.flatnonzero(~bad)
    out[bad] = points[good[0]]
    owner = np.repeat(np.arange(len(counts)), counts)
    corner_good = ~bad[indices]
    number = np.bincount(owner[corner_good], minlength=len(counts))
    sums = np.stack(
        [
            np.bincount(
                owner[corner_good], points[indices[corner_good], axis], minlength=len(counts)
            )
            for axis in range(3)
        ],
        axis=1,
    )
    corners = np.flatnonzero(~corner_good & (number[owner] > 0))
    middles = sums[owner[corners]] / number[owner[corners]][:, None]
    out[indices[corners]] = middles.astype(np.float32)
    return out


def replace_invalid_steps(shapes: Sequence[Array]) -> list[Array]:
    """Replaces points that are invalid at a shutter step by their value at the nearest valid step.

    Points that are invalid at all steps are replaced by the first valid point. Arrays without
    invalid points are returned unchanged.
    """
    masks = [invalid_point_mask(shape) for shape in shapes]
    if not any(mask.any() for mask in masks):
        return list(shapes)
    out = []
    for at, (shape, bad) in enumerate(zip(shapes, masks, strict=True)):
        made, left = shape.copy(), bad.copy()
        for other in sorted(range(len(shapes)), key=lambda k: abs(k - at)):
            found = left & ~masks[other]
            made[found] = shapes[other][found]
            left &= ~found
        if left.all():
            raise MeshError("its points are not finite or too far away")
        made[left] = made[np.flatnonzero(~left)[0]]
        out.append(made)
    return out
