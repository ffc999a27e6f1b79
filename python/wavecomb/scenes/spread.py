# SPDX-License-Identifier: Apache-2.0
"""A field of stones whose materials, textures, triangles and shading cost are chosen one by one.

For measuring how a renderer scales. Each stone is a mesh of its own, no instance, so that triangles
are memory. Materials are dealt at random, so that neighbours differ. Each has a texture of its own,
and the triangles of a stone lie all over it, as the charts of an atlas do: what neighbours read is
not neighbouring memory, and the more triangles are seen, the more of the texture is read.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, Vt

from wavecomb.scenes import materials as looks
from wavecomb.scenes.errors import SceneError
from wavecomb.scenes.materials import Colour, MaterialInfo
from wavecomb.scenes.mesh import Mesh, grid_faces, smooth_normals, without_flat_faces
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.stage import StageWriter
from wavecomb.scenes.textures import Image, TextureInfo, marble, weave, wood

MAX_MATERIALS = 4096
MAX_TEXTURE_MB = 4096.0
MIN_TRIANGLES = 32  # of a stone: a sphere of 4 x 4 cells
MAX_TRIANGLES = 60_000_000
MAX_COST = 1000.0
_STONES = 144
_PITCH = 2.3
_BYTES_PER_TEXEL = 4.0 * 4.0 / 3.0
"""Of 8 bit colour as the core holds it, mip levels included."""
_TILE = 8
"""Texels are stored in tiles of 8 x 8, so small textures take somewhat more than asked for."""
_CHART_TEXELS = 4
_PATTERNS = (marble, wood, weave)


def build_spread(writer: StageWriter, options: SceneOptions) -> None:
    """Fills the stage; ``SceneOptions`` says with how much."""
    _check(options)
    rng = np.random.default_rng([options.seed, 1000])
    names = [_material(writer, options, k, rng) for k in range(options.materials)]
    count = max(_STONES, options.materials)
    hands = [names[k] for _ in range(-(-count // len(names))) for k in rng.permutation(len(names))]
    side = math.ceil(math.sqrt(count))
    cells = _cells(options.triangles // count)
    edge = texture_edge(options)
    for index in range(count):
        row, column = divmod(index, side)
        place = np.array([column - 0.5 * (side - 1), 0.0, row - 0.5 * (side - 1)]) * _PITCH
        place += [rng.uniform(-0.25, 0.25), 0.0, rng.uniform(-0.25, 0.25)]
        mesh = _stone(cells, rng)
        atlas = _atlas(len(mesh.faces), edge, rng) if edge else None
        prim = _add(writer, f"/World/Objects/Stone_{index:04d}", mesh, atlas)
        UsdGeom.XformCommonAPI(prim).SetTranslate(tuple(float(v) for v in place))
        writer.bind(prim.GetPrim(), hands[index])
    _set(writer, side * _PITCH, options.aspect or 1.0)


def texture_edge(options: SceneOptions) -> int:
    """Edge of each material's texture in texels; 0 without textures."""
    if options.texture_mb <= 0.0:
        return 0
    texels = options.texture_mb * 1e6 / options.materials / _BYTES_PER_TEXEL
    return max(_TILE, round(math.sqrt(texels) / _TILE) * _TILE)


def evaluations(options: SceneOptions, index: int) -> int:
    """Of material ``index``: the last has ``shader_cost``, the first 1, geometrically between."""
    share = index / (options.materials - 1) if options.materials > 1 else 1.0
    return round(options.shader_cost**share)


def _check(options: SceneOptions) -> None:
    stones = max(_STONES, options.materials)
    for name, value, low, high in (
        ("materials", options.materials, 1, MAX_MATERIALS),
        ("programs", options.programs, 1, len(_PROGRAMS)),
        ("texture_mb", options.texture_mb, 0, MAX_TEXTURE_MB),
        ("shader_cost", options.shader_cost, 1, MAX_COST),
        ("triangles", options.triangles, stones * MIN_TRIANGLES, MAX_TRIANGLES),
    ):
        if not low <= value <= high:
            raise SceneError(f"spread: {name} must be from {low:g} to {high:g}, not {value:g}")


def _principled(colour: Colour) -> MaterialInfo:
    return looks.principled({"diffuseColor": colour, "roughness": 0.35, "ior": 1.5})


_PROGRAMS = (
    _principled,
    lambda colour: looks.diffuse(colour),
    lambda colour: looks.plastic(colour, 0.15),
    lambda colour: looks.metal(colour, 0.25),
    lambda colour: looks.dielectric(colour, 0.1),
)
"""Makers of a material from its colour; those of the first ``programs`` are used in turn."""


def _material(
    writer: StageWriter, options: SceneOptions, index: int, rng: np.random.Generator
) -> str:
    low, high = rng.uniform(0.05, 0.4), rng.uniform(0.5, 0.95)
    colour = tuple(float(v) for v in rng.permutation([low, 0.5 * (low + high), high]))
    name = f"Stone_{index:04d}"
    info = _PROGRAMS[index % options.programs]((colour[0], colour[1], colour[2]))
    edge = texture_edge(options)
    if edge:
        pattern = _PATTERNS[index % len(_PATTERNS)]

        def tinted(size: int, source: np.random.Generator) -> Image:
            grey = pattern(max(size, 16), source)[:size, :size].mean(axis=2, keepdims=True)
            return np.clip(0.2 + grey * np.array(colour), 0, 1).astype(np.float32)

        texture = f"stone_{index:04d}"
        writer.define_texture(texture, TextureInfo(tinted, edge, True))
        info = replace(info, textures={"diffuseColor": texture})
    writer.material(name, replace(info, evaluations=evaluations(options, index)))
    return name


def _cells(triangles: int) -> tuple[int, int]:
    """Rows and columns of a sphere's grid, for about so many triangles."""
    rows = max(4, round(math.sqrt(triangles / 4.0)))
    return rows, max(4, round(triangles / (2.0 * (rows - 1))))


def _stone(cells: tuple[int, int], rng: np.random.Generator) -> Mesh:
    """A closed, bumpy ball of radius about 1 that stands on y = 0.

    The relief is a sum of waves in space, so it is closed at seam and poles.
    """
    rows, columns = cells
    theta = np.linspace(0.0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0.0, 2.0 * np.pi, columns + 1)[None, :]
    unit = np.empty((rows + 1, columns + 1, 3))
    unit[:, :, 0] = np.sin(theta) * np.cos(phi)
    unit[:, :, 1] = np.cos(theta)
    unit[:, :, 2] = np.sin(theta) * np.sin(phi)
    unit[0], unit[-1], unit[:, -1] = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), unit[:, 0]
    radius = np.ones((rows + 1, columns + 1))
    for octave in range(5):
        waves = rng.normal(0.0, 1.7 * 1.8**octave, (3, 3))
        phase = rng.uniform(0.0, 2.0 * np.pi, 3)
        radius += 0.10 / 1.8**octave * np.sin(unit @ waves.T + phase).mean(axis=2)
    points = (unit * radius[:, :, None] * [1.0, 0.8, 1.0]).reshape(-1, 3)
    points[:, 1] -= points[:, 1].min()
    positions = points.astype(np.float32)
    faces = np.ascontiguousarray(grid_faces(rows + 1, columns + 1)[:, ::-1])
    normals = smooth_normals(positions, faces)
    uv = np.zeros((len(positions), 2), np.float32)
    return without_flat_faces(Mesh(positions, faces, normals, uv))


def _atlas(triangles: int, edge: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Texture coordinates of each corner, (triangles, 3, 2): every triangle in a chart of its own.

    Charts are squares of 4 x 4 texels in random order; where there are more triangles than charts,
    they share.
    """
    charts = edge // _CHART_TEXELS
    order = rng.permutation(charts * charts)
    chart = order[np.arange(triangles) % len(order)]
    origin = np.stack([chart % charts, chart // charts], axis=1)
    corners = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    return ((origin[:, None, :] + corners) / charts).astype(np.float32)


def _add(
    writer: StageWriter, path: str, mesh: Mesh, atlas: NDArray[np.float32] | None
) -> UsdGeom.Mesh:
    prim = writer.mesh(path, mesh)
    if atlas is not None:
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        primvar.SetInterpolation(UsdGeom.Tokens.faceVarying)
        primvar.Set(Vt.Vec2fArray.FromNumpy(atlas.reshape(-1, 2)))
    return prim


def _set(writer: StageWriter, width: float, aspect: float) -> None:
    """Ground, lights and camera for a field of stones so wide."""
    writer.material("Ground", looks.CHALK)
    half = 30.0 * width
    corners = np.array([[-half, 0, half], [half, 0, half], [half, 0, -half], [-half, 0, -half]])
    writer.polygons("/World/Set/Ground", corners, [[0, 1, 2, 3]], "Ground")
    writer.rect_light("Lamp", (0.0, 0.8 * width, 0.2 * width), 0.5 * width, 0.3 * width, (3, 3, 3))
    writer.dome_light("Sky", 0.0)
    writer.camera((0.0, 0.75 * width, 0.95 * width), (0.0, 0.0, 0.06 * width), 46.0, aspect)
