# SPDX-License-Identifier: Apache-2.0
"""A glass ball and a gold ring under a small lamp, on a matt floor.

Paths from the camera hardly find the light that comes by way of them.
"""

from __future__ import annotations

import numpy as np

from wavecomb.scenes import materials as looks
from wavecomb.scenes.mesh import Mesh, grid_faces, smooth_normals
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.shapes import placed, turned
from wavecomb.scenes.stage import StageWriter

_LAMP_RADIUS = 0.08
_LAMP_RADIANCE = (900.0, 860.0, 780.0)
_HALF = 6.0


def ball(radius: float, level: int) -> Mesh:
    """A sphere about the origin, of 4 ``level`` cells from pole to pole."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 4 * level + 1)
    profile = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    profile[[0, -1], 0] = 0.0
    return turned(profile, 8 * level, 1)


def ring(radius: float, thickness: float, height: float, level: int) -> Mesh:
    """A finger ring on y = 0: an ellipse, ``thickness`` wide, turned about y at ``radius``."""
    across, around = 2 * level, 8 * level
    a = np.linspace(0.0, 2.0 * np.pi, across + 1)
    b = np.linspace(0.0, 2.0 * np.pi, around + 1)
    a[-1] = b[-1] = 0.0
    far = radius + 0.5 * thickness * np.cos(a)[:, None]
    up = np.broadcast_to(0.5 * height * (1.0 + np.sin(a))[:, None], (across + 1, around + 1))
    places = np.stack([far * np.cos(b), up, far * np.sin(b)], axis=2)
    points = places.reshape(-1, 3).astype(np.float32)
    faces = grid_faces(across + 1, around + 1)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, around + 1), np.linspace(0, 1, across + 1)), axis=2)
    return Mesh(points, faces, smooth_normals(points, faces), uv.reshape(-1, 2).astype(np.float32))


def build_caustics(writer: StageWriter, options: SceneOptions) -> None:
    """Floor and wall, ball and ring, and the lamp."""
    writer.material("Floor", looks.diffuse((0.62, 0.60, 0.57)))
    writer.material("Wall", looks.diffuse((0.35, 0.42, 0.50)))
    h = _HALF
    floor = np.array([[-h, 0, h], [h, 0, h], [h, 0, -h], [-h, 0, -h]])
    wall = np.array([[-h, 0, -3.0], [h, 0, -3.0], [h, h, -3.0], [-h, h, -3.0]])
    writer.polygons("/World/Set/Floor", floor, [[0, 1, 2, 3]], "Floor")
    writer.polygons("/World/Set/Wall", wall, [[0, 1, 2, 3]], "Wall")
    writer.material("Glass", looks.CLEAR_GLASS)
    writer.material("Gold", looks.metal((1.00, 0.71, 0.29), 0.1, (1.0, 0.94, 0.78)))
    level = 2 * options.teapot_level
    for name, mesh, material in (
        ("Ball", placed(ball(0.8, level), (-1.1, 0.81, 0.0)), "Glass"),
        ("Ring", placed(ring(0.9, 0.16, 0.5, level), (1.2, 0.002, 0.7)), "Gold"),
    ):
        writer.bind(writer.mesh(f"/World/Objects/{name}", mesh).GetPrim(), material)
    writer.sphere_light("Lamp", (2.5, 4.1, -1.1), _LAMP_RADIUS, _LAMP_RADIANCE)
    writer.camera((0.0, 4.2, 6.4), (0.0, 0.35, 0.1), 40.0, options.aspect or 1.0)
