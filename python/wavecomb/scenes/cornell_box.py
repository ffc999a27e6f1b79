# SPDX-License-Identifier: Apache-2.0
"""The Cornell box from the measured data of the original, and a variant with a dragon.

Source: Cornell University Program of Computer Graphics, "The Cornell Box", 1998 (geometry in
millimetres, camera at (278, 273, -800), lens 35 mm over a film of 25 mm). Colours are the usual
conversions of the measured spectra to linear RGB.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.errors import SceneError
from wavecomb.scenes.options import SceneOptions

_WHITE = materials.diffuse((0.725, 0.71, 0.68))
_RED = materials.diffuse((0.63, 0.065, 0.05))
_GREEN = materials.diffuse((0.14, 0.45, 0.091))
_RADIANCE = (17.0, 12.0, 4.0)
_LIGHT_GAP = 0.5
"""Distance of the light from the ceiling, in mm. The original ceiling has a hole for the light."""

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
    """Adds one of the two blocks: a top and four sides.

    The block stands on the floor, without a bottom.
    """
    height, foot = _BLOCKS[name]
    corners = [[x, height, z] for x, z in foot] + [[x, 0.0, z] for x, z in foot]
    sides = [[k, k + 4, (k + 1) % 4 + 4, (k + 1) % 4] for k in range(4)]
    writer.polygons(f"/World/Objects/{name}", np.array(corners), [[0, 1, 2, 3], *sides], "White")


def build_cornell(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the box with its two blocks."""
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
    """Builds the box with a dragon on its floor."""
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
