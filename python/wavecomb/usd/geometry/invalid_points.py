# SPDX-License-Identifier: Apache-2.0
"""Leaves out only those faces or curves that use points that are not finite or too far away."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pxr import Gf

from wavecomb.usd.geometry.mesh_arrays import IDENTITY, LIMIT, Array, bake
from wavecomb.usd.geometry.triangulate import MeshError

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

WHY = "they have points that are not finite or too far away"


def invalid_point_mask(points: Array, matrix: Gf.Matrix4d = IDENTITY) -> Mask:
    """Returns a mask (n,) of the points (n, 3) that are invalid under a transform."""
    there = points if matrix == IDENTITY else bake(points, matrix)
    return np.asarray(~(np.abs(there) < LIMIT).all(axis=1))


def remove_invalid_points(
    points: Array, matrix: Gf.Matrix4d, counts: Ints, indices: Ints, holes: Ints | None
) -> tuple[Array, Ints, str]:
    """Removes the faces of a mesh that use invalid points.

    Args:
        points: (n, 3); some are invalid under ``matrix``.
        matrix: Transform from the mesh to its group.
        counts: (faces,) number of corners of each face.
        indices: (corners,) point indices.
        holes: Indices of faces that are not drawn.

    Returns:
        Points with invalid ones replaced, faces that are not drawn, and a message about the faces
        left out, which is "" if no face uses an invalid point.

    Raises:
        MeshError: No face remains, or counts and indices are inconsistent.
    """
    bad = invalid_point_mask(points, matrix)
    faces = faces_with(bad, counts, indices)
    points = fill_invalid(points, bad, counts, indices)
    words = f"{len(faces)} of {len(counts)} faces: {WHY}" if len(faces) else ""
    return points, faces if holes is None else np.concatenate([holes, faces]), words


def faces_with(bad: Mask, counts: Ints, indices: Ints) -> Ints:
    """Returns the faces with at least 3 corners that use an invalid point.

    Raises:
        MeshError: All faces use one, or counts and indices are inconsistent.
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
    """Replaces each invalid point by the mean of the valid points of its faces.

    There it distorts adjacent faces least when they are subdivided.
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
    """Replaces invalid points at shutter steps by their value at the nearest valid step.

    Points that are never valid become the first valid point. Equal arrays remain the same objects.
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
