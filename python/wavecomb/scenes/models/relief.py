# SPDX-License-Identifier: Apache-2.0
"""Surface reliefs of the dragon's tubes: scales, plates, rings, folds and grain.

A relief is a displacement that is evaluated on the grid of a tube. Detail finer than the grid is
left out, so that a coarse
mesh is smooth instead of noisy, and a fine mesh shows more detail.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wavecomb.scenes.models.mesh import FloatArray
from wavecomb.scenes.models.sweep import Relief, Surface


def ramp(x: FloatArray, low: float, high: float) -> FloatArray:
    """Smooth step from 0 at ``low`` to 1 at ``high``."""
    s = np.clip((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def _visible(cells: FloatArray) -> FloatArray:
    """Returns the weight of a feature from its wavelength in grid cells: 0 below 2.5, 1 above 5."""
    return ramp(cells, 2.5, 5.0)


def _scale_height(row: FloatArray, column: FloatArray, edge: FloatArray) -> FloatArray:
    """Returns the height, 0 to 1, of overlapping, staggered scales whose tips point to lower rows.

    Args:
        row: Lattice coordinate along the tube, one row per unit.
        column: Lattice coordinate around the tube, one scale per unit.
        edge: Width of the rim, in lattice units.
    """
    base = np.floor(-row)
    y = -row - base
    height = np.zeros(np.broadcast(row, column).shape)
    for back in (0, 1):
        reach = y + back
        x = np.mod(column - 0.5 * np.mod(base - back, 2.0), 1.0) - 0.5
        dome = (0.30 + 0.70 * reach / 1.8) * (1.0 - 1.3 * x * x)
        keel = 0.16 * np.exp(-((x / 0.07) ** 2)) * np.exp(-3.0 * edge)
        rings = 0.05 * np.sin(2.0 * np.pi * 4.0 * np.hypot(x * 1.6, reach - 0.2))
        rings = rings * _visible(0.2 / edge)
        scale = dome + keel + rings
        if back == 0:
            height = scale
        else:
            outline = 1.0 - np.hypot(x / 0.56, np.maximum(reach - 0.9, 0.0) / 0.9)
            inside = ramp(outline / edge, -0.5, 1.0)
            height = height * (1.0 - inside) + scale * inside
    return height


def _grain(surface: Surface, around: int) -> FloatArray:
    """Returns fine irregular grain, from about -1 to 1, made of products of sine waves."""
    a = 2.0 * np.pi * surface.around
    b = 2.0 * np.pi * surface.turns * around
    total = np.zeros(np.broadcast(a, b).shape)
    for octave, (p, q, phase) in enumerate(((1, 1.0, 0.3), (3, 2.3, 1.9), (5, 5.7, 4.1))):
        n = around * p
        seen = _visible(1.0 / (n * surface.cell))
        wave = np.sin(n * a + 1.7 * np.sin(q * b + phase)) * np.sin(
            q * b + 1.3 * np.sin(0.5 * n // 1 * a + phase)
        )
        total += wave * seen * 0.6**octave
    return total


def scaly(
    around: int, depth: float, belly: float, fade: Callable[[FloatArray], FloatArray] | None = None
) -> Relief:
    """Makes a relief of scales on the back, transverse plates on the belly, and grain.

    Args:
        around: Number of scales around the tube.
        depth: Height of a scale as a fraction of the tube's local radius.
        belly: Fraction of the circumference, on each side of the underside, that has plates; 0 for
            none.
        fade: Factor on the whole relief, as a function of the position ``along`` the tube.
    """

    def relief(surface: Surface) -> FloatArray:
        edge = np.clip(1.2 * around * surface.cell, 0.10, 0.6)
        column = surface.around * around
        row = surface.turns * around * 1.05
        height = depth * _scale_height(row, column, edge)
        if belly > 0.0:
            distance = np.minimum(surface.around, 1.0 - surface.around)
            under = 1.0 - ramp(distance, belly - 0.02, belly + 0.015)
            plate = np.mod(-row / 2.5, 1.0)
            step = plate * (1.0 - ramp(plate, 0.82, 1.0))
            height = height * (1.0 - under) + under * depth * (0.2 + 1.1 * step)
        height = height + 0.08 * depth * _grain(surface, 5 * around)
        if fade is not None:
            height = height * fade(surface.along)
        return height

    return relief


def ringed(rings: float, depth: float) -> Relief:
    """Makes a relief for horns, with rings across the horn and fine grooves along it."""

    def relief(surface: Surface) -> FloatArray:
        ring = np.abs(np.sin(np.pi * rings * surface.along**0.8))
        groove = np.sin(2.0 * np.pi * 9 * surface.around) * _visible(1.0 / (9 * surface.cell))
        return depth * (ring + 0.25 * groove + 0.2 * _grain(surface, 20))

    return relief


def fluted(folds: int, depth: float) -> Relief:
    """Makes a relief of folds along the blade, for fins and tufts."""

    def relief(surface: Surface) -> FloatArray:
        fold = np.sin(2.0 * np.pi * folds * surface.around + 2.0 * surface.along)
        return depth * (fold * _visible(1.0 / (folds * surface.cell)) + 0.2 * _grain(surface, 30))

    return relief


def skin(depth: float) -> Relief:
    """Makes a relief of grain only, for bare skin."""
    return lambda surface: depth * (_grain(surface, 9) + 0.6 * _grain(surface, 40))
