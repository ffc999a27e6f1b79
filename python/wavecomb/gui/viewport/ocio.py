# SPDX-License-Identifier: Apache-2.0
"""Views of OpenColorIO through OpenImageIO, from $OCIO or from OpenColorIO's ACES configuration."""

from __future__ import annotations

import functools
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError

_ENCODED = ("srgb - display", "srgb", "rec.1886 rec.709 - display")
_LINEAR = (
    "lin_rec709",
    "lin_rec709_srgb",
    "Linear Rec.709 (sRGB)",
    "Linear Rec.709",
    "lin_srgb",
    "Utility - Linear - sRGB",
    "lin_rec709_scene",
)


@functools.cache
def _config(name: str | None) -> tuple[Any, str, str] | None:
    """Returns configuration, display and linear Rec.709 colour space, or None if one is missing."""
    import OpenImageIO as oiio

    config = oiio.ColorConfig(name or "ocio://default")
    if config.geterror():
        return None
    displays = list(config.getDisplayNames())
    spaces = {space.lower(): space for space in config.getColorSpaceNames()}
    linear = next((spaces[n.lower()] for n in _LINEAR if n.lower() in spaces), None)
    if linear is None and config.getColorSpaceIndex("lin_rec709") >= 0:
        linear = "lin_rec709"
    if not displays or linear is None:
        return None
    by_name = {display.lower(): display for display in displays}
    display = next((by_name[n] for n in _ENCODED if n in by_name), None)
    return config, display or config.getDefaultDisplayName(), linear


def _current() -> tuple[Any, str, str] | None:
    return _config(os.environ.get("OCIO") or None)


def views() -> list[str]:
    """Returns the views for an sRGB screen; none if $OCIO cannot be used."""
    current = _current()
    if current is None:
        return []
    config, display, _ = current
    return [name for name in config.getViewNames(display) if name.lower() != "raw"]


def problem() -> str | None:
    """Returns why $OCIO is not used, or None."""
    if os.environ.get("OCIO") and _current() is None:
        return (
            f"$OCIO {os.environ['OCIO']}: cannot be read, or has no linear Rec.709 colour space; "
            "correct or unset it"
        )
    return None


def through_view(rgb: NDArray[Any], view: str) -> NDArray[np.uint8]:
    """Converts linear Rec.709, finite, (h, w, 3) to 8-bit values of the display.

    Raises:
        WavecombError: There is no such view.
    """
    import OpenImageIO as oiio

    current = _current()
    if current is None or view not in views():
        raise WavecombError(
            f"no view {view!r}; there are {', '.join(['Linear', 'Neutral', *views()])}"
        )
    _, display, linear = current
    source = oiio.ImageBuf(np.ascontiguousarray(rgb, dtype=np.float32))
    # Use only this thread: the render uses all cores, and OpenImageIO's thread pool was seen to
    # deadlock.
    shown = oiio.ImageBufAlgo.ociodisplay(
        source, display, view, linear, colorconfig=_name(), nthreads=1
    )
    if shown.has_error:
        raise WavecombError(f"view {view!r}: {shown.geterror()}")
    values = np.asarray(shown.get_pixels(oiio.FLOAT), np.float32).reshape(rgb.shape)
    return np.floor(np.clip(np.nan_to_num(values), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def _name() -> str:
    return os.environ.get("OCIO") or "ocio://default"
