# SPDX-License-Identifier: Apache-2.0
"""A dining room lit through a door that stands ajar.

The only light is in the next room, so that most of the visible light is indirect. Lengths are
metres. About 40 materials are UsdPreviewSurface without a Wavecomb program, as most exporters write
them. Textures repeat at the sizes of real boards, threads and grains.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.shapes import (
    Part,
    add_instance,
    add_object,
    add_prototype,
    placed,
    rounded_box,
)
from wavecomb.scenes.models.teapot import teapot
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.rooms import furniture, shell, tableware
from wavecomb.scenes.rooms.room_materials import write_materials
from wavecomb.scenes.rooms.shell import DEPTH, HEIGHT, WIDTH, build_shell

COLUMNS_A_LEVEL = 4
"""Number of cells around a body of revolution per unit of ``SceneOptions.teapot_level``."""
_LAMP = (-1.6, 3.2)
"""Coordinates x and z of the centre of the light in the next room."""
_LAMP_SIZE = (1.2, 0.6)
_RADIANCE = (1100.0, 1000.0, 860.0)
_RUG_TOP = 0.011
_TABLE = (2.2, 1.75)
_TEAPOT_SCALE = 0.04
_OBJECTS = "/World/Objects"


def build_room(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the room; ``teapot_level`` sets the resolution of bodies of revolution."""
    rng = np.random.default_rng([options.seed, 4])
    columns = max(12, COLUMNS_A_LEVEL * options.teapot_level)
    write_materials(writer, options)
    build_shell(writer, columns)
    _lamp(writer)
    _floor(writer, columns, rng)
    _table(writer, columns, options)
    _bookcase(writer, columns, options, rng)
    _walls(writer, columns)
    writer.camera((4.6, 1.5, 0.4), (1.2, 0.8, 2.6), 65.0, options.aspect or 1.5)


def _lamp(writer: StageWriter) -> None:
    """Adds a flat light panel below the ceiling of the next room."""
    x, z = _LAMP
    half_x, half_z = 0.5 * _LAMP_SIZE[0] + 0.02, 0.5 * _LAMP_SIZE[1] + 0.02
    low, high = (x - half_x, HEIGHT - 0.02, z - half_z), (x + half_x, HEIGHT + 0.01, z + half_z)
    add_object(writer, f"{_OBJECTS}/LampPanel", [(rounded_box(low, high, 0.004), "WhitePaint")])
    writer.rect_light("Panel", (x, HEIGHT - 0.022, z), *_LAMP_SIZE, _RADIANCE)


def _floor(writer: StageWriter, columns: int, rng: np.random.Generator) -> None:
    """Adds the objects on the floor."""
    x, z = _TABLE
    add_object(writer, f"{_OBJECTS}/Rug", furniture.rug(), (x, 0.0, z))
    add_object(writer, f"{_OBJECTS}/Table", furniture.table(), (x, _RUG_TOP, z))
    chair = add_prototype(writer, "Chair", furniture.chair(columns))
    seats = [(x - 0.36, z + 0.62, 176.0), (x + 0.40, z + 0.66, 192.0), (x - 0.30, z - 0.66, 14.0),
             (x - 1.02, z + 0.06, 97.0)]  # fmt: skip
    for index, (chair_x, chair_z, turn) in enumerate(seats):
        place = (chair_x, _RUG_TOP, chair_z)
        add_instance(writer, f"{_OBJECTS}/Chair_{index}", chair, place, turn)
    sofa = (2.2, 0.0, DEPTH - 0.48)
    add_object(writer, f"{_OBJECTS}/Sofa", furniture.sofa(columns), sofa, 180.0)
    cushions = [(-0.66, 0.46, "Twill", 160.0), (-0.30, 0.40, "Linen", 190.0),
                (0.64, 0.44, "Linen", 204.0)]  # fmt: skip
    for index, (along, width, material, turn) in enumerate(cushions):
        place = (sofa[0] + along, furniture.SEAT + 0.008, sofa[2] - 0.05)
        path = f"{_OBJECTS}/Cushion_{index}"
        add_object(writer, path, furniture.cushion(width, material), place, turn)
    side = (0.97, 0.0, DEPTH - 0.42)
    add_object(writer, f"{_OBJECTS}/SideTable", furniture.side_table(columns), side)
    top = (side[0] + 0.02, furniture.SIDE_TABLE_TOP, side[2] + 0.02)
    reading = _centred(shell.lying(shell.book(0.15, 0.22, 0.026, "BookRed"), 0.026, 128.0))
    add_object(writer, f"{_OBJECTS}/Book_SideTable", reading, top)
    lamp = furniture.floor_lamp(columns)
    add_object(writer, f"{_OBJECTS}/FloorLamp", lamp, (0.46, 0.0, DEPTH - 0.34))
    add_object(writer, f"{_OBJECTS}/Plant", furniture.plant(columns, rng), (0.36, 0.0, 2.0))
    add_object(writer, f"{_OBJECTS}/Ottoman", furniture.ottoman(columns), (0.70, 0.0, 0.52))


def _table(writer: StageWriter, columns: int, options: SceneOptions) -> None:
    """Adds the objects on the table."""
    top = furniture.TABLE_TOP + _RUG_TOP

    def at(x: float, z: float, up: float = 0.0) -> tuple[float, float, float]:
        return _TABLE[0] + x, top + up, _TABLE[1] + z

    pot = teapot(options.teapot_level).moved(_TEAPOT_SCALE, np.zeros(3))
    add_object(writer, f"{_OBJECTS}/Teapot", [(pot, "Glaze")], at(0.18, -0.05), 150.0)
    saucer = add_prototype(writer, "Saucer", tableware.saucer(columns))
    spoon = add_prototype(writer, "Spoon", tableware.spoon(columns))
    cups = [
        add_prototype(writer, name, tableware.cup(columns, is_full))
        for name, is_full in (("EmptyCup", False), ("FullCup", True))
    ]
    places = [(0.46, -0.20, 40.0, True), (-0.36, -0.24, -60.0, True), (0.44, 0.22, -120.0, False)]
    for index, (x, z, turn, is_full) in enumerate(places):
        add_instance(writer, f"{_OBJECTS}/Saucer_{index}", saucer, at(x, z))
        on_it = at(x, z, tableware.SAUCER_WELL)
        add_instance(writer, f"{_OBJECTS}/Cup_{index}", cups[is_full], on_it, turn)
        beside = at(x + 0.06, z + 0.10 * math.copysign(1.0, -z))
        add_instance(writer, f"{_OBJECTS}/Spoon_{index}", spoon, beside, turn - 25.0)
    bowl = (-0.26, 0.12)
    add_object(writer, f"{_OBJECTS}/Bowl", tableware.bowl(columns), at(*bowl))
    for index, (x, y, z) in enumerate(tableware.fruit_places()):
        name, fruit = ("Orange", tableware.orange(columns)) if index == 1 else (
            "Apple", tableware.apple(columns, 35.0 - 30.0 * index))  # fmt: skip
        place = at(bowl[0] + x, bowl[1] + z, y)
        add_object(writer, f"{_OBJECTS}/{name}_{index}", fruit, place, 110.0 * index)
    add_object(writer, f"{_OBJECTS}/Pear", tableware.pear(columns), at(-0.04, 0.21))
    loose = at(-0.06, 0.30, 0.97 * tableware.FRUIT)
    add_object(writer, f"{_OBJECTS}/Orange_4", tableware.orange(columns), loose)
    glass = add_prototype(writer, "Tumbler", tableware.tumbler(columns))
    for index, (x, z) in enumerate(((0.24, 0.21), (0.33, 0.28))):
        add_instance(writer, f"{_OBJECTS}/Tumbler_{index}", glass, at(x, z))
    novel = _centred(shell.lying(shell.book(0.13, 0.20, 0.022, "BookBlue"), 0.022, 24.0))
    add_object(writer, f"{_OBJECTS}/Book_Table", novel, at(-0.56, -0.02))


def _centred(parts: list[Part]) -> list[Part]:
    """Moves parts so that the centre of their common bounds is above the origin."""
    low = np.min([mesh.bounds[0] for mesh, _ in parts], axis=0)
    high = np.max([mesh.bounds[1] for mesh, _ in parts], axis=0)
    middle = 0.5 * (low + high) * [1.0, 0.0, 1.0]
    return [(placed(mesh, -middle), material) for mesh, material in parts]


_COVERS = ("BookRed", "BookBlue", "BookCream", "BookGreen", "BookOchre")
_ROWS = (
    (0, 0.0, 9, 12.0),
    (0, 0.62, 6, 0.0),
    (1, 0.0, 12, 15.0),
    (1, 0.78, 5, 10.0),
    (2, 0.0, 6, 9.0),
    (2, 0.40, 4, 0.0),
)
"""Rows of books in the bookcase: shelf (0 is the lowest), start in metres, number of books, and the
lean of the last book in degrees."""


def _bookcase(
    writer: StageWriter, columns: int, options: SceneOptions, rng: np.random.Generator
) -> None:
    """Adds the bookcase at the wall with the door, its books, and objects on top."""
    back, middle = 0.02, 1.14

    def at(along: float, height: float, out: float) -> tuple[float, float, float]:
        """Returns the world position of a point, given relative to the bookcase."""
        return back + out, height, middle - along

    add_object(writer, f"{_OBJECTS}/Bookcase", shell.bookcase(), at(0.0, 0.0, 0.0), 90.0)
    spine, number = shell.SHELF_DEPTH - 0.045, 0
    first = -0.5 * shell.SHELF_WIDTH + shell.BOARD + 0.003
    for row, start, count, lean in _ROWS:
        along, floor = first + start, shell.shelf_floor(row)
        for _ in range(count):
            height = float(rng.uniform(0.19, 0.27))
            width, thick = 0.72 * height, float(rng.uniform(0.018, 0.046))
            parts = shell.book(width, height, thick, _COVERS[int(rng.integers(len(_COVERS)))])
            place = at(along, floor, spine + float(rng.uniform(-0.02, 0.01)))
            add_object(writer, f"{_OBJECTS}/Book_{number:02d}", parts, place, 90.0)
            along += thick + 0.0008
            number += 1
        if lean:
            height, thick = 0.185, 0.027
            along += height * math.sin(math.radians(lean))
            parts = shell.leaning(shell.book(0.14, height, thick, "BookCream"), lean)
            place = at(along, floor, spine)
            add_object(writer, f"{_OBJECTS}/Book_{number:02d}", parts, place, 90.0)
            number += 1
    heap = shell.shelf_floor(2)
    for index, (size, thick, cover) in enumerate(
        ((0.26, 0.034, "BookGreen"), (0.23, 0.028, "BookRed"), (0.20, 0.022, "BookCream"))
    ):
        turn = 90.0 + (4.0, -7.0, 3.0)[index]
        parts = _centred(shell.lying(shell.book(0.7 * size, size, thick, cover), thick, turn))
        place = at(0.36, heap, 0.14)
        add_object(writer, f"{_OBJECTS}/Book_{number:02d}", parts, place)
        heap += thick
        number += 1
    top = shell.SHELF_TOP
    statue = tableware.statue(options.dragon_mesh())
    add_object(writer, f"{_OBJECTS}/Statue", statue, at(0.22, top, 0.15), 62.0)
    add_object(writer, f"{_OBJECTS}/Vase", tableware.vase(columns, rng), at(-0.38, top, 0.15))


def _walls(writer: StageWriter, columns: int) -> None:
    """Adds the pictures and the mirror on the walls."""
    pictures = [
        ("Hills", (0.86, 0.62), "Walnut", 0.06, (1.82, 1.56, DEPTH), 180.0),
        ("Fern", (0.42, 0.56), "Iron", 0.05, (2.62, 1.56, DEPTH), 180.0),
        ("Fields", (0.50, 0.66), "Brass", 0.0, (0.0, 1.86, 0.95), 90.0),
        ("Hills", (0.90, 0.66), "Iron", 0.0, (WIDTH, 1.68, 3.5), -90.0),
    ]
    for index, (image, (width, height), frame, mat, place, turn) in enumerate(pictures):
        parts = shell.picture(width, height, image, frame, mat)
        add_object(writer, f"{_OBJECTS}/Picture_{index}", parts, place, turn)
    add_object(writer, f"{_OBJECTS}/Mirror", shell.mirror(columns), (0.0, 1.62, 1.98), 90.0)
