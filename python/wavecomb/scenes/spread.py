# SPDX-License-Identifier: Apache-2.0
"""A field of stones whose materials, textures, triangles and shading cost can be set separately.

The stage serves to measure how a renderer scales. Each stone is a separate mesh instead of an
instance, so that memory grows with the triangles. Materials are assigned to stones at random, so
that neighbours differ. Each material has a separate texture, over which the triangles of a stone
are scattered like the charts of an atlas. Adjacent triangles therefore read distant texels, and
each further visible triangle reads another part of the texture. Expensive materials multiply the
texture by octaves of noise, in a network of MaterialX nodes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pxr import UsdShade

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.materials import Colour, MaterialInfo, Network
from wavecomb.scenes.authoring.patterns import Image
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.authoring.textures import TextureInfo
from wavecomb.scenes.models.stones import TILE, build_field, check_field, grey_pattern, texture_edge
from wavecomb.scenes.options import SceneOptions

MAX_MATERIALS = 4096
MAX_TEXTURE_MB = 4096.0
MAX_COST = 1000.0
_OCTAVES_OF_NODE = 8
"""Largest number of octaves of one fractal noise node. Materials with more octaves sum several
nodes."""
_BYTES_PER_TEXEL = 4.0 * 4.0 / 3.0
"""Memory of a texel of 8-bit colour in the core, in bytes, including mip levels."""


def build_spread(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the field of stones with the sizes in ``SceneOptions``."""
    check_field(
        "spread",
        options,
        materials=(1, MAX_MATERIALS),
        programs=(1, len(_PROGRAMS)),
        texture_mb=(0, MAX_TEXTURE_MB),
        shader_cost=(1, MAX_COST),
    )
    if options.plain and options.shader_cost > 1.0:
        raise SceneError(
            "spread has no plain form of a shader_cost above 1: that is a MaterialX network's noise"
        )
    rng = np.random.default_rng([options.seed, 1000])
    names = [_material(writer, options, k, rng) for k in range(options.materials)]
    build_field(writer, names, options.triangles, _edge(options), options.aspect or 1.0, rng)


def _edge(options: SceneOptions) -> int:
    """Returns the edge of each material's texture in texels, or 0 if there are no textures."""
    return texture_edge(options, _BYTES_PER_TEXEL, TILE) if options.texture_mb > 0.0 else 0


def octaves(options: SceneOptions, index: int) -> int:
    """Returns the number of noise octaves that material ``index`` has.

    The number of octaves grows geometrically from 1 for the first material, which means no noise,
    to ``shader_cost`` for the last.
    """
    share = index / (options.materials - 1) if options.materials > 1 else 1.0
    return round(options.shader_cost**share)


def _principled(colour: Colour) -> MaterialInfo:
    return materials.principled({"diffuseColor": colour, "roughness": 0.35, "ior": 1.5})


_PROGRAMS = (
    _principled,
    lambda colour: materials.diffuse(colour),
    lambda colour: materials.plastic(colour, 0.15),
    lambda colour: materials.metal(colour, 0.25),
    lambda colour: materials.dielectric(colour, 0.1),
)
"""Functions that make a material from a colour. Materials cycle through the first
``SceneOptions.programs`` functions."""


def _material(
    writer: StageWriter, options: SceneOptions, index: int, rng: np.random.Generator
) -> str:
    low, high = rng.uniform(0.05, 0.4), rng.uniform(0.5, 0.95)
    colour = tuple(float(v) for v in rng.permutation([low, 0.5 * (low + high), high]))
    name = f"Stone_{index:04d}"
    info = _PROGRAMS[index % options.programs]((colour[0], colour[1], colour[2]))
    texture = _texture(writer, index, edge, colour) if (edge := _edge(options)) else None
    count = octaves(options, index)
    if count == 1:
        textures = {"diffuseColor": texture} if texture else {}
        return writer.material(name, replace(info, textures=textures))
    writer.material(name, info)
    _lay_noise(writer, f"/World/Looks/{name}", texture, count)
    return name


def _texture(writer: StageWriter, index: int, edge: int, colour: tuple[float, ...]) -> str:
    """Registers a texture with a pattern in the given colour; returns the texture's name."""

    def tinted(size: int, source: np.random.Generator) -> Image:
        grey = grey_pattern(index, size, source)
        return np.clip(0.2 + grey * np.array(colour), 0, 1).astype(np.float32)

    texture = f"stone_{index:04d}"
    writer.define_texture(texture, TextureInfo(tinted, edge, True))
    return texture


def _lay_noise(writer: StageWriter, path: str, texture: str | None, count: int) -> None:
    """Multiplies the colour of a UsdPreviewSurface by noise."""
    net = Network(writer.stage, path)
    surface = UsdShade.Shader.Get(writer.stage, f"{path}/Surface")
    colour = surface.GetInput("diffuseColor")
    place = net.node("position", "vector3", space=("string", "world"))
    shade: UsdShade.Output | None = None
    for first in range(0, count, _OCTAVES_OF_NODE):
        there = net.node("add", "vector3FA", in1=place, in2=("float", 1.7 * first))
        few = min(_OCTAVES_OF_NODE, count - first)
        cloud = net.node("fractal3d", "float", position=there, octaves=("integer", few))
        shade = cloud if shade is None else net.node("add", "float", in1=shade, in2=cloud)
    veins = net.node("smoothstep", "float", in_=shade, low=("float", -1.5), high=("float", 0.5))
    plain = (
        net.node("image", "color3", file=("filename", writer.texture_file(texture)))
        if texture
        else ("color3", tuple(colour.Get()))
    )
    colour.ConnectToSource(net.node("multiply", "color3FA", in1=plain, in2=veins))
