# SPDX-License-Identifier: Apache-2.0
"""Images of domes that are not latlong, made so.

UsdLux names the formats and leaves open how they are turned. Here the middle of each looks at the
dome's +z, as that of a latlong image does, with +y up. Angular maps and crosses are seen from
inside: their right is -x. A mirrored ball is a photograph: its right is +x.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMATS = ("latlong", "mirroredBall", "angular", "cubeMapVerticalCross")
MAX_HEIGHT = 2048
"""Rows of a latlong image that is made."""

_SUBSAMPLES = 2
_ROWS = 64

Floats = NDArray[np.float64]


def format_of(name: str, size: tuple[int, int]) -> str:
    """The format of an image (height, width) where "automatic" is asked for; else ``name``.

    Four faces high and three wide is a cross, anything else latlong.
    """
    if name != "automatic":
        return name
    height, width = size
    return "cubeMapVerticalCross" if 3 * height == 4 * width else "latlong"


def to_latlong(pixels: NDArray[Any], form: str) -> NDArray[np.float32]:
    """An image (h, w, c) of one of ``FORMATS`` as a latlong one (n, 2 n, c).

    Each pixel is the mean of bilinear samples of the original.
    """
    height, width, channels = pixels.shape
    face = height // 4 if form == "cubeMapVerticalCross" else 0
    rows = min(max(2 * face or min(height, width), 4), MAX_HEIGHT)
    out = np.empty((rows, 2 * rows, channels), np.float32)
    source = np.asarray(pixels, np.float32)
    n = _SUBSAMPLES
    lon = np.pi - (np.arange(2 * rows * n) + 0.5) * (np.pi / (rows * n))
    for first in range(0, rows, _ROWS):
        last = min(first + _ROWS, rows)
        lat = np.pi / 2 - (np.arange(first * n, last * n) + 0.5) * (np.pi / (rows * n))
        ring = np.cos(lat)[:, None]
        x, y, z = np.broadcast_arrays(
            ring * np.sin(lon), np.sin(lat)[:, None], ring * np.cos(lon)
        )  # fmt: skip
        u, v, low, high = _place(x, y, z, form)
        values = _bilinear(source, u, v, low, high)
        fine = values.reshape(last - first, n, 2 * rows, n, channels)
        out[first:last] = fine.mean(axis=(1, 3))
    return out


def _place(x: Floats, y: Floats, z: Floats, form: str) -> tuple[Floats, Floats, Any, Any]:
    """Where directions lie in an image: u to the right and v down, in [0, 1]; and the bounds.

    The bounds (u, v), lowest and highest, are what bilinear samples stay within.
    """
    if form == "mirroredBall":
        # The ball's normal is halfway between the direction and the one to the viewer, +z.
        length = np.sqrt(np.maximum(2.0 + 2.0 * z, 1e-30))
        return 0.5 + 0.5 * x / length, 0.5 - 0.5 * y / length, (0.0, 0.0), (1.0, 1.0)
    if form == "angular":
        across = np.hypot(x, y)
        scale = 0.5 / np.pi * np.arctan2(across, z) / np.maximum(across, 1e-30)
        return 0.5 - scale * x, 0.5 - scale * y, (0.0, 0.0), (1.0, 1.0)
    return _cross(x, y, z)


def _cross(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Any, Any]:
    ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
    along_x = (ax > ay) & (ax > az)
    along_y = ~along_x & (ay > az)
    along_z = ~along_x & ~along_y
    faces = (
        # where, column, row, right, up
        (along_z & (z > 0), 1, 1, -x, y),
        (along_y & (y > 0), 1, 0, -x, -z),
        (along_y & (y <= 0), 1, 2, -x, z),
        (along_z & (z <= 0), 1, 3, -x, -y),
        (along_x & (x > 0), 0, 1, z, y),
        (along_x & (x <= 0), 2, 1, -z, y),
    )
    major = np.maximum(np.maximum(ax, ay), az)
    u, v = np.empty_like(major), np.empty_like(major)
    column, row = np.empty_like(major), np.empty_like(major)
    for where, at_column, at_row, right, up in faces:
        column[where], row[where] = at_column, at_row
        u[where] = (at_column + 0.5 + 0.5 * (right / major)[where]) / 3
        v[where] = (at_row + 0.5 - 0.5 * (up / major)[where]) / 4
    return u, v, (column / 3, row / 4), ((column + 1) / 3, (row + 1) / 4)


def _bilinear(image: NDArray[np.float32], u: Floats, v: Floats, low: Any, high: Any) -> Any:
    height, width = image.shape[:2]

    def taps(at: Floats, size: int, lowest: Any, highest: Any) -> tuple[Any, Any, Any]:
        first, last = np.asarray(lowest) * size, np.asarray(highest) * size - 1
        place = np.clip(at * size - 0.5, first, np.maximum(last, first))
        index = np.minimum(place.astype(np.int64), size - 1)
        after = np.minimum(index + 1, np.maximum(last, first).round().astype(np.int64))
        return index, after, (place - index)[..., None].astype(np.float32)

    x0, x1, fx = taps(u, width, low[0], high[0])
    y0, y1, fy = taps(v, height, low[1], high[1])
    top = image[y0, x0] * (1 - fx) + image[y0, x1] * fx
    bottom = image[y1, x0] * (1 - fx) + image[y1, x1] * fx
    return top * (1 - fy) + bottom * fy
