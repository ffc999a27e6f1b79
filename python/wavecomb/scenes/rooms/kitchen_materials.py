# SPDX-License-Identifier: Apache-2.0
"""Materials of the kitchen, mostly glossy: UsdPreviewSurface without a Wavecomb program."""

from __future__ import annotations

from wavecomb.scenes.authoring.materials import Colour, MaterialInfo, preview
from wavecomb.scenes.rooms.room_materials import MATERIALS as ROOM_MATERIALS
from wavecomb.scenes.rooms.room_materials import coated

MARBLE_METRES = 0.9
"""Edge of the area that the image ``marble`` covers in this scene, in metres."""
TILES = ("TileIvory", "TileMint", "TileJade")
"""Glaze materials of the wall tiles."""
JARS = ("Flour", "Lentils", "Paprika", "Coffee")
"""Materials of the jars' contents."""


def _metal(colour: Colour, roughness: float) -> MaterialInfo:
    return preview({"diffuseColor": colour, "metallic": 1.0, "roughness": roughness})


def _gloss(colour: Colour, roughness: float) -> MaterialInfo:
    return preview({"diffuseColor": colour, "roughness": roughness})


def _lacquer(colour: Colour) -> MaterialInfo:
    return coated(colour, 0.4, 1.0, 0.06)


_OF_THE_ROOM = (
    "WhitePaint", "CeilingPaint", "Porcelain", "Celadon", "Glass", "Apple", "Orange", "Walnut",
    "Tea",
)  # fmt: skip

MATERIALS: dict[str, MaterialInfo] = {
    **{name: ROOM_MATERIALS[name] for name in _OF_THE_ROOM},
    "Wall": preview({"diffuseColor": (0.62, 0.58, 0.50), "roughness": 0.6}),
    "FloorLight": preview({"roughness": 0.12}, {"diffuseColor": "marble"}, 1.0 / MARBLE_METRES),
    "FloorDark": _gloss((0.055, 0.058, 0.062), 0.09),
    "Counter": preview({"roughness": 0.16}, {"diffuseColor": "marble"}, 0.5 / MARBLE_METRES),
    "Grout": preview({"diffuseColor": (0.45, 0.43, 0.40), "roughness": 0.9}),
    "TileIvory": _gloss((0.74, 0.70, 0.60), 0.05),
    "TileMint": _gloss((0.50, 0.62, 0.55), 0.05),
    "TileJade": _gloss((0.12, 0.30, 0.25), 0.05),
    "LacquerBlue": _lacquer((0.022, 0.075, 0.115)),
    "LacquerCream": _lacquer((0.70, 0.65, 0.53)),
    "LacquerRed": _lacquer((0.42, 0.02, 0.018)),
    "Chrome": _metal((0.77, 0.78, 0.78), 0.04),
    "SatinSteel": _metal((0.60, 0.60, 0.59), 0.22),
    "Brass": _metal((0.89, 0.66, 0.32), 0.12),
    "Copper": _metal((0.93, 0.48, 0.32), 0.10),
    "CastIron": _gloss((0.022, 0.022, 0.024), 0.32),
    "BlackGlass": _gloss((0.006, 0.006, 0.007), 0.03),
    "BottleGreen": preview(
        {"diffuseColor": (0.05, 0.20, 0.07), "roughness": 0.02, "opacity": 0.35, "ior": 1.5}
    ),
    "Flour": _gloss((0.80, 0.76, 0.68), 0.8),
    "Lentils": _gloss((0.52, 0.20, 0.06), 0.5),
    "Paprika": _gloss((0.40, 0.045, 0.012), 0.7),
    "Coffee": _gloss((0.055, 0.026, 0.014), 0.3),
    "Board": preview({"roughness": 0.45}, {"diffuseColor": "walnut"}, 2.0),
    "Bakelite": _gloss((0.02, 0.018, 0.017), 0.12),
    "Shade": _gloss((0.75, 0.72, 0.66), 0.08),
}
"""All materials of the kitchen by name."""
