# SPDX-License-Identifier: Apache-2.0
"""A field of stones with materials as complex and diverse as in production scenes.

Each material is a network of MaterialX nodes. The network mixes images by fractal noise, grades
their colour and drives one of eight kinds of surface, from paint to a surface with all lobes. The
first material reads one image; the last one mixes eight layers. The materials therefore differ in
shading program, lobes, textures and cost.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdShade

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.materials import Network
from wavecomb.scenes.authoring.patterns import Image
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.authoring.textures import TextureInfo
from wavecomb.scenes.models.stones import TILE, build_field, check_field, grey_pattern, texture_edge
from wavecomb.scenes.options import SceneOptions

MAX_MATERIALS = 1024
MAX_TEXTURE_MB = 8192.0
LAYERS = 8
"""Number of layers of the most complex material."""
_BYTES_PER_TEXEL = (4.0 + 4.0 + 1.0) * 4.0 / 3.0
"""Texture bytes per texel of a material, for two colour maps and a roughness map of 8 bits with mip
levels."""

Inputs = dict[str, Any]


def build_heavy(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the field; ``SceneOptions`` sets the number of materials and the texture memory."""
    if options.plain:
        raise SceneError(
            "heavy has no plain form: UsdPreviewSurface cannot say what its MaterialX networks do"
        )
    check_field("heavy", options, materials=(1, MAX_MATERIALS), texture_mb=(0.1, MAX_TEXTURE_MB))
    rng = np.random.default_rng([options.seed, 2000])
    edge = texture_edge(options, _BYTES_PER_TEXEL, 2 * TILE)
    names = [_material(writer, options, k, edge, rng) for k in range(options.materials)]
    build_field(writer, names, options.triangles, edge, options.aspect or 1.0, rng)


def layers(options: SceneOptions, index: int) -> int:
    """Returns the number of texture layers of material ``index``, from 0 to ``LAYERS``."""
    share = index / max(options.materials - 1, 1)
    return min(int((LAYERS + 1) * share), LAYERS)


_KINDS: tuple[dict[str, float | tuple[float, float]], ...] = (
    {"specular_weight": 0.5},
    {"base_metalness": 1.0, "specular_roughness_anisotropy": 0.5},
    {"coat_weight": 1.0, "coat_color": (0.7, 1.0), "coat_roughness": 0.05},
    {"base_diffuse_roughness": 0.8, "fuzz_weight": 0.8, "fuzz_roughness": 0.4},
    {"base_metalness": 1.0, "thin_film_weight": 1.0, "thin_film_thickness": (0.25, 0.7)},
    {"transmission_weight": 0.7, "specular_ior": 1.45},
    {
        "base_metalness": 0.3,
        "transmission_weight": 0.2,
        "thin_film_weight": 0.5,
        "thin_film_thickness": 0.4,
        "coat_weight": 0.6,
        "fuzz_weight": 0.3,
    },
)
"""Inputs of OpenPBR surfaces: paint, metal, lacquer, cloth, thin film, glass, and all lobes.
Materials cycle through a diffuse UsdPreviewSurface and these kinds of surface. A pair of numbers is
the range of a random value."""


def _inputs(kind: dict[str, float | tuple[float, float]], rng: np.random.Generator) -> Inputs:
    made: Inputs = {}
    for name, value in kind.items():
        if not isinstance(value, tuple):
            made[name] = ("float", value)
        elif name.endswith("color"):
            made[name] = ("color3", tuple(float(v) for v in rng.uniform(*value, 3)))
        else:
            made[name] = ("float", float(rng.uniform(*value)))
    return made


def _material(
    writer: StageWriter, options: SceneOptions, index: int, edge: int, rng: np.random.Generator
) -> str:
    name = f"Stone_{index:04d}"
    colours = rng.uniform(0.1, 0.9, (2, 3))
    maps = {}
    for which, colour in zip("ab", colours, strict=True):
        maps[which] = _define(writer, f"{name.lower()}_{which}", edge, index, colour)
    if index % (len(_KINDS) + 1) == 0:
        return writer.material(name, materials.diffuse((0.5, 0.5, 0.5), maps["a"]))
    kind = _KINDS[index % (len(_KINDS) + 1) - 1]
    maps["r"] = _define(writer, f"{name.lower()}_r", edge, index, None)
    net = Network(writer.stage, f"/World/Looks/{name}")
    colour = _layered(net, writer, maps, layers(options, index), rng)
    rough = net.node("image", "float", file=("filename", writer.texture_file(maps["r"])))
    inputs = {"base_color": colour, "specular_roughness": rough, **_inputs(kind, rng)}
    net.openpbr(**inputs)
    return writer.own_material(name, net.material)


def _define(
    writer: StageWriter, name: str, edge: int, index: int, colour: np.ndarray | None
) -> str:
    """Registers a texture for colour, or for roughness if ``colour`` is None; returns its name."""

    def made(size: int, source: np.random.Generator) -> Image:
        grey = grey_pattern(index, size, source)
        tinted = 0.1 + 0.6 * grey if colour is None else 0.2 + grey * colour
        return np.clip(tinted, 0, 1).astype(np.float32)

    channels = "r" if colour is None else "rgb"
    writer.define_texture(name, TextureInfo(made, edge, colour is not None, channels))
    return name


def _layered(
    net: Network,
    writer: StageWriter,
    maps: dict[str, str],
    count: int,
    rng: np.random.Generator,
) -> UsdShade.Output:
    """Mixes ``count`` texture layers, each weighted by fractal noise in world space."""

    def image(which: str) -> UsdShade.Output:
        return net.node("image", "color3", file=("filename", writer.texture_file(maps[which])))

    colour = image("a")
    if count == 0:
        return colour
    other = image("b")
    place = net.node("position", "vector3", space=("string", "world"))
    for layer in range(count):
        scale = float(1.5 * 1.6**layer)
        scaled = net.node("multiply", "vector3FA", in1=place, in2=("float", scale))
        cloud = net.node("fractal3d", "float", position=scaled, octaves=("integer", 2 + layer))
        mask = net.node("smoothstep", "float", in_=cloud, low=("float", -0.2), high=("float", 0.4))
        if layer % 2 == 0:
            turn = tuple(float(v) for v in rng.uniform((-0.1, 0.6, 0.8), (0.1, 1.4, 1.2)))
            top = net.node("hsvadjust", "color3", in_=other, amount=("vector3", turn))
        else:
            tint = tuple(float(v) for v in rng.uniform(0.4, 1.0, 3))
            top = net.node("multiply", "color3", in1=colour, in2=("color3", tint))
        colour = net.node("mix", "color3", fg=top, bg=colour, mix=mask)
    return colour
