# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads and writes uncompressed OpenEXR files. Blender 4.2 has no reader for Python."""

from __future__ import annotations

import os
import struct
from typing import Any

import numpy as np

MAGIC = 20000630
TYPES: dict[int, np.dtype[Any]] = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}


class ExrError(Exception):
    """Raised if a file is damaged or not an EXR file that this module supports."""


def read(file: str) -> dict[str, np.ndarray]:
    """Reads all channels of a single-part, uncompressed scanline file.

    Returns:
        (height, width) arrays of 32-bit floats by channel name; the first row is the top one.

    Raises:
        ExrError: The file is damaged or of another kind.
    """
    with open(file, "rb") as stream:
        data = stream.read()
    try:
        return _parsed(data)
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise ExrError(f"{file} is damaged or compressed: {error}") from error


def texts(file: str) -> dict[str, str]:
    """Returns the text attributes of a file.

    Raises:
        ExrError: The file is damaged or of another kind.
    """
    with open(file, "rb") as stream:
        data = stream.read()
    try:
        kinds = _attributes(data)[0]
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise ExrError(f"{file} is damaged: {error}") from error
    return {n: v.decode(errors="replace") for n, (kind, v) in kinds.items() if kind == "string"}


def _parsed(data: bytes) -> dict[str, np.ndarray]:
    magic, version = struct.unpack_from("<ii", data)
    if magic != MAGIC or version & 0x1A00:
        raise ValueError("not a single-part scanline OpenEXR file")
    header, at = _header(data)
    if header["compression"][0] != 0:
        raise ValueError("it is compressed")
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels = _channels(header["channels"])
    row = width * sum(TYPES[kind].itemsize for _, kind in channels)
    lines = np.frombuffer(data, np.uint8, height * (row + 8), at + 8 * height)
    lines = lines.reshape(height, row + 8)
    found, place = {}, 8
    for name, kind in channels:
        size = width * TYPES[kind].itemsize
        part = np.ascontiguousarray(lines[:, place : place + size])
        found[name] = part.view(TYPES[kind]).astype(np.float32)
        place += size
    return found


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    found, at = _attributes(data)
    return {name: value for name, (_, value) in found.items()}, at


def _attributes(data: bytes) -> tuple[dict[str, tuple[str, bytes]], int]:
    """Returns types and values of attributes, and the end of the header."""
    at, header = 8, {}
    while data[at]:
        end = data.index(0, at)
        name = data[at:end].decode("latin-1")
        start = end + 1
        end = data.index(0, start) + 1
        (size,) = struct.unpack_from("<i", data, end)
        header[name] = (data[start : end - 1].decode("latin-1"), data[end + 4 : end + 4 + size])
        at = end + 4 + size
    return header, at + 1


def _channels(data: bytes) -> list[tuple[str, int]]:
    at, found = 0, []
    while data[at]:
        end = data.index(0, at)
        found.append((data[at:end].decode("latin-1"), struct.unpack_from("<i", data, end + 1)[0]))
        at = end + 17
    return found


def write(file: str, channels: dict[str, np.ndarray]) -> None:
    """Writes (height, width) arrays of floats, uncompressed."""
    names = sorted(channels)
    height, width = channels[names[0]].shape
    rows = b"".join(n.encode() + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for n in names) + b"\0"
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes: list[tuple[str, str, bytes]] = [
        ("channels", "chlist", rows),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
    ]
    head = struct.pack("<ii", MAGIC, 2)
    for name, kind, value in attributes:
        head += f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value
    head += b"\0"
    size = 4 * width * len(names)
    start = len(head) + 8 * height
    offsets = struct.pack(f"<{height}Q", *(start + y * (size + 8) for y in range(height)))
    planes: Any = np.stack([np.asarray(channels[n], "<f4") for n in names], axis=1)
    with open(file + ".part", "wb") as stream:
        stream.write(head + offsets)
        for y in range(height):
            stream.write(struct.pack("<ii", y, size) + planes[y].tobytes())
    os.replace(file + ".part", file)
