# SPDX-License-Identifier: Apache-2.0
"""Three glasses on a table, for nested dielectrics.

Each drink overlaps its glass, and the priorities of the materials determine the boundary.
"""

from __future__ import annotations

import numpy as np

from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.material_network import Network
from wavecomb.scenes.authoring.materials import Colour
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.mesh import FloatArray
from wavecomb.scenes.models.shapes import placed, turned
from wavecomb.scenes.options import SceneOptions

_RADIUS, _HEIGHT, _WALL, _FOOT = 3.0, 10.5, 0.32, 1.0
_OVERLAP = 0.1
"""Overlap of drink and glass, in centimetres."""
_DRINKS: tuple[tuple[str, tuple[float, float, float], float, Colour, Colour, float], ...] = (
    ("Cordial", (-8.0, 0.0, -1.0), 8.2, (0.0, 0.0, 0.0), (0.08, 0.9, 0.75), 0.0),
    ("Juice", (0.0, 0.0, 0.5), 8.8, (1.6, 1.3, 0.7), (0.01, 0.16, 1.3), 0.6),
    ("Milk", (8.0, 0.0, -1.0), 7.0, (4.0, 4.2, 4.5), (0.001, 0.003, 0.012), 0.5),
)
"""Name, position and level of each drink, its scattering and absorption per centimetre, and its
mean cosine."""


def _glassy(writer: StageWriter, name: str, ior: float, **inputs: tuple[str, object]) -> None:
    net = Network(writer.stage, f"/World/Looks/{name}")
    net.openpbr(
        specular_roughness=("float", 0.0),
        specular_ior=("float", ior),
        transmission_weight=("float", 1.0),
        **inputs,
    )
    writer.own_material(name, net.material)


def _wall(height: float, inwards: float) -> tuple[float, float]:
    """Returns a point of the tumbler's inclined side, ``inwards`` from its outer surface."""
    return (_RADIUS * (0.86 + 0.14 * height / _HEIGHT) - inwards, height)


def _rounded(corners: list[tuple[float, float]], radius: float) -> FloatArray:
    """Rounds the inner corners of a polyline with curves of a radius."""
    points = np.array(corners)
    line = [points[0]]
    for before, here, after in zip(points, points[1:], points[2:], strict=False):
        sides = [before - here, after - here]
        r = min(radius, *(0.45 * float(np.hypot(*side)) for side in sides))
        a, b = (here + r * side / np.hypot(*side) for side in sides)
        for t in np.linspace(0.0, 1.0, 7):
            line.append((1 - t) ** 2 * a + 2 * t * (1 - t) * here + t**2 * b)
    return np.array([*line, points[-1]])


def _turn(
    writer: StageWriter, name: str, corners: list[tuple[float, float]], radius: float,
    at: tuple[float, float, float], columns: int, material: str,
) -> None:  # fmt: skip
    made = placed(turned(_rounded(corners, radius), columns, 1), at)
    writer.mesh(f"/World/Objects/{name}", made, material)


def _serve(
    writer: StageWriter, name: str, at: tuple[float, float, float], level: float, columns: int
) -> None:
    """Adds a tumbler with a thick foot, and a drink that fills it and overlaps its wall."""
    outside = [(0.0, 0.0), _wall(0.0, 0.0), _wall(_HEIGHT, 0.0)]
    inside = [_wall(_HEIGHT, _WALL), _wall(_FOOT, _WALL), (0.0, _FOOT)]
    _turn(writer, f"{name}_Glass", outside + inside, 0.3, at, columns, "Glass")
    depth = _WALL - _OVERLAP
    foot = _FOOT - _OVERLAP
    drink = [(0.0, foot), _wall(foot, depth), _wall(level, depth), (0.0, level)]
    _turn(writer, f"{name}_Drink", drink, 0.3, at, columns, name)


def build_drinks(writer: StageWriter, options: SceneOptions) -> None:
    """Builds the glasses in front of a window."""
    writer.material("Table", materials.plastic((0.32, 0.26, 0.2), 0.35))
    writer.material("Wall", materials.diffuse((0.5, 0.52, 0.55)))
    _glassy(writer, "Glass", 1.52, dielectric_priority=("integer", 1))
    writer.floor("Table", 60.0, "Table")
    wall = [[-60, 0, -22], [60, 0, -22], [60, 60, -22], [-60, 60, -22]]
    writer.quad("/World/Set/Wall", wall, "Wall")
    columns = 16 * options.teapot_level
    for name, at, level, scattering, absorption, anisotropy in _DRINKS:
        extinction = np.array(scattering) + np.array(absorption)
        depth = 1.0 / float(extinction.max())
        _glassy(
            writer,
            name,
            1.34,
            transmission_color=("color3", np.exp(-depth * extinction).tolist()),
            transmission_depth=("float", depth),
            transmission_scatter=("color3", (depth * np.array(scattering)).tolist()),
            transmission_scatter_anisotropy=("float", anisotropy),
        )
        _serve(writer, name, at, level, columns)
    writer.rect_light("Window", (-14.0, 26.0, 6.0), 22.0, 22.0, (7.0, 7.4, 8.0), -60.0)
    writer.dome_light("Sky", 30.0, 0.35)
    writer.camera((0.0, 13.0, 36.0), (0.0, 4.9, 0.0), 36.0, options.aspect or 3.0 / 2.0)
