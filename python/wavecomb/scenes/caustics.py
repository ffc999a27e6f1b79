# SPDX-License-Identifier: Apache-2.0
"""Scenes with caustics, such as a glass ball and a gold ring under a small light.

Paths from the camera rarely find light that glass or metal focuses.
"""

from __future__ import annotations

import math

import numpy as np

from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.mesh import FloatArray, Mesh, grid_mesh, merge, normalized
from wavecomb.scenes.models.shapes import placed, turn_about, turned
from wavecomb.scenes.options import SceneOptions

_LAMP_RADIUS = 0.08
_LAMP_RADIANCE = (900.0, 860.0, 780.0)
_HALF = 6.0


def ball(radius: float, level: int) -> Mesh:
    """Makes a sphere about the origin, with ``4 * level`` cells from pole to pole."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 4 * level + 1)
    profile = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    profile[[0, -1], 0] = 0.0
    return turned(profile, 8 * level, 1)


def ring(radius: float, thickness: float, height: float, level: int) -> Mesh:
    """Makes a finger ring on y = 0 by revolving an ellipse of width ``thickness`` about y."""
    across, around = 2 * level, 8 * level
    a = np.linspace(0.0, 2.0 * np.pi, across + 1)
    b = np.linspace(0.0, 2.0 * np.pi, around + 1)
    a[-1] = b[-1] = 0.0
    far = radius + 0.5 * thickness * np.cos(a)[:, None]
    up = np.broadcast_to(0.5 * height * (1.0 + np.sin(a))[:, None], (across + 1, around + 1))
    places = np.stack([far * np.cos(b), up, far * np.sin(b)], axis=2)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, around + 1), np.linspace(0, 1, across + 1)), axis=2)
    return grid_mesh(places, uv)


def build_caustics(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a glass ball and a gold ring under a small light, on a floor in front of a wall."""
    writer.material("Floor", materials.diffuse((0.62, 0.60, 0.57)))
    writer.material("Wall", materials.diffuse((0.35, 0.42, 0.50)))
    h = _HALF
    wall = [[-h, 0, -3.0], [h, 0, -3.0], [h, h, -3.0], [-h, h, -3.0]]
    writer.floor("Floor", h, "Floor")
    writer.quad("/World/Set/Wall", wall, "Wall")
    writer.material("Glass", materials.CLEAR_GLASS)
    writer.material("Gold", materials.metal((1.00, 0.71, 0.29), 0.1, (1.0, 0.94, 0.78)))
    level = 2 * options.teapot_level
    for name, mesh, material in (
        ("Ball", placed(ball(0.8, level), (-1.1, 0.81, 0.0)), "Glass"),
        ("Ring", placed(ring(0.9, 0.16, 0.5, level), (1.2, 0.002, 0.7)), "Gold"),
    ):
        writer.mesh(f"/World/Objects/{name}", mesh, material)
    writer.sphere_light("Lamp", (2.5, 4.1, -1.1), _LAMP_RADIUS, _LAMP_RADIANCE)
    writer.camera((0.0, 4.2, 6.4), (0.0, 0.35, 0.1), 40.0, options.aspect or 1.0)


# ---- Caustics through glass and water: waves on a pool, a lens, a prism, a ring in a landscape
# ----


_SUN_ANGLE = 0.53
_WATER_IOR = 1.333

_POOL = (3.0, 2.0)
"""Half extent of the pool along x and z, in metres. The pool is ``_DEPTH`` deep, with water at y =
0."""
_DEPTH, _RIM = 1.3, 0.12
_WAVES = (
    # Waves on the water: direction in degrees, wavelength in metres, height in metres and phase in
    # radians.
    (20.0, 1.30, 0.020, 0.4),
    (75.0, 0.85, 0.012, 1.9),
    (-35.0, 0.62, 0.008, 3.1),
    (130.0, 0.41, 0.005, 5.0),
)

LENS_FOCUS, _LENS_RADIUS = 2.0, 0.9
"""Focal length and half width of the lens, in scene units. The light is at twice the focal length,
so its image is at the same distance and has the same size on the other side of the lens."""

_LAND = 100.0
"""Half extent of the landscape along x and z; the glass ring in the landscape has radius 1."""
_HILL = 6.0


def land(cells: int) -> Mesh:
    """Makes hills that are flat in the middle, as a grid of ``cells`` x ``cells`` cells."""
    x, z = np.meshgrid(*[np.linspace(-_LAND, _LAND, cells + 1)] * 2)
    far = np.clip(np.hypot(x, z) / (0.3 * _LAND) - 0.3, 0.0, 1.0)
    waves = 1.0 + np.sin(0.11 * x + 0.7) * np.cos(0.083 * z - 0.4)
    points = np.stack([x, 0.5 * _HILL * far * far * waves, z], axis=2)
    points = points.astype(np.float32)
    return grid_mesh(points, points[..., [0, 2]] / (2.0 * _LAND) + 0.5)


def build_landscape(writer: StageWriter, options: SceneOptions) -> None:
    """Builds wide hills in the sun, and a glass ring on the ground near the camera.

    Nearly all sunlight falls on ground that the camera does not see.
    """
    writer.material("Soil", materials.diffuse((0.45, 0.40, 0.33)))
    writer.material("Glass", materials.CLEAR_GLASS)
    level = options.teapot_level
    writer.mesh("/World/Set/Land", land(16 * level), "Soil")
    writer.mesh(
        "/World/Objects/Ring", placed(ring(0.5, 0.12, 0.3, level), (0.0, 0.002, 0)), "Glass"
    )
    writer.sun("Sun", (0.55, -0.62, -0.35), _SUN_ANGLE, (3.0, 2.8, 2.5))
    writer.dome_light("Sky", 90.0, 0.1)
    writer.camera((0.4, 1.7, 2.6), (0.2, 0.1, -0.15), 42.0, options.aspect or 1.0)


def water(level: int) -> Mesh:
    """Makes the water surface of the pool, with ``level`` cells per metre and analytic normals."""
    x0, z0 = _POOL
    columns, rows = 2 * round(x0 * level) + 1, 2 * round(z0 * level) + 1
    x, z = np.meshgrid(np.linspace(-x0, x0, columns), np.linspace(-z0, z0, rows))
    height, slope_x, slope_z = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for degrees, length, amplitude, phase in _WAVES:
        k = 2.0 * math.pi / length
        kx, kz = k * math.cos(math.radians(degrees)), k * math.sin(math.radians(degrees))
        angle = kx * x + kz * z + phase
        height += amplitude * np.sin(angle)
        slope_x += amplitude * kx * np.cos(angle)
        slope_z += amplitude * kz * np.cos(angle)
    normals = normalized(np.stack([-slope_x, np.ones_like(x), -slope_z], axis=2))
    return grid_mesh(np.stack([x, height, z], axis=2), np.stack([x, z], axis=2), normals)


def _basin() -> tuple[FloatArray, list[list[int]]]:
    """Returns points and faces of the pool's floor, walls (facing inwards) and rim."""
    (x, z), low, high, out = _POOL, -_DEPTH, _RIM, 0.6
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    points = [(sx * x, low, sz * z) for sx, sz in corners]
    points += [(sx * x, high, sz * z) for sx, sz in corners]
    points += [(sx * (x + out), high, sz * (z + out)) for sx, sz in corners]
    faces = [[3, 2, 1, 0]]
    for low_ring in (0, 4):
        faces += [
            [low_ring + i, low_ring + (i + 1) % 4, low_ring + 4 + (i + 1) % 4, low_ring + 4 + i]
            for i in range(4)
        ]
    return np.array(points, float), faces


def build_pool(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a pool with waves in the sun, seen from under water.

    Seen from above, light on the floor would refract at the water twice, once on its way from the
    sun and once towards the camera. Neither camera paths nor light paths can sample a connection
    through two refractions.
    """
    writer.material("Stone", materials.diffuse((0.55, 0.53, 0.50)))
    writer.material("Tiles", materials.diffuse((0.35, 0.62, 0.68)))
    writer.material("Water", materials.dielectric((1.0, 1.0, 1.0), 0.0, _WATER_IOR))
    points, faces = _basin()
    writer.polygons("/World/Set/Basin", points[:8], faces[:5], "Tiles")
    writer.polygons("/World/Set/Rim", points, faces[5:], "Stone")
    writer.mesh("/World/Objects/Water", water(2 * options.teapot_level), "Water")
    writer.sun("Sun", (0.45, -1.0, -0.25), _SUN_ANGLE, (2.6, 2.4, 2.1))
    writer.dome_light("Sky", 90.0, 0.15)
    writer.camera((-2.7, -0.4, 1.6), (0.3, -1.05, -0.4), 80.0, options.aspect or 1.0)


def lens(level: int) -> Mesh:
    """Makes a lens about the origin with axis x, from two caps of spheres of radius ``LENS_FOCUS``.

    With an index of refraction of 1.5, the radius is also the focal length: 1 / f = (n - 1) 2 / r.
    """
    r, a = LENS_FOCUS, _LENS_RADIUS
    rings, columns = 2 * level, 8 * level
    centre = math.sqrt(r * r - a * a)
    angle = np.linspace(0.0, math.asin(a / r), rings + 1)
    turn = np.linspace(0.0, 2.0 * math.pi, columns + 1)
    turn[-1] = 0.0
    radial = np.sin(angle)[:, None]
    axial = np.broadcast_to(np.cos(angle)[:, None], (rings + 1, columns + 1))
    outward = np.stack([axial, radial * np.cos(turn), radial * np.sin(turn)], axis=2)
    cap = r * outward - np.array([centre, 0.0, 0.0])
    mirrored = np.array([-1.0, 1.0, 1.0])
    return merge(
        [
            grid_mesh(cap, cap[..., 1:], outward),
            grid_mesh(cap * mirrored, cap[..., 1:], outward * mirrored, reverse=True),
        ]
    )


def build_lens(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a lens between a small light and a wall, above a floor."""
    writer.material("Matt", materials.diffuse((0.6, 0.6, 0.6)))
    writer.material("Dark", materials.diffuse((0.04, 0.04, 0.04)))
    writer.material("Glass", materials.CLEAR_GLASS)
    far, h, up = 2.0 * LENS_FOCUS, 6.0, 1.4
    floor = [[-9, 0, h], [far, 0, h], [far, 0, -h], [-9, 0, -h]]
    wall = [[far, 0, h], [far, 2 * h, h], [far, 2 * h, -h], [far, 0, -h]]
    writer.quad("/World/Set/Floor", floor, "Matt")
    writer.quad("/World/Set/Wall", wall, "Matt")
    writer.mesh("/World/Objects/Lens", placed(lens(options.teapot_level), (0.0, up, 0.0)), "Glass")
    writer.mesh("/World/Objects/Foot", placed(ball(0.18, 8), (0.0, up - 1.08, 0.0)), "Dark")
    writer.sphere_light("Lamp", (-far, up, 0.0), _LAMP_RADIUS, (2700.0, 2580.0, 2340.0))
    writer.camera((-2.6, 3.4, 6.2), (1.6, 1.1, 0.0), 52.0, options.aspect or 1.0)


def build_prism(writer: StageWriter, options: SceneOptions) -> None:
    """Builds an upright prism on a floor, a wall behind it, and the sun."""
    writer.material("Matt", materials.diffuse((0.6, 0.58, 0.55)))
    writer.material("Glass", materials.CLEAR_GLASS)
    h = 6.0
    floor = [[-h, 0, h], [h, 0, h], [h, 0, -2.5], [-h, 0, -2.5]]
    wall = [[-h, 0, -2.5], [h, 0, -2.5], [h, h, -2.5], [-h, h, -2.5]]
    writer.quad("/World/Set/Floor", floor, "Matt")
    writer.quad("/World/Set/Wall", wall, "Matt")
    side = np.array([[math.cos(a), 0.0, math.sin(a)] for a in np.radians((90.0, 210.0, 330.0))])
    side = 0.8 * side @ turn_about(1, 20.0).T
    up = np.array([0.0, 1.0, 0.0])
    points = np.concatenate([side + 0.01 * up, side + 2.0 * up])
    faces = [[0, 1, 2], [5, 4, 3], [1, 0, 3, 4], [2, 1, 4, 5], [0, 2, 5, 3]]
    writer.polygons("/World/Objects/Prism", points, faces, "Glass")
    writer.sun("Sun", (-0.75, -0.38, -0.8), _SUN_ANGLE, (5.0, 4.8, 4.4))
    writer.camera((1.2, 3.0, 6.0), (-0.4, 0.9, -0.6), 48.0, options.aspect or 1.0)
