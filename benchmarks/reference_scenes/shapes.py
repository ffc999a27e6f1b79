# SPDX-License-Identifier: Apache-2.0
"""Simple shapes and images that the translators write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray
from pictures import linear, read
from reference_scenes.stage import Inexpressible, Matrix

CHECKER_TEXELS = 128
"""Texels per checkerboard cell; bilinear lookups blur cell edges by one texel."""

_QUAD = np.array([[0, 1, 2, 3]])


def rectangle(to_world: Matrix) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Points, quads, normals and uv of a square from -1 to 1 in x and y with normal +z."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    uv = 0.5 + 0.5 * corners[:, :2]
    return _placed(corners, to_world), _QUAD, _turned([[0, 0, 1.0]] * 4, to_world), uv


def cube(
    to_world: Matrix, half: float = 1.0
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Points, quads, normals and uv of a box from -half to half; uv covers each face."""
    points, normals = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = side * np.eye(3)[axis]
            u = np.eye(3)[(axis + 1) % 3]
            v = np.cross(normal, u)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                points.append(half * (normal + a * u + b * v))
                normals.append(normal)
    uv = np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (6, 1))
    faces = np.arange(24).reshape(6, 4)
    return _placed(np.array(points), to_world), faces, _turned(normals, to_world), uv


def as_rectangle(points: NDArray[Any], faces: NDArray[Any]) -> tuple[Matrix, float, float]:
    """Convert a flat rectangular mesh to a RectLight: transform, width, height.

    Raises:
        Inexpressible: The mesh is not a rectangle.
    """
    used = points[np.unique(faces)]
    corners = np.unique(used.round(9), axis=0)
    a, b, c = (points[faces[0, k]] for k in (0, 1, 2))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    centre = corners.mean(axis=0)
    far = np.linalg.norm(corners - centre, axis=1)
    flat = abs((corners - centre) @ normal).max() <= 1e-5 * far.max()
    if len(corners) != 4 or not flat or np.ptp(far) > 1e-4 * far.max():
        raise Inexpressible(
            "an area light that is not a rectangle: meshes in Wavecomb emit to both sides"
        )
    others = sorted((p for p in corners[1:]), key=lambda p: float(np.linalg.norm(p - corners[0])))
    edge = others[0] - corners[0]
    width, height = float(np.linalg.norm(edge)), float(np.linalg.norm(others[1] - corners[0]))
    to_world = np.eye(4)
    to_world[:3, 0] = edge / width
    to_world[:3, 2] = -normal
    to_world[:3, 1] = np.cross(to_world[:3, 2], to_world[:3, 0])
    to_world[:3, 3] = centre
    return to_world, width, height


def write_checker(file: Path, first: Sequence[float], second: Sequence[float]) -> None:
    """Write a checkerboard of two by two cells; the first colour is at uv 0 and at uv 1."""
    cells = np.indices((2, 2)).sum(axis=0) % 2
    # Row 0 of an image is at the top and v increases upwards, so the last row of the checkerboard
    # starts with the first colour.
    colours = np.array([first, second], np.float32)
    image = colours[cells[::-1]]
    write_exr(file, image.repeat(CHECKER_TEXELS, axis=0).repeat(CHECKER_TEXELS, axis=1))


def write_dome(source: Path, file: Path) -> None:
    """Convert a latlong image of Mitsuba, with the first and last rows at the poles, to USD.

    In USD the first and last rows are centred half a row away from the poles.
    """
    image = read(source)
    height = len(image)
    at = (np.arange(height) + 0.5) * ((height - 1) / height)
    low = np.minimum(np.floor(at).astype(int), height - 2)
    part = (at - low)[:, None, None].astype(np.float32)
    write_exr(file, image[low] * (1 - part) + image[low + 1] * part)


def write_magnified(source: Path, file: Path, edge: int = 256) -> None:
    """Magnify a repeating sRGB image to ``edge`` texels by a cubic B-spline; return it linear."""
    image = linear(read(source))
    for axis in (0, 1):
        count = image.shape[axis]
        at = (np.arange(edge) + 0.5) * (count / edge) - 0.5
        low = np.floor(at).astype(int)
        t = (at - low).astype(np.float32)
        weights = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 1 + 3 * t + 3 * t**2 - 3 * t**3, t**3)
        shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
        image = sum(
            np.take(image, (low + k - 1) % count, axis) * (w / 6).reshape(shape)
            for k, w in enumerate(weights)
        )
    write_exr(file, np.asarray(image, np.float32))


def write_exr(file: Path, image: NDArray[np.float32]) -> None:
    """Write linear colours as 32-bit EXR."""
    file.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.ascontiguousarray(image, np.float32)
    out = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float"))
    out.set_pixels(oiio.ROI(), pixels)
    if not out.write(str(file)):
        raise OSError(f"{file}: {out.geterror()}")


def _placed(points: NDArray[Any], to_world: Matrix) -> NDArray[np.float64]:
    placed: NDArray[np.float64] = points @ to_world[:3, :3].T + to_world[:3, 3]
    return placed


def _turned(normals: Any, to_world: Matrix) -> NDArray[np.float64]:
    turned: NDArray[np.float64] = np.asarray(normals) @ np.linalg.inv(to_world[:3, :3])
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return turned
