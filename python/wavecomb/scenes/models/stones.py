# SPDX-License-Identifier: Apache-2.0
"""A field of stones, each a separate closed mesh, for stages that test materials."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, Vt

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.patterns import Image
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.authoring.textures import marble, weave, wood
from wavecomb.scenes.models.mesh import Mesh, grid_mesh, without_flat_faces
from wavecomb.scenes.options import SceneOptions

STONES = 144
"""Smallest number of stones in a field."""
MIN_TRIANGLES = 32
"""Smallest number of triangles of a stone: a sphere of 4 x 4 cells."""
MAX_TRIANGLES = 60_000_000
TILE = 8
"""Texture edges are rounded to a multiple of this number of texels."""
_PITCH = 2.3
_CHART_TEXELS = 4
_PATTERNS = (marble, wood, weave)


def stones_for(materials: int) -> int:
    """Returns the number of stones of a field with this number of materials."""
    return max(STONES, materials)


def check_field(scene: str, options: SceneOptions, **ranges: tuple[float, float]) -> None:
    """Raises SceneError if an option is outside of its range.

    The range of ``triangles`` is the same for all fields.
    """
    least = stones_for(options.materials) * MIN_TRIANGLES
    for name, (low, high) in {**ranges, "triangles": (least, MAX_TRIANGLES)}.items():
        value = getattr(options, name)
        if not low <= value <= high:
            raise SceneError(f"{scene}: {name} must be from {low:g} to {high:g}, not {value:g}")


def texture_edge(options: SceneOptions, bytes_per_texel: float, least: int) -> int:
    """Returns the edge in texels of textures that together take ``texture_mb``.

    Each material has ``bytes_per_texel``. Texels are stored in tiles of 8 x 8, so small textures
    take somewhat more than requested.
    """
    texels = options.texture_mb * 1e6 / options.materials / bytes_per_texel
    return max(least, round(math.sqrt(texels) / TILE) * TILE)


def grey_pattern(index: int, size: int, rng: np.random.Generator) -> Image:
    """Returns the lightness pattern of material ``index``, (size, size, 1), from about 0 to 1."""
    make = _PATTERNS[index % len(_PATTERNS)]
    return np.asarray(make(max(size, 16), rng)[:size, :size].mean(axis=2, keepdims=True))


def build_field(
    writer: StageWriter,
    names: Sequence[str],
    triangles: int,
    edge: int,
    aspect: float,
    rng: np.random.Generator,
) -> None:
    """Adds stones with randomly assigned materials, ground, lights and camera.

    Args:
        writer: Writer of the stage.
        names: Names of materials that exist in the stage.
        triangles: Number of triangles of all stones together.
        edge: Edge of the textures in texels. The triangles of a stone are scattered over the
            texture, like the charts of an atlas. 0 means no texture coordinates.
        aspect: Width / height of the image.
        rng: Source of random shapes and positions.
    """
    count = stones_for(len(names))
    hands = [names[k] for _ in range(-(-count // len(names))) for k in rng.permutation(len(names))]
    side = math.ceil(math.sqrt(count))
    cells = _cells(triangles // count)
    for index in range(count):
        row, column = divmod(index, side)
        place = np.array([column - 0.5 * (side - 1), 0.0, row - 0.5 * (side - 1)]) * _PITCH
        place += [rng.uniform(-0.25, 0.25), 0.0, rng.uniform(-0.25, 0.25)]
        mesh = _stone(cells, rng)
        atlas = _atlas(len(mesh.faces), edge, rng) if edge else None
        prim = _add(writer, f"/World/Objects/Stone_{index:04d}", mesh, atlas)
        UsdGeom.XformCommonAPI(prim).SetTranslate(tuple(float(v) for v in place))
        writer.bind(prim.GetPrim(), hands[index])
    _set(writer, side * _PITCH, aspect)


def _cells(triangles: int) -> tuple[int, int]:
    """Returns the numbers of rows and columns of a sphere with about ``triangles`` triangles."""
    rows = max(4, round(math.sqrt(triangles / 4.0)))
    return rows, max(4, round(triangles / (2.0 * (rows - 1))))


def _stone(cells: tuple[int, int], rng: np.random.Generator) -> Mesh:
    """Makes a closed, bumpy ball of radius about 1 that stands on y = 0.

    The relief is a sum of waves in space, so it is continuous at the seam and the poles.
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
    points = unit * radius[:, :, None] * [1.0, 0.8, 1.0]
    points[..., 1] -= points[..., 1].min()
    return without_flat_faces(grid_mesh(points, np.zeros((*radius.shape, 2)), reverse=True))


def _atlas(triangles: int, edge: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Returns texture coordinates of each corner, (triangles, 3, 2), one chart per triangle.

    Charts are squares of 4 x 4 texels, which the triangles use in random order. If there are more
    triangles than charts, several triangles use the same chart.
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
    """Adds ground, lights and camera for a field of a given width."""
    writer.material("Ground", materials.CHALK)
    writer.floor("Ground", 30.0 * width, "Ground")
    writer.rect_light("Lamp", (0.0, 0.8 * width, 0.2 * width), 0.5 * width, 0.3 * width, (3, 3, 3))
    writer.dome_light("Sky", 0.0)
    writer.camera((0.0, 0.75 * width, 0.95 * width), (0.0, 0.0, 0.06 * width), 46.0, aspect)
