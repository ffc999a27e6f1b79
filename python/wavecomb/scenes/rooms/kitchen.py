# SPDX-License-Identifier: Apache-2.0
"""A kitchen with mostly glossy materials: lacquer, glaze, marble, steel, copper, glass.

Light comes from strips below the wall cupboards, three pendants and the sky in a window. Lengths
are metres. Materials are UsdPreviewSurface without a Wavecomb program, as most exporters write
them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.shapes import (
    Part,
    add_instance,
    add_object,
    add_prototype,
    placed,
    rounded_box,
    tube,
    turn_about,
)
from wavecomb.scenes.models.teapot import teapot
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.rooms import tableware
from wavecomb.scenes.rooms.room_materials import JARS, TILES, write_textures
from wavecomb.scenes.rooms.room_materials import KITCHEN_MATERIALS as MATERIALS

_WIDTH, _DEPTH, _HEIGHT = 3.8, 3.4, 2.6
_THICK, _INTO = 0.12, 0.02
_TOP = 0.92
"""Height of the worktop."""
_SLAB, _COUNTER = 0.03, 0.62
"""Thickness and depth of the worktop."""
_SHELF, _HIGH = 1.45, 2.25
"""Lower and upper edge of the wall cupboards."""
_CUPBOARD = 0.34
_WINDOW = (1.35, 2.55, 1.12, 2.12)
"""Extent of the window: lowest and highest x, lowest and highest y."""
_TILE, _GAP = 0.10, 0.003
_OBJECTS = "/World/Objects"
_TEAPOT_SCALE = 0.036
_FRIDGE = 0.72


@dataclass(frozen=True)
class _Run:
    """A row of cupboards along a wall, with its position and rotation about Y in degrees."""

    name: str
    place: tuple[float, float, float]
    turn: float


_BACK = _Run("Back", (0.0, 0.0, 0.0), 0.0)
_LEFT = _Run("Left", (0.0, 0.0, _DEPTH), 90.0)


def build_kitchen(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the kitchen; ``teapot_level`` sets the resolution of bodies of revolution."""
    rng = np.random.default_rng([options.seed, 7])
    columns = max(12, 4 * options.teapot_level)
    write_textures(writer, options)
    for name, material in MATERIALS.items():
        writer.material(name, material)
    _walls(writer)
    _tiles(writer, rng)
    _cupboards(writer)
    _appliances(writer, columns)
    _things(writer, columns, options)
    _lamps(writer, columns)
    writer.camera((3.05, 1.62, 3.05), (1.12, 1.05, 0.35), 66.0, options.aspect or 1.5)


def _walls(writer: StageWriter) -> None:
    """Adds walls as overlapping solids, a floor of slabs, and the window's frame."""
    t, into = _THICK, _INTO
    x0, x1, y0, y1 = _WINDOW
    boxes: dict[str, tuple[tuple[float, ...], tuple[float, ...], str]] = {
        "Ceiling": ((-t, _HEIGHT, -t), (_WIDTH + t, _HEIGHT + t, _DEPTH + t), "CeilingPaint"),
        "WallLeft": ((-t, -into, -t), (0.0, _HEIGHT + into, _DEPTH + t), "Wall"),
        "WallRight": ((_WIDTH, -into, -t), (_WIDTH + t, _HEIGHT + into, _DEPTH + t), "Wall"),
        "WallFront": ((-into, -into, _DEPTH), (_WIDTH + into, _HEIGHT + into, _DEPTH + t), "Wall"),
        "BackLeft": ((-into, -into, -t), (x0, _HEIGHT + into, 0.0), "Wall"),
        "BackRight": ((x1, -into, -t), (_WIDTH + into, _HEIGHT + into, 0.0), "Wall"),
        "BackLow": ((x0 - into, -into, -t), (x1 + into, y0, 0.0), "Wall"),
        "BackHigh": ((x0 - into, y1, -t), (x1 + into, _HEIGHT + into, 0.0), "Wall"),
        "FloorBed": ((-t, -t, -t), (_WIDTH + t, -0.012, _DEPTH + t), "Grout"),
    }
    for name, (low, high, material) in boxes.items():
        add_object(writer, f"/World/Set/{name}", [(rounded_box(low, high, 0.001, 1), material)])
    frame: list[Part] = []
    bar, z = 0.05, (-0.09, -0.04)
    middle = 0.5 * (x0 + x1)
    for low, high in (
        ((x0 - 0.01, y0), (x0 + bar, y1)), ((x1 - bar, y0), (x1 + 0.01, y1)),
        ((x0, y0 - 0.01), (x1, y0 + bar)), ((x0, y1 - bar), (x1, y1 + 0.01)),
        ((middle - 0.5 * bar, y0), (middle + 0.5 * bar, y1)),
    ):  # fmt: skip
        frame.append((rounded_box((*low, z[0]), (*high, z[1]), 0.006), "WhitePaint"))
    sill = rounded_box((x0 - 0.03, y0 - 0.025, -0.1), (x1 + 0.03, y0 + 0.006, 0.03), 0.006)
    add_object(writer, f"{_OBJECTS}/Window", [*frame, (sill, "Counter")])
    edge = 0.38
    slabs = [
        add_prototype(writer, f"Slab{name}", [
            (rounded_box((0.001, -0.02, 0.001), (edge - 0.001, 0.0, edge - 0.001), 0.002), name)])
        for name in ("FloorLight", "FloorDark")
    ]  # fmt: skip
    for i in range(10):
        for k in range(9):
            place = (i * edge, 0.0, k * edge)
            add_instance(writer, f"/World/Set/Slab_{i}_{k}", slabs[(i + k) % 2], place)


def _tiles(writer: StageWriter, rng: np.random.Generator) -> None:
    """Adds glazed tiles between worktop and wall cupboards, each slightly tilted at random."""
    half = 0.5 * (_TILE - _GAP)
    body = rounded_box((-half, -half, -0.004), (half, half, 0.005), 0.0018, 2)
    kinds = [add_prototype(writer, name, [(body, name)]) for name in TILES]
    rows = int((_SHELF - _TOP) / _TILE) + 1
    number = 0
    for run, length in ((_BACK, _WIDTH), (_LEFT, _DEPTH)):
        for i in range(int(length / _TILE)):
            for k in range(rows):
                x, y = (i + 0.5) * _TILE, _TOP + (k + 0.5) * _TILE
                hole = _WINDOW[0] - 0.08 < x < _WINDOW[1] + 0.08 and y > _WINDOW[2] - 0.06
                if y + half > _SHELF or (run is _BACK and hole):
                    continue
                kind = kinds[int(rng.choice(3, p=(0.62, 0.26, 0.12)))]
                out = 0.004 + float(rng.uniform(0.0, 0.0015))
                place, turn = _on(run, (x, y, out)), run.turn + float(rng.normal(0.0, 0.35))
                add_instance(writer, f"/World/Set/Tile_{number}", kind, place, turn)
                number += 1


def _on(run: _Run, at: tuple[float, float, float]) -> tuple[float, float, float]:
    """Converts a position relative to a row of cupboards to world space."""
    turned = turn_about(1, run.turn) @ np.array(at)
    x, y, z = turned + np.array(run.place)
    return float(x), float(y), float(z)


def _put(writer: StageWriter, name: str, run: _Run, parts: list[Part]) -> None:
    add_object(writer, f"{_OBJECTS}/{run.name}{name}", parts, run.place, run.turn)


def _front(
    x0: float, x1: float, y0: float, y1: float, z: float, look: str, grip: str
) -> list[Part]:
    """Makes a door or drawer front with handle, for a cupboard whose front is at depth z."""
    gap = 0.002
    door = rounded_box((x0 + gap, y0 + gap, z - 0.002), (x1 - gap, y1 - gap, z + 0.02), 0.004, 3)
    wide = x1 - x0
    if grip == "drawer":
        bar = placed(tableware.handle(min(0.6 * wide, 0.3)), (0.5 * (x0 + x1), y1 - 0.06, z + 0.02))
    else:
        upright = placed(tableware.handle(0.16), turn=turn_about(2, 90.0))
        side = x1 - 0.05 if grip == "right" else x0 + 0.05
        high = y1 - 0.14 if z > 0.5 else y0 + 0.14
        bar = placed(upright, (side, high, z + 0.02))
    return [(door, look), (bar, "Brass")]


def _low(x0: float, x1: float, fronts: int, look: str) -> list[Part]:
    """Makes a floor cupboard with one door or several drawers."""
    deep, foot = _COUNTER - 0.04, 0.1
    body = rounded_box((x0, foot, 0.0), (x1, _TOP - _SLAB, deep - 0.002), 0.001, 1)
    plinth = rounded_box((x0, -0.002, 0.0), (x1, foot, deep - 0.06), 0.001, 1)
    parts: list[Part] = [(body, "WhitePaint"), (plinth, "Bakelite")]
    top = _TOP - _SLAB - 0.004
    if fronts == 1:
        return [*parts, *_front(x0, x1, foot, top, deep, look, "left")]
    step = (top - foot) / fronts
    for k in range(fronts):
        y = foot + k * step
        parts += _front(x0, x1, y, y + step, deep, look, "drawer")
    return parts


def _high(x0: float, x1: float, look: str, grip: str) -> list[Part]:
    """Makes a wall cupboard with a door."""
    body = rounded_box((x0, _SHELF, 0.0), (x1, _HIGH, _CUPBOARD), 0.001, 1)
    return [(body, "WhitePaint"), *_front(x0, x1, _SHELF, _HIGH, _CUPBOARD, look, grip)]


def _cupboards(writer: StageWriter) -> None:
    """Adds cupboards, worktops and the sink."""
    low: list[Part] = []
    for x0, x1, fronts in ((0.62, 1.22, 3), (1.22, 1.62, 1), (1.62, 2.30, 2), (2.30, 2.98, 3)):
        low += _low(x0, x1, fronts, "LacquerBlue")
    _put(writer, "Low", _BACK, low)
    end = _WIDTH - _FRIDGE - 0.06
    sink = (1.55, 2.25, 0.14, 0.54)
    x0, x1, z0, z1 = sink
    y0, y1 = _TOP - _SLAB, _TOP
    slabs = [
        ((0.0, y0, 0.0), (x0, y1, _COUNTER)), ((x1, y0, 0.0), (end, y1, _COUNTER)),
        ((x0 - 0.001, y0, 0.0), (x1 + 0.001, y1, z0)),
        ((x0 - 0.001, y0, z1), (x1 + 0.001, y1, _COUNTER)),
    ]  # fmt: skip
    tops: list[Part] = [(rounded_box(a, b, 0.003, 2), "Counter") for a, b in slabs]
    wall, deep = 0.006, 0.19
    basin = [
        ((x0 - wall, y0 - deep, z0 - wall), (x1 + wall, y0 - deep + wall, z1 + wall)),
        ((x0 - wall, y0 - deep, z0 - wall), (x0, y1 - 0.001, z1 + wall)),
        ((x1, y0 - deep, z0 - wall), (x1 + wall, y1 - 0.001, z1 + wall)),
        ((x0 - wall, y0 - deep, z0 - wall), (x1 + wall, y1 - 0.001, z0)),
        ((x0 - wall, y0 - deep, z1), (x1 + wall, y1 - 0.001, z1 + wall)),
    ]
    tops += [(rounded_box(a, b, 0.002, 1), "SatinSteel") for a, b in basin]
    _put(writer, "Top", _BACK, tops)
    left: list[Part] = []
    for x0, x1, fronts in ((0.5, 1.1, 3), (1.1, 1.75, 1), (2.35, 2.78, 3)):
        left += _low(x0, x1, fronts, "LacquerBlue")
    corner = rounded_box((2.78, 0.1, 0.0), (_DEPTH, y0, _COUNTER - 0.05), 0.001, 1)
    slab = rounded_box((0.5, y0, 0.0), (_DEPTH - _COUNTER, y1, _COUNTER), 0.003, 2)
    _put(writer, "Low", _LEFT, [*left, (corner, "LacquerBlue")])
    _put(writer, "Top", _LEFT, [(slab, "Counter")])
    high: list[Part] = []
    for x0, x1, grip in ((0.36, 0.80, "right"), (0.80, 1.26, "left"), (2.64, 3.02, "left")):
        high += _high(x0, x1, "LacquerCream", grip)
    _put(writer, "High", _BACK, high)
    high = []
    for x0, x1, grip in ((0.6, 1.18, "right"), (1.18, 1.72, "left"), (2.42, 3.04, "right")):
        high += _high(x0, x1, "LacquerCream", grip)
    _put(writer, "High", _LEFT, high)


def _appliances(writer: StageWriter, columns: int) -> None:
    """Adds stove and hood in the left row, the refrigerator in the corner, and the tap."""
    x0, x1, deep = 1.75, 2.35, _COUNTER
    stove: list[Part] = [
        (rounded_box((x0, 0.06, 0.0), (x1, _TOP - _SLAB, deep - 0.03), 0.002), "SatinSteel"),
        (rounded_box((x0 + 0.03, 0.16, deep - 0.04), (x1 - 0.03, 0.70, deep - 0.015), 0.006, 3),
         "BlackGlass"),
        (rounded_box((x0 + 0.02, _TOP - 0.002, 0.04), (x1 - 0.02, _TOP + 0.004, deep - 0.04),
                     0.002), "BlackGlass"),
    ]  # fmt: skip
    bar = tube([(x0 + 0.06, 0.74, deep + 0.01), (x1 - 0.06, 0.74, deep + 0.01)], 0.009, 12, 8)
    stove.append((bar, "Chrome"))
    for k in range(4):
        knob = placed(
            rounded_box((-0.02, -0.02, 0.0), (0.02, 0.02, 0.025), 0.012, 4),
            (x0 + 0.12 + 0.12 * k, 0.81, deep - 0.032),
        )
        stove.append((knob, "Bakelite"))
    _put(writer, "Stove", _LEFT, stove)
    hood: list[Part] = [
        (rounded_box((x0 - 0.03, 1.55, 0.0), (x1 + 0.03, 1.61, 0.5), 0.004), "SatinSteel"),
        (rounded_box((x0 + 0.14, 1.60, 0.0), (x1 - 0.14, _HEIGHT + 0.01, 0.27), 0.004),
         "SatinSteel"),
    ]  # fmt: skip
    _put(writer, "Hood", _LEFT, hood)
    cold0, cold1 = _WIDTH - _FRIDGE, _WIDTH - 0.01
    fridge: list[Part] = [
        (rounded_box((cold0, 0.03, 0.02), (cold1, 1.86, 0.62), 0.01, 3), "Bakelite"),
        (rounded_box((cold0, 0.06, 0.60), (cold1, 1.12, 0.66), 0.012, 3), "LacquerRed"),
        (rounded_box((cold0, 1.13, 0.60), (cold1, 1.86, 0.66), 0.012, 3), "LacquerRed"),
    ]
    for y in (0.86, 1.32):
        upright = placed(tableware.handle(0.26), turn=turn_about(2, 90.0))
        fridge.append((placed(upright, (cold0 + 0.06, y, 0.66)), "Chrome"))
    _put(writer, "Fridge", _BACK, fridge)
    add_object(writer, f"{_OBJECTS}/Tap", tableware.faucet(columns), _on(_BACK, (1.9, _TOP, 0.075)))


def _things(writer: StageWriter, columns: int, options: SceneOptions) -> None:
    """Adds the objects on the worktops and on the wall."""

    def put(
        name: str, parts: list[Part], run: _Run, x: float, z: float, turn: float = 0.0,
        up: float = 0.0,
    ) -> None:  # fmt: skip
        place = _on(run, (x, _TOP + up, z))
        add_object(writer, f"{_OBJECTS}/{name}", parts, place, run.turn + turn)

    for k, content in enumerate(JARS):
        put(f"Jar{content}", tableware.jar(columns, content), _BACK, 0.78 + 0.115 * k, 0.12)
    put("Toaster", tableware.toaster(), _BACK, 0.98, 0.36, 14.0)
    put("Plates", tableware.plates(columns, 7), _BACK, 1.36, 0.34)
    put("Bottle", tableware.bottle(columns), _BACK, 1.30, 0.13)
    kettle = teapot(options.teapot_level).moved(_TEAPOT_SCALE, np.zeros(3))
    put("Kettle", [(kettle, "Copper")], _LEFT, 2.22, 0.16, 30.0, 0.004)
    put("PotSmall", tableware.pot(columns, 0.085, "SatinSteel"), _LEFT, 1.91, 0.46, 20.0, 0.004)
    put("PotLarge", tableware.pot(columns, 0.12, "LacquerRed"), _LEFT, 1.92, 0.17, 90.0, 0.004)
    put("Knives", tableware.knives(), _LEFT, 2.52, 0.17, 8.0)
    bowl = (2.5, 0.34)
    put("Bowl", tableware.bowl(columns), _BACK, *bowl)
    for k, (x, y, z) in enumerate(tableware.fruit_places()):
        fruit = tableware.orange(columns) if k % 2 else tableware.apple(columns, 30.0 - 25.0 * k)
        put(f"Fruit{k}", fruit, _BACK, bowl[0] + x, bowl[1] + z, 90.0 * k, y)
    glass = add_prototype(writer, "Tumbler", tableware.tumbler(columns))
    for k, (x, z) in enumerate(((2.78, 0.22), (2.87, 0.30), (2.74, 0.33), (2.33, 0.12))):
        add_instance(writer, f"{_OBJECTS}/Tumbler{k}", glass, _on(_BACK, (x, _TOP, z)))
    cup = add_prototype(writer, "Cup", tableware.cup(columns, True))
    saucer = add_prototype(writer, "Saucer", tableware.saucer(columns))
    for k, (x, z, turn) in enumerate(((1.30, 0.40, 200.0), (1.52, 0.30, 130.0))):
        add_instance(writer, f"{_OBJECTS}/Saucer{k}", saucer, _on(_LEFT, (x, _TOP, z)))
        well = _on(_LEFT, (x, _TOP + tableware.SAUCER_WELL, z))
        add_instance(writer, f"{_OBJECTS}/Cup{k}", cup, well, turn)
    board = rounded_box((-0.17, 0.0, -0.012), (0.17, 0.30, 0.012), 0.01, 3)
    put("Board", [(placed(board, turn=turn_about(0, -12.0)), "Board")], _LEFT, 1.0, 0.10)
    rail, high = 1.40, (0.075, 0.095, 0.085)
    bar = tube([(2.38, rail, 0.06), (3.1, rail, 0.06)], 0.006, 12, 8)
    _put(writer, "Rail", _LEFT, [(bar, "Brass")])
    for k, radius in enumerate(high):
        pan = tableware.hanging_pan(columns, radius, ("Copper", "CastIron", "SatinSteel")[k])
        place = _on(_LEFT, (2.66 + 0.19 * k, rail + 0.002, 0.06))
        add_object(writer, f"{_OBJECTS}/Pan{k}", pan, place, _LEFT.turn)


def _lamps(writer: StageWriter, columns: int) -> None:
    """Adds light strips below the wall cupboards, pendant lamps, and the sky outside."""
    warm, white = (75.0, 62.0, 46.0), (60.0, 52.0, 40.0)
    strips = ((0.80, 0.0), (2.83, 0.0))
    for k, (x, _) in enumerate(strips):
        place = _on(_BACK, (x, _SHELF - 0.004, 0.20))
        writer.rect_light(f"Strip{k}", place, 0.36, 0.03, warm)
    for k, x in enumerate((1.16, 2.73)):
        place = _on(_LEFT, (x, _SHELF - 0.004, 0.20))
        writer.rect_light(f"Strip{2 + k}", place, 0.03, 0.5, warm)
    cord = 0.62
    shade = add_prototype(writer, "Pendant", tableware.pendant(columns, cord))
    for k, (x, z) in enumerate(((1.35, 1.55), (2.0, 1.85), (2.65, 2.15))):
        add_instance(writer, f"{_OBJECTS}/Pendant{k}", shade, (x, _HEIGHT, z))
        writer.sphere_light(f"Bulb{k}", (x, _HEIGHT - cord - 0.11, z), 0.05, white)
    writer.dome_light("Sky", 200.0, 6.0)
