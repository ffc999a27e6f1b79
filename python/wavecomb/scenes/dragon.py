# SPDX-License-Identifier: Apache-2.0
"""A procedural dragon of our own, with any number of triangles.

An eastern dragon, wingless, its scaly body in an S over the ground, head raised: a stand-in for the
Stanford XYZRGB dragon, which may not be shipped. It is a union of closed tubes that run into one
another (see ``sweep``): body, head, jaw, limbs, claws, horns, fins. Relief is evaluated at the
resolution of the mesh, so more triangles show finer detail: scales first, then their keels and
growth rings, then grain.

Units: about 2.2 long, 1.2 high; Y up, standing on y = 0, facing +x.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wavecomb.scenes.mesh import FloatArray, Mesh, merge, normalized
from wavecomb.scenes.sweep import Surface, Tube, spline, tube_extent, tube_mesh

MIN_TRIANGLES = 10_000
MAX_TRIANGLES = 20_000_000

# Centre line of the body from the tail's tip to the nape: x, y, z, half width, half height.
_BODY = np.array(
    [
        [-0.80, 0.86, -0.10, 0.004, 0.004],
        [-0.98, 0.84, -0.20, 0.020, 0.020],
        [-1.12, 0.66, -0.18, 0.036, 0.038],
        [-1.14, 0.42, -0.02, 0.052, 0.055],
        [-1.04, 0.20, 0.15, 0.068, 0.072],
        [-0.82, 0.15, 0.25, 0.088, 0.092],
        [-0.60, 0.27, 0.20, 0.118, 0.125],
        [-0.40, 0.45, 0.04, 0.142, 0.150],
        [-0.18, 0.58, -0.14, 0.140, 0.152],
        [0.04, 0.54, -0.24, 0.142, 0.152],
        [0.24, 0.39, -0.18, 0.148, 0.158],
        [0.42, 0.33, -0.02, 0.148, 0.158],
        [0.57, 0.42, 0.12, 0.134, 0.142],
        [0.60, 0.62, 0.16, 0.110, 0.116],
        [0.54, 0.83, 0.10, 0.094, 0.100],
        [0.58, 1.00, 0.02, 0.088, 0.092],
        [0.74, 1.06, 0.00, 0.080, 0.084],
    ]
)
# Direction of the back at each of those points.
_BODY_UP = np.array(
    [
        [0.2, 1.0, 0.2],
        [0.4, 0.9, 0.0],
        [0.9, 0.5, 0.0],
        [1.0, 0.3, 0.0],
        [0.7, 0.9, 0.0],
        [0.0, 1.0, 0.0],
        [-0.3, 1.0, 0.0],
        [-0.3, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.3, 1.0, 0.0],
        [0.2, 1.0, 0.0],
        [-0.2, 1.0, 0.0],
        [-0.8, 0.7, 0.0],
        [-1.0, 0.3, 0.0],
        [-1.0, 0.2, 0.0],
        [-0.8, 0.9, 0.0],
        [-0.1, 1.0, 0.0],
    ]
)
_HEAD_ORIGIN = np.array([0.74, 1.06, 0.0])
_HEAD_SIZE = 0.46
_HEAD_PITCH = np.radians(-14.0)
_SCALES_AROUND = 24


def _ramp(x: FloatArray, low: float, high: float) -> FloatArray:
    """Smooth step from 0 at ``low`` to 1 at ``high``."""
    s = np.clip((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def _visible(cells: FloatArray) -> FloatArray:
    """Weight of a feature whose wavelength is so many grid cells: 0 below 2.5, 1 above 5."""
    return _ramp(cells, 2.5, 5.0)


def _scale_height(row: FloatArray, column: FloatArray, edge: FloatArray) -> FloatArray:
    """Height 0 to 1 of overlapping, staggered scales whose tips point to lower rows.

    Args:
        row: Lattice coordinate along, one row a unit.
        column: Lattice coordinate around, one scale a unit.
        edge: Width of the rim, lattice units.
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
            inside = _ramp(outline / edge, -0.5, 1.0)
            height = height * (1.0 - inside) + scale * inside
    return height


def _grain(surface: Surface, around: int) -> FloatArray:
    """Fine irregular grain, about -1 to 1, of products of sines with unrelated frequencies."""
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


def _scaly(
    around: int, depth: float, belly: float, fade: Callable[[FloatArray], FloatArray] | None = None
) -> Callable[[Surface], FloatArray]:
    """Relief of scales above, transverse plates below, and grain.

    Args:
        around: Scales around the tube.
        depth: Height of a scale in local radii.
        belly: Part of the turn, each side of the underside, that has plates; 0 for none.
        fade: Factor on everything as a function of ``along``.
    """

    def relief(surface: Surface) -> FloatArray:
        edge = np.clip(1.2 * around * surface.cell, 0.10, 0.6)
        column = surface.around * around
        row = surface.turns * around * 1.05
        height = depth * _scale_height(row, column, edge)
        if belly > 0.0:
            distance = np.minimum(surface.around, 1.0 - surface.around)
            under = 1.0 - _ramp(distance, belly - 0.02, belly + 0.015)
            plate = np.mod(-row / 2.5, 1.0)
            step = plate * (1.0 - _ramp(plate, 0.82, 1.0))
            height = height * (1.0 - under) + under * depth * (0.2 + 1.1 * step)
        height = height + 0.08 * depth * _grain(surface, 5 * around)
        if fade is not None:
            height = height * fade(surface.along)
        return height

    return relief


def _ringed(rings: float, depth: float) -> Callable[[Surface], FloatArray]:
    """Relief of horns: rings across and fine grooves along."""

    def relief(surface: Surface) -> FloatArray:
        ring = np.abs(np.sin(np.pi * rings * surface.along**0.8))
        groove = np.sin(2.0 * np.pi * 9 * surface.around) * _visible(1.0 / (9 * surface.cell))
        return depth * (ring + 0.25 * groove + 0.2 * _grain(surface, 20))

    return relief


def _fluted(folds: int, depth: float) -> Callable[[Surface], FloatArray]:
    """Relief of fins and tufts: folds along the blade."""

    def relief(surface: Surface) -> FloatArray:
        fold = np.sin(2.0 * np.pi * folds * surface.around + 2.0 * surface.along)
        return depth * (fold * _visible(1.0 / (folds * surface.cell)) + 0.2 * _grain(surface, 30))

    return relief


def _skin(depth: float) -> Callable[[Surface], FloatArray]:
    """Relief of bare skin: grain only."""
    return lambda surface: depth * (_grain(surface, 9) + 0.6 * _grain(surface, 40))


def _spike(
    root: Sequence[float] | FloatArray,
    *path: Sequence[float] | FloatArray,
    radius: float,
    flat: float = 1.0,
    up: Sequence[float] | FloatArray = (0.0, 1.0, 0.0),
    relief: Callable[[Surface], FloatArray] | None = None,
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


def _ball(centre: Sequence[float] | FloatArray, radius: float, detail: float = 1.0) -> Tube:
    """A sphere."""
    c = np.array(centre, np.float64)
    axis = np.array([radius, 0.0, 0.0])
    points = np.stack([c - axis, c, c + axis])
    wide = np.full(3, radius)
    return Tube(points, wide, wide, np.array([0.0, 1.0, 0.0]), None, 1.0, detail)


def _mirrored(points: FloatArray, side: float) -> FloatArray:
    return points * np.array([1.0, 1.0, side])


def _head() -> list[Tube]:
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
    snout = _scaly(22, 0.07, 0.0, lambda a: 1.0 - 0.75 * _ramp(a, 0.5, 0.9))
    parts = [
        Tube(skull[:, :3], skull[:, 3], skull[:, 4], up, snout, 0.62, 2.0),
        Tube(jaw[:, :3], jaw[:, 3], jaw[:, 4], up, _scaly(18, 0.06, 0.0), 1.0, 2.0),
        Tube(
            np.array([[0.2, -0.14, 0], [0.45, -0.21, 0], [0.7, -0.24, 0.02], [0.95, -0.14, 0.03]]),
            np.array([0.08, 0.07, 0.05, 0.005]),
            np.array([0.03, 0.025, 0.02, 0.004]),
            up,
            _skin(0.02),
        ),
    ]
    for side in (1.0, -1.0):
        parts += _head_side(side)
    # A crest between the horns and a horn on the nose.
    for k in range(4):
        x = 0.26 - 0.11 * k
        h = 0.13 + 0.035 * k
        parts.append(
            _spike(
                [x, 0.24, 0],
                [x - 0.05, 0.30 + h * 0.5, 0],
                [x - 0.2, 0.3 + h, 0],
                radius=0.06,
                flat=0.35,
                up=(1, 0.3, 0),
                relief=_fluted(6, 0.06),
            )
        )
    parts.append(
        _spike([0.86, 0.10, 0], [0.88, 0.22, 0], [0.83, 0.31, 0], radius=0.05, up=(1, 0, 0))
    )
    return parts


def _head_side(side: float) -> list[Tube]:
    """Eye, brow, nostril, horn, whisker, teeth and mane of one side of the head."""

    def at(*xyz: float) -> FloatArray:
        return _mirrored(np.array(xyz), side)

    horn = _ringed(14.0, 0.10)
    parts = [
        _ball(at(0.37, 0.13, 0.165), 0.062, 2.0),
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
            _scaly(10, 0.10, 0.0),
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
            _skin(0.03),
        ),
        _ball(at(0.95, 0.085, 0.085), 0.066, 1.5),
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
            _skin(0.03),
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
        _spike(
            at(-0.26, 0.49, 0.26),
            at(-0.30, 0.62, 0.33),
            at(-0.38, 0.78, 0.35),
            radius=0.046,
            up=(1, 0, 0),
            relief=_ringed(8.0, 0.1),
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
        _spike(
            at(0.02, 0.10, 0.22),
            at(-0.08, 0.15, 0.38),
            at(-0.30, 0.18, 0.48),
            radius=0.09,
            flat=0.35,
            up=(0, 1, 0.3 * side),
            relief=_fluted(7, 0.07),
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
            _spike(
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
            _spike(
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
            _spike(
                at(-0.02, 0.03 + y, z),
                at(-0.20, 0.03 + 1.5 * y, 1.5 * z + 0.03),
                at(-0.36 - 0.2 * long, 0.02 + 2.0 * y, 1.8 * z),
                at(-0.20 - long, 0.08 + 2.6 * y, 2.3 * z),
                radius=0.075,
                flat=0.45,
                up=(0, np.cos(a), -side * np.sin(a)),
                relief=_fluted(8, 0.09),
                bulge=1.15,
            )
        )
    # Beard along the jaw.
    for k in range(4):
        x = 0.08 + 0.17 * k
        y = -0.20 - 0.40 * max(x - 0.12, 0.0)
        parts.append(
            _spike(
                at(x, y, 0.10 - 0.015 * k),
                at(x - 0.10, y - 0.11, 0.14 - 0.02 * k),
                at(x - 0.20, y - 0.16, 0.15 - 0.02 * k),
                at(x - 0.34, y - 0.15, 0.17 - 0.02 * k),
                radius=0.048,
                flat=0.5,
                up=(0.5, 0.8, 0),
                relief=_fluted(6, 0.08),
            )
        )
    return parts


def _placed(tube: Tube, scale: float, rotation: FloatArray, offset: FloatArray) -> Tube:
    """A tube under a similarity: rotation (3, 3), offset (3,)."""
    return Tube(
        tube.points @ rotation.T * scale + offset,
        tube.width * scale,
        tube.height * scale,
        np.broadcast_to(tube.up, tube.points.shape) @ rotation.T,
        tube.relief,
        tube.belly,
        tube.detail,
    )


def _leg(
    hip: FloatArray, knee: FloatArray, ankle: FloatArray, foot: FloatArray, yaw: float, thigh: float
) -> list[Tube]:
    """A leg with foot, toes and claws.

    Args:
        hip: Start, inside the body, (3,).
        knee: Knee or elbow, (3,).
        ankle: Ankle or wrist, (3,).
        foot: Middle of the foot, about 0.05 over the ground, (3,).
        yaw: Direction of the toes about Y, radians from +x.
        thigh: Radius of the thigh.
    """
    path = np.array([hip, 0.6 * hip + 0.4 * knee, knee, 0.5 * (knee + ankle), ankle, foot])
    radius = thigh * np.array([0.9, 1.05, 0.66, 0.50, 0.40, 0.46])
    forward = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    parts = [Tube(path, radius * 0.92, radius, forward, _scaly(16, 0.09, 0.0), 1.0, 1.2)]
    up = np.array([0.0, 1.0, 0.0])
    for spread, reach in ((-32.0, 0.125), (0.0, 0.145), (32.0, 0.125), (178.0, 0.085)):
        angle = yaw + np.radians(spread)
        ray = np.array([np.cos(angle), 0.0, -np.sin(angle)])
        base = np.array([foot[0], 0.05, foot[2]])
        toe = np.array(
            [
                base,
                base + ray * reach * 0.45 + up * 0.015,
                base + ray * reach * 0.8 - up * 0.008,
                base + ray * reach - up * 0.022,
            ]
        )
        width = np.array([0.036, 0.033, 0.028, 0.024])
        parts.append(Tube(toe, width, width, up, _scaly(12, 0.10, 0.0), 1.0, 1.2))
        claw = base + ray * (reach + 0.002) - up * 0.018
        parts.append(
            _spike(
                claw,
                claw + ray * 0.035 + up * 0.012,
                claw + ray * 0.075 - up * 0.008,
                claw + ray * 0.088 - up * 0.031,
                radius=0.021,
                flat=0.75,
            )
        )
    # Tufts behind the elbow.
    back = normalized(knee - 0.5 * (hip + ankle))
    for k, lift in enumerate((0.03, 0.0, -0.03)):
        tip = knee + back * (0.20 - 0.03 * k) + up * (0.10 + 2.2 * lift) - forward * 0.05
        parts.append(
            _spike(
                knee + up * lift,
                knee + back * 0.09 + up * (0.02 + 1.3 * lift),
                tip,
                radius=0.036,
                flat=0.4,
                up=up,
                relief=_fluted(6, 0.08),
                bulge=1.2,
            )
        )
    return parts


def _legs() -> list[Tube]:
    """The four legs; feet on the ground under the body's arches."""

    def v(*xyz: float) -> FloatArray:
        return np.array(xyz)

    return [
        # Fore legs, at the shoulder.
        *_leg(
            v(0.44, 0.34, 0.08),
            v(0.30, 0.25, 0.25),
            v(0.47, 0.13, 0.31),
            v(0.51, 0.055, 0.32),
            -0.25,
            0.088,
        ),
        *_leg(
            v(0.40, 0.34, -0.10),
            v(0.44, 0.27, -0.33),
            v(0.60, 0.14, -0.33),
            v(0.65, 0.055, -0.33),
            0.2,
            0.088,
        ),
        # Hind legs, at the hips.
        *_leg(
            v(-0.54, 0.32, 0.24),
            v(-0.40, 0.26, 0.42),
            v(-0.58, 0.12, 0.44),
            v(-0.54, 0.055, 0.45),
            -0.2,
            0.100,
        ),
        *_leg(
            v(-0.56, 0.32, 0.06),
            v(-0.42, 0.28, -0.17),
            v(-0.62, 0.13, -0.20),
            v(-0.58, 0.055, -0.21),
            0.25,
            0.100,
        ),
    ]


def _fins() -> list[Tube]:
    """Fins along the back, lower to both ends, and the flame at the tail's tip."""
    parts = []
    t = np.linspace(0.06, 0.955, 58)
    place = spline(_BODY, t)
    ahead = spline(_BODY[:, :3], np.minimum(t + 1e-3, 1.0)) - place[:, :3]
    tangent = normalized(ahead)
    up = spline(_BODY_UP, t)
    up = normalized(up - np.einsum("ij,ij->i", up, tangent)[:, None] * tangent)
    for k in range(len(t)):
        radius = place[k, 4]
        size = 0.055 + 0.55 * radius * (1.0 if k % 2 else 0.82)
        root = place[k, :3] + up[k] * radius * 0.86
        parts.append(
            _spike(
                root,
                root + up[k] * 0.45 * size + tangent[k] * 0.05 * size,
                root + up[k] * 0.95 * size - tangent[k] * 0.25 * size,
                root + up[k] * 1.20 * size - tangent[k] * 0.85 * size,
                radius=0.36 * size + 0.008,
                flat=0.30,
                up=tangent[k],
                relief=_fluted(6, 0.07),
                bulge=1.15,
            )
        )
    tip = _BODY[0, :3]
    outward = normalized(_BODY[0, :3] - _BODY[1, :3])
    side = np.array([0.0, 0.0, 1.0])
    rise = np.array([0.0, 1.0, 0.0])
    for lift, swing, long in (
        (0.0, 0.0, 0.34),
        (0.5, 0.12, 0.27),
        (-0.5, -0.1, 0.25),
        (0.95, -0.2, 0.20),
        (-0.9, 0.2, 0.18),
    ):
        aim = normalized(outward + lift * rise + swing * side)
        parts.append(
            _spike(
                tip - outward * 0.05,
                tip + aim * 0.4 * long,
                tip + aim * 0.75 * long - lift * 0.06 * rise + 0.02 * rise,
                tip + outward * 0.25 * long + aim * 0.8 * long + 0.05 * rise,
                radius=0.05,
                flat=0.4,
                up=normalized(np.cross(aim, side)),
                relief=_fluted(7, 0.09),
                bulge=1.3,
            )
        )
    return parts


def dragon_tubes() -> list[Tube]:
    """All parts of the dragon; the body comes first."""
    body = Tube(
        _BODY[:, :3],
        _BODY[:, 3],
        _BODY[:, 4],
        _BODY_UP,
        _scaly(_SCALES_AROUND, 0.13, 0.13),
        0.94,
        1.0,
    )
    c, s = np.cos(_HEAD_PITCH), np.sin(_HEAD_PITCH)
    pitch = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    head = [_placed(tube, _HEAD_SIZE, pitch, _HEAD_ORIGIN) for tube in _head()]
    return [body, *head, *_legs(), *_fins()]


def _grids(tubes: list[Tube], triangles: int) -> list[tuple[int, int]]:
    """Rings and columns for each tube, so that the total comes close to ``triangles``."""
    extents = [tube_extent(tube) for tube in tubes]
    low, high = 0.0, 4.0 * triangles / sum(extent.weight for extent in extents)
    grids = [(4, 5)] * len(tubes)
    for _ in range(24):
        middle = 0.5 * (low + high)
        grids = [extent.grid(middle) for extent in extents]
        if sum(2 * rings * columns for rings, columns in grids) > triangles:
            high = middle
        else:
            low = middle
    columns = grids[0][1]
    rest = sum(2 * r * c for r, c in grids[1:])
    grids[0] = (max(8, round((triangles - rest) / (2 * columns))), columns)
    return grids


def dragon(triangles: int = 250_000) -> Mesh:
    """Makes the dragon.

    Args:
        triangles: How many to make, from ``MIN_TRIANGLES`` to ``MAX_TRIANGLES``; met to a percent.

    Returns:
        Closed, outward parts that run into one another, with smooth normals and uv.

    Raises:
        ValueError: The count is out of range.
    """
    if not MIN_TRIANGLES <= triangles <= MAX_TRIANGLES:
        raise ValueError(
            f"dragon triangles must be from {MIN_TRIANGLES:,} to {MAX_TRIANGLES:,}, "
            f"not {triangles:,}"
        )
    tubes = dragon_tubes()
    grids = _grids(tubes, triangles)
    mesh = merge(tube_mesh(tube, *grid) for tube, grid in zip(tubes, grids, strict=True))
    low, high = mesh.bounds
    middle = 0.5 * (low + high)
    return mesh.moved(1.0, np.array([-middle[0], -low[1], -middle[2]]))
