# SPDX-License-Identifier: Apache-2.0
"""Noise in space, for grids of smoke and clouds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]

_EDGE = 64
"""Of the table: the noise repeats after so many units."""


class Noise:
    """Value noise: numbers at the corners of a lattice, smooth between them."""

    def __init__(self, seed: int, number: int = 0) -> None:
        """``number``: tells the noises of one seed apart."""
        rng = np.random.default_rng([seed, 977, number])
        self._table = rng.random((_EDGE, _EDGE, _EDGE), np.float32).ravel()

    def at(self, points: Points) -> NDArray[np.float32]:
        """Values in [0, 1] at points (n, 3)."""
        cell = np.floor(points)
        part = points - cell
        fade = part * part * part * (part * (part * 6.0 - 15.0) + 10.0)
        low = cell.astype(np.int64) % _EDGE
        high = (low + 1) % _EDGE
        found = np.zeros(len(points), np.float32)
        for corner in range(8):
            index = np.zeros(len(points), np.int64)
            weight = np.ones(len(points), np.float32)
            for axis in range(3):
                is_high = corner >> axis & 1
                index = index * _EDGE + (high if is_high else low)[:, axis]
                weight *= fade[:, axis] if is_high else 1.0 - fade[:, axis]
            found += weight * self._table[index]
        return found

    def fractal(self, points: Points, octaves: int, gain: float = 0.5) -> NDArray[np.float32]:
        """Sum of octaves, each of twice the frequency and ``gain`` times the weight, in [0, 1]."""
        found = np.zeros(len(points), np.float32)
        weight, weights = 1.0, 0.0
        for octave in range(octaves):
            found += np.float32(weight) * self.at(points * np.float32(2.0**octave) + 17.3 * octave)
            weights += weight
            weight *= gain
        return found / np.float32(weights)
