# SPDX-License-Identifier: Apache-2.0
"""A stage lit as most are: a key lamp, a fill lamp and a dim, even dome.

For measuring how a light is chosen. The dome gives off most of the power, as it is reckoned over
the whole stage, and little of the light: what it gives, bounces find as well.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes import materials as looks
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.stage import StageWriter
from wavecomb.scenes.teapot import teapot

_COLUMNS, _ROWS, _PITCH = 10, 9, 2.6
_GROUND_HALF = 13.5
_TEAPOT_SCALE = 0.36
_LOOKS = {
    "Clay": looks.TERRACOTTA,
    "Chalk": looks.CHALK,
    "BluePlastic": looks.BLUE_PLASTIC,
    "YellowPlastic": looks.YELLOW_PLASTIC,
    "Bronze": looks.BRONZE,
    "Copper": looks.COPPER,
}


def build_studio(writer: StageWriter, options: SceneOptions) -> None:
    """90 objects in rows on a matt floor, two lamps and a dome without a picture."""
    rng = np.random.default_rng([options.seed, 3])
    writer.material("Floor", looks.diffuse((0.35, 0.34, 0.33)))
    writer.floor("Floor", _GROUND_HALF, "Floor")
    for name, info in _LOOKS.items():
        writer.material(name, info)
    dragon = writer.prototype("Dragon", options.dragon_mesh())
    pot = writer.prototype("Teapot", teapot(options.teapot_level))
    for index in range(_COLUMNS * _ROWS):
        column, row = index % _COLUMNS, index // _COLUMNS
        x = (column - 0.5 * (_COLUMNS - 1)) * _PITCH + rng.uniform(-0.3, 0.3)
        z = (row - 0.5 * (_ROWS - 1)) * _PITCH + rng.uniform(-0.3, 0.3)
        is_pot = (column + row) % 2 == 0
        writer.instance(
            f"/World/Objects/{'Teapot' if is_pot else 'Dragon'}_{index:02d}",
            pot if is_pot else dragon,
            list(_LOOKS)[int(rng.integers(len(_LOOKS)))],
            (x, 0.0, z),
            rng.uniform(-180.0, 180.0),
            (_TEAPOT_SCALE if is_pot else 1.0) * math.exp(rng.uniform(-0.1, 0.1)),
        )
    writer.rect_light("Key", (-3.0, 11.0, 6.0), 3.0, 3.0, (13.0, 12.6, 12.0), -62.0)
    writer.rect_light("Fill", (9.0, 10.0, 14.0), 4.0, 4.0, (2.6, 2.8, 3.2), -40.0)
    writer.even_dome("Dome", 0.12)
    writer.camera((0.0, 9.0, 19.0), (0.0, 0.5, -1.0), 50.0, options.aspect or 1.0)
