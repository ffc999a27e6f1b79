# SPDX-License-Identifier: Apache-2.0
"""Stages for tests and benchmarks: the Cornell box, and 90 instanced objects with a mirror.

If ``SceneOptions.lamps`` is set, a key light, a fill light and a dim dome replace the usual lights.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.materials import MaterialInfo
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.teapot import teapot
from wavecomb.scenes.options import SceneOptions

_ROW_SIZES = (14, 13, 12, 11, 10, 9, 8, 7, 6)
"""Number of objects in each row, from the back; the 90 objects form a fan that fills the view."""
_PITCH_X = 2.65
_PITCH_Z = 2.55
_TEAPOT_SCALE = 0.36
_GROUND_HALF = 600.0
_TILE_REPEAT_LENGTH = 6.0

_TEAPOT_LOOKS: dict[str, MaterialInfo] = {
    "Porcelain": materials.PORCELAIN,
    "Copper": materials.COPPER,
    "Checker": materials.CHECKER,
    "BluePlastic": materials.BLUE_PLASTIC,
    "Marble": materials.MARBLE,
    "Walnut": materials.WALNUT,
    "Steel": materials.STEEL,
    "Terracotta": materials.TERRACOTTA,
    "Hammered": materials.HAMMERED,
    "YellowPlastic": materials.YELLOW_PLASTIC,
    "Cloth": materials.CLOTH,
    "ClearGlass": materials.CLEAR_GLASS,
}
_DRAGON_LOOKS: dict[str, MaterialInfo] = {
    "Gold": materials.GOLD,
    "Jade": materials.JADE,
    "Lacquer": materials.LACQUER,
    "Bronze": materials.BRONZE,
    "TealPlastic": materials.TEAL_PLASTIC,
    "AmberGlass": materials.AMBER_GLASS,
    "Chalk": materials.CHALK,
    "Silver": materials.SILVER,
    "Marble": materials.MARBLE,
    "FrostedGlass": materials.FROSTED_GLASS,
    "Walnut": materials.WALNUT,
    "Ember": materials.EMBER,
}


def _dealt(names: list[str], count: int, rng: np.random.Generator) -> list[str]:
    """Returns ``count`` of the given names in random order, each name equally often."""
    dealt: list[str] = []
    while len(dealt) < count:
        dealt += [names[k] for k in rng.permutation(len(names))]
    return dealt[:count]


def _set(writer: StageWriter, options: SceneOptions) -> None:
    """Adds the ground, the mirror, lights and camera."""
    writer.material("Floor", materials.FLOOR)
    half = _GROUND_HALF
    uv = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    writer.floor("Ground", half, "Floor", uv=uv / _TILE_REPEAT_LENGTH)

    writer.material("Mirror", materials.MIRROR)
    writer.material("Frame", materials.BRONZE)
    back = -(len(_ROW_SIZES) - 1) * _PITCH_Z - 3.0
    width, low, high, lean = 15.5, 0.35, 6.6, 0.15
    bottom, top = [[x, low, back] for x in (-width, width)], back + lean
    mirror = np.array([*bottom, [width, high, top], [-width, high, top]])
    writer.quad("/World/Set/Mirror", mirror, "Mirror")
    _frame(writer, mirror)

    if options.lamps:
        writer.rect_light("Key", (-7.0, 14.0, 8.0), 4.0, 4.0, (46.0, 44.0, 41.0), -52.0)
        writer.rect_light("Fill", (13.0, 11.0, 12.0), 5.0, 5.0, (5.0, 5.4, 6.2), -42.0)
        writer.even_dome("Dome", 0.12)
    else:
        writer.rect_light("Ceiling", (2.0, 15.0, -8.0), 20.0, 10.0, (2.6, 2.5, 2.35))
        writer.dome_light("Sky", 0.0)
    aspect = options.aspect or 16.0 / 9.0
    writer.camera((0.9, 5.6, 15.2), (0.0, 1.1, -9.5), 55.0, aspect)


def _frame(writer: StageWriter, mirror: np.ndarray) -> None:
    """Adds a frame and a back board for a mirror with corners (4, 3)."""
    right = mirror[1] - mirror[0]
    rise = mirror[3] - mirror[0]
    right, rise = right / np.linalg.norm(right), rise / np.linalg.norm(rise)
    normal = np.cross(right, rise)
    bar, depth = 0.35, 0.30
    for index in range(4):
        start, end = mirror[index], mirror[(index + 1) % 4]
        along = (end - start) / np.linalg.norm(end - start)
        out = np.cross(along, normal)
        # The long bars of the frame also cover its corners, to avoid coincident faces.
        cover = bar if index % 2 == 0 else 0.0
        a, b = start - along * cover, end + along * cover
        section = [
            -depth * normal,
            out * bar - depth * normal,
            out * bar + depth * normal,
            depth * normal,
        ]
        points = np.array([a + s for s in section] + [b + s for s in section])
        faces = [
            [0, 1, 2, 3],
            [7, 6, 5, 4],
            *[[k, k + 4, (k + 1) % 4 + 4, (k + 1) % 4] for k in range(4)],
        ]
        writer.polygons(f"/World/Set/Frame{index}", points, faces, "Frame")


def _build(writer: StageWriter, options: SceneOptions, with_teapots: bool) -> None:
    rng = np.random.default_rng([options.seed, 90])
    _set(writer, options)
    dragon_looks = dict(_DRAGON_LOOKS)
    if not with_teapots:
        dragon_looks.update(
            {k: _TEAPOT_LOOKS[k] for k in ("Copper", "Steel", "BluePlastic", "Terracotta")}
        )
    used = {**_TEAPOT_LOOKS, **dragon_looks} if with_teapots else dragon_looks
    for name, info in used.items():
        writer.material(name, info)
    dragon = writer.prototype("Dragon", options.dragon_mesh())
    pot = writer.prototype("Teapot", teapot(options.teapot_level)) if with_teapots else ""
    count = sum(_ROW_SIZES)
    teapot_hand = _dealt(list(_TEAPOT_LOOKS), count // 2, rng) if with_teapots else []
    dragon_hand = _dealt(list(dragon_looks), count - len(teapot_hand), rng)
    spots = [
        ((column - 0.5 * (size - 1)) * _PITCH_X, (row - len(_ROW_SIZES) + 1) * _PITCH_Z)
        for row, size in enumerate(_ROW_SIZES)
        for column in range(size)
    ]
    for index, (across, depth) in enumerate(spots):
        x = across + rng.uniform(-0.2, 0.2)
        z = depth + rng.uniform(-0.2, 0.2)
        scale = math.exp(rng.uniform(-0.13, 0.13))
        place = (x, 0.0, z)
        if with_teapots and index % 2 == 0:
            turn = rng.uniform(-180.0, 180.0)
            writer.instance(
                f"/World/Objects/Teapot_{index:02d}",
                pot,
                teapot_hand.pop(),
                place,
                turn,
                _TEAPOT_SCALE * scale,
            )
        else:
            # The dragons' heads are turned towards the camera, most of them to the right.
            turn = -38.0 + rng.uniform(-40.0, 40.0) - (104.0 if rng.random() < 0.35 else 0.0)
            writer.instance(
                f"/World/Objects/Dragon_{index:02d}", dragon, dragon_hand.pop(), place, turn, scale
            )


def build_mixed(writer: StageWriter, options: SceneOptions) -> None:
    """Builds 45 teapots and 45 dragons."""
    _build(writer, options, with_teapots=True)


def build_dragon(writer: StageWriter, options: SceneOptions) -> None:
    """Builds 90 dragons."""
    _build(writer, options, with_teapots=False)


_WHITE = materials.diffuse((0.725, 0.71, 0.68))
_RED = materials.diffuse((0.63, 0.065, 0.05))
_GREEN = materials.diffuse((0.14, 0.45, 0.091))
_RADIANCE = (17.0, 12.0, 4.0)
_LIGHT_GAP = 0.5
"""Distance of the Cornell box's light from the ceiling, in mm. The original ceiling has a hole for
the light."""

_QUADS: dict[str, tuple[str, list[list[float]]]] = {
    "Floor": ("White", [[552.8, 0, 0], [0, 0, 0], [0, 0, 559.2], [549.6, 0, 559.2]]),
    "Ceiling": ("White", [[556, 548.8, 0], [556, 548.8, 559.2], [0, 548.8, 559.2], [0, 548.8, 0]]),
    "BackWall": (
        "White",
        [[549.6, 0, 559.2], [0, 0, 559.2], [0, 548.8, 559.2], [556, 548.8, 559.2]],
    ),
    "RightWall": ("Green", [[0, 0, 559.2], [0, 0, 0], [0, 548.8, 0], [0, 548.8, 559.2]]),
    "LeftWall": ("Red", [[552.8, 0, 0], [549.6, 0, 559.2], [556, 548.8, 559.2], [556, 548.8, 0]]),
}
_BLOCKS: dict[str, tuple[float, list[list[float]]]] = {
    "ShortBlock": (165.0, [[130, 65], [82, 225], [240, 272], [290, 114]]),
    "TallBlock": (330.0, [[423, 247], [265, 296], [314, 456], [472, 406]]),
}


def _box(writer: StageWriter, aspect: float) -> None:
    """Adds the walls, the light and the camera."""
    writer.material("White", _WHITE)
    writer.material("Red", _RED)
    writer.material("Green", _GREEN)
    for name, (colour, corners) in _QUADS.items():
        writer.quad(f"/World/Set/{name}", corners, colour)
    writer.rect_light("Ceiling", (278.0, 548.8 - _LIGHT_GAP, 279.5), 130.0, 105.0, _RADIANCE)
    fov = math.degrees(2.0 * math.atan(0.5 * 25.0 / 35.0))
    writer.camera((278.0, 273.0, -800.0), (278.0, 273.0, 0.0), fov, aspect)


def _block(writer: StageWriter, name: str) -> None:
    """Adds one of the two blocks of the Cornell box as a top and four sides.

    The block stands on the floor, without a bottom.
    """
    height, foot = _BLOCKS[name]
    corners = [[x, height, z] for x, z in foot] + [[x, 0.0, z] for x, z in foot]
    sides = [[k, k + 4, (k + 1) % 4 + 4, (k + 1) % 4] for k in range(4)]
    writer.polygons(f"/World/Objects/{name}", np.array(corners), [[0, 1, 2, 3], *sides], "White")


def build_cornell(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the Cornell box with its two blocks."""
    _box(writer, options.aspect or 1.0)
    for name in _BLOCKS:
        _block(writer, name)


DRAGON_MATERIALS = {
    "gold": materials.metal((1.00, 0.71, 0.29), 0.32, (1.0, 0.94, 0.78)),
    "copper": materials.COPPER,
    "glass": materials.CLEAR_GLASS,
    "jade": materials.JADE,
}


def build_cornell_dragon(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the Cornell box with a dragon on its floor."""
    if options.material not in DRAGON_MATERIALS:
        raise SceneError(
            f"dragon material must be one of {', '.join(DRAGON_MATERIALS)}, "
            f"not {options.material!r}"
        )
    _box(writer, options.aspect or 1.0)
    mesh = options.dragon_mesh()
    writer.material("Dragon", DRAGON_MATERIALS[options.material])
    prototype = writer.prototype("Dragon", mesh)
    # The dragon faces +x. The camera looks along +z, with x to the left.
    writer.instance("/World/Objects/Dragon", prototype, "Dragon", (278.0, 0.0, 280.0), 152.0, 195.0)
