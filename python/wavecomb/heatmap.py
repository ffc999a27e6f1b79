# SPDX-License-Identifier: Apache-2.0
"""A picture of where two pictures differ, with a colour bar."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.compare import colour_layer, layers_of, luminance

if TYPE_CHECKING:
    from wavecomb.compare import Source

DECADES = 4
_NOT_FINITE = (0.0, 1.0, 1.0)
_BAR_HEIGHT = 34
# 3 x 5 pixels; each number is a row, its bits the pixels from left to right.
_DIGITS: dict[str, tuple[int, int, int, int, int]] = {
    "0": (7, 5, 5, 5, 7),
    "1": (2, 6, 2, 2, 7),
    "2": (7, 1, 7, 4, 7),
    "3": (7, 1, 7, 1, 7),
    "4": (5, 5, 7, 1, 1),
    "5": (7, 4, 7, 1, 7),
    "6": (7, 4, 7, 5, 7),
    "7": (7, 1, 1, 2, 2),
    "8": (7, 5, 7, 5, 7),
    "9": (7, 5, 7, 1, 7),
    "e": (0, 7, 7, 4, 7),
    ".": (0, 0, 0, 0, 2),
    "-": (0, 0, 7, 0, 0),
    "+": (0, 2, 7, 2, 0),
}


def colour_map(count: int = 256) -> NDArray[np.float32]:
    """Dark violet over red to light yellow, (count, 3), linear Rec.709.

    Lightness of OKLab (Ottosson 2020) rises evenly, so equal steps look equal; the hue turns from
    violet to yellow; chroma is the largest that the gamut has, up to 0.2.
    """
    t = np.linspace(0.0, 1.0, count)
    lightness = 0.2 + 0.76 * t
    hue = np.radians(300.0 + 170.0 * t)
    low, high = np.zeros(count), np.full(count, 0.2)
    for _ in range(20):
        chroma = 0.5 * (low + high)
        rgb = _linear_from_oklab(lightness, chroma * np.cos(hue), chroma * np.sin(hue))
        inside = ((rgb >= 0.0) & (rgb <= 1.0)).all(axis=1)
        low, high = np.where(inside, chroma, low), np.where(inside, high, chroma)
    rgb = _linear_from_oklab(lightness, low * np.cos(hue), low * np.sin(hue))
    return np.clip(rgb, 0.0, 1.0).astype(np.float32)


def _linear_from_oklab(
    lightness: NDArray[Any], a: NDArray[Any], b: NDArray[Any]
) -> NDArray[np.float64]:
    """OKLab -> linear Rec.709, (n, 3): https://bottosson.github.io/posts/oklab/."""
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return np.stack([long, medium, short], axis=1) @ to_rgb.T


def heat_map(a: Source, b: Source) -> NDArray[np.float32]:
    """Absolute luminance differences as colours, with a bar and its numbers below.

    The scale is logarithmic: from the largest difference down over four decades; smaller ones have
    the darkest colour, equal pixels are black, pixels with a NaN or an infinity are cyan.

    Returns:
        Linear Rec.709, (height + bar, width, 3).
    """
    pixels_a, pixels_b = colour_layer(layers_of(a), "A"), colour_layer(layers_of(b), "B")
    if pixels_a.shape != pixels_b.shape:
        raise ValueError("only pictures of one size can be compared")
    finite = np.isfinite(pixels_a).all(axis=2) & np.isfinite(pixels_b).all(axis=2)
    kept = finite[:, :, None]
    wide_a = np.where(kept, pixels_a, 0).astype(np.float64)
    difference = np.abs(luminance(wide_a - np.where(kept, pixels_b, 0)))
    peak = float(difference.max())
    colours = colour_map()
    result = np.zeros((*difference.shape, 3), np.float32)
    if peak > 0.0:
        with np.errstate(divide="ignore"):
            t = 1.0 + np.log10(difference / peak) / DECADES
        index = (np.clip(t, 0.0, 1.0) * (len(colours) - 1) + 0.5).astype(np.intp)
        result = np.where(difference[:, :, None] > 0.0, colours[index], np.float32(0))
    result[~finite] = _NOT_FINITE
    return np.concatenate([result, _bar(result.shape[1], peak, colours)])


def write_heat_map(path: str | os.PathLike[str], a: Source, b: Source) -> None:
    """Writes ``heat_map`` as a PNG file."""
    from wavecomb.image import write_png

    write_png(path, heat_map(a, b))


def _bar(width: int, peak: float, colours: NDArray[np.float32]) -> NDArray[np.float32]:
    """The colour bar with a number under each decade; bare where the picture is too small."""
    bar = np.zeros((_BAR_HEIGHT, width, 3), np.float32)
    margin = 6
    length = width - 2 * margin
    if length < 24:
        return bar
    ramp = np.linspace(0, len(colours) - 1, length).astype(np.intp)
    bar[6:18, margin : margin + length] = colours[ramp]
    if not (peak > 0.0 and math.isfinite(peak)):
        _write(bar, "0", 22, width - margin - 6)
        return bar
    end = -1
    for k in range(DECADES + 1):
        text = f"{peak * 10.0 ** (k - DECADES):.1e}".replace("e-0", "e-").replace("e+0", "e+")
        text_width = 8 * len(text)
        middle = margin + round((length - 1) * k / DECADES)
        left = min(max(middle - text_width // 2, 1), width - text_width - 1)
        bar[18:20, middle] = 1.0
        if left > end:
            _write(bar, text, 22, left)
            end = left + text_width
    return bar


def _write(image: NDArray[np.float32], text: str, top: int, left: int) -> None:
    """Draws a number with the digits above at twice their size."""
    for character in text:
        rows = _DIGITS[character]
        bits = np.array([[row >> (2 - x) & 1 for x in range(3)] for row in rows], np.float32)
        glyph = bits.repeat(2, axis=0).repeat(2, axis=1)
        image[top : top + 10, left : left + 6] = glyph[:, :, None]
        left += 8
