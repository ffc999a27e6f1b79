# SPDX-License-Identifier: Apache-2.0
"""Tubes of the dragon's head, and functions that make spikes and balls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavecomb.scenes.models.mesh import FloatArray
from wavecomb.scenes.models.relief import fluted, ramp, ringed, scaly, skin
from wavecomb.scenes.models.sweep import Relief, Tube


def spike(
    root: Sequence[float] | FloatArray,
    *path: Sequence[float] | FloatArray,
    radius: float,
    flat: float = 1.0,
    up: Sequence[float] | FloatArray = (0.0, 1.0, 0.0),
    relief: Relief | None = None,
    bulge: float = 1.0,
) -> Tube:
    """Makes a tapering horn, claw, tooth or blade from ``root`` through ``path``.

    Args:
        root: Start point.
        *path: Control points after the root; the last one is the tip.
        radius: Half width along ``up`` at the root.
        flat: Half width across ``up``, as a fraction of ``radius``.
        up: Direction of the wider axis of the cross-section.
        relief: Displacement.
        bulge: Radius of the second control point relative to a straight taper.
    """
    points = np.array([root, *path], np.float64)
    if len(points) == 2:
        points = np.stack([points[0], points.mean(axis=0), points[1]])
    taper = radius * (1.0 - np.linspace(0.0, 1.0, len(points)) ** 1.2)
    taper[1] *= bulge
    taper[-1] = 0.02 * radius
    return Tube(points, flat * taper, taper, np.array(up, np.float64), relief)


def ball(centre: Sequence[float] | FloatArray, radius: float, detail: float = 1.0) -> Tube:
    """Makes a sphere."""
    c = np.array(centre, np.float64)
    axis = np.array([radius, 0.0, 0.0])
    points = np.stack([c - axis, c, c + axis])
    wide = np.full(3, radius)
    return Tube(points, wide, wide, UP, None, 1.0, detail)


def tube(
    rows: Sequence[Sequence[float]],
    relief: Relief | None = None,
    belly: float = 1.0,
    detail: float = 1.0,
    side: float = 1.0,
) -> Tube:
    """Makes a tube from a table of control points.

    Args:
        rows: Control points as (x, y, z, half width, half height). If the half height is missing,
            the cross-section is round.
        relief: Displacement.
        belly: As in ``Tube``.
        detail: As in ``Tube``.
        side: Sign of the z coordinates; -1 mirrors the tube in the plane z = 0.
    """
    table = np.array(rows)
    points = table[:, :3] * np.array([1.0, 1.0, side])
    return Tube(points, table[:, 3], table[:, -1], UP, relief, belly, detail)


UP = np.array([0.0, 1.0, 0.0])
_SKULL = (
    (-0.22, 0.02, 0.0, 0.10, 0.10), (-0.08, 0.05, 0.0, 0.20, 0.19), (0.08, 0.07, 0.0, 0.26, 0.24),
    (0.24, 0.07, 0.0, 0.27, 0.24), (0.40, 0.04, 0.0, 0.20, 0.20), (0.54, 0.00, 0.0, 0.14, 0.13),
    (0.70, -0.01, 0.0, 0.13, 0.11), (0.84, 0.01, 0.0, 0.16, 0.14), (0.96, 0.03, 0.0, 0.15, 0.13),
    (1.04, 0.02, 0.0, 0.09, 0.08),
)  # fmt: skip
_JAW = (
    (-0.04, -0.04, 0.0, 0.12, 0.12), (0.12, -0.14, 0.0, 0.20, 0.13),
    (0.30, -0.22, 0.0, 0.16, 0.10), (0.52, -0.30, 0.0, 0.12, 0.075),
    (0.72, -0.37, 0.0, 0.11, 0.065), (0.86, -0.40, 0.0, 0.09, 0.06),
    (0.92, -0.40, 0.0, 0.06, 0.04),
)  # fmt: skip
_TONGUE = (
    (0.2, -0.14, 0.0, 0.08, 0.03), (0.45, -0.21, 0.0, 0.07, 0.025),
    (0.7, -0.24, 0.02, 0.05, 0.02), (0.95, -0.14, 0.03, 0.005, 0.004),
)  # fmt: skip
# Cross sections of parts that exist on both sides of the dragon's head. The z axis points away from
# the middle of the head.
_BROW = (
    (0.56, 0.09, 0.09, 0.02, 0.02), (0.45, 0.20, 0.17, 0.045, 0.04),
    (0.33, 0.235, 0.215, 0.055, 0.045), (0.20, 0.24, 0.25, 0.05, 0.045),
    (0.02, 0.33, 0.33, 0.003, 0.003),
)  # fmt: skip
_LID = (
    (0.54, 0.03, 0.12, 0.015, 0.015), (0.42, 0.045, 0.20, 0.035, 0.03),
    (0.28, 0.04, 0.26, 0.045, 0.04), (0.10, -0.02, 0.29, 0.03, 0.03),
)  # fmt: skip
_LIP = (
    (0.30, -0.06, 0.17, 0.02, 0.02), (0.50, -0.055, 0.14, 0.03, 0.028),
    (0.70, -0.06, 0.125, 0.03, 0.028), (0.86, -0.045, 0.15, 0.035, 0.032),
    (1.00, -0.03, 0.10, 0.035, 0.032), (1.05, -0.02, 0.0, 0.03, 0.028),
)  # fmt: skip
_HORN = (
    (0.10, 0.22, 0.13, 0.085), (-0.06, 0.40, 0.19, 0.075), (-0.28, 0.50, 0.27, 0.062),
    (-0.52, 0.56, 0.32, 0.05), (-0.74, 0.70, 0.32, 0.034), (-0.86, 0.90, 0.28, 0.003),
)  # fmt: skip
_WHISKER = (
    (0.94, 0.00, 0.13, 0.034), (1.06, -0.03, 0.30, 0.028), (0.98, -0.06, 0.52, 0.025),
    (0.70, 0.02, 0.66, 0.022), (0.46, 0.16, 0.74, 0.019), (0.22, 0.14, 0.86, 0.016),
    (0.06, 0.02, 0.96, 0.012), (-0.10, 0.06, 1.06, 0.003),
)  # fmt: skip
_UPPER_TEETH = (
    (0.97, 0.15, 0.026), (0.86, 0.09, 0.02), (0.78, 0.075, 0.018), (0.70, 0.085, 0.018),
    (0.62, 0.07, 0.017), (0.54, 0.06, 0.016), (0.46, 0.05, 0.015),
)  # fmt: skip
_LOWER_TEETH = (
    (0.86, 0.13, 0.024), (0.76, 0.07, 0.018), (0.67, 0.065, 0.017), (0.58, 0.06, 0.016),
    (0.49, 0.05, 0.015),
)  # fmt: skip
"""x coordinate, length and radius of each tooth of the dragon."""


def head_tubes() -> list[Tube]:
    """Makes the head in a local frame: unit length, muzzle along +x, nape at the origin."""
    snout = scaly(22, 0.07, 0.0, lambda a: 1.0 - 0.75 * ramp(a, 0.5, 0.9))
    parts = [
        tube(_SKULL, snout, 0.62, 2.0),
        tube(_JAW, scaly(18, 0.06, 0.0), 1.0, 2.0),
        tube(_TONGUE, skin(0.02)),
        *_head_side(1.0),
        *_head_side(-1.0),
    ]
    # Add a crest between the horns, and a horn on the nose.
    for k in range(4):
        x, h = 0.26 - 0.11 * k, 0.13 + 0.035 * k
        path = [x - 0.05, 0.30 + h * 0.5, 0], [x - 0.2, 0.3 + h, 0]
        fold = fluted(6, 0.06)
        parts.append(
            spike([x, 0.24, 0], *path, radius=0.06, flat=0.35, up=(1, 0.3, 0), relief=fold)
        )
    nose = [0.86, 0.10, 0], [0.88, 0.22, 0], [0.83, 0.31, 0]
    return [*parts, spike(*nose, radius=0.05, up=(1, 0, 0))]


def _head_side(side: float) -> list[Tube]:
    """Makes eye, brow, nostril, horn, whisker, teeth and mane of one side of the head."""

    def at(*xyz: float) -> FloatArray:
        return np.array(xyz) * np.array([1.0, 1.0, side])

    prong = at(-0.26, 0.49, 0.26), at(-0.30, 0.62, 0.33), at(-0.38, 0.78, 0.35)
    ear = at(0.02, 0.10, 0.22), at(-0.08, 0.15, 0.38), at(-0.30, 0.18, 0.48)
    outward = (0, 1, 0.3 * side)
    parts = [
        ball(at(0.37, 0.13, 0.165), 0.062, 2.0),
        tube(_BROW, scaly(10, 0.10, 0.0), 1.0, 1.6, side),
        tube(_LID, skin(0.03), side=side),
        ball(at(0.95, 0.085, 0.085), 0.066, 1.5),
        tube(_LIP, skin(0.03), side=side),
        tube(_HORN, ringed(14.0, 0.10), side=side),
        spike(*prong, radius=0.046, up=(1, 0, 0), relief=ringed(8.0, 0.1)),
        tube(_WHISKER, side=side),
        spike(*ear, radius=0.09, flat=0.35, up=outward, relief=fluted(7, 0.07), bulge=1.2),
    ]
    for x, length, radius in _UPPER_TEETH:
        z = 0.11 if x > 0.9 else 0.125
        middle = at(x - 0.005, -0.06 - 0.6 * length, z + 0.005)
        tip = at(x - 0.025, -0.06 - length, z - 0.01)
        parts.append(spike(at(x, -0.05, z), middle, tip, radius=radius, up=(1, 0, 0)))
    for x, length, radius in _LOWER_TEETH:
        y, z = -0.37 + 0.38 * (0.86 - x), 0.06 + 0.12 * (0.86 - x)
        bend, tip = at(x + 0.01, y + 0.6 * length, z + 0.008), at(x - 0.01, y + length, z)
        parts.append(spike(at(x, y, z), bend, tip, radius=radius, up=(1, 0, 0)))
    # The mane consists of two fans of tufts behind the cheek, of which the outer fan is shorter.
    for k in range(7):
        a = np.radians(-62.0 + 22.0 * k)
        y, z = 0.22 * np.sin(a), 0.20 * np.cos(a)
        long = 0.50 + 0.10 * np.cos(2.3 * k)
        path = [
            at(-0.02, 0.03 + y, z),
            at(-0.20, 0.03 + 1.5 * y, 1.5 * z + 0.03),
            at(-0.36 - 0.2 * long, 0.02 + 2.0 * y, 1.8 * z),
            at(-0.20 - long, 0.08 + 2.6 * y, 2.3 * z),
        ]
        up, fold = (0, np.cos(a), -side * np.sin(a)), fluted(8, 0.09)
        parts.append(spike(*path, radius=0.075, flat=0.45, up=up, relief=fold, bulge=1.15))
    # Add the dragon's beard along the jaw.
    for k in range(4):
        x = 0.08 + 0.17 * k
        y = -0.20 - 0.40 * max(x - 0.12, 0.0)
        path = [
            at(x, y, 0.10 - 0.015 * k),
            at(x - 0.10, y - 0.11, 0.14 - 0.02 * k),
            at(x - 0.20, y - 0.16, 0.15 - 0.02 * k),
            at(x - 0.34, y - 0.15, 0.17 - 0.02 * k),
        ]
        fold = fluted(6, 0.08)
        parts.append(spike(*path, radius=0.048, flat=0.5, up=(0.5, 0.8, 0), relief=fold))
    return parts
