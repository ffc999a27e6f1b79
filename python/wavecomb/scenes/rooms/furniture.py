# SPDX-License-Identifier: Apache-2.0
"""Furniture of the room: table, chairs, sofa, ottoman, lamp, side table, rug, plant.

Each function returns the parts of a piece of furniture on y = 0 at the origin, facing +z.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.models.mesh import Mesh
from wavecomb.scenes.models.shapes import (
    Part,
    disc,
    mapped_flat,
    pillow,
    placed,
    rounded_box,
    tapered,
    tube,
    turn_about,
    turned,
)
from wavecomb.scenes.rooms.textures import RUG_METRES

TABLE_TOP = 0.74
"""Height of the table."""
SIDE_TABLE_TOP = 0.52
SEAT = 0.45
"""Height of a sofa's or chair's seat."""
_TABLE = (1.5, 0.86)


def _leg(x: float, z: float, height: float, width: float, foot: float, seed: int) -> Mesh:
    half = 0.5 * width
    box = rounded_box(
        (-half, 0.0, -half), (half, height, half), 0.006, uv_offset=(0.37 * seed, 0.21 * seed)
    )
    return placed(tapered(box, foot), (x, 0.0, z))


def table() -> list[Part]:
    """Makes a dining table of walnut."""
    x, z = 0.5 * _TABLE[0], 0.5 * _TABLE[1]
    parts = [rounded_box((-x, TABLE_TOP - 0.032, -z), (x, TABLE_TOP, z), 0.008, 3)]
    low, high, inset = TABLE_TOP - 0.12, TABLE_TOP - 0.03, 0.07
    for sign in (-1.0, 1.0):
        a, b = sorted((sign * (z - inset), sign * (z - inset - 0.022)))
        parts.append(rounded_box((-x + 0.1, low, a), (x - 0.1, high, b), 0.003))
        a, b = sorted((sign * (x - inset), sign * (x - inset - 0.022)))
        parts.append(rounded_box((a, low, -z + 0.1), (b, high, z - 0.1), 0.003))
    for k, (sx, sz) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
        parts.append(_leg(sx * (x - 0.085), sz * (z - 0.085), TABLE_TOP - 0.02, 0.066, 0.55, k))
    return [(mesh, "Walnut") for mesh in parts]


def chair(columns: int) -> list[Part]:
    """Makes a chair with a leather seat that faces +z."""
    half, deep, thick = 0.21, 0.21, 0.035
    parts: list[Part] = []
    for k, side in enumerate((-1.0, 1.0)):
        parts.append((_leg(side * (half - 0.022), deep - 0.022, 0.44, 0.042, 0.65, k), "Walnut"))
        x = side * (half - 0.02)
        back = [(x, 0.0, -deep - 0.05), (x, 0.25, -deep + 0.005), (x, 0.45, -deep + 0.015),
                (x, 0.68, -deep - 0.02), (x, 0.88, -deep - 0.075)]  # fmt: skip
        post = tube(back, [0.013, 0.017, 0.02, 0.018, 0.013], columns // 2, 24)
        low = float(post.points[:, 1].min())
        parts.append((placed(post, (0.0, -low, 0.0)), "Walnut"))
        rail = rounded_box((x - 0.011, 0.375, -deep), (x + 0.011, 0.43, deep - 0.03), 0.003)
        parts.append((rail, "Walnut"))
    for z in (-deep + 0.012, deep - 0.024):
        rail = rounded_box((-half + 0.03, 0.375, z - 0.011), (half - 0.03, 0.43, z + 0.011), 0.003)
        parts.append((rail, "Walnut"))
    for height, back_z, tall in ((0.80, -0.262, 0.034), (0.66, -0.225, 0.02), (0.56, -0.203, 0.02)):
        bow = [(-half + 0.03, height, back_z), (-0.08, height, back_z - 0.018),
               (0.08, height, back_z - 0.018), (half - 0.03, height, back_z)]  # fmt: skip
        slat = tube(bow, 0.009, columns // 2, 20, height=tall, up=(0.0, 1.0, -0.12))
        parts.append((slat, "Walnut"))
    seat = rounded_box(
        (-half, SEAT - thick, -deep + 0.03), (half, SEAT, deep), 0.016, 4, (0.0, 0.012, 0.0)
    )
    parts.append((seat, "Leather"))
    return parts


def sofa(columns: int) -> list[Part]:
    """Makes a sofa for two, 1.9 m wide, with a wooden foot at each corner; it faces +z."""
    half, deep, arm = 0.95, 0.43, 0.15
    inner = half - arm
    body = [
        rounded_box((-half + 0.02, 0.13, -deep + 0.02), (half - 0.02, 0.30, deep - 0.02), 0.02, 3),
        rounded_box((-half + 0.05, 0.2, -deep), (half - 0.05, 0.78, -deep + 0.2), 0.05, 5,
                    (0.0, 0.01, 0.015)),
    ]  # fmt: skip
    for side in (-1.0, 1.0):
        a, b = sorted((side * inner, side * half))
        body.append(
            rounded_box((a, 0.13, -deep + 0.01), (b, 0.60, deep), 0.05, 5, (0.012, 0.008, 0.01))
        )
        low, high = sorted((side * 0.004, side * (inner + 0.005)))
        seat = rounded_box(
            (low, 0.29, -deep + 0.17), (high, SEAT, deep + 0.015), 0.045, 5, (0.0, 0.022, 0.012)
        )
        cushion = rounded_box(
            (low + 0.01, 0.0, -0.075), (high - 0.01, 0.40, 0.075), 0.06, 5, (0.0, 0.015, 0.045)
        )
        body += [seat, placed(cushion, (0.0, SEAT - 0.01, -deep + 0.30), turn_about(0, -12.0))]
    parts: list[Part] = [(mesh, "Wool") for mesh in body]
    foot = turned([(0, 0), (0.016, 0), (0.016, 0), (0.028, 0.14), (0, 0.14)], columns)
    for sx in (-1.0, 1.0):
        for sz in (-1.0, 1.0):
            parts.append((placed(foot, (sx * (half - 0.09), 0.0, sz * (deep - 0.08))), "Walnut"))
    return parts


def cushion(width: float, material: str) -> list[Part]:
    """Makes a cushion that leans back slightly, faces +z and rests on its lower edge."""
    lean = turn_about(0, -24.0)
    mesh = placed(pillow(width, width, 0.36 * width), turn=lean)
    return [(placed(mesh, (0.0, -float(mesh.points[:, 1].min()), 0.0)), material)]


def ottoman(columns: int) -> list[Part]:
    """Makes a round leather ottoman on a wooden ring."""
    radius, height = 0.29, 0.40
    body = turned(
        [(0, 0.035), (radius - 0.02, 0.035), (radius - 0.02, 0.035), (radius, 0.06),
         (radius + 0.008, 0.2), (radius, height - 0.06), (radius - 0.004, height - 0.035),
         (radius - 0.03, height - 0.006), (radius - 0.12, height + 0.008), (0, height + 0.012)],
        2 * columns,
    )  # fmt: skip
    welt = _ring(radius - 0.001, height - 0.045, 0.006, columns)
    base = turned(
        [(0, 0), (radius - 0.05, 0), (radius - 0.05, 0), (radius - 0.045, 0.04), (0, 0.04)], columns
    )
    return [(body, "Leather"), (welt, "Leather"), (base, "Walnut")]


def _ring(radius: float, height: float, thick: float, columns: int) -> Mesh:
    """Makes a torus about y."""
    turn = np.linspace(0.0, 2.0 * np.pi, 13)
    profile = np.column_stack([radius + thick * np.cos(turn), height + thick * np.sin(turn)])
    return turned(profile, 2 * columns, 1)


def floor_lamp(columns: int) -> list[Part]:
    """Makes a floor lamp that emits no light: brass foot and pole, a linen shade and a bulb."""
    foot = turned(
        [(0, 0), (0.15, 0), (0.15, 0), (0.152, 0.012), (0.14, 0.02), (0.03, 0.03), (0.014, 0.05),
         (0.011, 0.10), (0.011, 1.42), (0.011, 1.42), (0, 1.42)],
        columns,
    )  # fmt: skip
    low, high, r0, r1, thick = 1.30, 1.58, 0.225, 0.15, 0.0025
    shade = turned(
        [(r0 - thick, low), (r0 - thick, low), (r0, low), (r0, low), (r1, high), (r1, high),
         (r1 - thick, high), (r1 - thick, high), (r0 - thick, low), (r0 - thick, low)],
        2 * columns,
    )  # fmt: skip
    bulb = turned(
        [(0, 1.40), (0.014, 1.40), (0.016, 1.43), (0.03, 1.47), (0.03, 1.50), (0, 1.525)], columns
    )
    spokes: list[Part] = [
        (tube([(0, 1.415, 0), (0.105 * math.cos(a), 1.42, 0.105 * math.sin(a)),
               (0.203 * math.cos(a), 1.385, 0.203 * math.sin(a))], 0.003, 8, 8, up=(0, 1, 0)),
         "Brass")
        for a in (0.3, 0.3 + 2.0 * math.pi / 3.0, 0.3 + 4.0 * math.pi / 3.0)
    ]  # fmt: skip
    return [(foot, "Brass"), (shade, "Linen"), (bulb, "Porcelain"), *spokes]


def side_table(columns: int) -> list[Part]:
    """Makes a side table with a round marble top on a brass column."""
    top, radius = SIDE_TABLE_TOP, 0.215
    slab = turned(
        [(0, top - 0.022), (radius - 0.004, top - 0.022), (radius - 0.004, top - 0.022),
         (radius, top - 0.018), (radius, top - 0.004), (radius - 0.004, top),
         (radius - 0.004, top), (0, top)],
        2 * columns,
    )  # fmt: skip
    column = turned(
        [(0, 0), (0.14, 0), (0.14, 0), (0.14, 0.01), (0.14, 0.01), (0.03, 0.016), (0.014, 0.04),
         (0.014, top - 0.06), (0.03, top - 0.03), (0.06, top - 0.02), (0, top - 0.02)],
        columns,
    )  # fmt: skip
    return [(slab, "Marble"), (column, "Brass")]


def rug() -> list[Part]:
    """Makes a knotted rug."""
    x, z = 0.5 * RUG_METRES[0], 0.5 * RUG_METRES[1]
    mesh = rounded_box((-x, 0.0, -z), (x, 0.011, z), 0.005, 2)
    return [(mapped_flat(mesh, 0, 2), "Rug")]


def plant(columns: int, rng: np.random.Generator) -> list[Part]:
    """Makes a rubber plant in a terracotta pot."""
    pot = turned(
        [(0, 0), (0.10, 0), (0.10, 0), (0.135, 0.22), (0.135, 0.22), (0.155, 0.222), (0.158, 0.27),
         (0.156, 0.276), (0.143, 0.276), (0.14, 0.27), (0.13, 0.20), (0, 0.20)],
        columns,
    )  # fmt: skip
    parts: list[Part] = [(pot, "Terracotta"), (disc(0.136, 0.25, columns), "Soil")]
    for stem in range(3):
        lean = 2.1 * stem + 0.4
        foot = np.array([0.03 * math.cos(lean), 0.24, 0.03 * math.sin(lean)])
        rise = np.array([0.11 * math.cos(lean), 0.72 - 0.13 * stem, 0.11 * math.sin(lean)])
        tip = foot + rise
        parts.append((tube([foot, 0.5 * (foot + tip) - [0.01, 0, 0.01], tip], 0.006, 8), "Leaf"))
        for leaf in range(8 - stem):
            share = 0.28 + 0.72 * leaf / (7.0 - stem)
            turn = 2.4 * leaf + stem + rng.uniform(-0.25, 0.25)
            start = foot + share * (tip - foot)
            parts.append((_leaf(start, turn, 0.25 - 0.08 * share, 0.9 * share, rng), "Leaf"))
    return parts


def _leaf(
    start: np.ndarray, turn: float, length: float, lift: float, rng: np.random.Generator
) -> Mesh:
    """Makes a leaf on a short stalk that rises by ``lift`` and then bends down."""
    out = np.array([math.cos(turn), 0.0, math.sin(turn)])
    rise = np.array([0.0, 0.45 + 0.9 * (lift + rng.uniform(-0.1, 0.1)), 0.0])
    steps = ((0.0, 0.0), (0.25, 0.24), (0.5, 0.40), (0.78, 0.36), (1.0, 0.18))
    points = [start + length * (s * out + y * rise) for s, y in steps]
    width = length * np.array([0.012, 0.10, 0.21, 0.16, 0.0])
    return tube(
        points, list(width), 12, 16, height=[0.002, 0.002, 0.0015, 0.0012, 0.0], up=(0, 1, 0)
    )
