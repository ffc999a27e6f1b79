# SPDX-License-Identifier: Apache-2.0
"""Colours that vary over instances, as few materials."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_COLOURS = 256
"""Materials that one varying colour may turn into."""


def quantise(colours: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Colours (m, 3) as a palette (k, 3), k <= ``MAX_COLOURS``, and an index (m,) into it.

    Steps are even in the square root, near to what the eye sees as even.
    """
    colours = np.nan_to_num(np.asarray(colours, np.float64), nan=0.0, posinf=1.0, neginf=0.0)
    colours = np.maximum(colours, 0.0)
    top = max(1.0, float(colours.max(initial=0.0)))
    level = np.sqrt(colours / top)
    for steps in (4095, 31, 15, 7, 5):
        q = np.rint(level * steps).astype(np.int64)
        keys = (q[:, 0] * 4096 + q[:, 1]) * 4096 + q[:, 2]
        unique, index = np.unique(keys, return_inverse=True)
        if len(unique) <= MAX_COLOURS:
            break
    index = index.ravel()
    sizes = np.bincount(index)
    sums = [np.bincount(index, weights=colours[:, axis]) for axis in range(3)]
    return np.stack(sums, axis=1) / sizes[:, None], index
