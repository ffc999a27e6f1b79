# SPDX-License-Identifier: Apache-2.0
"""A dragon of Gaussian splats in front of a mirror, made from a mesh.

The splats are flat and lie on the surface of the mesh. Their colours are computed for one light,
with a view-dependent sheen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Vt

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.mesh import FloatArray, Mesh, face_areas, normalized
from wavecomb.scenes.models.ply import ply_vertices
from wavecomb.scenes.options import SceneOptions

_COUNTS = {0: 0, 9: 1, 24: 2, 45: 3}
"""Degree of the spherical harmonics by the number of ``f_rest_*`` properties in the PLY file."""
_DIRECTIONS = 128
"""Number of directions in which splat colours are evaluated."""
_CHUNK = 1 << 15
"""Number of splats whose colours are converted together."""


@dataclass
class Splats:
    """Arrays of Gaussian splats, named like the attributes of UsdVol.

    Attributes:
        positions: (n, 3).
        scales: (n, 3), lengths.
        orientations: (n, 4) quaternions w, x, y, z.
        opacities: (n,) from 0 to 1.
        harmonics: (n, k, 3) spherical harmonics coefficients of the colour minus 0.5.
    """

    positions: FloatArray
    scales: FloatArray
    orientations: FloatArray
    opacities: FloatArray
    harmonics: FloatArray


def read_capture(path: Path) -> Splats:
    """Reads a PLY file of 3D Gaussian splatting.

    The PLY properties are x, y, z, scale_* (logarithms), rot_*, opacity (a logit), f_dc_* and
    f_rest_* (ordered by channel).

    Raises:
        SceneError: The file is not a capture of 3D Gaussian splatting.
    """
    try:
        columns = ply_vertices(path.read_bytes())
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise SceneError(f"{path}: not a capture of Gaussian splats: {error}") from error
    rest = sum(name.startswith("f_rest_") for name in columns)
    names = [
        "x", "y", "z", "opacity", *(f"scale_{k}" for k in range(3)),
        *(f"rot_{k}" for k in range(4)), *(f"f_dc_{k}" for k in range(3)),
        *(f"f_rest_{k}" for k in range(rest)),
    ]  # fmt: skip
    missing = [name for name in names if name not in columns]
    if missing or rest not in _COUNTS:
        what = (
            f"no {missing[0]}" if missing else f"{rest} values f_rest_*; 0, 9, 24 or 45 are known"
        )
        raise SceneError(f"{path}: not a capture of Gaussian splats: {what}")

    def table(prefix: str, count: int) -> FloatArray:
        return np.stack([columns[f"{prefix}{k}"] for k in range(count)], axis=1)

    n = len(columns["x"])
    first = table("f_dc_", 3)[:, None]
    if rest:
        others = table("f_rest_", rest).reshape(n, 3, rest // 3).transpose(0, 2, 1)
        first = np.concatenate([first, others], axis=1)
    with np.errstate(over="ignore"):
        opacities = 1.0 / (1.0 + np.exp(-columns["opacity"]))
        scales = np.exp(table("scale_", 3))
    positions = np.stack([columns[axis] for axis in "xyz"], axis=1)
    return Splats(positions, scales, table("rot_", 4), opacities, first)


def basis(directions: FloatArray) -> FloatArray:
    """Evaluates real spherical harmonics up to degree 3, (n, 16), in unit directions (n, 3).

    Uses the Condon-Shortley phase, like geometry/gaussian_splat/harmonics.h.
    """
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    high = 4 * zz - xx - yy
    return np.stack(
        [
            np.full_like(x, 0.28209479),
            -0.48860251 * y, 0.48860251 * z, -0.48860251 * x,
            1.09254843 * x * y, -1.09254843 * y * z, 0.31539157 * (2 * zz - xx - yy),
            -1.09254843 * x * z, 0.54627422 * (xx - yy),
            -0.59004359 * y * (3 * xx - yy), 2.89061144 * x * y * z, -0.45704580 * y * high,
            0.37317633 * z * (2 * zz - 3 * (xx + yy)), -0.45704580 * x * high,
            1.44530572 * z * (xx - yy), -0.59004359 * x * (xx - 3 * yy),
        ],
        axis=1,
    )  # fmt: skip


def linear_harmonics(harmonics: FloatArray) -> FloatArray:
    """Converts spherical harmonics (n, k, 3) of sRGB colours to linear colours, both minus 0.5.

    Evaluates the colours in many directions, clamps them at 0, converts them to linear values and
    fits spherical harmonics by least squares.
    """
    from wavecomb.image.files.image import linear_from_srgb

    turn = np.arange(_DIRECTIONS) * (np.pi * (3.0 - 5.0**0.5))
    z = 1.0 - (2.0 * np.arange(_DIRECTIONS) + 1.0) / _DIRECTIONS
    r = np.sqrt(1.0 - z * z)
    seen = basis(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1))
    seen = seen[:, : harmonics.shape[1]]
    fit = np.linalg.pinv(seen)
    out = np.empty(harmonics.shape, np.float64)
    for first in range(0, len(harmonics), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        colours = np.maximum(0.5 + seen @ harmonics[chunk], 0.0)
        out[chunk] = fit @ (linear_from_srgb(colours) - 0.5)
    return out


def add_splats(writer: StageWriter, path: str, splats: Splats) -> None:
    """Adds a prim of Gaussian splats to a stage."""
    prim = writer.stage.DefinePrim(path, "ParticleField3DGaussianSplat")

    def put(name: str, kind: Any, values: FloatArray) -> None:
        prim.GetAttribute(name).Set(kind.FromNumpy(np.ascontiguousarray(values, np.float32)))

    put("positions", Vt.Vec3fArray, splats.positions)
    put("scales", Vt.Vec3fArray, splats.scales)
    # USD stores the real part of a quaternion last in memory.
    put("orientations", Vt.QuatfArray, splats.orientations[:, [1, 2, 3, 0]])
    put("opacities", Vt.FloatArray, splats.opacities)
    degree = round(splats.harmonics.shape[1] ** 0.5) - 1
    prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(degree)
    put(
        "radiance:sphericalHarmonicsCoefficients",
        Vt.Vec3fArray,
        splats.harmonics.reshape(-1, 3),
    )
    reach = 3.0 * splats.scales.max(1, keepdims=True)
    low, high = (splats.positions - reach).min(0), (splats.positions + reach).max(0)
    prim.GetAttribute("extent").Set([Gf.Vec3f(*map(float, end)) for end in (low, high)])


_Y0, _Y1 = 0.5 / math.sqrt(math.pi), math.sqrt(0.75 / math.pi)
_LAMP = np.array([-3.2, 6.0, 4.5])


def places(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Samples points (n, 3) and normals (n, 3) on a mesh, uniformly by area."""
    areas = np.asarray(face_areas(mesh.points, mesh.faces), np.float64)
    sums = np.cumsum(areas)
    wanted = (np.arange(count) + rng.uniform(size=count)) / count * sums[-1]
    face = np.minimum(np.searchsorted(sums, wanted), len(areas) - 1)
    a, b = np.sqrt(rng.uniform(size=count)), rng.uniform(size=count)
    weights = np.stack([1.0 - a, a * (1.0 - b), a * b], axis=1)[:, :, None]
    corners = mesh.faces[face]
    points = (mesh.points[corners].astype(np.float64) * weights).sum(1)
    return points, normalized((mesh.normals[corners].astype(np.float64) * weights).sum(1))


def turns_to(normals: FloatArray, spin: FloatArray) -> FloatArray:
    """Returns quaternions (w, x, y, z), (n, 4), that rotate z to the given unit vectors.

    Each quaternion first rotates about z by the angle ``spin``.
    """
    half = np.stack(
        [1.0 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=1
    )
    down = normals[:, 2] < -0.999999
    half[down] = (0.0, 1.0, 0.0, 0.0)
    w, x, y, z = (half / np.linalg.norm(half, axis=1, keepdims=True)).T
    c, s = np.cos(0.5 * spin), np.sin(0.5 * spin)
    return np.stack([w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s], axis=1)


def colours(points: FloatArray, normals: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Returns the colours of the splats as spherical harmonics of degree 1 (n, 4, 3), minus 0.5."""
    height = np.maximum(points[:, 1] / points[:, 1].max(), 0.0)
    bands = 0.5 + 0.5 * np.sin(26.0 * height + 2.0 * np.sin(5.0 * points[:, 0]))
    low, high = np.array([0.06, 0.30, 0.26]), np.array([0.85, 0.55, 0.16])
    paint = low + (high - low) * (bands * height**0.5)[:, None]
    paint *= rng.uniform(0.85, 1.15, (len(points), 1))
    lit = np.maximum((normals * normalized(_LAMP - points)).sum(1), 0.0)
    sky = 0.22 + 0.16 * normals[:, 1]
    shine = paint * (0.62 * lit + 0.8 * sky)[:, None]
    # The brightness of a splat is a linear function of the viewing direction. It is highest along
    # the half vector between the splat's normal and the direction to the light.
    half = normalized(normalized(_LAMP - points) + normals)
    sheen = -0.18 * half * lit[:, None]
    out = np.empty((len(points), 4, 3))
    out[:, 0] = (shine - 0.5) / _Y0
    tint = np.array([1.0, 0.92, 0.75])
    for k, (axis, sign) in enumerate(((1, -1.0), (2, 1.0), (0, -1.0)), start=1):
        out[:, k] = sign * sheen[:, axis, None] / _Y1 * tint
    return out


def build_splats(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a floor, a mirror, a light and a dragon, or only the splats of ``options.capture``."""
    if options.capture is not None:
        capture = read_capture(Path(options.capture))
        if not options.capture_linear:
            capture.harmonics = linear_harmonics(capture.harmonics)
        add_splats(writer, "/World/Objects/Capture", capture)
        return
    rng = np.random.default_rng([options.seed, 77])
    writer.material("Floor", materials.diffuse((0.42, 0.41, 0.39)))
    writer.material("Mirror", materials.MIRROR)
    writer.floor("Floor", 14.0, "Floor")
    mirror = [[-2.2, 0.05, -1.9], [2.6, 0.05, -1.6], [2.6, 2.6, -1.7], [-2.2, 2.6, -2.0]]
    writer.quad("/World/Set/Mirror", mirror, "Mirror")
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
