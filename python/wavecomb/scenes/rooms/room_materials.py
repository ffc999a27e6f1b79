# SPDX-License-Identifier: Apache-2.0
"""Materials of the dining room and the kitchen, as UsdPreviewSurface without a Wavecomb program."""

from __future__ import annotations

from wavecomb.scenes.authoring.materials import Colour, MaterialInfo, preview
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.authoring.textures import TextureInfo
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.rooms import textures as images

MARBLE_METRES = 0.45
"""Edge of the area that the texture ``marble`` covers in the dining room, in metres."""
_FULL_SIZE = 2048
_MIN_SIZE = 16

ROOM_TEXTURES = {
    "plaster": TextureInfo(images.plaster, 1024, True),
    "plaster_normal": TextureInfo(images.plaster_normal, 1024, False, "rgb", True),
    "planks": TextureInfo(images.planks, 2048, True),
    "planks_roughness": TextureInfo(images.planks_roughness, 2048, False, "r"),
    "walnut": TextureInfo(images.walnut, 1024, True),
    "linen": TextureInfo(images.linen, 1024, True),
    "wool": TextureInfo(images.wool, 1024, True),
    "weave_normal": TextureInfo(images.weave_normal, 1024, False, "rgb", True),
    "leather_normal": TextureInfo(images.leather_normal, 1024, False, "rgb", True),
    "rug": TextureInfo(images.rug, 2048, True),
    "pages": TextureInfo(images.pages, 256, True),
    "hills": TextureInfo(images.hills, 1024, True),
    "fields": TextureInfo(images.fields, 1024, True),
    "fern": TextureInfo(images.fern, 1024, True),
}
"""Textures that only the dining room uses, in addition to ``textures.TEXTURES``."""

_PLASTER = 1.0 / images.PLASTER_METRES
_WEAVE = 1.0 / images.LINEN_METRES
_LEATHER = 1.0 / images.LEATHER_METRES
_WALNUT = 1.0 / images.WALNUT_METRES


def coated(
    colour: Colour,
    roughness: float,
    coat: float,
    coat_roughness: float,
    textures: dict[str, str] | None = None,
    repeat: float = 1.0,
) -> MaterialInfo:
    """Makes a coloured surface under a clear coat.

    ``textures`` and ``repeat`` have the same meaning as in ``preview``.
    """
    values: dict[str, float | int | Colour] = {
        "diffuseColor": colour,
        "roughness": roughness,
        "clearcoat": coat,
        "clearcoatRoughness": coat_roughness,
    }
    return preview(values, textures, repeat)


MATERIALS: dict[str, MaterialInfo] = {
    "Plaster": preview(
        {"roughness": 0.9}, {"diffuseColor": "plaster", "normal": "plaster_normal"}, _PLASTER
    ),
    "SagePaint": preview({"diffuseColor": (0.33, 0.38, 0.33), "roughness": 0.8}),
    "CeilingPaint": preview({"diffuseColor": (0.82, 0.81, 0.79), "roughness": 0.95}),
    "WhitePaint": preview({"diffuseColor": (0.76, 0.75, 0.72), "roughness": 0.32}),
    "Planks": preview(
        {}, {"diffuseColor": "planks", "roughness": "planks_roughness"}, 1.0 / images.PLANKS_METRES
    ),
    "Walnut": preview({"roughness": 0.38}, {"diffuseColor": "walnut"}, _WALNUT),
    "Wool": preview({"roughness": 0.9}, {"diffuseColor": "wool", "normal": "weave_normal"}, _WEAVE),
    "Linen": preview(
        {"roughness": 0.9}, {"diffuseColor": "linen", "normal": "weave_normal"}, _WEAVE
    ),
    "Twill": preview({"roughness": 0.85}, {"diffuseColor": "weave"}, 1.0 / 0.12),
    "Rug": preview({"roughness": 1.0}, {"diffuseColor": "rug"}),
    "Leather": coated((0.19, 0.072, 0.028), 0.5, 0.5, 0.22, {"normal": "leather_normal"}, _LEATHER),
    "Marble": preview({"roughness": 0.14}, {"diffuseColor": "marble"}, 1.0 / MARBLE_METRES),
    "Porcelain": preview({"diffuseColor": (0.80, 0.79, 0.76), "roughness": 0.06}),
    "Glaze": preview({"roughness": 0.05}, {"diffuseColor": "glaze"}),
    "Celadon": coated((0.17, 0.30, 0.25), 0.35, 1.0, 0.04),
    "Terracotta": preview({"diffuseColor": (0.47, 0.19, 0.10), "roughness": 0.8}),
    "Brass": preview({"diffuseColor": (0.89, 0.69, 0.34), "metallic": 1.0, "roughness": 0.22}),
    "Bronze": preview({"diffuseColor": (0.55, 0.36, 0.20), "metallic": 1.0, "roughness": 0.34}),
    "Steel": preview(
        {"diffuseColor": (0.62, 0.61, 0.60), "metallic": 1.0}, {"roughness": "brushed"}, 10.0
    ),
    "Iron": preview({"diffuseColor": (0.03, 0.03, 0.032), "roughness": 0.45}),
    "Mirror": preview({"diffuseColor": (0.93, 0.94, 0.94), "metallic": 1.0, "roughness": 0.0}),
    "Glass": preview(
        {"diffuseColor": (1.0, 1.0, 1.0), "roughness": 0.0, "ior": 1.5, "opacity": 0.0}
    ),
    "Paper": preview({"diffuseColor": (0.80, 0.78, 0.72), "roughness": 0.9}),
    "Pages": preview({"roughness": 0.95}, {"diffuseColor": "pages"}, 20.0),
    "BookRed": preview({"diffuseColor": (0.36, 0.05, 0.04), "roughness": 0.6}),
    "BookBlue": preview({"diffuseColor": (0.04, 0.09, 0.20), "roughness": 0.55}),
    "BookGreen": preview({"diffuseColor": (0.05, 0.14, 0.08), "roughness": 0.6}),
    "BookOchre": preview({"diffuseColor": (0.55, 0.33, 0.08), "roughness": 0.6}),
    "BookCream": preview({"diffuseColor": (0.66, 0.60, 0.47), "roughness": 0.5}),
    "Apple": coated((0.46, 0.045, 0.035), 0.35, 0.6, 0.12),
    "Orange": preview(
        {"diffuseColor": (0.78, 0.27, 0.02), "roughness": 0.38}, {"normal": "leather_normal"}, 12.0
    ),
    "Pear": preview({"diffuseColor": (0.50, 0.46, 0.08), "roughness": 0.42}),
    "Leaf": preview({"diffuseColor": (0.055, 0.15, 0.035), "roughness": 0.36}),
    "Soil": preview({"diffuseColor": (0.05, 0.033, 0.022), "roughness": 1.0}),
    "Tea": preview({"diffuseColor": (0.14, 0.045, 0.01), "roughness": 0.0, "ior": 1.33}),
    "Hills": preview({"roughness": 0.55}, {"diffuseColor": "hills"}),
    "Fields": preview({"roughness": 0.6}, {"diffuseColor": "fields"}),
    "Fern": preview({"roughness": 0.8}, {"diffuseColor": "fern"}),
}
"""All materials of the dining room by name."""


def write_textures(writer: StageWriter, options: SceneOptions) -> None:
    """Registers the textures of the dining room, so that materials can use them."""
    for name, info in ROOM_TEXTURES.items():
        size = max(_MIN_SIZE, info.size * options.texture_size // _FULL_SIZE)
        scaled = TextureInfo(info.make, size, info.colour, info.channels, info.normal)
        writer.define_texture(name, scaled)


def write_materials(writer: StageWriter, options: SceneOptions) -> None:
    """Adds all materials and the textures that they read."""
    write_textures(writer, options)
    for name, material in MATERIALS.items():
        writer.material(name, material)


KITCHEN_MARBLE_METRES = 0.9
"""Edge of the area that the texture ``marble`` covers in the kitchen, in metres."""
TILES = ("TileIvory", "TileMint", "TileJade")
"""Names of the glaze materials of the wall tiles."""
JARS = ("Flour", "Lentils", "Paprika", "Coffee")
"""Names of the materials inside the jars."""


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

KITCHEN_MATERIALS: dict[str, MaterialInfo] = {
    **{name: MATERIALS[name] for name in _OF_THE_ROOM},
    "Wall": preview({"diffuseColor": (0.62, 0.58, 0.50), "roughness": 0.6}),
    "FloorLight": preview(
        {"roughness": 0.12}, {"diffuseColor": "marble"}, 1.0 / KITCHEN_MARBLE_METRES
    ),
    "FloorDark": _gloss((0.055, 0.058, 0.062), 0.09),
    "Counter": preview(
        {"roughness": 0.16}, {"diffuseColor": "marble"}, 0.5 / KITCHEN_MARBLE_METRES
    ),
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
