# SPDX-License-Identifier: Apache-2.0
"""A smooth form like a head, one radius for each direction from its middle: +Z is the face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wavecomb.scenes.mesh import FloatArray, Mesh, grid_faces, smooth_normals, without_flat_faces

HEAD_LEVEL = 96
"""Cells from pole to pole."""

_AXES = (0.78, 1.12, 0.98)
_BUMPS = (
    ((0.0, -0.10, 1.0), 0.14, 0.13),  # nose
    ((0.0, -0.78, 0.68), 0.22, 0.10),  # chin
    ((0.30, 0.12, 0.95), 0.13, -0.05),  # eyes
    ((-0.30, 0.12, 0.95), 0.13, -0.05),
    ((0.0, 0.32, 0.95), 0.30, 0.03),  # brow
    ((1.0, -0.05, -0.05), 0.16, 0.10),  # ears
    ((-1.0, -0.05, -0.05), 0.16, 0.10),
)
"""Direction, width and height of what stands out or in."""


def _smoothstep(low: float, high: float, x: FloatArray) -> FloatArray:
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def head_radius(d: FloatArray) -> FloatArray:
    """(n,) From the middle to the surface in unit directions (n, 3)."""
    jaw = _smoothstep(0.1, 1.0, -d[:, 1])
    x, y, z = d[:, 0] / (_AXES[0] - 0.20 * jaw), d[:, 1] / _AXES[1], d[:, 2] / _AXES[2]
    radius = 1.0 / np.sqrt(x * x + y * y + z * z)
    for toward, width, height in _BUMPS:
        way = np.array(toward) / np.linalg.norm(toward)
        radius = radius + height * np.exp((d @ way - 1.0) / (width * width))
    return radius


def is_scalp(d: FloatArray, chance: FloatArray) -> NDArray[np.bool_]:
    """Where hair grows: above a line from the brow round to the neck, sparser along it."""
    line = -0.50 + 1.08 * _smoothstep(-0.5, 0.75, d[:, 2])
    return chance < _smoothstep(0.0, 0.12, d[:, 1] - line)


def head_mesh(level: int) -> Mesh:
    """The form as a mesh of ``level`` cells from pole to pole."""
    columns = 2 * level
    up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, level + 1)
    turn = np.linspace(0.0, 2.0 * np.pi, columns + 1)
    turn[-1] = 0.0
    across = np.cos(up)
    across[[0, -1]] = 0.0
    shape = (level + 1, columns + 1)
    d = np.stack(
        [across[:, None] * np.cos(turn), np.broadcast_to(np.sin(up)[:, None], shape),
         across[:, None] * np.sin(turn)], axis=2,
    ).reshape(-1, 3)  # fmt: skip
    points = (d * head_radius(d)[:, None]).astype(np.float32)
    faces = grid_faces(*shape)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, level + 1)), axis=2)
    mesh = Mesh(points, faces, smooth_normals(points, faces), uv.reshape(-1, 2).astype(np.float32))
    return without_flat_faces(mesh, 1e-9)
