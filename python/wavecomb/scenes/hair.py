# SPDX-License-Identifier: Apache-2.0
"""Scenes of fur and hair, with combed and bent strands as cubic curves on smooth bodies.

NumPy computes one point of all strands at a time; 100,000 strands take about a second.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, UsdGeom, Vt

from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.materials import Network
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.drinks import below_surface
from wavecomb.scenes.models.mesh import FloatArray, Mesh, grid_mesh, normalized, without_flat_faces
from wavecomb.scenes.models.relief import ramp
from wavecomb.scenes.models.shapes import turned
from wavecomb.scenes.options import SceneOptions

HEAD_LEVEL = 96
"""Number of mesh cells of the head from pole to pole."""

_AXES = (0.78, 1.12, 0.98)
_BUMPS = (
    ((0.0, -0.10, 1.0), 0.14, 0.13),  # nose
    ((0.0, -0.78, 0.68), 0.22, 0.10),  # chin
    ((0.30, 0.12, 0.95), 0.13, -0.05),  # eyes
    ((-0.30, 0.12, 0.95), 0.13, -0.05),
    ((0.0, 0.32, 0.95), 0.30, 0.03),  # brow
    ((1.0, -0.05, -0.05), 0.16, 0.10),  # ears
    ((-1.0, -0.05, -0.05), 0.16, 0.10),
)
"""Direction, angular width and height of each bump of the head; negative heights are dents."""


def head_radius(d: FloatArray) -> FloatArray:
    """Returns the radius (n,) of the head along unit directions (n, 3)."""
    jaw = ramp(-d[:, 1], 0.1, 1.0)
    x, y, z = d[:, 0] / (_AXES[0] - 0.20 * jaw), d[:, 1] / _AXES[1], d[:, 2] / _AXES[2]
    radius = 1.0 / np.sqrt(x * x + y * y + z * z)
    for toward, width, height in _BUMPS:
        way = np.array(toward) / np.linalg.norm(toward)
        radius = radius + height * np.exp((d @ way - 1.0) / (width * width))
    return radius


def is_scalp(d: FloatArray, chance: FloatArray) -> NDArray[np.bool_]:
    """Returns whether hair grows on the head in unit directions (n, 3); the result is (n,).

    Hair grows above a line from brow to neck, and more sparsely near the line.
    """
    line = -0.50 + 1.08 * ramp(d[:, 2], -0.5, 0.75)
    return chance < ramp(d[:, 1] - line, 0.0, 0.12)


def head_mesh(level: int) -> Mesh:
    """Makes the head as a mesh with ``level`` cells from pole to pole."""
    columns = 2 * level
    up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, level + 1)
    turn = np.linspace(0.0, 2.0 * np.pi, columns + 1)
    turn[-1] = 0.0
    across = np.cos(up)
    across[[0, -1]] = 0.0
    shape = (level + 1, columns + 1)
    d = np.stack(
        [across[:, None] * np.cos(turn), np.broadcast_to(np.sin(up)[:, None], shape),
         across[:, None] * np.sin(turn)], axis=2,
    )  # fmt: skip
    points = d * head_radius(d.reshape(-1, 3)).reshape(*shape, 1)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, level + 1)), axis=2)
    return without_flat_faces(grid_mesh(points, uv), 1e-9)


_HAIR_POINTS, _FUR_POINTS = 9, 5
_HAIR_WIDTH, _FUR_WIDTH = 0.0016, 0.008


def _sphere(rng: np.random.Generator, count: int) -> FloatArray:
    return normalized(rng.normal(size=(count, 3)))


def _waves(p: FloatArray, frequency: float, seed: float) -> FloatArray:
    """Evaluates a smooth random vector field with mean 0 at points ``p``, (n, 3)."""
    turns = np.array([[1.0, 0.7, -0.4], [-0.6, 1.1, 0.5], [0.3, -0.8, 1.2]]) * frequency
    return np.sin(p @ turns.T + seed * np.array([1.0, 2.3, 4.1]))


def add_strands(
    writer: StageWriter,
    path: str,
    strands: FloatArray,
    width: float,
    material: str,
    primvars: dict[str, tuple[str, FloatArray]],
) -> None:
    """Adds strands that taper towards their tips.

    Args:
        writer: Writer of the stage.
        path: Path of the prim.
        strands: Points of the strands, (n, points, 3), root first.
        width: Width at the root, in scene units.
        material: Name of the bound material.
        primvars: For each primvar, its interpolation ("uniform" or "varying") and its values
            (numbers or colours).
    """
    count, points = strands.shape[:2]
    flat = strands.reshape(-1, 3).astype(np.float32)
    taper = 1.0 - 0.75 * np.linspace(0.0, 1.0, points) ** 2
    widths = np.tile((width * taper).astype(np.float32), count)
    prim = UsdGeom.BasisCurves.Define(writer.stage, path)
    prim.CreateTypeAttr(UsdGeom.Tokens.cubic)
    prim.CreateBasisAttr(UsdGeom.Tokens.catmullRom)
    prim.CreateWrapAttr(UsdGeom.Tokens.pinned)
    prim.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(count, points, np.int32)))
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(flat))
    prim.CreateWidthsAttr(Vt.FloatArray.FromNumpy(widths))
    prim.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
    prim.CreateExtentAttr([Gf.Vec3f(*map(float, end)) for end in (flat.min(0), flat.max(0))])
    api = UsdGeom.PrimvarsAPI(prim)
    types = Sdf.ValueTypeNames
    for name, (interpolation, values) in primvars.items():
        wide = values.ndim == 2
        kind = types.Color3fArray if wide else types.FloatArray
        array: Any = Vt.Vec3fArray if wide else Vt.FloatArray
        made = api.CreatePrimvar(name, kind, interpolation)
        made.Set(array.FromNumpy(np.ascontiguousarray(values, np.float32)))
    writer.bind(prim.GetPrim(), material)


def _lamps(writer: StageWriter, strength: float) -> None:
    """Adds a key light, and a light from behind that shines through the hair."""
    key, rim = (x * strength for x in (26.0, 30.0))
    writer.rect_light("Key", (-3.0, 5.5, 5.0), 2.4, 2.4, (key, 0.95 * key, 0.88 * key), -48.0)
    writer.rect_light("Rim", (2.2, 4.4, -4.6), 2.6, 2.6, (0.9 * rim, 0.95 * rim, rim), -136.0)
    writer.sphere_light("Fill", (5.0, 2.0, 4.0), 0.8, (6.0, 6.4, 7.0))


def _floor(writer: StageWriter, height: float) -> None:
    writer.material("Floor", materials.diffuse((0.16, 0.17, 0.19)))
    writer.floor("Floor", 12.0, "Floor", height)


def _egg(d: FloatArray) -> FloatArray:
    """Returns the points of an egg around the origin, in directions ``d``."""
    return d * np.array([0.95, 1.15, 0.95]) * (1.0 + 0.12 * d[..., 1:2] * (d[..., 1:2] - 1.0))


def fur_strands(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    """Returns the strands of the egg, (count, points, 3), and their root directions."""
    d = _sphere(rng, count)
    p = _egg(d)
    length = 0.22 * rng.uniform(0.7, 1.15, (count, 1))
    step = length / (_FUR_POINTS - 1)
    down = np.array([0.0, -1.0, 0.0])
    comb = down + 0.5 * np.cross(d, down) + 0.35 * _waves(d, 6.0, 1.7)
    comb -= d * (d * comb).sum(1, keepdims=True)
    frizz = rng.normal(scale=0.16, size=(count, 3))
    places = [p]
    for k in range(_FUR_POINTS - 1):
        bend = (k + 0.6) / _FUR_POINTS
        p = p + step * normalized(d + 1.5 * bend * comb + frizz * (0.4 + bend))
        places.append(p)
    return np.stack(places, axis=1), d


def build_fur(writer: StageWriter, options: SceneOptions) -> None:
    """Builds an egg with stripes of dark and light fur, lighter at the tips."""
    rng = np.random.default_rng([options.seed, 21])
    writer.material("Skin", materials.diffuse((0.16, 0.10, 0.07)))
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 65)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(65)], axis=1)
    profile = _egg(ring)[:, :2]
    profile[[0, -1], 0] = 0.0
    body = turned(profile, 96, 1)
    writer.mesh("/World/Objects/Body", body, "Skin")
    strands, d = fur_strands(rng, options.strands)
    stripe = np.sin(11.0 * d[:, 1] + 1.6 * _waves(d, 3.0, 0.4)[:, 0])
    light = 1.0 / (1.0 + np.exp(-7.0 * (stripe + 0.15)))
    shade = rng.uniform(0.8, 1.1, len(d))[:, None]
    dark, pale = np.array([0.07, 0.045, 0.03]), np.array([0.80, 0.50, 0.24])
    colour = np.clip((dark + (pale - dark) * light[:, None]) * shade, 0.0, 1.0)
    along = np.tile(np.linspace(0.0, 1.0, _FUR_POINTS), len(d))
    add_strands(
        writer,
        "/World/Objects/Fur",
        strands,
        _FUR_WIDTH,
        _fur(writer),
        {"furColor": ("uniform", colour), "along": ("varying", along)},
    )
    _floor(writer, -1.38)
    _lamps(writer, 1.8)
    writer.camera((0.0, 1.0, 6.4), (0.0, -0.08, 0.0), 30.0, options.aspect or 1.0)


def _fur(writer: StageWriter) -> str:
    """Adds a hair material that reads the colour of each strand, and is paler towards the tip."""
    net = Network(writer.stage, "/World/Looks/Fur")
    own = net.node(
        "geompropvalue", "color3",
        geomprop=("string", "furColor"), default=("color3", (0.5, 0.3, 0.2)),
    )  # fmt: skip
    along = net.node("geompropvalue", "float", geomprop=("string", "along"))
    share = net.node("multiply", "float", in1=along, in2=("float", 0.45))
    colour = net.node("mix", "color3", bg=own, fg=("color3", (0.92, 0.84, 0.7)), mix=share)
    net.hair(
        "chiang_hair_absorption_from_color",
        {"longitudinal": ("float", 0.4), "azimuthal": ("float", 0.5)},
        color=colour,
        azimuthal_roughness=("float", 0.5),
    )
    return writer.own_material("Fur", net.material)


def hair_strands(rng: np.random.Generator, count: int) -> FloatArray:
    """Returns strands on the head, (count, points, 3), parted and combed to both sides."""
    roots = np.zeros((0, 3))
    while len(roots) < count:
        d = _sphere(rng, 2 * count)
        roots = np.concatenate([roots, d[is_scalp(d, rng.random(len(d)))]])
    d = roots[:count]
    p = d * head_radius(d)[:, None]
    side = np.where(d[:, :1] > 0.10, 1.0, -1.0) * np.clip(0.75 + 0.9 * d[:, 2:], 0.06, 1.0)
    length = 1.7 * rng.uniform(0.82, 1.06, (count, 1)) * (1.0 + 0.10 * _waves(d, 5.0, 0.9)[:, :1])
    step = length / (_HAIR_POINTS - 1)
    lift = 1.02 + 0.11 * rng.random((count, 1)) ** 1.5
    comb = np.concatenate([side, np.full_like(side, 0.1), np.full_like(side, -0.45)], axis=1)
    comb -= d * (d * comb).sum(1, keepdims=True)
    frizz = rng.normal(scale=0.05, size=(count, 3))
    waves = _waves(d, 9.0, 2.2)
    heading = 0.5 * d + 0.8 * comb
    phase = 5.0 * _waves(d, 7.0, 3.3)[:, :1]
    places = [p]
    for k in range(_HAIR_POINTS - 1):
        t = (k + 1.0) / (_HAIR_POINTS - 1)
        curl = 0.30 * t * np.sin(2.2 * math.pi * t + phase) * waves
        heading = normalized(heading) + np.array([0.0, -0.8, 0.0]) + 0.3 * comb * (1.0 - t)
        q = p + step * normalized(heading + curl + frizz)
        # Keep the strand outside of the head and close to its surface. Below the head, keep the
        # strand within the head's width.
        out = np.linalg.norm(q, axis=1, keepdims=True)
        way = q / np.maximum(out, 1e-9)
        near = head_radius(way)[:, None] * (lift if k else 1.0 + 0.5 * (lift - 1.0))
        most = np.where(q[:, 1:2] > -0.45, near * 1.07, np.inf)
        q = way * np.clip(out, near, most)
        wide = np.linalg.norm(q[:, ::2], axis=1, keepdims=True)
        q[:, ::2] *= np.minimum(1.0, 0.95 * lift / np.maximum(wide, 1e-9))
        heading = q - p
        p = p + step * normalized(heading)
        places.append(p)
    return np.stack(places, axis=1)


def build_head(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a smooth head, without a detailed face, and its hair."""
    rng = np.random.default_rng([options.seed, 22])
    # The coat of the skin's material models a thin film of oil. The mean free paths of the skin are
    # in decimetres.
    skin = {"specular_roughness": 0.48, "specular_ior": 1.4, "coat_weight": 0.25,
            "coat_roughness": 0.3, "coat_ior": 1.45}  # fmt: skip
    below_surface(writer, "Head", (0.76, 0.5, 0.38), (0.037, 0.014, 0.007), **skin)
    writer.mesh("/World/Objects/Head", head_mesh(HEAD_LEVEL), "Head")
    neck = turned(
        [(0.0, -2.5), (1.0, -2.5), (0.9, -2.2), (0.5, -1.7), (0.45, -1.0), (0.42, -0.5),
         (0.0, -0.45)], 64,
    )  # fmt: skip
    back = np.array([0.0, 0.0, -0.16], np.float32)
    writer.mesh("/World/Objects/Neck", replace(neck, points=neck.points + back), "Head")
    melanin = np.clip(rng.normal(0.52, 0.07, options.strands), 0.1, 0.95)
    add_strands(
        writer,
        "/World/Objects/Hair",
        hair_strands(rng, options.strands),
        _HAIR_WIDTH,
        _brown(writer),
        {"melanin": ("uniform", melanin)},
    )
    _floor(writer, -2.5)
    _lamps(writer, 1.8)
    writer.camera((2.3, 0.5, 6.6), (0.0, -0.55, 0.0), 32.0, options.aspect or 1.0)


def _brown(writer: StageWriter) -> str:
    """Adds a hair material that reads the melanin of each strand."""
    net = Network(writer.stage, "/World/Looks/Hair")
    melanin = net.node(
        "geompropvalue", "float", geomprop=("string", "melanin"), default=("float", 0.5)
    )
    net.hair(
        "deon_hair_absorption_from_melanin",
        {"longitudinal": ("float", 0.25), "azimuthal": ("float", 0.3)},
        melanin_concentration=melanin,
        melanin_redness=("float", 0.35),
    )
    return writer.own_material("Hair", net.material)
