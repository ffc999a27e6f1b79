# SPDX-License-Identifier: Apache-2.0
"""The dragon's head, and the spikes and balls that other parts of it use too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavecomb.scenes.mesh import FloatArray
from wavecomb.scenes.relief import fluted, ramp, ringed, scaly, skin
from wavecomb.scenes.sweep import Relief, Tube


def spike(
    root: Sequence[float] | FloatArray,
    *path: Sequence[float] | FloatArray,
    radius: float,
    flat: float = 1.0,
    up: Sequence[float] | FloatArray = (0.0, 1.0, 0.0),
    relief: Relief | None = None,
    bulge: float = 1.0,
) -> Tube:
    """A tapering horn, claw, tooth or blade from ``root`` through ``path``.

    Args:
        root: Where it starts.
        *path: Further control points; the last is the tip.
        radius: Half width along ``up`` at the root.
        flat: Half width across as a fraction of ``radius``.
        up: Direction of the broad side.
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
    """A sphere."""
    c = np.array(centre, np.float64)
    axis = np.array([radius, 0.0, 0.0])
    points = np.stack([c - axis, c, c + axis])
    wide = np.full(3, radius)
    return Tube(points, wide, wide, np.array([0.0, 1.0, 0.0]), None, 1.0, detail)


def _mirrored(points: FloatArray, side: float) -> FloatArray:
    return points * np.array([1.0, 1.0, side])


def head_tubes() -> list[Tube]:
    """The head's tubes in its own frame: unit length, muzzle along +x, nape at the origin."""
    up = np.array([0.0, 1.0, 0.0])
    skull = np.array(
        [
            [-0.22, 0.02, 0.0, 0.10, 0.10],
            [-0.08, 0.05, 0.0, 0.20, 0.19],
            [0.08, 0.07, 0.0, 0.26, 0.24],
            [0.24, 0.07, 0.0, 0.27, 0.24],
            [0.40, 0.04, 0.0, 0.20, 0.20],
            [0.54, 0.00, 0.0, 0.14, 0.13],
            [0.70, -0.01, 0.0, 0.13, 0.11],
            [0.84, 0.01, 0.0, 0.16, 0.14],
            [0.96, 0.03, 0.0, 0.15, 0.13],
            [1.04, 0.02, 0.0, 0.09, 0.08],
        ]
    )
    jaw = np.array(
        [
            [-0.04, -0.04, 0.0, 0.12, 0.12],
            [0.12, -0.14, 0.0, 0.20, 0.13],
            [0.30, -0.22, 0.0, 0.16, 0.10],
            [0.52, -0.30, 0.0, 0.12, 0.075],
            [0.72, -0.37, 0.0, 0.11, 0.065],
            [0.86, -0.40, 0.0, 0.09, 0.06],
            [0.92, -0.40, 0.0, 0.06, 0.04],
        ]
    )
    snout = scaly(22, 0.07, 0.0, lambda a: 1.0 - 0.75 * ramp(a, 0.5, 0.9))
    parts = [
        Tube(skull[:, :3], skull[:, 3], skull[:, 4], up, snout, 0.62, 2.0),
        Tube(jaw[:, :3], jaw[:, 3], jaw[:, 4], up, scaly(18, 0.06, 0.0), 1.0, 2.0),
        Tube(
            np.array([[0.2, -0.14, 0], [0.45, -0.21, 0], [0.7, -0.24, 0.02], [0.95, -0.14, 0.03]]),
            np.array([0.08, 0.07, 0.05, 0.005]),
            np.array([0.03, 0.025, 0.02, 0.004]),
            up,
            skin(0.02),
        ),
    ]
    for side in (1.0, -1.0):
        parts += _head_side(side)
    # A crest between the horns and a horn on the nose.
    for k in range(4):
        x = 0.26 - 0.11 * k
        h = 0.13 + 0.035 * k
        parts.append(
            spike(
                [x, 0.24, 0],
                [x - 0.05, 0.30 + h * 0.5, 0],
                [x - 0.2, 0.3 + h, 0],
                radius=0.06,
                flat=0.35,
                up=(1, 0.3, 0),
                relief=fluted(6, 0.06),
            )
        )
    parts.append(
        spike([0.86, 0.10, 0], [0.88, 0.22, 0], [0.83, 0.31, 0], radius=0.05, up=(1, 0, 0))
    )
    return parts


def _head_side(side: float) -> list[Tube]:
    """Eye, brow, nostril, horn, whisker, teeth and mane of one side of the head."""

    def at(*xyz: float) -> FloatArray:
        return _mirrored(np.array(xyz), side)

    horn = ringed(14.0, 0.10)
    parts = [
        ball(at(0.37, 0.13, 0.165), 0.062, 2.0),
        # Brow: a ridge over the eye that ends in a spike behind it.
        Tube(
            np.array(
                [
                    at(0.56, 0.09, 0.09),
                    at(0.45, 0.20, 0.17),
                    at(0.33, 0.235, 0.215),
                    at(0.20, 0.24, 0.25),
                    at(0.02, 0.33, 0.33),
                ]
            ),
            np.array([0.02, 0.045, 0.055, 0.05, 0.003]),
            np.array([0.02, 0.04, 0.045, 0.045, 0.003]),
            np.array([0.0, 1.0, 0.0]),
            scaly(10, 0.10, 0.0),
            1.0,
            1.6,
        ),
        # Lower lid and cheek bone.
        Tube(
            np.array(
                [
                    at(0.54, 0.03, 0.12),
                    at(0.42, 0.045, 0.20),
                    at(0.28, 0.04, 0.26),
                    at(0.10, -0.02, 0.29),
                ]
            ),
            np.array([0.015, 0.035, 0.045, 0.03]),
            np.array([0.015, 0.03, 0.04, 0.03]),
            np.array([0.0, 1.0, 0.0]),
            skin(0.03),
        ),
        ball(at(0.95, 0.085, 0.085), 0.066, 1.5),
        # Upper lip, rolled over the teeth.
        Tube(
            np.array(
                [
                    at(0.30, -0.06, 0.17),
                    at(0.50, -0.055, 0.14),
                    at(0.70, -0.06, 0.125),
                    at(0.86, -0.045, 0.15),
                    at(1.00, -0.03, 0.10),
                    at(1.05, -0.02, 0.0),
                ]
            ),
            np.array([0.02, 0.03, 0.03, 0.035, 0.035, 0.03]),
            np.array([0.02, 0.028, 0.028, 0.032, 0.032, 0.028]),
            np.array([0.0, 1.0, 0.0]),
            skin(0.03),
        ),
        # Horn with a prong.
        Tube(
            np.array(
                [
                    at(0.10, 0.22, 0.13),
                    at(-0.06, 0.40, 0.19),
                    at(-0.28, 0.50, 0.27),
                    at(-0.52, 0.56, 0.32),
                    at(-0.74, 0.70, 0.32),
                    at(-0.86, 0.90, 0.28),
                ]
            ),
            np.array([0.085, 0.075, 0.062, 0.05, 0.034, 0.003]),
            np.array([0.085, 0.075, 0.062, 0.05, 0.034, 0.003]),
            np.array([0.0, 1.0, 0.0]),
            horn,
        ),
        spike(
            at(-0.26, 0.49, 0.26),
            at(-0.30, 0.62, 0.33),
            at(-0.38, 0.78, 0.35),
            radius=0.046,
            up=(1, 0, 0),
            relief=ringed(8.0, 0.1),
        ),
        # Whisker.
        Tube(
            np.array(
                [
                    at(0.94, 0.00, 0.13),
                    at(1.06, -0.03, 0.30),
                    at(0.98, -0.06, 0.52),
                    at(0.70, 0.02, 0.66),
                    at(0.46, 0.16, 0.74),
                    at(0.22, 0.14, 0.86),
                    at(0.06, 0.02, 0.96),
                    at(-0.10, 0.06, 1.06),
                ]
            ),
            np.array([0.034, 0.028, 0.025, 0.022, 0.019, 0.016, 0.012, 0.003]),
            np.array([0.034, 0.028, 0.025, 0.022, 0.019, 0.016, 0.012, 0.003]),
            np.array([0.0, 1.0, 0.0]),
        ),
        # Ear.
        spike(
            at(0.02, 0.10, 0.22),
            at(-0.08, 0.15, 0.38),
            at(-0.30, 0.18, 0.48),
            radius=0.09,
            flat=0.35,
            up=(0, 1, 0.3 * side),
            relief=fluted(7, 0.07),
            bulge=1.2,
        ),
    ]
    for x, length, radius in (
        (0.97, 0.15, 0.026),
        (0.86, 0.09, 0.02),
        (0.78, 0.075, 0.018),
        (0.70, 0.085, 0.018),
        (0.62, 0.07, 0.017),
        (0.54, 0.06, 0.016),
        (0.46, 0.05, 0.015),
    ):
        z = 0.11 if x > 0.9 else 0.125
        parts.append(
            spike(
                at(x, -0.05, z),
                at(x - 0.005, -0.06 - 0.6 * length, z + 0.005),
                at(x - 0.025, -0.06 - length, z - 0.01),
                radius=radius,
                up=(1, 0, 0),
            )
        )
    for x, length, radius in (
        (0.86, 0.13, 0.024),
        (0.76, 0.07, 0.018),
        (0.67, 0.065, 0.017),
        (0.58, 0.06, 0.016),
        (0.49, 0.05, 0.015),
    ):
        y = -0.37 + 0.38 * (0.86 - x)
        z = 0.06 + 0.12 * (0.86 - x)
        parts.append(
            spike(
                at(x, y, z),
                at(x + 0.01, y + 0.6 * length, z + 0.008),
                at(x - 0.01, y + length, z),
                radius=radius,
                up=(1, 0, 0),
            )
        )
    # Mane: two fans of tufts behind the cheek, the outer one shorter.
    for k in range(7):
        a = np.radians(-62.0 + 22.0 * k)
        y, z = 0.22 * np.sin(a), 0.20 * np.cos(a)
        long = 0.50 + 0.10 * np.cos(2.3 * k)
        parts.append(
            spike(
                at(-0.02, 0.03 + y, z),
                at(-0.20, 0.03 + 1.5 * y, 1.5 * z + 0.03),
                at(-0.36 - 0.2 * long, 0.02 + 2.0 * y, 1.8 * z),
                at(-0.20 - long, 0.08 + 2.6 * y, 2.3 * z),
                radius=0.075,
                flat=0.45,
                up=(0, np.cos(a), -side * np.sin(a)),
                relief=fluted(8, 0.09),
                bulge=1.15,
            )
        )
    # Beard along the jaw.
    for k in range(4):
        x = 0.08 + 0.17 * k
        y = -0.20 - 0.40 * max(x - 0.12, 0.0)
        parts.append(
            spike(
                at(x, y, 0.10 - 0.015 * k),
                at(x - 0.10, y - 0.11, 0.14 - 0.02 * k),
                at(x - 0.20, y - 0.16, 0.15 - 0.02 * k),
                at(x - 0.34, y - 0.15, 0.17 - 0.02 * k),
                radius=0.048,
                flat=0.5,
                up=(0.5, 0.8, 0),
                relief=fluted(6, 0.08),
            )
        )
    return parts
