# SPDX-License-Identifier: Apache-2.0
"""Objects of the kitchen.

Each function returns a list of parts that stand on y = 0 or hang from it.
"""

from __future__ import annotations

from wavecomb.scenes.models.groups import Part
from wavecomb.scenes.models.mesh import Mesh
from wavecomb.scenes.models.shapes import grounded, placed, rounded_box, tube, turn_about, turned

POT_DEPTH = 0.11
HANGER = 0.045
"""Length of the hook that a pan hangs from."""


def jar(columns: int, content: str) -> list[Part]:
    """Makes a glass jar, two thirds full, with a steel lid."""
    profile = [
        (0, 0), (0.044, 0), (0.044, 0), (0.047, 0.003), (0.047, 0.12), (0.042, 0.138),
        (0.042, 0.145), (0.039, 0.145), (0.039, 0.137), (0.0445, 0.12), (0.0445, 0.006),
        (0.042, 0.004), (0, 0.004),
    ]  # fmt: skip
    lid = [(0, 0.143), (0.043, 0.143), (0.043, 0.143), (0.044, 0.146), (0.044, 0.158),
           (0.042, 0.161), (0.042, 0.161), (0, 0.161)]  # fmt: skip
    fill = [(0, 0.0045), (0.044, 0.0065), (0.044, 0.0065), (0.044, 0.09), (0.044, 0.09),
            (0.02, 0.094), (0, 0.095)]  # fmt: skip
    return [
        (turned(profile, columns), "Glass"),
        (turned(lid, columns), "SatinSteel"),
        (turned(fill, columns), content),
    ]


def pot(columns: int, radius: float, material: str) -> list[Part]:
    """Makes a pot with two handles and a lid with a knob."""
    r, d = radius, POT_DEPTH * radius / 0.11
    body = [(0, 0), (r - 0.01, 0), (r - 0.004, 0.004), (r, 0.015), (r, d), (r + 0.003, d + 0.003),
            (r - 0.002, d + 0.004), (r - 0.004, d), (r - 0.004, 0.012), (0, 0.006)]  # fmt: skip
    lid = [(0, d + 0.003), (r, d + 0.003), (r, d + 0.003), (r + 0.003, d + 0.005),
           (0.6 * r, d + 0.018), (0.1 * r, d + 0.026), (0, d + 0.026)]  # fmt: skip
    knob = [(0, 0), (0.008, 0), (0.007, 0.008), (0.015, 0.016), (0.013, 0.024), (0, 0.026)]
    parts: list[Part] = [
        (turned(body, columns), material),
        (turned(lid, columns), material),
        (placed(turned(knob, columns // 2), (0.0, d + 0.025, 0.0)), "Bakelite"),
    ]
    for side in (-1.0, 1.0):
        ear = [(side * r, 0.75 * d, -0.035), (side * (r + 0.03), 0.78 * d, -0.02),
               (side * (r + 0.03), 0.78 * d, 0.02), (side * r, 0.75 * d, 0.035)]  # fmt: skip
        parts.append((tube(ear, 0.005, 10, 24, up=(0.0, 1.0, 0.0)), "Brass"))
    return parts


def hanging_pan(columns: int, radius: float, material: str) -> list[Part]:
    """Makes a pan that hangs from y = 0 by a hook, its inside towards +z."""
    r = radius
    body = [(0, 0), (r - 0.012, 0), (r - 0.004, 0.004), (r, 0.045), (r + 0.003, 0.05),
            (r - 0.003, 0.05), (r - 0.008, 0.006), (0, 0.003)]  # fmt: skip
    upright = turn_about(0, 90.0)
    long = 0.17
    middle = -HANGER - long - r
    grip = [(0.0, -HANGER, 0.02), (0.0, -HANGER - 0.5 * long, 0.028),
            (0.0, middle + r - 0.01, 0.04)]  # fmt: skip
    hook = [(0.0, -HANGER - 0.012, 0.02), (0.0, -HANGER + 0.005, 0.026), (0.0, -0.02, 0.012),
            (0.0, 0.004, 0.0), (0.0, -0.01, -0.012)]  # fmt: skip
    return [
        (placed(turned(body, columns), (0.0, middle, 0.0), upright), material),
        (tube(grip, 0.007, 10, 24, height=0.004), "CastIron"),
        (tube(hook, 0.0022, 8, 32, up=(1.0, 0.0, 0.0)), "Brass"),
    ]


def bottle(columns: int) -> list[Part]:
    """Makes an oil bottle with a cork."""
    profile = [
        (0, 0.004), (0.03, 0), (0.035, 0.004), (0.036, 0.02), (0.036, 0.15), (0.033, 0.18),
        (0.014, 0.215), (0.013, 0.27), (0.016, 0.272), (0.016, 0.282), (0.012, 0.283), (0, 0.283),
    ]  # fmt: skip
    cork = turned([(0, 0.28), (0.010, 0.28), (0.011, 0.30), (0.010, 0.302), (0, 0.302)], columns)
    return [(grounded(turned(profile, columns)), "BottleGreen"), (cork, "Board")]


def plates(columns: int, count: int) -> list[Part]:
    """Makes a pile of plates."""
    profile = [
        (0, 0.003), (0.05, 0.003), (0.052, 0), (0.058, 0), (0.06, 0.004), (0.10, 0.014),
        (0.118, 0.02), (0.12, 0.022), (0.117, 0.023), (0.098, 0.018), (0.06, 0.008), (0, 0.007),
    ]  # fmt: skip
    one = turned(profile, columns)
    return [(placed(one, (0.0, 0.0075 * k, 0.0)), "Porcelain") for k in range(count)]


def toaster() -> list[Part]:
    """Makes a chrome toaster on a bakelite foot."""
    box = rounded_box((-0.14, 0.015, -0.085), (0.14, 0.19, 0.085), 0.035, 6)
    foot = rounded_box((-0.13, 0.0, -0.075), (0.13, 0.03, 0.075), 0.008)
    slots = [
        rounded_box((-0.10, 0.18, z - 0.012), (0.10, 0.191, z + 0.012), 0.002)
        for z in (-0.03, 0.03)
    ]
    lever = rounded_box((0.135, 0.11, -0.012), (0.165, 0.125, 0.012), 0.004)
    return [(box, "Chrome"), (foot, "Bakelite"), (lever, "Bakelite"),
            *((slot, "BlackGlass") for slot in slots)]  # fmt: skip


def knives() -> list[Part]:
    """Makes a tilted block with five knives."""
    lean = turn_about(0, -18.0)
    block = placed(rounded_box((-0.05, 0.0, -0.06), (0.05, 0.20, 0.06), 0.006), turn=lean)
    parts: list[Part] = [(block, "Board")]
    for k, (x, z) in enumerate(
        ((-0.03, 0.03), (0.0, 0.03), (0.03, 0.03), (-0.02, -0.02), (0.02, -0.02))
    ):
        top = 0.29 + 0.012 * (k % 3)
        grip = rounded_box((x - 0.008, 0.2, z - 0.012), (x + 0.008, top, z + 0.012), 0.005, 3)
        parts.append((placed(grip, turn=lean), "Bakelite"))
    low = min(float(mesh.points[:, 1].min()) for mesh, _ in parts)
    return [(placed(mesh, (0.0, -low, 0.0)), material) for mesh, material in parts]


def faucet(columns: int) -> list[Part]:
    """Makes a tall tap that bends towards +z, and its lever."""
    neck = [(0, 0.0, 0), (0, 0.20, 0), (0, 0.30, 0.03), (0, 0.31, 0.10), (0, 0.27, 0.15),
            (0, 0.22, 0.155)]  # fmt: skip
    base = turned([(0, 0), (0.026, 0), (0.026, 0.004), (0.018, 0.03), (0, 0.032)], columns)
    lever = tube([(0.012, 0.05, 0), (0.04, 0.06, 0), (0.08, 0.085, 0)], 0.005, 10, 16)
    return [(tube(neck, 0.0105, 14, 60, up=(1.0, 0.0, 0.0)), "Chrome"), (base, "Chrome"),
            (lever, "Chrome")]  # fmt: skip


def pendant(columns: int, cord: float) -> list[Part]:
    """Makes an enamel lampshade that hangs from y = 0 on a cord.

    The light of the pendant belongs 0.11 m below the end of the cord.
    """
    shade = [
        (0, -0.005),
        (0.02, -0.008),
        (0.03, -0.03),
        (0.09, -0.09),
        (0.13, -0.15),
        (0.133, -0.155),
        (0.129, -0.155),
        (0.086, -0.093),
        (0.026, -0.034),
        (0, -0.012),
    ]
    body = placed(turned(shade[::-1], columns), (0.0, -cord, 0.0))
    wire = tube([(0, 0.01, 0), (0, -0.5 * cord, 0), (0, -cord, 0)], 0.003, 8, 8)
    return [(body, "Shade"), (wire, "Bakelite")]


def handle(length: float) -> Mesh:
    """Makes a handle along x that protrudes towards +z."""
    half = 0.5 * length
    bow = [(-half, 0, 0), (-half, 0, 0.02), (-half + 0.012, 0, 0.03), (0, 0, 0.032),
           (half - 0.012, 0, 0.03), (half, 0, 0.02), (half, 0, 0)]  # fmt: skip
    return tube(bow, 0.005, 10, 48, up=(0.0, 1.0, 0.0))
