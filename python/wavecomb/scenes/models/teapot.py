# SPDX-License-Identifier: Apache-2.0
"""The Utah teapot: Martin Newell's 32 bicubic Bezier patches, tessellated.

Source: M. E. Newell, "The Utilization of Procedure Models in Digital Image Synthesis", PhD thesis,
University of Utah, 1975; numbers as published by F. Crow, "The Origins of the Teapot", IEEE CG&A
7(1), 1987, with the bottom that was added later.

The published list has 306 points, most of which follow from symmetry. Rim, body, lid and bottom are
surfaces of revolution with four patches each around the axis; handle and spout are mirrored in y =
0. This file has only the points from which the patches are generated.
"""

from __future__ import annotations

import numpy as np

from wavecomb.errors import SceneError
from wavecomb.scenes.models.mesh import (
    FloatArray,
    Mesh,
    grid_mesh,
    merge,
    normalized,
    without_flat_faces,
)

_CIRCLE = 0.56
"""Newell's rounded constant for a Bezier quarter circle (the exact value is 0.5523)."""

# Bezier control points (radius, height) of the profiles of the teapot's surfaces of revolution. A
# patch has four control points and shares the last of them with the next patch.
_RIM = np.array(
    [[1.4, 2.4], [1.3375, 2.53125], [1.4375, 2.53125], [1.5, 2.4]],
)
_BODY = np.array(
    [[1.5, 2.4], [1.75, 1.875], [2, 1.35], [2, 0.9], [2, 0.45], [1.5, 0.225], [1.5, 0.15]],
)
_LID = np.array(
    [[0, 3.15], [0.8, 3.15], [0, 2.85], [0.2, 2.7], [0.4, 2.55], [1.3, 2.55], [1.3, 2.4]],
)
_BOTTOM = np.array([[1.5, 0.15], [1.5, 0.075], [1.425, 0], [0, 0]])
_KNOB_ROW = 1
_KNOB_CIRCLE = 0.5625
"""Quarter circle constant of the widest row of the lid's knob, published as 0.45 / 0.8 instead of
0.56."""

# Control points of handle and spout, which are tubes along a curve. Each row contains x and z of
# one side of the tube, x and z of the opposite side, and the half width in y.
_HANDLE = np.array(
    [
        [-1.6, 2.025, -1.5, 2.25, 0.3],
        [-2.3, 2.025, -2.5, 2.25, 0.3],
        [-2.7, 2.025, -3.0, 2.25, 0.3],
        [-2.7, 1.8, -3.0, 1.8, 0.3],
        [-2.7, 1.575, -3.0, 1.35, 0.3],
        [-2.5, 1.125, -2.65, 0.9375, 0.3],
        [-2.0, 0.9, -1.9, 0.6, 0.3],
    ]
)
_SPOUT = np.array(
    [
        [1.7, 1.425, 1.7, 0.6, 0.66],
        [2.6, 1.425, 3.1, 0.825, 0.66],
        [2.3, 2.1, 2.4, 2.025, 0.25],
        [2.7, 2.4, 3.3, 2.4, 0.25],
        [2.8, 2.475, 3.525, 2.49375, 0.25],
        [2.9, 2.475, 3.45, 2.5125, 0.15],
        [2.8, 2.4, 3.2, 2.4, 0.15],
    ]
)

_TEXTURE_LENGTH = 2.0 * np.pi
"""Length that one texture repeat covers, in teapot units; two repeats go around the belly."""


def _turned(profile: FloatArray) -> FloatArray:
    """Returns the patches (k, 4, 4, 3) of the surface of revolution of a profile (radius, height).

    The first patch index runs along the profile, the second around the axis.
    """
    constants = np.full(len(profile), _CIRCLE)
    if profile is _LID:
        constants[_KNOB_ROW] = _KNOB_CIRCLE
    patches = []
    for first in range(0, len(profile) - 1, 3):
        rows = slice(first, first + 4)
        radius, height = profile[rows].T
        kappa = radius * constants[rows]
        zero = np.zeros(4)
        x = np.stack([radius, radius, kappa, zero], axis=1)
        y = np.stack([zero, kappa, radius, radius], axis=1)
        z = np.repeat(height[:, None], 4, axis=1)
        for _ in range(4):
            patches.append(np.stack([x, y, z], axis=2))
            x, y = -y, x
    return np.array(patches) + 0.0


def _swept(rows: FloatArray) -> FloatArray:
    """Returns the patches (k, 4, 4, 3) of a tube that is symmetric in y = 0.

    The first index of a patch runs along the tube, the second around one half of it.
    """
    patches = []
    for first in range(0, len(rows) - 1, 3):
        near_x, near_z, far_x, far_z, half = rows[first : first + 4].T
        zero = np.zeros(4)
        x = np.stack([near_x, near_x, far_x, far_x], axis=1)
        z = np.stack([near_z, near_z, far_z, far_z], axis=1)
        for sign in (1.0, -1.0):
            y = np.stack([zero, sign * half, sign * half, zero], axis=1)
            patch = np.stack([x, y, z], axis=2)
            # The half of the tube at negative y has its points in reverse order, so that the two
            # halves form one full turn with the same orientation.
            patches.append(patch[:, ::-1] if sign < 0.0 else patch)
    return np.array(patches) + 0.0


def teapot_patches() -> FloatArray:
    """Returns the 32 patches in Newell's coordinates (Z up, spout along +x), float64 (32, 4, 4, 3).

    The first index of a patch runs along the profile or tube, the second around the axis or tube.
    """
    parts = [_turned(p) for p in (_RIM, _BODY, _LID, _BOTTOM)] + [_swept(_HANDLE), _swept(_SPOUT)]
    return np.concatenate(parts)


def _bernstein(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Evaluates the cubic Bernstein polynomials (n, 4) and their derivatives (n, 4) at t (n,)."""
    s = 1.0 - t
    value = np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=1)
    slope = np.stack([-3 * s * s, 3 * s * s - 6 * s * t, 6 * s * t - 3 * t * t, 3 * t * t], axis=1)
    return value, slope


def _evaluate(
    patch: FloatArray, along: FloatArray, around: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Evaluates points and unnormalised normals, each (rows, columns, 3), of a patch on a grid."""
    value_i, slope_i = _bernstein(along)
    value_j, slope_j = _bernstein(around)
    points = np.einsum("ri,ijk,cj->rck", value_i, patch, value_j)
    d_along = np.einsum("ri,ijk,cj->rck", slope_i, patch, value_j)
    d_around = np.einsum("ri,ijk,cj->rck", value_i, patch, slope_j)
    return points, np.cross(d_along, d_around)


def _arc_lengths(rows: FloatArray) -> FloatArray:
    """Returns the arc lengths at the ends of the patches, ((k - 1) // 3 + 1,).

    ``rows`` are the control points of a profile or centre line, (k, 3).
    """
    t = np.linspace(0.0, 1.0, 65)
    value, _ = _bernstein(t)
    pieces = [
        np.linalg.norm(np.diff(value @ rows[k : k + 4], axis=0), axis=1).sum()
        for k in range(0, len(rows) - 1, 3)
    ]
    return np.concatenate([[0.0], np.cumsum(pieces)])


def _tessellate(patches: FloatArray, turns: int, level: int, repeats: float) -> Mesh:
    """Tessellates one part of the teapot in Newell's coordinates.

    Args:
        patches: Bezier patches (k, 4, 4, 3); consecutive groups of ``turns`` patches go once around
            the part.
        turns: Number of patches around the part.
        level: Cells along each patch edge.
        repeats: Texture repeats around the part.
    """
    t = np.linspace(0.0, 1.0, level + 1)
    inner = np.clip(t, 1e-4, 1.0 - 1e-4)
    steps = patches[::turns, :, 0]
    column = np.concatenate([steps[0], *[s[1:] for s in steps[1:]]])
    lengths = _arc_lengths(column) / _TEXTURE_LENGTH
    meshes = []
    for index, patch in enumerate(patches):
        row, turn = divmod(index, turns)
        points, normals = _evaluate(patch, t, t)
        # At a pole, one of the two derivatives of the patch is zero. There, use the normal of a
        # point slightly inside the patch.
        _, near = _evaluate(patch, inner, inner)
        size = np.linalg.norm(normals, axis=2, keepdims=True)
        normals = np.where(size > 1e-9 * size.max(), normals, near)
        u = (turn + t) / turns * repeats
        v = lengths[row] + t * (lengths[row + 1] - lengths[row])
        uv = np.stack(np.meshgrid(u, -v, indexing="xy"), axis=2)
        meshes.append(grid_mesh(points, uv, normalized(normals)))
    return merge(meshes)


def teapot(level: int = 16) -> Mesh:
    """Tessellates the teapot, Y up, standing on y = 0, spout along +x, 6.43 units wide.

    Args:
        level: Cells along each patch edge, at least 1; yields about ``64 * level**2`` triangles.

    Returns:
        The mesh with analytic normals and texture coordinates; a texture repeat is 6.28 teapot
        units long.
    """
    if level < 1:
        raise SceneError(f"teapot level must be at least 1, not {level}")
    parts = [
        *[_tessellate(_turned(p), 4, level, 2.0) for p in (_RIM, _BODY, _LID, _BOTTOM)],
        _tessellate(_swept(_HANDLE), 2, level, 0.25),
        _tessellate(_swept(_SPOUT), 2, level, 0.5),
    ]
    whole = merge(parts)

    def upright(vectors: np.ndarray) -> np.ndarray:
        return np.stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]], axis=1) + np.float32(0.0)

    mesh = Mesh(upright(whole.points), whole.faces, upright(whole.normals), whole.uv)
    return without_flat_faces(mesh)
