# SPDX-License-Identifier: Apache-2.0
"""Conversions between colour spaces with OpenColorIO's built-in config."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Colour = tuple[float, float, float]

OCIO_NAMES = {"rec709": "Linear Rec.709 (sRGB)", "acescg": "ACEScg"}
"""OpenColorIO's names of Wavecomb's working spaces."""

LINEAR = OCIO_NAMES["rec709"]
SRGB = "sRGB Encoded Rec.709 (sRGB)"
RAW = "Raw"

# Names of colour spaces that are resolved without loading OpenColorIO, which takes 30 MB.
_COMMON = {
    "raw": RAW,
    "data": RAW,
    "identity": RAW,
    "unknown": RAW,
    "srgb": SRGB,
    "srgb_texture": SRGB,
    "srgb_rec709_scene": SRGB,
    "srgbcolorspace": SRGB,
    "gamma_2.2": "Gamma 2.2 Encoded Rec.709",
    "linear": LINEAR,
    "lin_rec709": LINEAR,
    "lin_srgb": LINEAR,
    "lin_rec709_scene": LINEAR,
}
_ROWS = 256
"""Number of pixel rows that are converted together, which bounds the memory used."""


@functools.cache
def canonical(name: str) -> str | None:
    """Returns OpenColorIO's name of a colour space; None if OpenColorIO does not know the space."""
    known = _COMMON.get(name.lower())
    if known is not None:
        return known
    config = _config()
    found = str(config.resolve(name))
    return found if config.getColorSpaceIndex(found) >= 0 else None


@functools.cache
def _config() -> Any:
    import OpenImageIO as oiio

    return oiio.ColorConfig("ocio://default")


def colours_in_linear(colours: NDArray[Any], name: str) -> NDArray[np.float32]:
    """Converts colours (k, 3 or more) to linear Rec.709; further components are unchanged.

    Raises:
        ValueError: OpenColorIO does not know the space.
    """
    space = canonical(name)
    if space is None:
        raise ValueError(f"colour space {name}")
    out = np.array(colours, np.float32)
    if space not in (RAW, LINEAR):
        out[:, :3] = convert(out[None, :, :3], space, "rec709")[0]
    return out


def convert(pixels: NDArray[Any], source: str, working: str) -> NDArray[np.float32]:
    """Converts colours (h, w, 3 or 4) from an OpenColorIO space to the working space.

    Maps uint8 to the range 0 to 1, keeps alpha, and replaces values that are not finite by 0.
    """
    import OpenImageIO as oiio

    out = np.empty(pixels.shape, np.float32)
    for first in range(0, len(pixels), _ROWS):
        rows = pixels[first : first + _ROWS].astype(np.float32)
        if pixels.dtype == np.uint8:
            rows /= np.float32(255)
        buffer = oiio.ImageBuf(np.ascontiguousarray(rows[..., :3]))
        # OpenImageIO's thread pool can deadlock in this call, so the conversion runs on the calling
        # thread.
        made = oiio.ImageBufAlgo.colorconvert(
            buffer, source, OCIO_NAMES[working], unpremult=False,
            colorconfig="ocio://default", nthreads=1,
        )  # fmt: skip
        if made.has_error:
            raise ValueError(f"colour space {source}: {made.geterror()}")
        rows[..., :3] = made.get_pixels(oiio.FLOAT)
        out[first : first + _ROWS] = np.nan_to_num(rows, nan=0.0, posinf=0.0, neginf=0.0)
    return out


@functools.cache
def convert_colour(colour: Colour, source: str, working: str) -> Colour:
    """Converts one colour in the same way as ``convert`` converts images."""
    if source in (RAW, OCIO_NAMES[working]):
        return colour
    r, g, b = convert(np.array(colour, np.float32).reshape(1, 1, 3), source, working)[0, 0]
    return float(r), float(g), float(b)


# ---- the sRGB curve, and mip levels in linear light --------------------------------------------


def to_linear(values: NDArray[Any]) -> NDArray[np.float32]:
    """Decodes the sRGB transfer curve of IEC 61966-2-1 to linear."""
    v = np.asarray(values, np.float32)
    low = v / np.float32(12.92)
    high = ((np.maximum(v, 0) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(v <= 0.04045, low, high).astype(np.float32)


def halve(pixels: NDArray[Any], srgb: bool) -> NDArray[Any]:
    """Halves the size of an image (h, w, c), rounded down, with the mip filter of the core.

    The box filter works on linear values; the result has the type of the input. ``srgb`` states
    whether uint8 colours are sRGB encoded.
    """
    height, width, channels = pixels.shape
    out = np.empty((max(height // 2, 1), max(width // 2, 1), channels), pixels.dtype)
    # An image of even height is filtered in bands of even height, which are independent. An image
    # of odd height is filtered as a whole.
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
    """Averages pairs of values along an axis; for an odd size n, boxes are n / (n // 2) wide."""
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
    """Encodes non-negative linear values with the sRGB transfer curve."""
    high = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, high).astype(np.float32)
