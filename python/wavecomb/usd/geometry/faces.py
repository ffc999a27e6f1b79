# SPDX-License-Identifier: Apache-2.0
"""Faces of what is drawn as polygons: meshes, and the surfaces of tetrahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from wavecomb.usd.geometry.primvar import as_array, as_integers
from wavecomb.usd.geometry.triangulate import MeshError

Ints = NDArray[np.int32]

TETRAHEDRA = "TetMesh"
"""Type name of the prims that have tetrahedra in place of faces."""


def read_faces(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[Ints, Ints]:
    """Corners of each face, and the points at all corners, of a Mesh or a TetMesh.

    Raises:
        MeshError: Tetrahedra name points that are not there.
    """
    get = prim.GetAttribute
    if prim.GetTypeName() == TETRAHEDRA:
        indices = _surface(prim, time)
        return np.full(len(indices) // 3, 3, np.int32), indices
    counts = as_integers(get("faceVertexCounts").Get(time))
    return counts, as_integers(get("faceVertexIndices").Get(time)) if len(counts) else counts


def _surface(prim: Usd.Prim, time: Usd.TimeCode) -> Ints:
    """Triangles of the outside of tetrahedra: as authored, else those that only one of them has."""
    values = as_array(prim.GetAttribute("surfaceFaceVertexIndices").Get(time))
    if values is None or len(values) == 0:
        tetrahedra = as_array(prim.GetAttribute("tetVertexIndices").Get(time))
        if tetrahedra is None or tetrahedra.shape != (len(tetrahedra), 4):
            return np.empty(0, np.int32)
        points = prim.GetAttribute("points").Get(time)
        if tetrahedra.min() < 0 or tetrahedra.max() >= len(points or ()):
            raise MeshError("tetVertexIndices name points that are not there")
        values = as_array(UsdGeom.TetMesh.ComputeSurfaceFaces(UsdGeom.TetMesh(prim), time))
    if values is None or values.shape != (len(values), 3):
        return np.empty(0, np.int32)
    return np.ascontiguousarray(values.reshape(-1), np.int32)
