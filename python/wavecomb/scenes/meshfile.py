# SPDX-License-Identifier: Apache-2.0
"""Reads a triangle mesh from OBJ, PLY (ASCII or binary, also .gz) or USD, to stand for the dragon.

Whoever has the Stanford XYZRGB dragon, which we may not ship, brings it in this way.
"""

from __future__ import annotations

import gzip
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Gf, Tf, Usd, UsdGeom

from wavecomb.scenes.errors import SceneError
from wavecomb.scenes.mesh import (
    FloatArray,
    Mesh,
    signed_volume,
    smooth_normals,
    without_flat_faces,
)

TARGET_DIAGONAL = 3.05
"""Diagonal of our dragon's bounding box, scene units; imported meshes are scaled to it."""

_TEXTURE_LENGTH = 0.5
_USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_MAX_FACE_VERTICES = 255
MAX_UNPACKED = 1 << 31
"""Bytes that a .gz may hold: ten times the largest dragon."""

_PLY_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}


@dataclass(frozen=True)
class RawMesh:
    """What a file holds: points float64 (n, 3), triangles int64 (m, 3), uv (n, 2) or None."""

    points: FloatArray
    faces: np.ndarray
    uv: FloatArray | None


def load_dragon(path: Path) -> Mesh:
    """Reads a mesh and makes it fit where our dragon would stand.

    It is scaled to our dragon's size, centred over the origin, set on y = 0 and given smooth
    normals; where it has no uv it gets a cylindrical projection about Y.

    Args:
        path: .obj, .ply, either with .gz, or .usd, .usda, .usdc, .usdz.

    Raises:
        SceneError: The file is missing, broken, empty or of another kind.
    """
    if not path.is_file():
        raise SceneError(f"{path}: no such mesh file")
    try:
        with np.errstate(invalid="ignore"):  # an index that is no number: _check finds it
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
    # Removing flat faces may drop the points that spanned the bounds: stand it on the ground.
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
    return _read_obj(data) if kind[0] == ".obj" else _read_ply(data)


def _check(raw: RawMesh) -> None:
    if not len(raw.points) or not len(raw.faces):
        raise ValueError("it has no triangles")
    if raw.faces.min() < 0 or raw.faces.max() >= len(raw.points):
        raise ValueError("a face refers to a vertex that is not there")
    if not np.isfinite(raw.points).all():
        raise ValueError("a vertex is not a finite number")
    if raw.uv is not None and not np.isfinite(raw.uv).all():
        raise ValueError("a texture coordinate is not a finite number")
    extent = np.ptp(raw.points, axis=0)
    if not 1e-30 < float(extent.max()) < 1e30:
        raise ValueError("its size is zero or absurd")


def _fans(counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Triangle fans of polygons: counts (k,), indices (sum,) -> int64 (m, 3)."""
    counts = np.asarray(counts, np.int64)
    indices = np.asarray(indices, np.int64)
    if len(counts) and (counts.min() < 0 or counts.sum() != len(indices)):
        raise ValueError("face sizes and indices do not agree")
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    owner = np.repeat(np.arange(len(counts)), triangles)
    corner = np.arange(int(triangles.sum())) - np.repeat(
        np.cumsum(triangles) - triangles, triangles
    )
    first = starts[owner]
    return np.stack([indices[first], indices[first + corner + 1], indices[first + corner + 2]], 1)


def _cylinder(points: np.ndarray) -> FloatArray:
    """Cylindrical projection about Y, (n, 2), about one repeat for each half unit."""
    radius = float(np.hypot(points[:, 0], points[:, 2]).mean())
    repeats = max(1, round(2.0 * np.pi * radius / _TEXTURE_LENGTH))
    # A triangle wave has no seam to tear a triangle that crosses it.
    turn = np.abs(np.arctan2(points[:, 2], points[:, 0])) / np.pi
    return np.stack([turn * repeats, points[:, 1] / _TEXTURE_LENGTH], axis=1)


def _read_obj(data: bytes) -> RawMesh:
    """Wavefront OBJ: v, vt and f; a vertex is split where its texture coordinates differ."""
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
        return RawMesh(points, _fans(np.array(counts), vertex), None)
    uv = np.array(textures, np.float64).reshape(-1, 2)
    texture = np.array([int(s[1]) for s in split])
    texture = np.where(texture < 0, len(uv) + texture, texture - 1)
    if min(vertex.min(), texture.min()) < 0 or vertex.max() >= len(points):
        raise ValueError("a face refers to a vertex that is not there")
    if texture.max() >= len(uv):
        raise ValueError("a face refers to a texture coordinate that is not there")
    pairs, shared = np.unique(vertex * len(uv) + texture, return_inverse=True)
    return RawMesh(
        points[pairs // len(uv)], _fans(np.array(counts), shared.ravel()), uv[pairs % len(uv)]
    )


@dataclass
class _Element:
    """A PLY element: its count and properties (name, type, type of the list's count or None)."""

    name: str
    count: int
    properties: list[tuple[str, str, str | None]]


def _ply_header(data: bytes) -> tuple[str, list[_Element], int]:
    """Format, elements and offset of the body."""
    if not data.startswith(b"ply"):
        raise ValueError("it does not begin with 'ply'")
    end = data.find(b"end_header")
    stop = data.find(b"\n", end)
    if end < 0 or stop < 0:
        raise ValueError("its header has no end")
    style = ""
    elements: list[_Element] = []
    for line in data[:end].decode("ascii", "replace").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            style = words[1]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), []))
            if not 0 <= elements[-1].count <= len(data):
                raise ValueError(f"it cannot hold {words[2]} of {words[1]}")
        elif words[:2] == ["property", "list"]:
            elements[-1].properties.append((words[4], _PLY_TYPES[words[3]], _PLY_TYPES[words[2]]))
        elif words[:1] == ["property"]:
            elements[-1].properties.append((words[2], _PLY_TYPES[words[1]], None))
    if any(element.count and not element.properties for element in elements):
        raise ValueError("it has an element without properties")
    if style not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise ValueError(f"its format {style!r} is unknown")
    return style, elements, stop + 1


class _PlyBody:
    """Reads elements one after the other."""

    def __init__(self, data: bytes, offset: int, style: str) -> None:
        self._data = data
        self._offset = offset
        self._order = ">" if style == "binary_big_endian" else "<"
        self._words = data[offset:].split() if style == "ascii" else None
        self._word = 0

    def scalars(self, element: _Element) -> dict[str, np.ndarray]:
        """Columns of an element without lists."""
        names = [name for name, _, _ in element.properties]
        if self._words is not None:
            size = element.count * len(names)
            words = self._words[self._word : self._word + size]
            if len(words) < size:
                raise ValueError(f"it ends within its {element.name} data")
            self._word += size
            table = np.array(words, np.float64).reshape(element.count, len(names))
            return {name: table[:, k] for k, name in enumerate(names)}
        row = np.dtype([(name, self._order + kind) for name, kind, _ in element.properties])
        rows = self._rows(row, element)
        return {name: rows[name].astype(np.float64) for name in names}

    def _rows(self, row: np.dtype, element: _Element) -> np.ndarray:
        size = row.itemsize * element.count
        if self._offset + size > len(self._data):
            raise ValueError(f"it ends within its {element.name} data")
        rows = np.frombuffer(self._data, row, element.count, self._offset)
        self._offset += size
        return rows

    def lists(self, element: _Element) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Counts and values of each list of an element; its scalars are skipped."""
        uniform = self._uniform(element)
        if uniform is not None:
            return uniform
        counts: dict[str, list[int]] = {}
        values: dict[str, list[np.ndarray]] = {}
        for _ in range(element.count):
            for name, kind, count_kind in element.properties:
                size = 1 if count_kind is None else int(self._take(count_kind, 1)[0])
                if not 0 <= size <= _MAX_FACE_VERTICES:
                    raise ValueError(f"a face with {size} vertices")
                taken = self._take(kind, size)
                if count_kind is not None:
                    counts.setdefault(name, []).append(size)
                    values.setdefault(name, []).append(taken)
        return {name: (np.array(counts[name]), np.concatenate(values[name])) for name in counts}

    def _uniform(self, element: _Element) -> dict[str, tuple[np.ndarray, np.ndarray]] | None:
        """The same where all lists have three entries, at once; None where they have not."""
        if self._words is not None:
            if len(element.properties) != 1:
                return None
            words = self._words[self._word : self._word + 4 * element.count]
            if len(words) < 4 * element.count:
                return None
            table = np.array(words).reshape(-1, 4)
            if not (table[:, 0] == b"3").all():
                return None
            self._word += 4 * element.count
            values = table[:, 1:].astype(np.int64).ravel()
            return {element.properties[0][0]: (np.full(element.count, 3), values)}
        fields: list[tuple] = []
        lists = []
        for name, kind, count_kind in element.properties:
            if count_kind is None:
                fields.append((name, self._order + kind))
            else:
                lists.append(name)
                fields += [
                    (f"{name} count", self._order + count_kind),
                    (name, self._order + kind, (3,)),
                ]
        row = np.dtype(fields)
        if self._offset + row.itemsize * element.count > len(self._data):
            return None
        rows = np.frombuffer(self._data, row, element.count, self._offset)
        if not all((rows[f"{name} count"] == 3).all() for name in lists):
            return None
        self._offset += row.itemsize * element.count
        return {name: (np.full(element.count, 3), rows[name].ravel()) for name in lists}

    def _take(self, kind: str, size: int) -> np.ndarray:
        if self._words is not None:
            words = self._words[self._word : self._word + size]
            if len(words) < size:
                raise ValueError("it ends within its faces")
            self._word += size
            return np.array([float(word) for word in words])
        dtype = np.dtype(self._order + kind)
        if self._offset + size * dtype.itemsize > len(self._data):
            raise ValueError("it ends within its faces")
        taken = np.frombuffer(self._data, dtype, size, self._offset)
        self._offset += size * dtype.itemsize
        return taken


def _read_ply(data: bytes) -> RawMesh:
    """PLY: vertex x, y, z and s, t or u, v where present; faces of any size."""
    style, elements, offset = _ply_header(data)
    body = _PlyBody(data, offset, style)
    points: FloatArray | None = None
    faces: np.ndarray | None = None
    uv: FloatArray | None = None
    for element in elements:
        if any(count_kind for _, _, count_kind in element.properties):
            lists = body.lists(element)
            for name in ("vertex_indices", "vertex_index"):
                if element.name == "face" and name in lists:
                    faces = _fans(*lists[name])
        else:
            columns = body.scalars(element)
            if element.name == "vertex":
                points = np.stack([columns[axis] for axis in "xyz"], axis=1)
                for u, v in (("s", "t"), ("u", "v"), ("texture_u", "texture_v")):
                    if u in columns and v in columns:
                        uv = np.stack([columns[u], columns[v]], axis=1)
        if points is not None and faces is not None:
            break
    if points is None or faces is None:
        raise ValueError("it has no vertices or no faces")
    return RawMesh(points, faces, uv)


def _read_usd(path: Path) -> RawMesh:
    """All meshes of a USD stage in world space, Y up; uv where every mesh has vertex ``st``."""
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
            raise ValueError(f"{prim.GetPath()}: a face refers to a vertex that is not there")
        matrix = np.array(cache.GetLocalToWorldTransform(prim) * turn)
        triangles = _fans(counts, indices) + offset
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
