# SPDX-License-Identifier: Apache-2.0
"""Coordinates that single precision cannot hold, whatever the scene is built around."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf

from wavecomb.usd.stage.origin import NEAR

_STEP = 2.0**-23
"""Spacing of floats, as a share of their size."""

_COARSE = 1e-3
"""Steps of more than this share of a shape show."""

STORED = (
    "points are stored too far from the prim's own origin: their single precision is coarser than "
    "a thousandth of what they make; store them nearer and move the prim by a transform"
)
INSTANCED = (
    "shapes are too far from the origin of what is instanced: single precision there is coarser "
    "than a thousandth of them; move the instances instead"
)
POSITIONS = (
    "instances are placed too far from their instancer: the single precision of positions is "
    "coarser than a thousandth of their extent; move the instancer by a transform"
)


def problem_of(bounds: NDArray[Any], matrix: Gf.Matrix4d, *, in_world: bool) -> str | None:
    """What makes a shape too coarse; None: nothing.

    Args:
        bounds: (2, 3), in its group's space.
        matrix: From the prim to its group.
        in_world: The group is the world, which is built around the camera.
    """
    (a, b, c), (x, y, z) = bounds.tolist()
    size = max(x - a, y - b, z - c)
    reach = max(x, y, z, -a, -b, -c)
    if not in_world and reach > NEAR and reach * _STEP > _COARSE * size:
        return INSTANCED
    move = matrix.GetRow3(3)
    p, q, r = 0.5 * (a + x) - move[0], 0.5 * (b + y) - move[1], 0.5 * (c + z) - move[2]
    # Distances are in units of the group, and so is the size: their ratio is the prim's own.
    # Chained comparisons, not calls: this is done for every prim.
    far = size * (_COARSE / _STEP)
    if -far <= p <= far and -far <= q <= far and -far <= r <= far:
        return None
    return None if max(abs(p), abs(q), abs(r)) <= NEAR * _scale(matrix) else STORED


def _scale(matrix: Gf.Matrix4d) -> float:
    return float(abs(matrix.GetDeterminant3()) ** (1.0 / 3.0))


def positions_are_coarse(positions: NDArray[Any]) -> bool:
    """Whether positions (n, 3) of instances, stored as floats, are too coarse for their extent."""
    if len(positions) < 2:
        return False
    reach = float(np.abs(positions).max())
    return reach > NEAR and reach * _STEP > _COARSE * float(np.ptp(positions, axis=0).max())
