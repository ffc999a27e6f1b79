# SPDX-License-Identifier: Apache-2.0
"""Control cage of a subdivision surface, its subdivision rules, and its size in pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd

from wavecomb.image.files.render_output import camera_window, pixel_aspect
from wavecomb.usd.cameras.camera import View
from wavecomb.usd.geometry.primvar import Primvar, as_array, as_integers
from wavecomb.usd.geometry.triangulate import Topology
from wavecomb.usd.materials.network import word
from wavecomb.usd.stage.report import LoadReport

SCHEMES = ("catmullClark", "loop", "bilinear")
_BOUNDARIES = ("none", "edgeOnly", "edgeAndCorner")
_FACE_VARYING = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")
_TRIANGLES = ("catmullClark", "smooth")
_INFINITE = 10.0
"""Value of UsdGeomMesh::SHARPNESS_INFINITE."""

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


@dataclass
class Cage:
    """An authored mesh in object space, before subdivision and displacement.

    Attributes:
        points: (n, 3).
        counts: (faces,) number of corners of each face.
        indices: (corners,) point indices.
        matrix: Transform from mesh space to the space of its group (the world or a prototype).
        left_handed: Whether faces are clockwise when seen from outside.
        scheme: One of ``SCHEMES``, or "none" for polygons that are displaced but not subdivided.
        rules: Arguments of ``SceneBuilder.make_surfaces`` for boundaries, creases, corners and
            holes.
        uvs: Primvar of the texture coordinates.
        topology: Triangulation of the cage.
        smooth: Whether the polygons have smooth normals.
        steps: Points and matrices at equal steps over the shutter; empty if the mesh is static.
    """

    points: Floats
    counts: Ints
    indices: Ints
    matrix: Gf.Matrix4d
    left_handed: bool
    scheme: str
    rules: dict[str, Any]
    uvs: Primvar | None
    topology: Topology
    smooth: bool = True
    steps: Sequence[tuple[Floats, Gf.Matrix4d]] = ()

    def triangles_at(self, level: int) -> int:
        """Returns the number of triangles after ``level`` subdivision steps."""
        if level == 0:
            return self.topology.count
        if self.scheme == "loop":
            return len(self.counts) * 4**level
        return 2 * len(self.indices) * int(4 ** (level - 1))

    def over_shutter(self, description: dict[str, Any]) -> list[dict[str, Any]]:
        """Returns a description for ``SceneBuilder.make_surfaces`` at each shutter step."""
        if not self.steps:
            return [description]
        return [description | {"points": p, "matrix": np.array(m)} for p, m in self.steps]

    def primvar(self, primvar: Primvar, width: int) -> dict[str, Any]:
        """Converts a valid primvar to a description for ``SceneBuilder.make_surfaces``."""
        from wavecomb import _core

        values = np.nan_to_num(
            np.asarray(primvar.values[:, :width], np.float32), nan=0.0, posinf=0.0, neginf=0.0
        )
        kind, index = primvar.interpolation, primvar.index
        if kind == "constant":
            kind, values = "varying", np.repeat(values[:1], len(self.points), axis=0)
        elif kind == "uniform":
            kind = "faceVarying"
            corners = np.repeat(np.arange(len(self.counts), dtype=np.int32), self.counts)
        elif kind == "faceVarying" and index is not None:
            # Keep the authored indices, since corners with different indices stay separate in
            # subdivision even if their values are equal.
            corners, table = index, np.zeros((int(index.max()) + 1, values.shape[1]), np.float32)
            table[index] = values
            values = table
        elif kind == "faceVarying":
            values = np.ascontiguousarray(values)
            corners, values = _core.weld_corners(self.indices, len(self.points), values)
        out = {"interpolation": kind, "values": np.ascontiguousarray(values), "width": width}
        return out | {"indices": corners} if kind == "faceVarying" else out


def read_rules(prim: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> dict[str, Any]:
    """Reads boundary rules, creases, corners and holes of a UsdGeomMesh."""
    get, path = prim.GetAttribute, prim.GetPath()

    def token(name: str, known: Sequence[str], default: str) -> str:
        value = get(name).Get(time)
        if value is None or word(value) in known:
            return word(value) or default
        report.warn(f"{name} {value!r} is none of {', '.join(known)}: {default}", path)
        return default

    def numbers(name: str) -> Floats:
        array = as_array(get(name).Get(time))
        if array is None:
            return np.empty(0, np.float32)
        values = np.nan_to_num(array[:, 0].astype(np.float32), posinf=_INFINITE)
        return np.clip(values, 0.0, _INFINITE).astype(np.float32)

    rules: dict[str, Any] = {
        "boundary": token("interpolateBoundary", _BOUNDARIES, "edgeAndCorner"),
        "face_varying": token("faceVaryingLinearInterpolation", _FACE_VARYING, "cornersPlus1"),
        "smooth_triangles": token("triangleSubdivisionRule", _TRIANGLES, "catmullClark")
        == "smooth",
    }
    if get("holeIndices").HasAuthoredValue():
        rules["holes"] = as_integers(get("holeIndices").Get(time))
    if get("creaseIndices").HasAuthoredValue():
        edges = crease_pairs(
            as_integers(get("creaseIndices").Get(time)),
            as_integers(get("creaseLengths").Get(time)),
            numbers("creaseSharpnesses"),
        )
        if edges is None:
            report.warn("creases whose lengths do not fit: ignored", path)
        else:
            rules["crease_edges"], rules["crease_sharpness"] = edges
    if get("cornerIndices").HasAuthoredValue():
        corners, sharpness = (
            as_integers(get("cornerIndices").Get(time)),
            numbers("cornerSharpnesses"),
        )
        if len(corners) == len(sharpness):
            rules["corner_vertices"], rules["corner_sharpness"] = corners, sharpness
        else:
            report.warn("corners without a sharpness each: ignored", path)
    return rules


SHARP = 1.0
"""Smallest crease sharpness that makes an edge hard if the mesh is not subdivided."""


def sharp_edges(
    prim: Usd.Prim, point_count: int, time: Usd.TimeCode, report: LoadReport
) -> NDArray[np.int64] | None:
    """Returns hard edges (k, 2) of a mesh without subdivision; None if the mesh has no creases."""
    get = prim.GetAttribute
    indices = as_integers(get("creaseIndices").Get(time))
    lengths = as_integers(get("creaseLengths").Get(time))
    sharpness = as_array(get("creaseSharpnesses").Get(time))
    if sharpness is None or not ((indices >= 0) & (indices < point_count)).all():
        report.warn("creases that name no points of the mesh: ignored", prim.GetPath())
        return None
    creases = crease_pairs(indices, lengths, sharpness[:, 0])
    return None if creases is None else creases[0][creases[1] >= SHARP].astype(np.int64)


def crease_pairs(
    indices: Ints, lengths: Ints, sharpness: Floats
) -> tuple[NDArray[np.int32], Floats] | None:
    """Returns crease edges (k, 2) and their sharpness (k,); None if array lengths do not match.

    Args:
        indices: Point indices of all creases, one crease after the other.
        lengths: Number of points of each crease.
        sharpness: One value for each crease, or one value for each edge.
    """
    if len(lengths) == 0 or lengths.min() < 2 or lengths.sum(dtype=np.int64) != len(indices):
        return None
    last = np.zeros(len(indices), bool)
    last[np.cumsum(lengths) - 1] = True
    first = np.flatnonzero(~last)
    if len(sharpness) == len(lengths):
        sharpness = np.repeat(sharpness, lengths - 1)
    elif len(sharpness) != len(first):
        return None
    edges = np.stack([indices[first], indices[first + 1]], axis=1)
    return np.ascontiguousarray(edges, np.int32), np.ascontiguousarray(sharpness, np.float32)


Matrices = NDArray[np.float64]

NEAREST = 16
"""Number of instances of a mesh, the largest in the image, whose edges are measured in pixels."""


class ViewSize:
    """Conversion of lengths to pixels for one camera view.

    Attributes:
        pixels: Pixels per unit of the camera's window.
        per_length: Pixels per unit of length at a point where ``distances`` returns 1.
    """

    def __init__(self, view: View, size: tuple[int, int]) -> None:
        """``size`` is the width and height of the image."""
        x0, x1, y0, y1 = camera_window(view.options, *size)
        half = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        self.centre = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        self.half = half
        # If pixels are not square, use the direction with the smaller pixel size, so that the mesh
        # is refined enough in both directions.
        shape = pixel_aspect(view.options, *size)
        self.pixels = size[0] / (2.0 * half[0]) * (shape if shape > 1.0 + 1e-5 else 1.0)
        self.projection = str(view.options.get("projection", "perspective"))
        all_round = self.projection == "latlong"
        self.per_length = size[0] / (2.0 * np.pi) if all_round else self.pixels
        self.to_camera = np.linalg.inv(np.asarray(view.transform, np.float64))

    def distances(self, points: NDArray[Any], to_world: Matrices) -> NDArray[np.float64]:
        """Returns divisors (n,) that convert lengths at points (n, 3) to projected lengths.

        For a perspective camera, the divisor is the depth of a point in front of the camera, or the
        distance of a point behind the camera. For a latlong camera, the divisor is the distance;
        for an orthographic camera, it is 1.
        """
        if self.projection == "orthographic":
            return np.ones(len(points))
        to_camera = to_world @ self.to_camera
        seen = points @ to_camera[:3, :3] + to_camera[3, :3]
        away = np.linalg.norm(seen, axis=1)
        if self.projection == "perspective":
            away = np.where(seen[:, 2] < 0, -seen[:, 2], away)
        return np.asarray(away, np.float64)

    def edges(self, cage: Cage, bounds: NDArray[Any], placed: Matrices) -> float:
        """Returns the mean edge length of a cage in pixels, for the instance with the largest mean.

        Args:
            cage: The cage.
            bounds: (2, 3) bounds of the cage in the space of its group (the world or a prototype).
            placed: (k, 4, 4) transforms from the cage's group to the world.
        """
        from wavecomb import _core

        if len(placed) > NEAREST:
            placed = placed[self._largest(bounds, placed)]
        transforms = np.array(cage.matrix) @ placed
        return _core.edge_pixels(
            cage.points, cage.counts, cage.indices, np.ascontiguousarray(transforms),
            np.ascontiguousarray(self.to_camera), self.centre, self.half, self.pixels,
            self.projection,
        )  # fmt: skip

    def _largest(self, bounds: NDArray[Any], placed: Matrices) -> NDArray[np.intp]:
        """Returns indices of the instances with the largest bounding spheres in the image."""
        centre = 0.5 * (bounds[0] + bounds[1]).astype(np.float64)
        radius = 0.5 * float(np.linalg.norm(bounds[1] - bounds[0]))
        linear = placed[:, :3, :3]
        scale = np.sqrt(np.einsum("kij,kij->ki", linear, linear).max(axis=1))
        world = centre @ linear + placed[:, 3, :3]
        seen = world @ self.to_camera[:3, :3] + self.to_camera[3, :3]
        reach = radius * scale
        distance = np.maximum(np.linalg.norm(seen, axis=1) - reach, 0.01 * reach + 1e-30)
        depth = np.maximum(-seen[:, 2] + reach, 0.0)
        if self.projection == "latlong":
            return np.argsort(-scale / distance, kind="stable")[:NEAREST]
        if self.projection == "orthographic":
            distance = np.ones_like(distance)
            depth = (depth > 0).astype(np.float64)
        aside = [
            np.abs(seen[:, axis] - self.centre[axis] * depth) - reach <= self.half[axis] * depth
            for axis in (0, 1)
        ]
        weight = np.where((depth > 0) & aside[0] & aside[1], 1.0, 0.125)
        return np.argsort(-weight * scale / distance, kind="stable")[:NEAREST]
