# SPDX-License-Identifier: Apache-2.0
"""Objects at the room's walls: the bookcase and its books, pictures, the mirror."""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.models.groups import Part
from wavecomb.scenes.models.mesh import Mesh
from wavecomb.scenes.models.shapes import disc, mapped_flat, placed, rounded_box, turn_about, turned

SHELF_WIDTH, SHELF_DEPTH, SHELF_TOP = 1.2, 0.29, 1.10
"""Width, depth and height of the bookcase."""
BOARD = 0.022
_BOARDS_Y = (0.07, 0.42, 0.75, SHELF_TOP - BOARD)
"""Heights of the undersides of the bookcase's boards."""


def shelf_floor(row: int) -> float:
    """Returns the height on which objects stand in a row of the bookcase; row 0 is the lowest."""
    return _BOARDS_Y[row] + BOARD


def bookcase() -> list[Part]:
    """Makes a low walnut bookcase with three rows, its back at z = 0, facing +z."""
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
    """Makes a book that stands on y = 0, its spine at z = 0 towards +z, x from 0 to ``thick``."""
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
    """Returns the mesh with texture rows across x, because the pages are stacked along x."""
    uv = np.stack([mesh.points[:, 1] + mesh.points[:, 2], mesh.points[:, 0]], axis=1)
    return Mesh(mesh.points, mesh.faces, mesh.normals, uv.astype(np.float32))


def leaning(parts: list[Part], degrees: float) -> list[Part]:
    """Turns a book so that it leans towards -x on its lower edge at x = 0."""
    return [(placed(mesh, turn=turn_about(2, degrees)), material) for mesh, material in parts]


def lying(parts: list[Part], thick: float, turn_degrees: float) -> list[Part]:
    """Lays a book on its side, its spine still towards +z, and then rotates it about y."""
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
