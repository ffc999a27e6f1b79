# SPDX-License-Identifier: Apache-2.0
"""Converts UsdGeom's implicit shapes to triangles with exact normals.

Uses the absolute value of negative sizes. The attribute ``doubleSided`` is not read, since all
surfaces are rendered on both sides. ``orientation`` determines the outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb.usd.materials.network import number as number_of
from wavecomb.usd.materials.network import word

Array = NDArray[np.float32]

AROUND = 64
"""Number of segments around the axis of a shape."""

RINGS = 32
"""Number of segments from pole to pole of a sphere."""


@dataclass(frozen=True)
class Shape:
    """Triangles of an implicit shape.

    Contract: prims of equal sizes share the arrays, so callers must not modify the arrays.
    """

    positions: Array
    normals: Array
    uvs: Array
    triangles: NDArray[np.uint32]


def read_shape(prim: Usd.Prim, time: Usd.TimeCode, names: frozenset[str]) -> Shape | None:
    """Returns the triangles of an implicit shape; None for prims of unsupported types.

    ``names`` are the prim's authored properties. Sizes are read even if they are not authored,
    since value clips may define them.
    """
    kind = str(prim.GetTypeName())
    if kind not in _READERS:
        return None

    def number(name: str, default: float) -> float:
        return abs(number_of(prim.GetAttribute(name).Get(time), default))

    def token(name: str, default: str) -> str:
        value = prim.GetAttribute(name).Get(time)
        return word(value) if word(value) in ("X", "Y", "Z") else default

    shape = _READERS[kind](number, token)
    if "orientation" in names and prim.GetAttribute("orientation").Get(time) == "leftHanded":
        inward = np.ascontiguousarray(shape.triangles[:, ::-1])
        return Shape(shape.positions, -shape.normals, shape.uvs, inward)
    return shape


Number = Callable[[str, float], float]
Token = Callable[[str, str], str]


def _sphere(number: Number, token: Token) -> Shape:
    del token
    return _revolve("sphere", number("radius", 1.0), 0.0, 0.0, "Z")


def _capsule(number: Number, token: Token) -> Shape:
    radius = number("radius", 0.5)
    top, bottom = number("radiusTop", radius), number("radiusBottom", radius)
    return _revolve("capsule", bottom, top, number("height", 1.0), token("axis", "Z"))


def _cylinder(number: Number, token: Token) -> Shape:
    radius = number("radius", 1.0)
    top, bottom = number("radiusTop", radius), number("radiusBottom", radius)
    return _revolve("cylinder", bottom, top, number("height", 2.0), token("axis", "Z"))


def _cone(number: Number, token: Token) -> Shape:
    return _revolve("cone", number("radius", 1.0), 0.0, number("height", 2.0), token("axis", "Z"))


def _cube(number: Number, token: Token) -> Shape:
    del token
    return _box(0.5 * number("size", 2.0))


@lru_cache(maxsize=256)
def _box(half: float) -> Shape:
    """Returns a cube with coordinates from -half to half."""
    positions, normals, uvs = [], [], []
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.zeros((4, 3), np.float32)
            face[:, axis] = sign
            face[:, (axis + 1) % 3] = corners[:, 0] * sign
            face[:, (axis + 2) % 3] = corners[:, 1]
            normal = np.zeros((4, 3), np.float32)
            normal[:, axis] = sign
            positions.append(face * np.float32(half))
            normals.append(normal)
            uvs.append(0.5 * corners + 0.5)
    quads = 4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Shape(
        np.concatenate(positions),
        np.concatenate(normals),
        np.concatenate(uvs).astype(np.float32),
        quads.reshape(-1, 3).astype(np.uint32),
    )


def _plane(number: Number, token: Token) -> Shape:
    return _rectangle(0.5 * number("width", 2.0), 0.5 * number("length", 2.0), token("axis", "Z"))


@lru_cache(maxsize=256)
def _rectangle(w: float, h: float, axis: str) -> Shape:
    """Returns a rectangle from (-w, -h) to (w, h) whose normal is along an axis."""
    corners = np.array([[-w, -h, 0], [w, -h, 0], [w, h, 0], [-w, h, 0]])
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Shape(
        _turn_plane(corners, axis),
        _turn_plane(normals, axis),
        uvs,
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )


def _turn_plane(values: NDArray[Any], axis: str) -> Array:
    """Rotates a plane from +Z to another axis: Y maps (width, length) to (x, z), X to (z, y)."""
    x, y, z = values.T
    turned = {"X": (z, y, -x), "Y": (x, z, -y), "Z": (x, y, z)}[axis]
    return np.ascontiguousarray(np.stack(turned, axis=1), np.float32)


def _to_axis(values: NDArray[Any], axis: str) -> Array:
    """Rotates geometry from the Z axis to another axis by permuting coordinates cyclically."""
    order = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    return np.ascontiguousarray(values[:, order], np.float32)


@lru_cache(maxsize=256)
def _revolve(kind: str, bottom: float, top: float, height: float, axis: str) -> Shape:
    """Revolves the profile of a shape about an axis; the profile runs from bottom to top."""
    half = 0.5 * height
    pieces: list[tuple[NDArray[Any], NDArray[Any]]] = []
    if kind == "sphere":
        pieces.append(_arc(bottom, -90, 90, 0.0, RINGS))
    elif kind == "capsule":
        low, n_low = _arc(bottom, -90, 0, -half, RINGS // 2)
        high, n_high = _arc(top, 0, 90, half, RINGS // 2)
        if bottom == top:
            pieces.append((np.concatenate([low, high]), np.concatenate([n_low, n_high])))
        else:
            pieces += [(low, n_low), _side(bottom, top, height), (high, n_high)]
    else:
        pieces.append((np.array([[0, -half], [bottom, -half]]), np.array([[0.0, -1], [0, -1]])))
        pieces.append(_side(bottom, top, height))
        if kind == "cylinder":
            pieces.append((np.array([[top, half], [0, half]]), np.array([[0.0, 1], [0, 1]])))
    angle = np.linspace(0.0, 2.0 * math.pi, AROUND + 1)
    angle[-1] = 0.0
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    positions, normals, uvs, triangles = [], [], [], []
    base = 0
    for profile, normal in pieces:
        rows = len(profile)
        positions.append(_sweep(profile, turn))
        normals.append(_sweep(normal, turn))
        u, v = np.meshgrid(np.linspace(0, 1, AROUND + 1), np.linspace(0, 1, rows))
        uvs.append(np.stack([u, v], axis=-1).reshape(-1, 2))
        a = (np.arange(rows - 1)[:, None] * (AROUND + 1) + np.arange(AROUND)).ravel() + base
        d = a + AROUND + 1
        least = 1e-9 * max(bottom, top)
        lower = np.repeat(profile[:-1, 0] > least, AROUND)
        upper = np.repeat(profile[1:, 0] > least, AROUND)
        triangles.append(np.stack([a, a + 1, d + 1], axis=1)[lower])
        triangles.append(np.stack([a, d + 1, d], axis=1)[upper])
        base += rows * (AROUND + 1)
    return Shape(
        _to_axis(np.concatenate(positions), axis),
        _to_axis(np.concatenate(normals), axis),
        np.ascontiguousarray(np.concatenate(uvs), np.float32),
        np.ascontiguousarray(np.concatenate(triangles), np.uint32),
    )


def _side(bottom: float, top: float, height: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Returns profile and profile normals of the side of a cylinder or truncated cone."""
    half = 0.5 * height
    slope = np.array([height, bottom - top]) / (math.hypot(height, bottom - top) or 1.0)
    # The side of a cone is divided into several rows, so that interpolated normals are smooth near
    # the tip.
    s = np.linspace(0.0, 1.0, 2 if bottom and top else 9)[:, None]
    return (1 - s) * (bottom, -half) + s * (top, half), np.tile(slope, (len(s), 1))


def _arc(
    radius: float, start: float, stop: float, z: float, steps: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    angle = np.radians(np.linspace(start, stop, steps + 1))
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normal[np.abs(normal) < 1e-12] = 0.0
    return radius * normal + (0.0, z), normal


def _sweep(profile: NDArray[Any], turn: NDArray[Any]) -> NDArray[Any]:
    """Revolves a profile (rows, 2) of radius and z about Z; returns (rows * columns, 3)."""
    out = np.empty((len(profile), len(turn), 3))
    out[..., :2] = profile[:, None, :1] * turn
    out[..., 2] = profile[:, None, 1]
    return out.reshape(-1, 3)


_READERS: dict[str, Callable[[Number, Token], Shape]] = {
    "Sphere": _sphere,
    "Cube": _cube,
    "Cylinder": _cylinder,
    "Cylinder_1": _cylinder,
    "Cone": _cone,
    "Capsule": _capsule,
    "Capsule_1": _capsule,
    "Plane": _plane,
}
SHAPES = tuple(_READERS)
"""Type names of the prims that ``read_shape`` supports."""
