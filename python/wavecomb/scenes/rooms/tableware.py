# SPDX-License-Identifier: Apache-2.0
"""Objects on the dining table, such as cups and glasses, and kitchenware, such as pots.

Each function returns parts on y = 0 at the origin, unless its docstring says otherwise.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.models.mesh import FloatArray, Mesh
from wavecomb.scenes.models.shapes import (
    Part,
    disc,
    grounded,
    placed,
    rounded_box,
    tube,
    turn_about,
    turned,
)
from wavecomb.scenes.models.sweep import spline

SAUCER_WELL = 0.0065
"""Height at which a cup stands on its saucer."""
FRUIT = 0.037
"""Radius of apples and oranges."""
PLINTH = 0.035
"""Height of the statue's plinth."""

_BOWL = np.array(
    [[0, 0.004], [0.045, 0.004], [0.047, 0], [0.052, 0], [0.053, 0.006], [0.09, 0.03],
     [0.122, 0.068], [0.126, 0.0755], [0.123, 0.077], [0.119, 0.075], [0.087, 0.036],
     [0.05, 0.013], [0, 0.011]]
)  # fmt: skip
_BOWL_INSIDE = 8
"""Index of the first point of the profile ``_BOWL`` on the inside."""


def saucer(columns: int) -> list[Part]:
    """Makes a saucer with a well for the cup."""
    profile = [
        (0, 0.003), (0.022, 0.003), (0.023, 0), (0.028, 0), (0.030, 0.003), (0.055, 0.008),
        (0.074, 0.016), (0.0765, 0.0185), (0.074, 0.0195), (0.055, 0.0115), (0.031, 0.008),
        (0.027, SAUCER_WELL), (0.02, SAUCER_WELL), (0, SAUCER_WELL),
    ]  # fmt: skip
    return [(grounded(turned(profile, columns)), "Porcelain")]


def cup(columns: int, is_full: bool) -> list[Part]:
    """Makes a tea cup with a handle."""
    profile = [
        (0, 0.004), (0.017, 0.004), (0.018, 0), (0.022, 0), (0.023, 0.004), (0.034, 0.013),
        (0.0395, 0.033), (0.043, 0.057), (0.0435, 0.0605), (0.042, 0.0608), (0.0405, 0.057),
        (0.037, 0.034), (0.031, 0.016), (0.018, 0.009), (0, 0.008),
    ]  # fmt: skip
    body = grounded(turned(profile, columns))
    ear = [(0.0395, 0.050, 0), (0.056, 0.054, 0), (0.067, 0.042, 0), (0.058, 0.024, 0),
           (0.0365, 0.0185, 0)]  # fmt: skip
    handle = tube(ear, 0.0032, 10, 24, height=0.0042)
    parts: list[Part] = [(body, "Porcelain"), (handle, "Porcelain")]
    return [*parts, (disc(0.0395, 0.049, columns), "Tea")] if is_full else parts


def spoon(columns: int) -> list[Part]:
    """Makes a steel tea spoon that lies along x."""
    points = [(0.0, 0.0045, 0), (0.018, 0.0025, 0), (0.038, 0.004, 0), (0.055, 0.009, 0),
              (0.10, 0.0065, 0), (0.135, 0.004, 0)]  # fmt: skip
    wide = [0.004, 0.0135, 0.010, 0.0026, 0.0028, 0.005]
    tall = [0.001, 0.0016, 0.0016, 0.0018, 0.001, 0.001]
    mesh = tube(points, wide, max(8, columns // 3), 40, height=tall, up=(0.0, 1.0, 0.0))
    return [(grounded(mesh), "Steel")]


def bowl(columns: int) -> list[Part]:
    """Makes a fruit bowl."""
    return [(grounded(turned(_BOWL, 2 * columns)), "Celadon")]


def _rest_height(out: float, radius: float) -> float:
    """Returns the height of a fruit's centre in the bowl, ``out`` metres from the bowl's axis."""
    inside = spline(_BOWL, np.linspace(0.0, 1.0, 400))
    inside = inside[int(400 * _BOWL_INSIDE / (len(_BOWL) - 1)) :]
    apart = np.abs(inside[:, 0] - out)
    under = inside[apart < radius]
    reach = np.sqrt(radius**2 - apart[apart < radius] ** 2)
    return float((under[:, 1] + reach).max())


def fruit_places() -> list[FloatArray]:
    """Returns the centres of four fruits of radius ``FRUIT``: three in the bowl and one on top."""
    out = 1.02 * 2.0 * FRUIT / math.sqrt(3.0)
    low = _rest_height(out, FRUIT)
    ring = [2.0 * math.pi * k / 3.0 + 0.5 for k in range(3)]
    places = [np.array([out * math.cos(a), low, out * math.sin(a)]) for a in ring]
    top = low + math.sqrt((2.0 * FRUIT) ** 2 - out**2) - 0.001
    return [*places, np.array([0.0, top, 0.0])]


def apple(columns: int, tilt: float) -> list[Part]:
    """Makes an apple around the origin, with its stalk tilted ``tilt`` degrees from vertical."""
    r = FRUIT
    profile = [(0, -0.72 * r), (0.12 * r, -0.80 * r), (0.35 * r, -0.95 * r), (0.75 * r, -0.80 * r),
               (1.04 * r, -0.1 * r), (0.98 * r, 0.55 * r), (0.6 * r, 0.92 * r),
               (0.25 * r, 0.85 * r), (0.08 * r, 0.62 * r), (0, 0.55 * r)]  # fmt: skip
    lean = turn_about(0, tilt)
    stalk = tube([(0, 0.5 * r, 0), (0.03 * r, 0.9 * r, 0), (0.12 * r, 1.2 * r, 0)], 0.0014, 8, 8)
    return [
        (placed(turned(profile, columns), turn=lean), "Apple"),
        (placed(stalk, turn=lean), "Walnut"),
    ]


def orange(columns: int) -> list[Part]:
    """Makes an orange around the origin."""
    a = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 17)
    profile = np.column_stack([FRUIT * np.cos(a), 0.97 * FRUIT * np.sin(a)])
    profile[[0, -1], 0] = 0.0
    return [(turned(profile, columns, 1), "Orange")]


def pear(columns: int) -> list[Part]:
    """Makes a standing pear."""
    profile = [(0, 0.003), (0.012, 0), (0.03, 0.006), (0.038, 0.03), (0.030, 0.058),
               (0.019, 0.078), (0.013, 0.092), (0.004, 0.097), (0, 0.094)]  # fmt: skip
    stalk = tube([(0, 0.09, 0), (0.002, 0.105, 0), (0.007, 0.116, 0)], 0.0014, 8, 8)
    return [(grounded(turned(profile, columns)), "Pear"), (stalk, "Walnut")]


def tumbler(columns: int) -> list[Part]:
    """Makes a drinking glass with a thick foot."""
    profile = [
        (0, 0), (0.031, 0), (0.031, 0), (0.033, 0.002), (0.0375, 0.096), (0.0375, 0.0975),
        (0.0365, 0.0975), (0.036, 0.096), (0.0315, 0.013), (0.030, 0.0105), (0.028, 0.01),
        (0, 0.01),
    ]  # fmt: skip
    return [(grounded(turned(profile, 2 * columns)), "Glass")]


def vase(columns: int, rng: np.random.Generator) -> list[Part]:
    """Makes a vase with a few dry twigs."""
    profile = [
        (0, 0.004), (0.036, 0.004), (0.038, 0), (0.042, 0.002), (0.058, 0.05), (0.072, 0.11),
        (0.062, 0.17), (0.032, 0.21), (0.025, 0.235), (0.031, 0.258), (0.032, 0.262),
        (0.029, 0.262), (0.022, 0.235), (0.028, 0.21), (0.056, 0.17), (0.066, 0.11), (0.05, 0.04),
        (0, 0.012),
    ]  # fmt: skip
    parts: list[Part] = [(grounded(turned(profile, columns)), "Porcelain")]
    for twig in range(5):
        turn = 2.0 * math.pi * twig / 5.0 + rng.uniform(-0.3, 0.3)
        out = np.array([math.cos(turn), 0.0, math.sin(turn)])
        high = rng.uniform(0.42, 0.56)
        bend = [-0.03 * out + [0, 0.03, 0], 0.010 * out + [0, 0.235, 0], 0.05 * out + [0, 0.34, 0],
                rng.uniform(0.08, 0.15) * out + [0, high, 0]]  # fmt: skip
        parts.append((tube(bend, [0.0022, 0.002, 0.0016, 0.0008], 8, 24), "Walnut"))
        for bud in range(6):
            share = 0.62 + 0.38 * bud / 5.0
            place = spline(np.array(bend), np.array([share]))[0] + rng.normal(0.0, 0.003, 3)
            parts.append((_bud(place, rng), "Linen"))
    return parts


def _bud(place: FloatArray, rng: np.random.Generator) -> Mesh:
    tip = place + 0.016 * rng.normal(0.0, 1.0, 3) / math.sqrt(3.0) + [0.0, 0.010, 0.0]
    return tube([place, 0.5 * (place + tip), tip], [0.003, 0.006, 0.002], 8, 8)


def statue(dragon: Mesh) -> list[Part]:
    """Makes a bronze dragon on a marble plinth, 0.38 m long, facing +x."""
    plinth = rounded_box((-0.185, 0.0, -0.075), (0.185, PLINTH, 0.075), 0.004, 3)
    low, high = dragon.bounds
    scale = 0.36 / float(high[0] - low[0])
    middle = 0.5 * scale * (low + high)
    body = dragon.moved(scale, np.array([-middle[0], PLINTH - scale * low[1], -middle[2]]))
    return [(plinth, "Marble"), (body, "Bronze")]


POT_DEPTH = 0.11
HANGER = 0.045
"""Length of the hook that a pan hangs from."""


def jar(columns: int, content: str) -> list[Part]:
    """Makes a glass jar with a steel lid, filled to two thirds."""
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
    """Makes a pan that hangs by a hook from y = 0; its inside faces +z."""
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
    """Makes a tall tap that bends towards +z, with a lever."""
    neck = [(0, 0.0, 0), (0, 0.20, 0), (0, 0.30, 0.03), (0, 0.31, 0.10), (0, 0.27, 0.15),
            (0, 0.22, 0.155)]  # fmt: skip
    base = turned([(0, 0), (0.026, 0), (0.026, 0.004), (0.018, 0.03), (0, 0.032)], columns)
    lever = tube([(0.012, 0.05, 0), (0.04, 0.06, 0), (0.08, 0.085, 0)], 0.005, 10, 16)
    return [(tube(neck, 0.0105, 14, 60, up=(1.0, 0.0, 0.0)), "Chrome"), (base, "Chrome"),
            (lever, "Chrome")]  # fmt: skip


def pendant(columns: int, cord: float) -> list[Part]:
    """Makes an enamel lampshade that hangs from y = 0 on a cord.

    Callers put the light of the lamp 0.11 m below the end of the cord.
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
