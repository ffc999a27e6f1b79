# SPDX-License-Identifier: Apache-2.0
"""Reads a triangle mesh from OBJ, PLY (ASCII or binary, also .gz) or USD, to replace the dragon.

Users can thus render the Stanford XYZRGB dragon, which Wavecomb may not distribute.
"""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import numpy as np
from pxr import Gf, Tf, Usd, UsdGeom

from wavecomb.errors import SceneError
from wavecomb.scenes.models.mesh import (
    FloatArray,
    Mesh,
    signed_volume,
    smooth_normals,
    without_flat_faces,
)
from wavecomb.scenes.models.ply import RawMesh, fans, read_ply

TARGET_DIAGONAL = 3.05
"""Diagonal of the built-in dragon's bounding box, in scene units. Imported meshes are scaled to the
same diagonal."""

_TEXTURE_LENGTH = 0.5
_USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
MAX_UNPACKED = 1 << 31
"""Largest unpacked size of a .gz file in bytes, ten times the size of the largest dragon."""


def load_dragon(path: Path) -> Mesh:
    """Reads a mesh, and scales and moves it so that it can replace the built-in dragon.

    The mesh is scaled to the dragon's size, centred over the origin and put on y = 0. The mesh gets
    smooth normals. A mesh without texture coordinates gets a cylindrical projection about Y.

    Args:
        path: File with ending .obj, .ply, .obj.gz, .ply.gz, .usd, .usda, .usdc or .usdz.

    Raises:
        SceneError: The file is missing, damaged, empty or not a mesh file.
    """
    if not path.is_file():
        raise SceneError(f"{path}: no such mesh file")
    try:
        with np.errstate(invalid="ignore"):  # `_check` reports indices that are NaN
            raw = _read(path)
        _check(raw)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, OverflowError) as error:
        raise SceneError(f"{path}: cannot read the mesh: {_one_line(error)}") from error
    except (ValueError, IndexError, KeyError, TypeError) as error:
        raise SceneError(f"{path}: not a usable mesh: {_one_line(error)}") from error
    low, high = raw.points.min(axis=0), raw.points.max(axis=0)
    scale = TARGET_DIAGONAL / float(np.linalg.norm(high - low))
    centre = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
    points = ((raw.points - centre) * scale).astype(np.float32)
    faces = raw.faces.astype(np.int32)
    if signed_volume(points, faces) < 0.0:
        faces = np.ascontiguousarray(faces[:, ::-1])
    uv = _cylinder(points) if raw.uv is None else raw.uv
    empty = np.zeros((len(points), 3), np.float32)
    mesh = without_flat_faces(Mesh(points, faces, empty, uv.astype(np.float32)))
    if not len(mesh.faces):
        raise SceneError(f"{path}: not a usable mesh: all its faces have no area")
    # Removing flat faces may drop the lowest points, so put the mesh on the ground again.
    points = mesh.points - np.array([0.0, mesh.points[:, 1].min(), 0.0], np.float32)
    return Mesh(points, mesh.faces, smooth_normals(points, mesh.faces), mesh.uv)


def _one_line(error: Exception) -> str:
    lines = str(error).splitlines()
    return lines[0] if lines else type(error).__name__


def _read(path: Path) -> RawMesh:
    suffixes = [suffix.lower() for suffix in path.suffixes]
    packed = suffixes[-1:] == [".gz"]
    kind = (suffixes[-2:-1] if packed else suffixes[-1:]) or [""]
    if kind[0] in _USD_SUFFIXES and not packed:
        return _read_usd(path)
    if kind[0] not in (".obj", ".ply"):
        raise ValueError("the name must end in .obj, .ply, .obj.gz, .ply.gz or a USD ending")
    data = b"" if packed else path.read_bytes()
    if packed:
        with gzip.open(path) as file:
            data = file.read(MAX_UNPACKED + 1)
        if len(data) > MAX_UNPACKED:
            raise ValueError(f"it unpacks to more than {MAX_UNPACKED >> 20} MB")
    return _read_obj(data) if kind[0] == ".obj" else read_ply(data)


def _check(raw: RawMesh) -> None:
    if not len(raw.points) or not len(raw.faces):
        raise ValueError("it has no triangles")
    if raw.faces.min() < 0 or raw.faces.max() >= len(raw.points):
        raise ValueError("a face refers to a vertex that does not exist")
    if not np.isfinite(raw.points).all():
        raise ValueError("a vertex is not a finite number")
    if raw.uv is not None and not np.isfinite(raw.uv).all():
        raise ValueError("a texture coordinate is not a finite number")
    extent = np.ptp(raw.points, axis=0)
    if not 1e-30 < float(extent.max()) < 1e30:
        raise ValueError("its size is 0 or too large")


def _cylinder(points: np.ndarray) -> FloatArray:
    """Computes texture coordinates (n, 2) by cylindrical projection about Y."""
    radius = float(np.hypot(points[:, 0], points[:, 2]).mean())
    repeats = max(1, round(2.0 * np.pi * radius / _TEXTURE_LENGTH))
    # The coordinate u is a triangle wave of the angle about Y. It has no seam, where a triangle
    # would span the whole texture.
    turn = np.abs(np.arctan2(points[:, 2], points[:, 0])) / np.pi
    return np.stack([turn * repeats, points[:, 1] / _TEXTURE_LENGTH], axis=1)


def _read_obj(data: bytes) -> RawMesh:
    """Reads Wavefront OBJ (v, vt and f); duplicates vertices with several texture coordinates."""
    positions: list[bytes] = []
    textures: list[bytes] = []
    corners: list[bytes] = []
    counts: list[int] = []
    seen_v: list[int] = []
    for line in data.replace(b"\\\n", b" ").splitlines():
        words = line.split()
        if not words or len(words) < 3:
            continue
        if words[0] == b"v":
            positions += words[1:4]
        elif words[0] == b"vt":
            textures += words[1:3]
        elif words[0] == b"f":
            corners += words[1:]
            counts.append(len(words) - 1)
            seen_v.append(len(positions) // 3)
    points = np.array(positions, np.float64).reshape(-1, 3)
    if not corners:
        return RawMesh(points, np.zeros((0, 3), np.int64), None)
    split = [corner.split(b"/") for corner in corners]
    vertex = np.array([int(s[0]) for s in split])
    owner = np.repeat(np.array(seen_v), np.array(counts))
    vertex = np.where(vertex < 0, owner + vertex, vertex - 1)
    if not textures or not all(len(s) > 1 and s[1] for s in split):
        return RawMesh(points, fans(np.array(counts), vertex), None)
    uv = np.array(textures, np.float64).reshape(-1, 2)
    texture = np.array([int(s[1]) for s in split])
    texture = np.where(texture < 0, len(uv) + texture, texture - 1)
    if min(vertex.min(), texture.min()) < 0 or vertex.max() >= len(points):
        raise ValueError("a face refers to a vertex that does not exist")
    if texture.max() >= len(uv):
        raise ValueError("a face refers to a texture coordinate that does not exist")
    pairs, shared = np.unique(vertex * len(uv) + texture, return_inverse=True)
    return RawMesh(
        points[pairs // len(uv)], fans(np.array(counts), shared.ravel()), uv[pairs % len(uv)]
    )


def _read_usd(path: Path) -> RawMesh:
    """Reads all meshes of a USD stage as one mesh in world space, Y up.

    The mesh has texture coordinates if every mesh of the stage has a primvar ``st`` with vertex
    interpolation.
    """
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise ValueError(f"USD cannot open it: {_one_line(error)}") from error
    turn = Gf.Matrix4d(1.0)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        turn.SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), -90.0))
    cache = UsdGeom.XformCache()
    points: list[FloatArray] = []
    faces: list[np.ndarray] = []
    uvs: list[FloatArray | None] = []
    offset = 0
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        local = np.array(mesh.GetPointsAttr().Get() or [], np.float64).reshape(-1, 3)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or [], np.int64)
        indices = np.array(mesh.GetFaceVertexIndicesAttr().Get() or [], np.int64)
        if not len(local) or not len(counts):
            continue
        if len(indices) and not 0 <= indices.min() <= indices.max() < len(local):
            raise ValueError(f"{prim.GetPath()}: a face refers to a vertex that does not exist")
        matrix = np.array(cache.GetLocalToWorldTransform(prim) * turn)
        triangles = fans(counts, indices) + offset
        mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        if mirrored != (mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded):
            triangles = triangles[:, ::-1]
        points.append(local @ matrix[:3, :3] + matrix[3, :3])
        faces.append(triangles)
        st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        flat = np.array((st.ComputeFlattened() if st else None) or [], np.float64)
        uvs.append(flat if flat.shape == (len(local), 2) else None)
        offset += len(local)
    if not points:
        raise ValueError("it has no meshes")
    have = [uv for uv in uvs if uv is not None]
    return RawMesh(
        np.concatenate(points),
        np.concatenate(faces),
        np.concatenate(have) if len(have) == len(uvs) else None,
    )
