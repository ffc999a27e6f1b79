# SPDX-License-Identifier: Apache-2.0
"""Images at half their size, for textures that leave out their finest mip levels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def halve(pixels: NDArray[Any], srgb: bool) -> NDArray[Any]:
    """An image (h, w, c) at half its size, rounded down, as the core makes mip levels.

    Box filter in linear light; ``srgb``: colours of uint8 are encoded. The type stays.
    """
    height, width, channels = pixels.shape
    out = np.empty((max(height // 2, 1), max(width // 2, 1), channels), pixels.dtype)
    # Bands of an even height stand for themselves; else all at once.
    band = 256 if height % 2 == 0 else height
    colours = (channels - 1) if channels % 2 == 0 else channels
    for first in range(0, height, band):
        rows = pixels[first : first + band]
        if rows.dtype == np.uint8:
            light = rows.astype(np.float32) / np.float32(255)
            if srgb:
                light[..., :colours] = _LINEAR[rows[..., :colours]]
        else:
            light = rows.astype(np.float32)
        light = _halve_axis(_halve_axis(light, 0), 1)
        if rows.dtype == np.uint8:
            if srgb:
                light[..., :colours] = _encode(light[..., :colours])
            light = np.rint(light * 255).clip(0, 255)
        out[first // 2 : first // 2 + len(light)] = light
    return out


def _halve_axis(values: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Means of boxes along an axis; of an odd number of n values boxes are n / (n // 2) wide."""
    size = values.shape[axis]
    if size == 1:
        return values
    values = np.moveaxis(values, axis, 0)
    if size % 2 == 0:
        out = 0.5 * values[0::2] + 0.5 * values[1::2]
    else:
        n = size // 2
        sums = np.concatenate([np.zeros_like(values[:1]), values]).cumsum(axis=0, dtype=np.float64)
        edge = np.arange(n + 1) * (size / n)
        whole = np.minimum(edge.astype(np.intp), size - 1)
        part = (edge - whole).reshape(-1, *([1] * (values.ndim - 1)))
        at = sums[whole] * (1 - part) + sums[whole + 1] * part
        out = (np.diff(at, axis=0) * (n / size)).astype(np.float32)
    return np.moveaxis(out, 0, axis)


_CODES = np.arange(256) / 255.0
_LINEAR = np.where(
    _CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4
).astype(np.float32)  # fmt: skip


def _encode(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """The sRGB transfer curve of values of at least 0."""
    high = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, high).astype(np.float32)
