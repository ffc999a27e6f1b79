# SPDX-License-Identifier: Apache-2.0
"""A dragon of Gaussian splats before a mirror: as a capture would be, made of our own mesh.

Splats are flat and lie on the mesh; what they shine is worked out from one lamp, with a sheen that
changes with the view.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from wavecomb.scenes import materials as looks
from wavecomb.scenes.capture import Splats, add_splats, linear_harmonics, read_capture
from wavecomb.scenes.mesh import FloatArray, Mesh, face_areas
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.stage import StageWriter

_Y0, _Y1 = 0.5 / math.sqrt(math.pi), math.sqrt(0.75 / math.pi)
_LAMP = np.array([-3.2, 6.0, 4.5])


def _unit(v: FloatArray) -> FloatArray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def places(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) of a mesh, by area alike, and normals there."""
    areas = np.asarray(face_areas(mesh.points, mesh.faces), np.float64)
    sums = np.cumsum(areas)
    wanted = (np.arange(count) + rng.uniform(size=count)) / count * sums[-1]
    face = np.minimum(np.searchsorted(sums, wanted), len(areas) - 1)
    a, b = np.sqrt(rng.uniform(size=count)), rng.uniform(size=count)
    weights = np.stack([1.0 - a, a * (1.0 - b), a * b], axis=1)[:, :, None]
    corners = mesh.faces[face]
    points = (mesh.points[corners].astype(np.float64) * weights).sum(1)
    return points, _unit((mesh.normals[corners].astype(np.float64) * weights).sum(1))


def turns_to(normals: FloatArray, spin: FloatArray) -> FloatArray:
    """Quaternions w, x, y, z (n, 4) from z to unit vectors, after turns about z by ``spin``."""
    half = np.stack(
        [1.0 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=1
    )
    down = normals[:, 2] < -0.999999
    half[down] = (0.0, 1.0, 0.0, 0.0)
    w, x, y, z = _unit(half).T
    c, s = np.cos(0.5 * spin), np.sin(0.5 * spin)
    return np.stack([w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s], axis=1)


def colours(points: FloatArray, normals: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Coefficients (n, 4, 3) of degree 1 for what splats there shine, less 0.5."""
    height = np.maximum(points[:, 1] / points[:, 1].max(), 0.0)
    bands = 0.5 + 0.5 * np.sin(26.0 * height + 2.0 * np.sin(5.0 * points[:, 0]))
    low, high = np.array([0.06, 0.30, 0.26]), np.array([0.85, 0.55, 0.16])
    paint = low + (high - low) * (bands * height**0.5)[:, None]
    paint *= rng.uniform(0.85, 1.15, (len(points), 1))
    lit = np.maximum((normals * _unit(_LAMP - points)).sum(1), 0.0)
    sky = 0.22 + 0.16 * normals[:, 1]
    shine = paint * (0.62 * lit + 0.8 * sky)[:, None]
    # Brighter where it is looked at from above and the lamp's side: a linear function of direction.
    half = _unit(_unit(_LAMP - points) + normals)
    sheen = -0.18 * half * lit[:, None]
    out = np.empty((len(points), 4, 3))
    out[:, 0] = (shine - 0.5) / _Y0
    tint = np.array([1.0, 0.92, 0.75])
    for k, (axis, sign) in enumerate(((1, -1.0), (2, 1.0), (0, -1.0)), start=1):
        out[:, k] = sign * sheen[:, axis, None] / _Y1 * tint
    return out


def build_splats(writer: StageWriter, options: SceneOptions) -> None:
    """Floor, mirror, lamp, and the dragon; or a capture alone."""
    if options.capture is not None:
        capture = read_capture(Path(options.capture))
        if not options.capture_linear:
            capture.harmonics = linear_harmonics(capture.harmonics)
        add_splats(writer, "/World/Objects/Capture", capture)
        return
    rng = np.random.default_rng([options.seed, 77])
    writer.material("Floor", looks.diffuse((0.42, 0.41, 0.39)))
    writer.material("Mirror", looks.MIRROR)
    h = 14.0
    floor = np.array([[-h, 0, h], [h, 0, h], [h, 0, -h], [-h, 0, -h]])
    mirror = np.array([[-2.2, 0.05, -1.9], [2.6, 0.05, -1.6], [2.6, 2.6, -1.7], [-2.2, 2.6, -2.0]])
    writer.polygons("/World/Set/Floor", floor, [[0, 1, 2, 3]], "Floor")
    writer.polygons("/World/Set/Mirror", mirror, [[0, 1, 2, 3]], "Mirror")
    mesh = options.dragon_mesh()
    count = options.splats
    points, normals = places(mesh, count, rng)
    area = float(np.sum(face_areas(mesh.points, mesh.faces)))
    size = 1.1 * math.sqrt(area / count)
    scales = size * rng.uniform(0.5, 0.9, (count, 3)) * np.array([1.0, 0.7, 0.12])
    turns = turns_to(normals, rng.uniform(0.0, 2.0 * np.pi, count))
    opacities = rng.uniform(0.75, 0.98, count)
    dragon = Splats(points, scales, turns, opacities, colours(points, normals, rng))
    add_splats(writer, "/World/Objects/Dragon", dragon)
    writer.sphere_light("Lamp", tuple(_LAMP), 0.35, (150.0, 142.0, 128.0))
    writer.even_dome("Dome", 0.07)
    writer.camera((1.3, 2.1, 4.6), (0.1, 0.75, -0.3), 42.0, options.aspect or 16.0 / 10.0)
