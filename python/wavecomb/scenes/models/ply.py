# SPDX-License-Identifier: Apache-2.0
"""Reader of PLY files, ASCII and binary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavecomb.scenes.models.mesh import FloatArray


@dataclass(frozen=True)
class RawMesh:
    """Mesh as read from a file, with or without texture coordinates."""

    points: FloatArray
    faces: np.ndarray
    uv: FloatArray | None


def fans(counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Splits polygons with ``counts`` vertices each into triangles, (m, 3)."""
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


_MAX_FACE_VERTICES = 255
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


@dataclass
class _Element:
    """Declaration of an element in the header of a PLY file.

    Each property is (name, type, count type); the count type is None unless the property is a list.
    """

    name: str
    count: int
    properties: list[tuple[str, str, str | None]]


def _ply_header(data: bytes) -> tuple[str, list[_Element], int]:
    """Parses a PLY header; returns the format, the elements and the byte offset of the body."""
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
    """Reader of the body of a PLY file, element by element."""

    def __init__(self, data: bytes, offset: int, style: str) -> None:
        self._data = data
        self._offset = offset
        self._order = ">" if style == "binary_big_endian" else "<"
        self._words = data[offset:].split() if style == "ascii" else None
        self._word = 0

    def scalars(self, element: _Element) -> dict[str, np.ndarray]:
        """Reads an element without list properties; returns its columns."""
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
        """Reads the counts and values of each list of an element; skips scalars."""
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
        """Reads the lists at once if every list has three entries, otherwise returns None."""
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


def read_ply(data: bytes) -> RawMesh:
    """Reads a PLY mesh with polygons and optional texture coordinates (s, t or u, v)."""
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
                    faces = fans(*lists[name])
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


def ply_vertices(data: bytes) -> dict[str, np.ndarray]:
    """Reads all scalar properties of the vertices of a PLY file, by name, as float64 (n,)."""
    style, elements, offset = _ply_header(data)
    if not elements or elements[0].name != "vertex":
        raise ValueError("it does not begin with vertices")
    if any(count_kind for _, _, count_kind in elements[0].properties):
        raise ValueError("its vertices have lists")
    return _PlyBody(data, offset, style).scalars(elements[0])
