# SPDX-License-Identifier: Apache-2.0
"""Converts layers of an image to screen colours.

Radiance is tone-mapped; other layers get false colours.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.files import image
from wavecomb.image.working_space import LUMINANCE
from wavecomb.run import aovs

_HUE_BELOW, _HUE_ABOVE = 255.0, 70.0


def colour_map(count: int = 256) -> NDArray[np.float32]:
    """Returns a colour map (count, 3) from dark violet via red to light yellow, in linear Rec.709.

    The OKLab lightness (Ottosson 2020) rises linearly, so that steps look uniform. The hue turns
    from violet to yellow. The chroma is the largest in the gamut, but at most 0.2.
    """
    t = np.linspace(0.0, 1.0, count)
    return _largest_chroma(0.2 + 0.76 * t, np.radians(300.0 + 170.0 * t), 0.2)


def signed_colour_map(count: int = 257) -> NDArray[np.float32]:
    """Returns a colour map (count, 3) from light blue via black to light orange.

    Lightness rises linearly from the middle, which is black, to both ends. People with any common
    colour vision deficiency can distinguish blue and orange.
    """
    t = np.linspace(-1.0, 1.0, count)
    hue = np.radians(np.where(t < 0.0, _HUE_BELOW, _HUE_ABOVE))
    return _largest_chroma(0.9 * np.abs(t), hue, 0.16)


def _largest_chroma(
    lightness: NDArray[np.float64], hue: NDArray[np.float64], most: float
) -> NDArray[np.float32]:
    """Returns the colours with the largest chroma, up to ``most``, that are inside the gamut."""
    low, high = np.zeros_like(lightness), np.full_like(lightness, most)
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
    """Converts OKLab to linear Rec.709 (n, 3). Source: https://bottosson.github.io/posts/oklab/."""
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


Develop = Callable[[NDArray[Any]], NDArray[np.uint8]]
"""Converts linear Rec.709 (height, width, 3) to 8-bit sRGB values."""

_CRYPTO = ("crypto_", "Crypto")
NOT_FINITE = (0, 255, 255)


@dataclass(frozen=True)
class Legend:
    """Legend of a layer in false colours.

    Attributes:
        title: Name and unit of the displayed quantity.
        low: Value of the darkest colour.
        high: Value of the lightest colour.
        logarithmic: Whether the colour scale is logarithmic.
    """

    title: str
    low: float
    high: float
    logarithmic: bool

    def ticks(self, count: int = 5) -> list[tuple[float, str]]:
        """Returns the labels of the colour bar with their positions, from 0 to 1."""
        out = []
        for t in np.linspace(0.0, 1.0, count):
            if self.logarithmic:
                value = self.low * (self.high / self.low) ** t
            else:
                value = self.low + (self.high - self.low) * t
            out.append((float(t), f"{value:.3g}"))
        return out


@dataclass(frozen=True)
class DisplayLayer:
    """A layer that was converted to screen colours.

    Attributes:
        pixels: 8-bit sRGB values with shape (height, width, 3).
        legend: Legend of the false colours; None if the layer is not in false colours.
    """

    pixels: NDArray[np.uint8]
    legend: Legend | None = None


def is_light(layer: str) -> bool:
    """Returns whether a layer holds radiance, so that exposure and tone mapping apply."""
    return aovs.content(layer) == "light"


def show_layer(
    layer: NDArray[Any],
    name: str,
    develop: Develop = image.display,
    *,
    low: float | None = None,
    high: float | None = None,
) -> DisplayLayer:
    """Converts a layer to screen colours.

    Args:
        layer: Array with shape (height, width) or (height, width, channels).
        name: Name of the AOV or of the layer in a file.
        develop: Function that converts radiance to 8-bit sRGB values.
        low: Lower end of the false colours; None derives the value from the layer.
        high: Upper end of the false colours; None derives the value from the layer.
    """
    array = np.asarray(layer)
    if is_light(name):
        return DisplayLayer(develop(array))
    content = aovs.content(name)
    if content == "colour":
        return DisplayLayer(image.display(array))
    if content == "direction":
        return DisplayLayer(_codes(0.5 * array + 0.5))
    if name.startswith(_CRYPTO):
        return DisplayLayer(
            id_colours(np.ascontiguousarray(array[:, :, 0], np.float32).view(np.uint32))
        )
    if content == "id":
        return DisplayLayer(id_colours(array.reshape(array.shape[:2])))
    if name == "uv":
        wide = np.zeros((*array.shape[:2], 3), np.float32)
        wide[:, :, :2] = array - np.floor(array)
        return DisplayLayer(_codes(wide))
    if name == "motion":
        wide = np.zeros((*array.shape[:2], 3), np.float32)
        wide[:, :, :2] = array / max(float(np.abs(array).max()), 1e-6)
        return DisplayLayer(_codes(0.5 * wide + 0.5))
    if name == "position":
        return DisplayLayer(_codes(_stretched(array)))
    if array.ndim == 3:
        # A variance is infinite while it is unknown.
        with np.errstate(invalid="ignore"):
            array = array @ np.array(LUMINANCE, np.float32)
    return heat(array, name, low, high)


def has_false_colours(name: str) -> bool:
    """Returns whether a layer has one number per pixel and is displayed in false colours."""
    row = aovs.row_of(name)
    if row is None:
        return False
    # The luminance of a variance is displayed.
    return row.content == "magnitude" or (row.channels == 1 and row.content in ("value", "exact"))


def _legend_title(name: str) -> str:
    """Returns the title of a legend, from the name of a layer or another title."""
    row = aovs.row_of(name)
    return (row.title if row else "") or name


def heat(
    values: NDArray[Any],
    name: str,
    low: float | None = None,
    high: float | None = None,
) -> DisplayLayer:
    """Converts values to false colours. Values that are not finite become cyan.

    Args:
        values: (height, width).
        name: Name of the layer, which determines the legend's title and scale, or any other title.
        low: Value of the darkest colour; None derives it from the image.
        high: Value of the lightest colour; None derives it from the image.
    """
    wide = np.asarray(values, np.float64)
    finite = np.isfinite(wide)
    logarithmic = aovs.content(name) == "magnitude"
    usable = wide[finite & (wide > 0.0)] if logarithmic else wide[finite]
    if usable.size == 0:
        usable = np.array([1.0])
    # The range of a logarithmic scale excludes the lowest and highest 1 % of the values, so that a
    # few bright pixels do not darken all other pixels.
    ends = np.percentile(usable, (1.0, 99.0)) if logarithmic else (usable.min(), usable.max())
    least = float(ends[0]) if low is None else low
    most = float(ends[1]) if high is None else high
    if logarithmic:
        least = max(least, 1e-30)
        most = max(most, least * 1.0001)
        safe = np.maximum(np.where(finite, wide, least), 1e-300)
        position = np.log(safe / least) / np.log(most / least)
    else:
        most = most if most > least else least + 1.0
        position = (np.where(finite, wide, least) - least) / (most - least)
    table = _table()
    index = (np.clip(position, 0.0, 1.0) * (len(table) - 1) + 0.5).astype(np.intp)
    pixels = table[index]
    pixels[~finite] = NOT_FINITE
    return DisplayLayer(pixels, Legend(_legend_title(name), least, most, logarithmic))


def ramp(width: int) -> NDArray[np.uint8]:
    """Returns the false colours (width, 3) of a colour bar, from low to high."""
    table = _table()
    return table[np.linspace(0, len(table) - 1, width).astype(np.intp)]


@functools.cache
def _table() -> NDArray[np.uint8]:
    return image.display(colour_map()[None])[0]


def id_colours(ids: NDArray[Any]) -> NDArray[np.uint8]:
    """Returns a distinct colour (h, w, 3) for each integer (h, w). The integer 0 is black."""
    mixed = ids.astype(np.uint32) * np.uint32(2654435761)
    mixed ^= mixed >> np.uint32(15)
    mixed *= np.uint32(2246822519)
    mixed ^= mixed >> np.uint32(13)
    channels = [(mixed >> np.uint32(shift)) & np.uint32(255) for shift in (0, 8, 16)]
    pixels = (64 + np.stack(channels, axis=-1) * 3 // 4).astype(np.uint8)
    pixels[ids == 0] = 0
    return pixels


def _stretched(array: NDArray[Any]) -> NDArray[np.float32]:
    finite = np.where(np.isfinite(array), array, 0.0)
    low = finite.min(axis=(0, 1))
    size = np.maximum(finite.max(axis=(0, 1)) - low, 1e-20)
    return ((finite - low) / size).astype(np.float32)


def _codes(values: NDArray[Any]) -> NDArray[np.uint8]:
    clean = np.clip(np.nan_to_num(values), 0.0, 1.0)
    return np.floor(clean * 255.0 + 0.5).astype(np.uint8)
