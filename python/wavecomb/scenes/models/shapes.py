# SPDX-License-Identifier: Apache-2.0
"""Basic shapes of furniture, such as rounded boxes and tubes, and functions to add them.

All shapes are closed meshes in metres. Texture coordinates are also in metres, with v along the
grain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pxr import Gf, UsdGeom

from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.mesh import (
    FloatArray,
    Mesh,
    grid_mesh,
    merge,
    normalized,
    smooth_normals,
    without_flat_faces,
)
from wavecomb.scenes.models.sweep import Tube, spline, tube_mesh

Vector = Sequence[float] | FloatArray
"""Sequence of two or three numbers."""

_WELD_DIGITS = 6
"""Number of decimals of point coordinates; rounding makes adjacent faces share points exactly."""
_TUBE_LENGTH = 0.5
"""Length along a tube from ``sweep`` per unit of texture coordinates, in metres."""


def turn_about(axis: int, degrees: float) -> FloatArray:
    """Returns the rotation matrix (3, 3) about axis x, y or z (0, 1 or 2).

    Positive angles are counter-clockwise as seen from the tip of the axis.
    """
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def placed(mesh: Mesh, offset: Vector = (0.0, 0.0, 0.0), turn: FloatArray | None = None) -> Mesh:
    """Returns the mesh rotated by a matrix (3, 3), then translated by (3,)."""
    matrix = np.eye(3) if turn is None else turn
    points = mesh.points.astype(np.float64) @ matrix.T + np.asarray(offset, float)
    normals = mesh.normals.astype(np.float64) @ matrix.T
    return replace(mesh, points=points.astype(np.float32), normals=normals.astype(np.float32))


def grounded(mesh: Mesh) -> Mesh:
    """Returns the mesh translated so that it stands on y = 0."""
    return placed(mesh, (0.0, -float(mesh.points[:, 1].min()), 0.0))


def mapped_flat(mesh: Mesh, across: int, up: int) -> Mesh:
    """Maps texture coordinates from 0 to 1 to the mesh's bounds along two axes."""
    low, high = mesh.bounds
    axes = [across, up]
    uv = (mesh.points[:, axes] - low[axes]) / (high - low)[axes]
    return Mesh(mesh.points, mesh.faces, mesh.normals, uv.astype(np.float32))


def tapered(mesh: Mesh, foot: float) -> Mesh:
    """Scales a mesh towards the y axis, by ``foot`` at its lowest point and by 1 at its top."""
    low, high = mesh.bounds
    height = (mesh.points[:, 1] - low[1]) / (high[1] - low[1])
    points = mesh.points.copy()
    points[:, [0, 2]] *= (foot + (1.0 - foot) * height)[:, None]
    return Mesh(points, mesh.faces, mesh.normals, mesh.uv)


def rounded_box(
    low: Vector,
    high: Vector,
    radius: float = 0.003,
    arc: int = 2,
    bulge: Vector = (0.0, 0.0, 0.0),
    uv_offset: Vector = (0.0, 0.0),
) -> Mesh:
    """Makes a box with rounded edges.

    Args:
        low: Lower corner (3,).
        high: Upper corner (3,).
        radius: Radius of the edges; at most half of the thinnest side.
        arc: Number of cells on an eighth of a circle.
        bulge: Height by which the faces across x, y and z bulge, for upholstery.
        uv_offset: Offset of the texture coordinates (2,), so that boards look different.
    """
    low, high, swell = (np.asarray(v, float) for v in (low, high, bulge))
    half = 0.5 * (high - low)
    radius = min(radius, 0.999 * float(half.min()))
    cells = 8 if swell.any() else 1
    rounding = np.linspace(0.0, 1.0, arc + 1)
    lean = np.concatenate([-rounding[::-1], np.zeros(cells - 1), rounding])
    end = np.ones(arc + 1)
    place = np.concatenate([-end, np.linspace(-1.0, 1.0, cells + 1)[1:-1], end])
    sides = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        along, across = (b, c) if half[b] > half[c] else (c, b)
        for sign in (-1.0, 1.0):
            normals = np.empty((len(lean), len(lean), 3))
            normals[..., axis], normals[..., b], normals[..., c] = sign, lean[:, None], lean
            normals = normalized(normals)
            points = np.empty_like(normals)
            points[..., axis], points[..., b], points[..., c] = sign, place[:, None], place
            points = points * (half - radius) + radius * normals
            uv = (points + 0.5 * (low + high))[..., [across, along]] + np.asarray(uv_offset, float)
            sides.append(grid_mesh(points, uv, normals, reverse=sign < 0.0))
    box = merge(sides)
    points = box.points.astype(np.float64)
    if swell.any():
        x, y, z = (1.0 - np.clip((points / half) ** 2, 0.0, 1.0)).T
        points = points * (1.0 + swell / half * np.stack([y * z, z * x, x * y], axis=1))
    welded = np.round(points + 0.5 * (low + high), _WELD_DIGITS).astype(np.float32)
    rounded = smooth_normals(welded, box.faces) if swell.any() else box.normals
    return Mesh(welded, box.faces, rounded, box.uv)


def _lengths(curve: FloatArray) -> FloatArray:
    """Returns the arc length of a polyline (n, k) at each of its points, (n,)."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def turned(profile: Sequence[Vector] | FloatArray, columns: int, steps: int = 4) -> Mesh:
    """Makes a body of revolution about y.

    Args:
        profile: Control points (radius, height) of a spline from axis to axis, upwards on the
            outside. A repeated control point makes an almost sharp corner.
        columns: Cells around.
        steps: Number of cells between two control points.
    """
    control = np.asarray(profile, float)
    curve = spline(control, np.linspace(0.0, 1.0, steps * (len(control) - 1) + 1))
    radius, height = np.where(curve[:, 0] > 1e-9, curve[:, 0], 0.0), curve[:, 1]
    turn = np.linspace(0.0, 2.0 * np.pi, columns + 1)
    cosine, sine = np.cos(turn), np.sin(turn)
    cosine[-1], sine[-1] = cosine[0], sine[0]
    shape = (len(curve), columns + 1)
    points = np.stack(
        [radius[:, None] * cosine, np.broadcast_to(height[:, None], shape), radius[:, None] * sine],
        axis=2,
    )
    arc = _lengths(curve)[:, None]
    uv = np.stack(np.broadcast_arrays(turn * radius.max(), arc), axis=2)
    return without_flat_faces(grid_mesh(points, uv), 1e-9)


def disc(radius: float, height: float, columns: int) -> Mesh:
    """Makes a flat disc that faces up."""
    return turned([(radius, height), (0.5 * radius, height), (0.0, height)], columns, 2)


def tube(
    points: Sequence[Vector],
    width: float | Sequence[float],
    columns: int = 12,
    rings: int = 16,
    height: float | Sequence[float] | None = None,
    up: Vector = (0.0, 0.0, 1.0),
) -> Mesh:
    """Makes a closed tube with round ends along a spline.

    Args:
        points: Control points of the centre line, (k, 3).
        width: Half width, either one number or one for each point.
        columns: Cells around.
        rings: Cells along.
        height: Half height along ``up``; None means the half width.
        up: Any direction that is not parallel to the tube.
    """
    control = np.asarray(points, float)
    wide = np.broadcast_to(np.asarray(width, float), len(control)).copy()
    tall = wide if height is None else np.broadcast_to(np.asarray(height, float), len(control))
    mesh = tube_mesh(Tube(control, wide, tall.copy(), np.asarray(up, float)), rings, columns)
    around = math.pi * float(wide.mean() + tall.mean()) / float(mesh.uv[:, 0].max())
    uv = mesh.uv * np.array([around, _TUBE_LENGTH], np.float32)
    return Mesh(mesh.points, mesh.faces, mesh.normals, uv)


def pillow(width: float, depth: float, thickness: float, cells: int = 20) -> Mesh:
    """Makes a pillow in the xy plane, its front towards +z, centred at the origin."""
    t = np.sin(0.5 * np.pi * np.linspace(-1.0, 1.0, cells + 1))
    t[[0, -1]] = -1.0, 1.0
    x, y = np.meshgrid(t, t, indexing="xy")
    pinch = 0.07
    flat = [
        0.5 * width * x * (1.0 - pinch * (1.0 - y * y)),
        0.5 * depth * y * (1.0 - pinch * (1.0 - x * x)),
    ]
    swell = 0.5 * thickness * np.sqrt((1.0 - x**4) * (1.0 - y**4))
    # Texture coordinates are arc lengths along the middle lines of the cushion, so that the texture
    # is not stretched.
    middle = np.stack([flat[0][cells // 2], swell[cells // 2]], axis=1)
    upright = np.stack([flat[1][:, cells // 2], swell[:, cells // 2]], axis=1)
    uv = np.stack(np.meshgrid(_lengths(middle), _lengths(upright)), axis=2)
    sides = []
    for sign in (1.0, -1.0):
        points = np.round(np.stack([*flat, sign * swell], 2), _WELD_DIGITS)
        # Grid rows run along +y and columns along +x, so the grid's default normals point along -z.
        sides.append(grid_mesh(points, uv, np.zeros(points.shape), reverse=sign > 0.0))
    both = merge(sides)
    return replace(both, normals=smooth_normals(both.points, both.faces))


Part = tuple[Mesh, str]
"""Part of an object: a mesh and the name of its material."""


def add_object(
    writer: StageWriter,
    path: str,
    parts: Sequence[Part],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    turn_degrees: float = 0.0,
) -> None:
    """Adds an Xform, rotated about Y, with one mesh for each material of the parts."""
    _place(UsdGeom.Xform.Define(writer.stage, path), position, turn_degrees)
    _fill(writer, path, parts)


def add_prototype(writer: StageWriter, name: str, parts: Sequence[Part]) -> str:
    """Adds a class prim with one mesh for each material; returns its path for ``add_instance``."""
    path = f"/_Prototype_{name}"
    writer.stage.CreateClassPrim(path).SetTypeName("Xform")
    _fill(writer, path, parts)
    return path


def add_instance(
    writer: StageWriter,
    path: str,
    prototype: str,
    position: Sequence[float],
    turn_degrees: float = 0.0,
) -> None:
    """Adds a native instance of a prototype from ``add_prototype``."""
    xform = UsdGeom.Xform.Define(writer.stage, path)
    _place(xform, position, turn_degrees)
    xform.GetPrim().GetReferences().AddInternalReference(prototype)
    xform.GetPrim().SetInstanceable(True)


def _place(xform: UsdGeom.Xform, position: Sequence[float], turn_degrees: float) -> None:
    xform.AddTranslateOp().Set(Gf.Vec3d(*(float(v) for v in position)))
    xform.AddRotateYOp().Set(float(turn_degrees))


def _fill(writer: StageWriter, path: str, parts: Sequence[Part]) -> None:
    meshes: dict[str, list[Mesh]] = {}
    for mesh, material in parts:
        meshes.setdefault(material, []).append(mesh)
    for material, some in meshes.items():
        writer.mesh(f"{path}/{material}", merge(some), material)
