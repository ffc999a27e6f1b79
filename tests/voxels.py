# SPDX-License-Identifier: Apache-2.0
"""Arrays of voxels for tests."""

from __future__ import annotations

from typing import Any

import numpy as np


def bricks(voxels: Any) -> tuple[Any, Any]:
    """Origins and values of a cube of voxels, whose edge is a multiple of 8."""
    n, rest = voxels.shape[0] // 8, voxels.shape[3:]
    parts = voxels.reshape(n, 8, n, 8, n, 8, *rest)
    parts = parts.transpose(0, 2, 4, 1, 3, 5, *range(6, parts.ndim))
    origins = 8 * np.array(list(np.ndindex(n, n, n)), np.int32)
    return origins, np.ascontiguousarray(parts).reshape(-1, 8, 8, 8, *rest)
