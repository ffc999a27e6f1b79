# SPDX-License-Identifier: Apache-2.0
"""Scenes: three drinks for nested dielectrics; candles and a marble ball for subsurface scattering.

Each drink overlaps the wall of its glass, and material priorities decide which medium fills the
overlap.
"""

from __future__ import annotations

import numpy as np

from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.materials import Colour, Network
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.caustics import ball
from wavecomb.scenes.models.mesh import FloatArray
from wavecomb.scenes.models.shapes import placed, turned
from wavecomb.scenes.options import SceneOptions

_RADIUS, _HEIGHT, _WALL, _FOOT = 3.0, 10.5, 0.32, 1.0
_OVERLAP = 0.1
"""Depth by which a drink overlaps its glass, in centimetres."""
_DRINKS: tuple[tuple[str, tuple[float, float, float], float, Colour, Colour, float], ...] = (
    ("Cordial", (-8.0, 0.0, -1.0), 8.2, (0.0, 0.0, 0.0), (0.08, 0.9, 0.75), 0.0),
    ("Juice", (0.0, 0.0, 0.5), 8.8, (1.6, 1.3, 0.7), (0.01, 0.16, 1.3), 0.6),
    ("Milk", (8.0, 0.0, -1.0), 7.0, (4.0, 4.2, 4.5), (0.001, 0.003, 0.012), 0.5),
)
"""Name, position and fill height of each drink, its scattering and absorption coefficients per
centimetre, and the mean cosine of its phase function."""


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
    """Returns a point in the tumbler's sloping wall, ``inwards`` below the outer surface."""
    return (_RADIUS * (0.86 + 0.14 * height / _HEIGHT) - inwards, height)


def _rounded(corners: list[tuple[float, float]], radius: float) -> FloatArray:
    """Rounds the inner corners of a polyline with curves of radius ``radius``."""
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
    """Builds three glasses with drinks in front of a window."""
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


_FLAME = (95.0, 48.0, 16.0)
_CANDLES = (
    ("Tall", (-5.2, 0.0, -0.5), 2.6, 15.0),
    ("Middle", (1.2, 0.0, -2.6), 3.1, 10.5),
    ("Low", (4.4, 0.0, 2.6), 3.4, 5.6),
)
"""Name, position, radius and height of each candle, in centimetres."""


def below_surface(
    writer: StageWriter, name: str, colour: Colour, radius: Colour, **inputs: float
) -> str:
    """Adds an OpenPBR material with subsurface scattering and returns its name.

    Args:
        writer: Writer of the stage.
        name: Name of the material.
        colour: Diffuse reflectance of a flat surface of the material.
        radius: Mean free path of each colour channel, in scene units.
        **inputs: Other inputs of the OpenPBR surface.
    """
    net = Network(writer.stage, f"/World/Looks/{name}")
    longest = max(radius)
    net.openpbr(
        base_color=("color3", colour),
        subsurface_weight=("float", 1.0),
        subsurface_color=("color3", colour),
        subsurface_radius=("float", longest),
        subsurface_radius_scale=("color3", [r / longest for r in radius]),
        **{key: ("float", value) for key, value in inputs.items()},
    )
    return writer.own_material(name, net.material)


def _candle(writer: StageWriter, name: str, at: tuple[float, float, float], radius: float,
            height: float, columns: int) -> None:  # fmt: skip
    """Adds a candle: wax with a shallow pool, a wick, and a flame that is also a light."""
    rim = 0.12 * radius
    profile = np.array([
        (0.0, 0.0), (0.97 * radius, 0.0), (radius, 0.03 * radius), (radius, height - rim),
        (0.96 * radius, height - 0.3 * rim), (0.88 * radius, height), (0.8 * radius, height - rim),
        (0.62 * radius, height - 2.2 * rim), (0.3 * radius, height - 2.7 * rim),
        (0.0, height - 2.8 * rim),
    ])  # fmt: skip
    wax = placed(turned(profile, columns, 6), at)
    writer.mesh(f"/World/Objects/{name}_Wax", wax, "Wax")
    bottom = height - 3.2 * rim
    wick = np.array([(0.0, bottom), (0.12, bottom), (0.1, height + 0.45), (0.0, height + 0.5)])
    made = placed(turned(wick, 12, 2), at)
    writer.mesh(f"/World/Objects/{name}_Wick", made, "Wick")
    t = np.linspace(0.0, 1.0, 17)
    flame = np.stack([0.42 * np.sin(np.pi * t) * (1.0 - 0.55 * t), height + 0.35 + 2.6 * t], axis=1)
    flame[[0, -1], 0] = 0.0
    made = placed(turned(flame, 24, 1), at)
    writer.mesh(f"/World/Objects/{name}_Flame", made, "Flame")


def build_candles(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a table with candles and a marble ball, in a dim room."""
    writer.material("Table", materials.plastic((0.17, 0.08, 0.045), 0.3))
    writer.material("Wick", materials.diffuse((0.03, 0.025, 0.02)))
    writer.material("Flame", materials.emissive(_FLAME))
    wax, marble = {"specular_roughness": 0.35, "specular_ior": 1.44}, {"specular_roughness": 0.12}
    below_surface(writer, "Wax", (0.93, 0.83, 0.66), (0.9, 0.45, 0.22), **wax)
    below_surface(writer, "Marble", (0.78, 0.8, 0.74), (0.5, 0.62, 0.44), **marble)
    writer.floor("Table", 40.0, "Table")
    columns = 8 * options.teapot_level
    for name, at, radius, height in _CANDLES:
        _candle(writer, name, at, radius, height, columns)
    made = placed(ball(2.1, options.teapot_level), (-1.6, 2.1, 3.4))
    writer.mesh("/World/Objects/Ball", made, "Marble")
    writer.rect_light("Window", (-6.0, 24.0, 22.0), 14.0, 14.0, (1.6, 2.0, 2.8), -45.0)
    writer.dome_light("Sky", 30.0, 0.05)
    writer.camera((0.0, 13.0, 37.0), (-0.4, 8.2, 0.0), 38.0, options.aspect or 4.0 / 3.0)
