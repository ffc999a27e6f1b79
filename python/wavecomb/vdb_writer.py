# SPDX-License-Identifier: Apache-2.0
"""Writes .vdb files (format 224) without OpenVDB: trees with nodes of 4096, 128 and 8 voxels.

A tree consists of dictionaries by position: nodes, and tiles, which have one value. Voxels and
tiles other than +0 are active, and the background is +0, so that all bits are preserved.
"""

from __future__ import annotations

import hashlib
import itertools
import struct
import uuid
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError

BRICK = 8
"""Edge length of a brick in voxels."""

Floats = NDArray[np.float32]
Index = tuple[int, int, int]

_MAGIC, _FORMAT, _LIBRARY = 0x56444220, 224, (10, 0)
_ZIP, _ACTIVE_MASK = 1, 2
_LOG2 = {4096: 5, 128: 4}
"""Maps the edge length of an inner node in voxels to log2 of its number of entries per edge."""
_CHILD = {4096: 128, 128: BRICK}


def write(path: str | Path, grids: Sequence[Mapping[str, Any]]) -> None:
    """Writes a file of grids in the form of ``wavecomb.vdb.write``.

    Raises:
        WavecombError: Arrays are inconsistent, or the file cannot be written.
    """
    try:
        data = file_bytes(grids)
    except ValueError as error:
        raise WavecombError(f"{path}: {error}") from None
    try:
        Path(path).write_bytes(data)
    except OSError as error:
        raise WavecombError(f"{path}: {error.strerror or error}") from None


def file_bytes(grids: Sequence[Mapping[str, Any]]) -> bytes:
    """Returns the bytes of a file; equal grids give equal bytes.

    Raises:
        ValueError: Arrays are inconsistent.
    """
    start = struct.pack("<qIII?", _MAGIC, _FORMAT, *_LIBRARY, True)
    rest = bytearray(struct.pack("<Ii", 0, len(grids)))
    identifier_bytes = 36
    names: set[str] = set()
    for grid in grids:
        rest += _grid_bytes(grid, names, len(start) + identifier_bytes + len(rest))
    # OpenVDB uses a random identifier; a hash makes files reproducible.
    digest = hashlib.sha256(start + rest).digest()
    return start + str(uuid.UUID(bytes=digest[:16], version=4)).encode() + rest


def _grid_bytes(grid: Mapping[str, Any], names: set[str], offset: int) -> bytes:
    """Returns a grid with its table row, for an offset of the row in the file."""
    values = np.asarray(grid["values"])
    is_half, channels = values.dtype == np.float16, 3 if values.ndim == 5 else 1
    tree = _Tree(channels)
    for first, last, value in grid.get("boxes", ()):
        tree.fill(tuple(first), tuple(last), value)
    origins = np.ascontiguousarray(grid["origins"], np.int32)
    tree.add(origins, np.ascontiguousarray(values, np.float32))
    if grid.get("tiles", False):
        tree.prune()
    kind = ("vec3s" if channels == 3 else "float") + "_5_4_3"
    head = _text(_unique(grid["name"], names)) + _text(
        f"Tree_{kind}_HalfFloat" if is_half else f"Tree_{kind}"
    )
    head += _text("")  # The grid shares no voxels with another grid.
    at_grid = offset + len(head) + 24
    before = struct.pack("<I", _ACTIVE_MASK | _ZIP) + _metadata(grid["name"], tree, is_half)
    before += _transform(np.asarray(grid["index_to_object"], np.float64))
    out = _Output(is_half)
    topology = struct.pack("<i", 1) + tree.topology(out)
    buffers = tree.buffers(out)
    at_buffers = at_grid + len(before) + len(topology)
    table = struct.pack("<qqq", at_grid, at_buffers, at_buffers + len(buffers))
    return b"".join((head, table, before, topology, buffers))


def _text(text: str | bytes) -> bytes:
    data = text.encode() if isinstance(text, str) else text
    return struct.pack("<I", len(data)) + data


def _unique(name: str, names: set[str]) -> str:
    """Returns a name that is unique by OpenVDB's rule: a separator and a number are appended."""
    numbered = (f"{name}\x1e{number}" for number in itertools.count(0 if not name else 1))
    found = next(
        one for one in itertools.chain([name] if name else [], numbered) if one not in names
    )
    names.add(found)
    return found


def _metadata(name: str, tree: _Tree, is_half: bool) -> bytes:
    voxels, box = tree.extent()
    rows = [("name", "string", name.encode()), ("is_saved_as_half_float", "bool", bytes([is_half]))]
    if tree.channels == 1:
        rows.append(("class", "string", b"fog volume"))
    rows.append(("file_voxel_count", "int64", struct.pack("<q", voxels)))
    if box is not None:
        for end, corner in zip(("min", "max"), box, strict=True):
            rows.append((f"file_bbox_{end}", "vec3i", struct.pack("<3i", *corner)))
    made = [_text(key) + _text(kind) + _text(value) for key, kind, value in sorted(rows)]
    return struct.pack("<I", len(made)) + b"".join(made)


def _transform(matrix: NDArray[np.float64]) -> bytes:
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or not np.linalg.det(matrix):
        raise ValueError("a transform without an inverse")
    return _text("AffineMap") + matrix.astype("<f8").tobytes()


class _Output:
    """Encoder of node values in the form of a file."""

    def __init__(self, is_half: bool) -> None:
        self._dtype = "<f2" if is_half else "<f4"

    def values(self, active: Floats) -> bytes:
        """Encodes the active values of a node whose inactive values are the background."""
        without_inactive = b"\0"
        if not active.size and self._dtype == "<f2":
            return without_inactive
        plain = active.astype(self._dtype).tobytes()
        packed = zlib.compress(plain, 1)
        if len(packed) < len(plain):
            return without_inactive + struct.pack("<q", len(packed)) + packed
        return without_inactive + struct.pack("<q", -len(plain)) + plain


@dataclass
class _Node:
    """An inner node with children (nodes or leaves) and tiles by entry number."""

    edge: int
    children: dict[int, Any] = field(default_factory=dict)
    tiles: dict[int, Floats] = field(default_factory=dict)

    def number(self, at: Index) -> int:
        """Returns the number of the entry that contains a voxel."""
        log2, child = _LOG2[self.edge], _CHILD[self.edge]
        x, y, z = ((c & (self.edge - 1)) // child for c in at)
        return (x << 2 * log2) | (y << log2) | z

    def corner(self, number: int, origin: Index) -> Index:
        """Returns the first voxel of an entry, for a node with the given origin."""
        log2, child = _LOG2[self.edge], _CHILD[self.edge]
        mask = (1 << log2) - 1
        shifts = (2 * log2, log2, 0)
        x, y, z = (c + (number >> s & mask) * child for c, s in zip(origin, shifts, strict=True))
        return x, y, z

    @property
    def entries(self) -> int:
        return 1 << 3 * _LOG2[self.edge]

    def child(self, number: int, channels: int) -> Any:
        """Returns a child node or leaf; creates it if necessary, from a tile if there is one."""
        if number in self.children:
            return self.children[number]
        tile = self.tiles.pop(number, None)
        made: Any
        if (edge := _CHILD[self.edge]) == BRICK:
            shape = (BRICK**3, channels)
            made = np.zeros(shape, np.float32) if tile is None else np.broadcast_to(tile, shape)
            made = np.array(made, np.float32)
        else:
            made = _Node(edge)
            if tile is not None:
                made.tiles = dict.fromkeys(range(made.entries), tile)
        self.children[number] = made
        return made

    def prune(self) -> None:
        """Converts children with a single value to tiles, and removes empty children."""
        for number, child in list(self.children.items()):
            if isinstance(child, _Node):
                child.prune()
                value = child.constant()
                is_empty = not child.children and not child.tiles
            else:
                value = child[0] if _is_constant(child) and _active(child).all() else None
                is_empty = not _active(child).any()
            if value is not None:
                self.tiles[number] = value
            if value is not None or is_empty:
                del self.children[number]

    def constant(self) -> Floats | None:
        """Returns the value of a node that is filled with equal tiles; None for other nodes."""
        if self.children or len(self.tiles) != self.entries:
            return None
        values = np.array([self.tiles[number] for number in range(self.entries)])
        return values[0] if _is_constant(values) else None


def _bits(values: Floats) -> NDArray[np.uint32]:
    return np.ascontiguousarray(values).view(np.uint32)


def _active(values: Floats) -> NDArray[np.bool_]:
    """Returns a mask of the values (n, channels) that are not +0."""
    return np.asarray(_bits(values).any(axis=-1), np.bool_)


def _is_constant(values: Floats) -> bool:
    return bool((_bits(values) == _bits(values[0])).all())


def _mask(numbers: Iterable[int], entries: int) -> bytes:
    on = np.zeros(entries, np.uint8)
    on[list(numbers)] = 1
    return np.packbits(on, bitorder="little").tobytes()


class _Tree:
    """A tree with tiles and nodes of 4096 voxels per edge by their origins."""

    def __init__(self, channels: int) -> None:
        self.channels = channels
        self._tiles: dict[Index, Floats] = {}
        self._nodes: dict[Index, _Node] = {}

    def _upper(self, at: Index) -> _Node:
        x, y, z = (c & ~4095 for c in at)
        key = (x, y, z)
        if key not in self._nodes:
            node = self._nodes[key] = _Node(4096)
            if (tile := self._tiles.pop(key, None)) is not None:
                node.tiles = dict.fromkeys(range(node.entries), tile)
        return self._nodes[key]

    def fill(self, first: Index, last: Index, value: float) -> None:
        """Fills a box of voxels with a value, using tiles where possible."""
        if any(c % BRICK for c in first) or any((c + 1) % BRICK for c in last):
            raise ValueError("boxes must begin and end at multiples of 8 voxels")
        filled = np.full(self.channels, value, np.float32)
        for key in _cells(first, last, 4096):
            low, high = _clipped(first, last, key, 4096)
            if (low, high) == _clipped(key, _end(key, 4096), key, 4096):
                self._nodes.pop(key, None)
                self._tiles[key] = filled
            else:
                self._fill_node(self._upper(key), low, high, filled)

    def _fill_node(self, node: _Node, first: Index, last: Index, value: Floats) -> None:
        edge = _CHILD[node.edge]
        for cell in _cells(first, last, edge):
            low, high = _clipped(first, last, cell, edge)
            number = node.number(cell)
            if (low, high) == (cell, _end(cell, edge)):
                node.children.pop(number, None)
                node.tiles[number] = value
            else:
                self._fill_node(node.child(number, self.channels), low, high, value)

    def add(self, origins: NDArray[np.int32], values: Floats) -> None:
        """Adds bricks; voxels of +0 do not overwrite existing values."""
        count = len(origins)
        if origins.shape != (count, 3) or values.size != count * BRICK**3 * self.channels:
            raise ValueError("bricks of another shape")
        if (origins % BRICK).any():
            raise ValueError("origins must be multiples of 8")
        bricks = values.reshape(count, BRICK**3, self.channels)
        for origin, brick in zip(origins.tolist(), bricks, strict=True):
            at = (origin[0], origin[1], origin[2])
            upper = self._upper(at)
            lower = upper.child(upper.number(at), self.channels)
            leaf = lower.child(lower.number(at), self.channels)
            active = _active(brick)
            leaf[active] = brick[active]

    def prune(self) -> None:
        """Converts nodes with a single value to the largest possible tiles."""
        for key, node in list(self._nodes.items()):
            node.prune()
            if (value := node.constant()) is not None:
                self._tiles[key] = value
            if value is not None or not (node.children or node.tiles):
                del self._nodes[key]

    def extent(self) -> tuple[int, tuple[Index, Index] | None]:
        """Returns the number of active voxels and their bounding box."""
        voxels, lows, highs = 0, [], []
        for first, edge in self._all_tiles():
            voxels += edge**3
            lows.append(first)
            highs.append(_end(first, edge))
        for origin, leaf in self._leaves():
            on = np.argwhere(_active(leaf).reshape(BRICK, BRICK, BRICK)) + origin
            if len(on):
                voxels += len(on)
                lows.append(tuple(on.min(axis=0).tolist()))
                highs.append(tuple(on.max(axis=0).tolist()))
        if not voxels:
            return 0, None
        low, high = np.min(lows, axis=0).tolist(), np.max(highs, axis=0).tolist()
        return voxels, ((low[0], low[1], low[2]), (high[0], high[1], high[2]))

    def _lowers(self) -> Iterator[tuple[Index, _Node]]:
        """Yields nodes of 128 voxels with their origins, in file order."""
        for key in sorted(self._nodes):
            upper = self._nodes[key]
            for number in sorted(upper.children):
                yield upper.corner(number, key), upper.children[number]

    def _leaves(self) -> Iterator[tuple[Index, Floats]]:
        for origin, lower in self._lowers():
            for number in sorted(lower.children):
                yield lower.corner(number, origin), lower.children[number]

    def _all_tiles(self) -> Iterator[tuple[Index, int]]:
        for key in self._tiles:
            yield key, 4096
        for key, upper in self._nodes.items():
            for number in upper.tiles:
                yield upper.corner(number, key), 128
        for origin, lower in self._lowers():
            for number in lower.tiles:
                yield lower.corner(number, origin), BRICK

    def topology(self, out: _Output) -> bytes:
        """Encodes the structure of the tree and the values of tiles."""
        made = bytearray(np.zeros(self.channels, "<f4").tobytes())
        made += struct.pack("<II", len(self._tiles), len(self._nodes))
        for key in sorted(self._tiles):
            made += struct.pack("<3i", *key) + self._tiles[key].astype("<f4").tobytes() + b"\1"
        for key in sorted(self._nodes):
            made += struct.pack("<3i", *key)
            self._node_topology(self._nodes[key], out, made)
        return bytes(made)

    def _node_topology(self, node: _Node, out: _Output, made: bytearray) -> None:
        made += _mask(node.children, node.entries) + _mask(node.tiles, node.entries)
        tiles = [node.tiles[number] for number in sorted(node.tiles)]
        made += out.values(np.array(tiles, np.float32).reshape(-1, self.channels))
        for number in sorted(node.children):
            child = node.children[number]
            if isinstance(child, _Node):
                self._node_topology(child, out, made)
            else:
                made += _leaf_mask(child)

    def buffers(self, out: _Output) -> bytes:
        """Encodes the voxel values of all leaves."""
        made = bytearray()
        for _, leaf in self._leaves():
            made += _leaf_mask(leaf) + out.values(leaf[_active(leaf)])
        return bytes(made)


def _leaf_mask(leaf: Floats) -> bytes:
    return np.packbits(_active(leaf), bitorder="little").tobytes()


def _cells(first: Index, last: Index, edge: int) -> Iterator[Index]:
    """Yields the origins of all cells that a box intersects."""
    ranges = (range(a // edge * edge, b + 1, edge) for a, b in zip(first, last, strict=True))
    yield from itertools.product(*ranges)


def _end(first: Index, edge: int) -> Index:
    return first[0] + edge - 1, first[1] + edge - 1, first[2] + edge - 1


def _clipped(first: Index, last: Index, cell: Index, edge: int) -> tuple[Index, Index]:
    """Returns the part of a box inside a cell."""
    end = _end(cell, edge)
    lows = tuple(max(a, b) for a, b in zip(first, cell, strict=True))
    highs = tuple(min(a, b) for a, b in zip(last, end, strict=True))
    return (lows[0], lows[1], lows[2]), (highs[0], highs[1], highs[2])
