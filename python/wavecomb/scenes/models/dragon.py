# SPDX-License-Identifier: Apache-2.0
"""A procedural dragon with any number of triangles.

The dragon is eastern, without wings; its scaly body forms an S and its head is raised. This dragon
replaces the Stanford XYZRGB dragon, whose licence forbids shipping it. It consists of closed,
overlapping tubes (see ``sweep``) for body, head, jaw, limbs, claws, horns and fins. Surface relief
is evaluated at the resolution of the mesh. With more triangles, first scales appear, then keels and
growth rings of scales, then grain.

The dragon is about 2.4 scene units long and 1.6 high. It stands on y = 0 with Y up and faces +x.
"""

from __future__ import annotations

import numpy as np

from wavecomb.errors import SceneError
from wavecomb.scenes.models.dragon_head import head_tubes, spike
from wavecomb.scenes.models.mesh import FloatArray, Mesh, merge, normalized
from wavecomb.scenes.models.relief import fluted, scaly
from wavecomb.scenes.models.sweep import Tube, spline, tube_extent, tube_mesh

MIN_TRIANGLES = 10_000
MAX_TRIANGLES = 20_000_000

# Cross sections of the dragon's body from the tip of the tail to the nape. Each row contains the
# centre (x, y, z), half width, half height, and the direction (x, y, z) of the back.
_BODY = np.array(
    [
        [-0.80, 0.86, -0.10, 0.004, 0.004, 0.2, 1.0, 0.2],
        [-0.98, 0.84, -0.20, 0.020, 0.020, 0.4, 0.9, 0.0],
        [-1.12, 0.66, -0.18, 0.036, 0.038, 0.9, 0.5, 0.0],
        [-1.14, 0.42, -0.02, 0.052, 0.055, 1.0, 0.3, 0.0],
        [-1.04, 0.20, 0.15, 0.068, 0.072, 0.7, 0.9, 0.0],
        [-0.82, 0.15, 0.25, 0.088, 0.092, 0.0, 1.0, 0.0],
        [-0.60, 0.27, 0.20, 0.118, 0.125, -0.3, 1.0, 0.0],
        [-0.40, 0.45, 0.04, 0.142, 0.150, -0.3, 1.0, 0.0],
        [-0.18, 0.58, -0.14, 0.140, 0.152, 0.0, 1.0, 0.0],
        [0.04, 0.54, -0.24, 0.142, 0.152, 0.3, 1.0, 0.0],
        [0.24, 0.39, -0.18, 0.148, 0.158, 0.2, 1.0, 0.0],
        [0.42, 0.33, -0.02, 0.148, 0.158, -0.2, 1.0, 0.0],
        [0.57, 0.42, 0.12, 0.134, 0.142, -0.8, 0.7, 0.0],
        [0.60, 0.62, 0.16, 0.110, 0.116, -1.0, 0.3, 0.0],
        [0.54, 0.83, 0.10, 0.094, 0.100, -1.0, 0.2, 0.0],
        [0.58, 1.00, 0.02, 0.088, 0.092, -0.8, 0.9, 0.0],
        [0.74, 1.06, 0.00, 0.080, 0.084, -0.1, 1.0, 0.0],
    ]
)
# The two fore legs and the two hind legs of the dragon. Each row contains the points of hip, knee,
# ankle and foot, the direction of the toes, and the radius of the thigh.
_LEGS = (
    ((0.44, 0.34, 0.08), (0.30, 0.25, 0.25), (0.47, 0.13, 0.31), (0.51, 0.055, 0.32), -0.25, 0.088),
    ((0.40, 0.34, -0.10), (0.44, 0.27, -0.33), (0.60, 0.14, -0.33), (0.65, 0.055, -0.33),
     0.2, 0.088),
    ((-0.54, 0.32, 0.24), (-0.40, 0.26, 0.42), (-0.58, 0.12, 0.44), (-0.54, 0.055, 0.45),
     -0.2, 0.100),
    ((-0.56, 0.32, 0.06), (-0.42, 0.28, -0.17), (-0.62, 0.13, -0.20), (-0.58, 0.055, -0.21),
     0.25, 0.100),
)  # fmt: skip
_HEAD_ORIGIN = np.array([0.74, 1.06, 0.0])
_HEAD_SIZE = 0.46
_HEAD_PITCH = np.radians(-14.0)
_SCALES_AROUND = 24


def _placed(tube: Tube, scale: float, rotation: FloatArray, offset: FloatArray) -> Tube:
    """Rotates a tube by a matrix (3, 3), scales it and translates it by (3,)."""
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
    """Makes a leg with foot, toes and claws.

    Args:
        hip: Upper end of the leg, inside the body, (3,).
        knee: Knee or elbow, (3,).
        ankle: Ankle or wrist, (3,).
        foot: Middle of the foot, about 0.05 above the ground, (3,).
        yaw: Direction of the toes about Y, in radians from +x.
        thigh: Radius of the thigh.
    """
    path = np.array([hip, 0.6 * hip + 0.4 * knee, knee, 0.5 * (knee + ankle), ankle, foot])
    radius = thigh * np.array([0.9, 1.05, 0.66, 0.50, 0.40, 0.46])
    forward = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    parts = [Tube(path, radius * 0.92, radius, forward, scaly(16, 0.09, 0.0), 1.0, 1.2)]
    up = np.array([0.0, 1.0, 0.0])
    for spread, reach in ((-32.0, 0.125), (0.0, 0.145), (32.0, 0.125), (178.0, 0.085)):
        angle = yaw + np.radians(spread)
        ray = np.array([np.cos(angle), 0.0, -np.sin(angle)])
        base = np.array([foot[0], 0.05, foot[2]])
        toe = base + ray * reach * np.array([0.0, 0.45, 0.8, 1.0])[:, None]
        toe += np.array([0.0, 0.015, -0.008, -0.022])[:, None] * up
        width = np.array([0.036, 0.033, 0.028, 0.024])
        parts.append(Tube(toe, width, width, up, scaly(12, 0.10, 0.0), 1.0, 1.2))
        claw = base + ray * (reach + 0.002) - up * 0.018
        bends = (0.035, 0.012), (0.075, -0.008), (0.088, -0.031)
        curve = [claw + ray * out + up * rise for out, rise in bends]
        parts.append(spike(claw, *curve, radius=0.021, flat=0.75))
    # Tufts of fur behind the dragon's elbow.
    back = normalized(knee - 0.5 * (hip + ankle))
    for k, lift in enumerate((0.03, 0.0, -0.03)):
        tip = knee + back * (0.20 - 0.03 * k) + up * (0.10 + 2.2 * lift) - forward * 0.05
        middle = knee + back * 0.09 + up * (0.02 + 1.3 * lift)
        root, fold = knee + up * lift, fluted(6, 0.08)
        parts.append(
            spike(root, middle, tip, radius=0.036, flat=0.4, up=up, relief=fold, bulge=1.2)
        )
    return parts


def _legs() -> list[Tube]:
    """Makes the four legs, with feet on the ground under the body's arches."""
    parts = []
    for *joints, yaw, thigh in _LEGS:
        hip, knee, ankle, foot = np.array(joints)
        parts += _leg(hip, knee, ankle, foot, yaw, thigh)
    return parts


def _fins() -> list[Tube]:
    """Makes fins along the back, which are lower towards both ends, and the tuft of the tail."""
    parts = []
    t = np.linspace(0.06, 0.955, 58)
    place = spline(_BODY[:, :5], t)
    ahead = spline(_BODY[:, :3], np.minimum(t + 1e-3, 1.0)) - place[:, :3]
    tangent = normalized(ahead)
    up = spline(_BODY[:, 5:], t)
    up = normalized(up - np.einsum("ij,ij->i", up, tangent)[:, None] * tangent)
    for k in range(len(t)):
        radius = place[k, 4]
        size = 0.055 + 0.55 * radius * (1.0 if k % 2 else 0.82)
        root = place[k, :3] + up[k] * radius * 0.86
        bends = (0.45, 0.05), (0.95, -0.25), (1.20, -0.85)
        path = [root + up[k] * rise * size + tangent[k] * along * size for rise, along in bends]
        wide, fold = 0.36 * size + 0.008, fluted(6, 0.07)
        parts.append(
            spike(root, *path, radius=wide, flat=0.30, up=tangent[k], relief=fold, bulge=1.15)
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
        path = [
            tip - outward * 0.05,
            tip + aim * 0.4 * long,
            tip + aim * 0.75 * long - lift * 0.06 * rise + 0.02 * rise,
            tip + outward * 0.25 * long + aim * 0.8 * long + 0.05 * rise,
        ]
        broad, fold = normalized(np.cross(aim, side)), fluted(7, 0.09)
        parts.append(spike(*path, radius=0.05, flat=0.4, up=broad, relief=fold, bulge=1.3))
    return parts


def dragon_tubes() -> list[Tube]:
    """Returns all tubes of the dragon; the body is the first."""
    points, width, height, up = _BODY[:, :3], _BODY[:, 3], _BODY[:, 4], _BODY[:, 5:]
    body = Tube(points, width, height, up, scaly(_SCALES_AROUND, 0.13, 0.13), 0.94)
    c, s = np.cos(_HEAD_PITCH), np.sin(_HEAD_PITCH)
    pitch = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    head = [_placed(tube, _HEAD_SIZE, pitch, _HEAD_ORIGIN) for tube in head_tubes()]
    return [body, *head, *_legs(), *_fins()]


def _grids(tubes: list[Tube], triangles: int) -> list[tuple[int, int]]:
    """Chooses the grid of each tube so that there are about ``triangles`` triangles in total."""
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
        triangles: Number of triangles, from ``MIN_TRIANGLES`` to ``MAX_TRIANGLES``. The actual
            number differs by at most one percent.

    Returns:
        A mesh of closed, overlapping parts, with outward faces, smooth normals and texture
        coordinates.

    Raises:
        SceneError: ``triangles`` is out of range.
    """
    if not MIN_TRIANGLES <= triangles <= MAX_TRIANGLES:
        raise SceneError(
            f"dragon triangles must be from {MIN_TRIANGLES:,} to {MAX_TRIANGLES:,}, "
            f"not {triangles:,}"
        )
    tubes = dragon_tubes()
    grids = _grids(tubes, triangles)
    mesh = merge(tube_mesh(tube, *grid) for tube, grid in zip(tubes, grids, strict=True))
    low, high = mesh.bounds
    middle = 0.5 * (low + high)
    return mesh.moved(1.0, np.array([-middle[0], -low[1], -middle[2]]))
