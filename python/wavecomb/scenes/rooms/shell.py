# SPDX-License-Identifier: Apache-2.0
"""Shell of the dining room: walls, floor, ceiling, door, wall decoration and the next room.

Walls are solids that overlap each other, the floor and the ceiling, so that no ray finds a gap.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.mesh import FloatArray, Mesh
from wavecomb.scenes.models.shapes import (
    Part,
    add_object,
    disc,
    mapped_flat,
    placed,
    rounded_box,
    tube,
    turn_about,
    turned,
)

HEIGHT, WIDTH, DEPTH = 2.7, 5.0, 4.0
"""Size of the room along y, x and z, in metres."""
PARTITION = 0.12
"""Thickness of the wall with the door, which is at x < 0."""
DOOR_LOW, DOOR_HIGH, DOOR_TOP = 2.4, 3.3, 2.05
"""Extent of the doorway: start and end along z, and height."""
NEXT_X, NEXT_LOW, NEXT_HIGH = -3.2, 0.9, 4.6
"""Extent of the next room: x of its far wall, start and end along z."""
DOOR_DEGREES = 25.0
_THICK = 0.15
_INTO = 0.05
"""Overlap of adjacent solids, in metres."""
_LINING = 0.025
_LEAF = 0.04
_GAP = 0.004


def _walls(writer: StageWriter) -> None:
    t, into = _THICK, _INTO
    left, right = NEXT_X - t, WIDTH + t
    near, far = min(0.0, NEXT_LOW) - t, max(DEPTH, NEXT_HIGH) + t
    low, high = -into, HEIGHT + into
    boxes = {
        "Floor": ((left, -t, near), (right, 0.0, far), "Planks"),
        "Ceiling": ((left, HEIGHT, near), (right, HEIGHT + t, far), "CeilingPaint"),
        "WallNear": ((-into, low, -t), (right - into, high, 0.0), "Plaster"),
        "WallFar": ((-into, low, DEPTH), (right - into, high, DEPTH + t), "Plaster"),
        "WallRight": ((WIDTH, low, -into), (right, high, DEPTH + into), "Plaster"),
        "NextNear": ((left, low, NEXT_LOW - t), (-into, high, NEXT_LOW), "SagePaint"),
        "NextFar": ((left, low, NEXT_HIGH), (-into, high, NEXT_HIGH + t), "SagePaint"),
        "NextLeft": ((left, low, NEXT_LOW - into), (NEXT_X, high, NEXT_HIGH + into), "SagePaint"),
    }
    for name, (start, end, material) in boxes.items():
        _solid(writer, f"/World/Set/{name}", np.array(start), np.array(end), material)
    _partition(writer, near + into, far - into)


def _solid(
    writer: StageWriter, path: str, low: FloatArray, high: FloatArray, material: str
) -> None:
    """Adds a box of flat polygons, with texture coordinates in metres; on top, v runs along x."""
    points: list[FloatArray] = []
    uv: list[FloatArray] = []
    polygons: list[list[int]] = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        across, along = (2, 0) if axis == 1 else (c if b == 1 else b, 1)
        for side in (low, high):
            ring = np.array([low, low, low, low])
            ring[[1, 2], b], ring[[2, 3], c], ring[:, axis] = high[b], high[c], side[axis]
            ring = ring if side is high else ring[::-1]
            polygons.append([len(points) + k for k in range(4)])
            points += list(ring)
            uv += list(ring[:, [across, along]])
    writer.polygons(path, np.array(points), polygons, material, np.array(uv))


def _partition(writer: StageWriter, near: float, far: float) -> None:
    """Adds both faces of the wall with the doorway, and the reveal of the doorway.

    The outer edges of the wall are hidden inside floor and ceiling.
    """
    low, high = -_INTO, HEIGHT + _INTO
    outline = np.array(
        [
            [low, near], [low, DOOR_LOW], [DOOR_TOP, DOOR_LOW], [DOOR_TOP, DOOR_HIGH],
            [low, DOOR_HIGH], [low, far], [high, far], [high, near],
        ]
    )  # fmt: skip
    count = len(outline)
    front = np.column_stack([np.zeros(count), outline])
    back = front - [PARTITION, 0.0, 0.0]
    # The partition's outline is clockwise as seen from +x.
    polygons = [list(range(count))[::-1], list(range(count, 2 * count))]
    polygons += [[k, (k + 1) % count, count + (k + 1) % count, count + k] for k in range(count)]
    points = np.concatenate([front, back])
    uv = points[:, [2, 1]] + points[:, :1]
    writer.polygons("/World/Set/Partition", points, polygons, "Plaster", uv)


def _skirting(writer: StageWriter) -> None:
    """Adds skirting boards along the walls, up to the casing of the door."""
    height, deep, casing = 0.095, 0.016, 0.075
    runs = [
        ((0.0, 0.0), (WIDTH, deep)),
        ((0.0, DEPTH - deep), (WIDTH, DEPTH)),
        ((WIDTH - deep, 0.0), (WIDTH, DEPTH)),
        ((0.0, 0.0), (deep, DOOR_LOW - casing)),
        ((0.0, DOOR_HIGH + casing), (deep, DEPTH)),
        ((NEXT_X, NEXT_LOW), (NEXT_X + deep, NEXT_HIGH)),
        ((NEXT_X, NEXT_HIGH - deep), (-PARTITION, NEXT_HIGH)),
        ((NEXT_X, NEXT_LOW), (-PARTITION, NEXT_LOW + deep)),
    ]
    # depth in metres by which skirting boards reach into wall and floor, to avoid coincident faces
    hidden = 0.004
    boards = []
    for (x0, z0), (x1, z1) in runs:
        low, high = (x0 - hidden, -hidden, z0 - hidden), (x1 + hidden, height, z1 + hidden)
        boards.append((rounded_box(low, high, 0.005, 2), "WhitePaint"))
    add_object(writer, "/World/Set/Skirting", boards)


def _door_frame(writer: StageWriter) -> None:
    """Adds the lining of the doorway, casings on both sides, and the stop of the door."""
    deep = 0.006  # distance in metres by which the door casings project from the wall
    parts: list[Part] = []

    def board(low: tuple[float, ...], high: tuple[float, ...]) -> None:
        parts.append((rounded_box(low, high, 0.003, 2), "WhitePaint"))

    x0, x1 = -PARTITION - deep, deep
    inner_low, inner_high, top = DOOR_LOW + _LINING, DOOR_HIGH - _LINING, DOOR_TOP - _LINING
    board((x0, -0.004, DOOR_LOW - 0.004), (x1, DOOR_TOP, inner_low))
    board((x0, -0.004, inner_high), (x1, DOOR_TOP, DOOR_HIGH + 0.004))
    board((x0, top, DOOR_LOW - 0.004), (x1, DOOR_TOP + 0.004, DOOR_HIGH + 0.004))
    stop = (-PARTITION + 0.02, -_LEAF - 0.003)
    board((stop[0], -0.004, inner_low - 0.004), (stop[1], top + 0.004, inner_low + 0.012))
    board((stop[0], -0.004, inner_high - 0.012), (stop[1], top + 0.004, inner_high + 0.004))
    board((stop[0], top - 0.012, inner_low), (stop[1], top + 0.004, inner_high))
    wide, thick, show = 0.075, 0.018, 0.008
    for low, high in ((-0.004, thick), (-PARTITION - thick, -PARTITION + 0.004)):
        a, b = DOOR_LOW - wide, DOOR_LOW + show
        c, d = DOOR_HIGH - show, DOOR_HIGH + wide
        board((low, -0.004, a), (high, DOOR_TOP + wide, b))
        board((low, -0.004, c), (high, DOOR_TOP + wide, d))
        board((low + 0.001, DOOR_TOP - show, b - 0.004), (high - 0.001, DOOR_TOP + wide, c + 0.004))
    add_object(writer, "/World/Set/DoorFrame", parts)


def _door(writer: StageWriter, columns: int) -> None:
    """Adds the door with stiles, rails, two sunk panels and handles."""
    wide = DOOR_HIGH - DOOR_LOW - 2.0 * (_LINING + _GAP)
    top = DOOR_TOP - _LINING - 2.0 * _GAP
    stile, lock, sunk = 0.11, 0.95, 0.012
    parts: list[Part] = []

    def board(y0: float, y1: float, z0: float, z1: float, inset: float = 0.0) -> None:
        low, high = (-_LEAF + inset, y0, -z1), (-inset, y1, -z0)
        parts.append((rounded_box(low, high, 0.004, 2), "WhitePaint"))

    foot = 0.008
    board(foot, top, 0.0, stile)
    board(foot, top, wide - stile, wide)
    for y0, y1 in ((foot, 0.22), (lock - 0.09, lock + 0.09), (top - stile, top)):
        board(y0, y1, stile - 0.005, wide - stile + 0.005, 0.001)
    board(0.2, top - 0.1, stile - 0.005, wide - stile + 0.005, sunk)
    for y0, y1 in ((0.22, lock - 0.09), (lock + 0.09, top - stile)):
        board(y0 + 0.05, y1 - 0.05, stile + 0.05, wide - stile - 0.05, 0.004)
    parts += _handles(wide - 0.06, lock, columns)
    hinge = (0.0, 0.0, DOOR_HIGH - _LINING - _GAP)
    # A rotation about +y turns -z towards -x. The negative angle opens the door into the room (+x).
    add_object(writer, "/World/Objects/Door", parts, hinge, -DOOR_DEGREES)


def _handles(reach: float, height: float, columns: int) -> list[Part]:
    """Makes a rose and a lever on each side of the door, at a distance from the hinge."""
    rose = turned(
        [(0, -0.002), (0.026, -0.002), (0.026, -0.002), (0.027, 0.006), (0.024, 0.008),
         (0.024, 0.008), (0.009, 0.009), (0.009, 0.009), (0.009, 0.03), (0.0, 0.03)],
        columns,
    )  # fmt: skip
    parts: list[Part] = []
    for side in (1.0, -1.0):
        face = 0.0 if side > 0.0 else -_LEAF
        out = turn_about(2, -90.0 * side)
        parts.append((placed(rose, (face, height, -reach), out), "Brass"))
        lever = [(0.03, 0, 0), (0.052, 0, 0), (0.055, 0, 0.02), (0.055, 0, 0.06), (0.052, 0, 0.12)]
        path = [(face + side * x, height + y, -reach + z) for x, y, z in lever]
        parts.append((tube(path, 0.008, columns // 2, 24, up=(0.0, 1.0, 0.0)), "Brass"))
    return parts


def build_shell(writer: StageWriter, columns: int) -> None:
    """Adds walls and door; ``columns`` is the number of cells around a body of revolution."""
    _walls(writer)
    _skirting(writer)
    _door_frame(writer)
    _door(writer, columns)
    plate = rounded_box((-0.002, 1.05, 2.20), (0.009, 1.13, 2.28), 0.003)
    rocker = rounded_box((0.0, 1.07, 2.22), (0.013, 1.11, 2.26), 0.002)
    switch: list[Part] = [(plate, "WhitePaint"), (rocker, "Porcelain")]
    add_object(writer, "/World/Objects/LightSwitch", switch)


SHELF_WIDTH, SHELF_DEPTH, SHELF_TOP = 1.2, 0.29, 1.10
"""Width, depth and height of the bookcase."""
BOARD = 0.022
_BOARDS_Y = (0.07, 0.42, 0.75, SHELF_TOP - BOARD)
"""Heights of the undersides of the bookcase's boards."""


def shelf_floor(row: int) -> float:
    """Returns the height at which objects stand in a row of the bookcase; row 0 is the lowest."""
    return _BOARDS_Y[row] + BOARD


def bookcase() -> list[Part]:
    """Makes a low walnut bookcase with three rows; its back is at z = 0 and it faces +z."""
    half, deep = 0.5 * SHELF_WIDTH, SHELF_DEPTH
    panel = rounded_box((-half + 0.01, 0.06, 0.0), (half - 0.01, SHELF_TOP - 0.005, 0.008), 0.001)
    parts = []
    for k, side in enumerate((-1.0, 1.0)):
        a, b = sorted((side * half, side * (half - BOARD)))
        parts.append(
            rounded_box(
                (a, 0.0, 0.0), (b, SHELF_TOP - 0.003, deep), 0.003, uv_offset=(0.4 * k, 0.7)
            )
        )
    for k, y in enumerate(_BOARDS_Y):
        out = 0.004 if k == len(_BOARDS_Y) - 1 else -BOARD + 0.002
        front = deep if k == len(_BOARDS_Y) - 1 else deep - 0.006
        low, high = (-half - out, y, 0.002), (half + out, y + BOARD, front + max(out, 0.0))
        parts.append(rounded_box(low, high, 0.003, uv_offset=(0.13 * k, 0.31 * k)))
    plinth = rounded_box((-half + 0.01, 0.0, deep - 0.04), (half - 0.01, 0.08, deep - 0.025), 0.002)
    return [(panel, "WhitePaint"), *((mesh, "Walnut") for mesh in (*parts, plinth))]


def book(width: float, height: float, thick: float, cover: str) -> list[Part]:
    """Makes a book on y = 0, with its spine at z = 0 facing +z, and x from 0 to ``thick``."""
    board, inset = 0.0025, 0.003
    parts: list[Part] = []
    for x in (0.0, thick - board):
        parts.append((rounded_box((x, 0.0, -width), (x + board, height, -0.001), 0.001, 1), cover))
    half = 0.5 * thick
    turn = np.linspace(0.0, np.pi, 9)
    round_back = 0.16 * thick
    spine = rounded_box((0.0, 0.0, -0.004), (thick, height, round_back), round_back, 4)
    pages = rounded_box(
        (board - 0.0005, inset, -width + inset),
        (thick - board + 0.0005, height - inset, -0.002),
        0.0004,
        1,
    )
    parts += [(spine, cover), (_along_x(pages), "Pages")]
    if thick > 0.028:
        for y in (0.14 * height, 0.80 * height):
            band = 1.004 * half
            ring = np.column_stack([half + band * np.cos(turn), round_back * np.sin(turn)])
            low, high = ring.min(axis=0), ring.max(axis=0)
            parts.append(
                (rounded_box((low[0], y, -0.003), (high[0], y + 0.006, high[1] + 0.0008),
                             round_back, 4), "Brass")
            )  # fmt: skip
    return parts


def _along_x(mesh: Mesh) -> Mesh:
    """Returns the mesh with texture rows across x, since the pages are stacked along x."""
    uv = np.stack([mesh.points[:, 1] + mesh.points[:, 2], mesh.points[:, 0]], axis=1)
    return Mesh(mesh.points, mesh.faces, mesh.normals, uv.astype(np.float32))


def leaning(parts: list[Part], degrees: float) -> list[Part]:
    """Tilts a book towards -x about its lower edge at x = 0."""
    return [(placed(mesh, turn=turn_about(2, degrees)), material) for mesh, material in parts]


def lying(parts: list[Part], thick: float, turn_degrees: float) -> list[Part]:
    """Lays a book on its side with its spine towards +z, then rotates it about y."""
    turn = turn_about(1, turn_degrees) @ turn_about(2, -90.0)
    return [
        (placed(mesh, turn_about(1, turn_degrees) @ np.array([0.0, thick, 0.0]), turn), material)
        for mesh, material in parts
    ]


def picture(width: float, height: float, image: str, frame: str, mat: float) -> list[Part]:
    """Makes a framed picture that hangs at z = 0 and faces +z, centred at the origin."""
    x, y, bar, deep = 0.5 * width, 0.5 * height, 0.022, 0.026
    parts: list[Part] = []
    for side in (-1.0, 1.0):
        a, b = sorted((side * y, side * (y - bar)))
        parts.append((rounded_box((-x, a, 0.002), (x, b, deep), 0.003, 3), frame))
        a, b = sorted((side * x, side * (x - bar)))
        box = rounded_box(
            (a, -y + bar - 0.003, 0.002), (b, y - bar + 0.003, deep - 0.0005), 0.003, 3
        )
        parts.append((box, frame))
    x, y = x - bar + 0.002, y - bar + 0.002
    parts.append((rounded_box((-x, -y, 0.002), (x, y, 0.010), 0.0005, 1), "Paper"))
    x, y = x - mat, y - mat
    canvas = rounded_box((-x, -y, 0.002), (x, y, 0.0112), 0.0005, 1)
    parts.append((mapped_flat(canvas, 0, 1), image))
    return parts


def mirror(columns: int) -> list[Part]:
    """Makes a round mirror in a brass rim at z = 0 that faces +z, centred at the origin."""
    radius, rim = 0.27, 0.011
    turn = np.linspace(0.0, 2.0 * math.pi, 13)
    profile = np.column_stack([radius + rim * np.cos(turn), 0.013 + rim * np.sin(turn)])
    ring = turned(profile, 2 * columns, 1)
    # Bodies of revolution are made about y, and then turned to face +z.
    tip = turn_about(0, 90.0)
    glass = disc(radius, 0.013, 2 * columns)
    return [(placed(ring, turn=tip), "Brass"), (placed(glass, turn=tip), "Mirror")]
