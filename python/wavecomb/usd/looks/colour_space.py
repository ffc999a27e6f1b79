# SPDX-License-Identifier: Apache-2.0
"""Colour spaces of textures and values, to the working space, by OpenColorIO's built-in config."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd

OCIO_NAMES = {"rec709": "Linear Rec.709 (sRGB)", "acescg": "ACEScg"}
"""What OpenColorIO calls the working spaces."""

LINEAR = OCIO_NAMES["rec709"]
SRGB = "sRGB Encoded Rec.709 (sRGB)"
RAW = "Raw"

# Names that need no OpenColorIO: it takes 30 MB as soon as it is loaded.
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
"""Rows of pixels that are converted at once, so that little memory is taken."""


@functools.cache
def canonical(name: str) -> str | None:
    """OpenColorIO's name of a colour space, or None where it knows none of that name."""
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


def space_of(attribute: Usd.Attribute | None) -> str:
    """The colour space that a stage gives an attribute, itself or by a prim above it; else "".

    Of files only what they have themselves: what prims say is meant for values.
    """
    if not attribute:
        return ""
    if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
        return str(attribute.GetColorSpace())
    return str(Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None) or "")


def linear_colour(
    colour: tuple[float, float, float], attribute: Usd.Attribute | None
) -> tuple[float, float, float]:
    """A colour of an attribute in linear Rec.709.

    Raises:
        ValueError: OpenColorIO does not know its space.
    """
    name = space_of(attribute)
    if not name:
        return colour
    space = canonical(name)
    if space is None:
        raise ValueError(f"colour space {name}")
    return convert_colour(colour, space, "rec709")


def convert(pixels: NDArray[Any], source: str, working: str) -> NDArray[np.float32]:
    """Colours (h, w, 3 or 4), encoded in a space of OpenColorIO's, in the working space.

    uint8 counts as 0 to 1; alpha stays. What is not finite becomes 0.
    """
    import OpenImageIO as oiio

    out = np.empty(pixels.shape, np.float32)
    for first in range(0, len(pixels), _ROWS):
        rows = pixels[first : first + _ROWS].astype(np.float32)
        if pixels.dtype == np.uint8:
            rows /= np.float32(255)
        buffer = oiio.ImageBuf(np.ascontiguousarray(rows[..., :3]))
        # On this thread alone: OpenImageIO's pool was seen to wait for ever.
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
def convert_colour(
    colour: tuple[float, float, float], source: str, working: str
) -> tuple[float, float, float]:
    """One colour, as ``convert``."""
    if source in (RAW, OCIO_NAMES[working]):
        return colour
    r, g, b = convert(np.array(colour, np.float32).reshape(1, 1, 3), source, working)[0, 0]
    return float(r), float(g), float(b)
