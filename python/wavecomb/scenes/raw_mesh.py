# SPDX-License-Identifier: Apache-2.0
"""What a file of a mesh holds, before it is anything of ours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavecomb.scenes.mesh import FloatArray


@dataclass(frozen=True)
class RawMesh:
    """What a file holds: points float64 (n, 3), triangles int64 (m, 3), uv (n, 2) or None."""

    points: FloatArray
    faces: np.ndarray
    uv: FloatArray | None


def fans(counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Triangle fans of polygons: counts (k,), indices (sum,) -> int64 (m, 3)."""
    counts = np.asarray(counts, np.int64)
    indices = np.asarray(indices, np.int64)
    if len(counts) and (counts.min() < 0 or counts.sum() != len(indices)):
        raise ValueError("face sizes and indices do not agree")
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    owner = np.repeat(np.arange(len(counts)), triangles)
    corner = np.arange(int(triangles.sum())) - np.repeat(
        np.cumsum(triangles) - triangles, triangles
    )
    first = starts[owner]
    return np.stack([indices[first], indices[first + corner + 1], indices[first + corner + 2]], 1)
