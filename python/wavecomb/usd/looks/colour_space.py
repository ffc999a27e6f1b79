# SPDX-License-Identifier: Apache-2.0
"""Colour spaces of textures and values, to the working space, by OpenColorIO's built-in config."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd

from wavecomb.usd.stage.report import LoadReport

Colour = tuple[float, float, float]

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
    if attribute.HasColorSpace():
        return str(attribute.GetColorSpace())
    # USD's own search gives up at names that it does not know itself, such as srgb_texture.
    prim = attribute.GetPrim()
    while prim and not prim.IsPseudoRoot():
        if prim.HasAPI(Usd.ColorSpaceAPI):
            name = Usd.ColorSpaceAPI(prim).GetColorSpaceNameAttr().Get()
            if name:
                return str(name)
        prim = prim.GetParent()
    return ""


def linear_colour(colour: Colour, attribute: Usd.Attribute | None) -> Colour:
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


def read_colour(
    colour: Colour, attribute: Usd.Attribute | None, report: LoadReport, place: object
) -> Colour:
    """A colour of an attribute in linear Rec.709; lists a space that is not known."""
    try:
        return linear_colour(colour, attribute)
    except ValueError as error:
        report.missing(f"{error} (read as linear)", place)
        return colour


def holds_colour(attribute: Usd.Attribute | None) -> bool:
    """Whether the type of an attribute is a colour, which has a colour space."""
    return attribute is not None and attribute.GetTypeName().role == "Color"


def colours_in_linear(colours: NDArray[Any], name: str) -> NDArray[np.float32]:
    """Colours (k, 3 or more) of a space in linear Rec.709; further components stay.

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
def convert_colour(colour: Colour, source: str, working: str) -> Colour:
    """One colour, as ``convert``."""
    if source in (RAW, OCIO_NAMES[working]):
        return colour
    r, g, b = convert(np.array(colour, np.float32).reshape(1, 1, 3), source, working)[0, 0]
    return float(r), float(g), float(b)
