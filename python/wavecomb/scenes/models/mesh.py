# SPDX-License-Identifier: Apache-2.0
"""Triangle meshes as NumPy arrays, and operations on meshes that several scenes use."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
"""Any float64 array. The docstring of each function states the shapes of its arrays."""

_CHUNK_FACES = 1 << 20


@dataclass(frozen=True)
class Mesh:
    """An indexed triangle mesh, Y up.

    Attributes:
        points: Vertex positions, float32 (n, 3), in scene units.
        faces: Vertex indices, int32 (m, 3), counter-clockwise seen from outside.
        normals: Unit vertex normals, float32 (n, 3).
        uv: Texture coordinates, float32 (n, 2).
    """

    points: NDArray[np.float32]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32]
    uv: NDArray[np.float32]

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner of the bounding box, each float64 (3,)."""
        return (
            self.points.min(axis=0).astype(np.float64),
            self.points.max(axis=0).astype(np.float64),
        )

    def moved(self, scale: float, offset: FloatArray) -> Mesh:
        """Returns the mesh scaled by a positive factor, then translated by (3,)."""
        points = self.points.astype(np.float64) * scale + offset
        return Mesh(points.astype(np.float32), self.faces, self.normals, self.uv)


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """Concatenates meshes without welding vertices."""
    parts = list(meshes)
    offsets = np.cumsum([0] + [len(part.points) for part in parts[:-1]])
    return Mesh(
        np.concatenate([part.points for part in parts]),
        np.concatenate(
            [part.faces + np.int32(offset) for part, offset in zip(parts, offsets, strict=True)]
        ),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uv for part in parts]),
    )


def face_areas(points: NDArray[np.floating], faces: NDArray[np.integer]) -> FloatArray:
    """Computes the areas of triangles, float64 (m,), from points (n, 3) and faces (m, 3)."""
    corners = points.astype(np.float64)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def signed_volume(points: NDArray[np.floating], faces: NDArray[np.integer]) -> float:
    """Computes the volume enclosed by outward-facing triangles, by the divergence theorem."""
    corners = points.astype(np.float64)
    corners = corners - corners.mean(axis=0)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def normalized(vectors: FloatArray) -> FloatArray:
    """Returns unit vectors along the last axis; zero vectors become (0, 1, 0)."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit = vectors / np.where(length > 0.0, length, 1.0)
    return np.where(length > 0.0, unit, np.array([0.0, 1.0, 0.0]))


def smooth_normals(points: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.float32]:
    """Computes area-weighted unit vertex normals, float32 (n, 3).

    Vertices at bitwise equal positions share one normal, so texture seams stay invisible.
    """
    _, shared = np.unique(
        np.ascontiguousarray(points.astype(np.float32) + np.float32(0.0)).view("V12").ravel(),
        return_inverse=True,
    )
    count = int(shared.max()) + 1 if len(shared) else 0
    total = np.zeros((count, 3))
    corners = points.astype(np.float64)
    for start in range(0, len(faces), _CHUNK_FACES):
        chunk = faces[start : start + _CHUNK_FACES]
        a, b, c = (corners[chunk[:, k]] for k in range(3))
        weighted = np.cross(b - a, c - a)
        for k in range(3):
            ids = shared[chunk[:, k]]
            for axis in range(3):
                total[:, axis] += np.bincount(ids, weighted[:, axis], count)
    return normalized(total)[shared].astype(np.float32)


def grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Returns two triangles per cell of a grid of rows x columns vertices, as int32 (m, 3).

    Vertex (i, j) has index ``i * columns + j``; the face normal is the cross product of the steps
    to the next row and the next column.
    """
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    lower = np.stack([a, a + columns, a + columns + 1], axis=1)
    upper = np.stack([a, a + columns + 1, a + 1], axis=1)
    return np.stack([lower, upper], axis=1).reshape(-1, 3).astype(np.int32)


def grid_mesh(
    points: FloatArray,
    uv: FloatArray,
    normals: FloatArray | None = None,
    *,
    reverse: bool = False,
) -> Mesh:
    """Makes a triangle mesh from a grid of vertices.

    Args:
        points: Positions, (rows, columns, 3).
        uv: Texture coordinates, (rows, columns, 2).
        normals: Normals, (rows, columns, 3); None computes smooth normals.
        reverse: Whether to flip the faces.
    """
    faces = grid_faces(*points.shape[:2])
    if reverse:
        faces = np.ascontiguousarray(faces[:, ::-1])
    places = points.reshape(-1, 3).astype(np.float32)
    if normals is None:
        turned = smooth_normals(places, faces)
    else:
        turned = normals.reshape(-1, 3).astype(np.float32)
    return Mesh(places, faces, turned, uv.reshape(-1, 2).astype(np.float32))


def without_flat_faces(mesh: Mesh, tolerance: float = 1e-14) -> Mesh:
    """Removes degenerate faces and unused points.

    A face is degenerate if its area is at most ``tolerance`` times the squared size of the mesh.
    """
    low, high = mesh.bounds
    limit = tolerance * float(((high - low) ** 2).sum())
    keep = face_areas(mesh.points, mesh.faces) > limit
    faces = mesh.faces[keep]
    used, compact = np.unique(faces, return_inverse=True)
    return Mesh(
        mesh.points[used],
        compact.reshape(-1, 3).astype(np.int32),
        mesh.normals[used],
        mesh.uv[used],
    )
