# SPDX-License-Identifier: Apache-2.0
"""Applies views of OpenColorIO by OpenImageIO, from $OCIO or the built-in ACES configuration."""

from __future__ import annotations

import functools
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError

PREFIX = "ocio:"
"""Prefix of a tone mapping that names a view, "ocio:VIEW" or "ocio:VIEW|DISPLAY"."""

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
    """Returns configuration, display and linear Rec.709 space, or None if any is missing."""
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


def displays() -> list[str]:
    """Returns the displays of the configuration, or an empty list if $OCIO cannot be used."""
    current = _current()
    return [] if current is None else list(current[0].getDisplayNames())


def views(display: str | None = None) -> list[str]:
    """Returns the views of a display; the default display is an sRGB screen.

    The list is empty if $OCIO cannot be used.
    """
    current = _current()
    if current is None:
        return []
    config, usual, _ = current
    return [name for name in config.getViewNames(display or usual) if name.lower() != "raw"]


def tone_map(view: str, display: str | None = None) -> str:
    """Returns the value of ``tone_map`` in ``wavecomb.Picture.save`` that applies a view.

    Args:
        view: Name of a view, in upper or lower case.
        display: Name of a display, in upper or lower case. None means an sRGB screen.

    Raises:
        WavecombError: $OCIO cannot be used, or its configuration has no such view or display.
    """
    if why := problem():
        raise WavecombError(why)
    if display is not None:
        display = _known("display", display, displays())
    return PREFIX + "|".join(filter(None, (_known("view", view, views(display)), display)))


def _known(what: str, name: str, there: list[str]) -> str:
    found = {one.lower(): one for one in there}.get(name.lower())
    if found is None:
        config = os.environ.get("OCIO") or "OpenColorIO's configuration (set OCIO for another)"
        raise WavecombError(f"no OCIO {what} {name!r} in {config}; there are {', '.join(there)}")
    return found


def mapped(rgb: NDArray[Any], tone_map: str) -> NDArray[np.uint8]:
    """Converts linear Rec.709 (h, w, 3) to 8-bit values by a tone mapping from ``tone_map``."""
    view, _, display = tone_map.removeprefix(PREFIX).partition("|")
    return through_view(rgb, view, display or None)


def problem() -> str | None:
    """Returns the reason why $OCIO cannot be used, or None if it can be used."""
    if os.environ.get("OCIO") and _current() is None:
        return (
            f"$OCIO {os.environ['OCIO']}: cannot be read, or has no linear Rec.709 colour space; "
            "correct or unset it"
        )
    return None


def through_view(rgb: NDArray[Any], view: str, display: str | None = None) -> NDArray[np.uint8]:
    """Converts finite linear Rec.709 colours (h, w, 3) to 8-bit values of the display.

    Raises:
        WavecombError: The display has no view of that name.
    """
    import OpenImageIO as oiio

    current = _current()
    if current is None or view not in views(display):
        raise WavecombError(
            f"no view {view!r}; there are {', '.join(['Linear', 'Neutral', *views(display)])}"
        )
    _, usual, linear = current
    source = oiio.ImageBuf(np.ascontiguousarray(rgb, dtype=np.float32))
    # Use one thread, because the render uses all cores, and because OpenImageIO's thread pool can
    # deadlock.
    shown = oiio.ImageBufAlgo.ociodisplay(
        source, display or usual, view, linear, colorconfig=_name(), nthreads=1
    )
    if shown.has_error:
        raise WavecombError(f"view {view!r}: {shown.geterror()}")
    values = np.asarray(shown.get_pixels(oiio.FLOAT), np.float32).reshape(rgb.shape)
    return np.floor(np.clip(np.nan_to_num(values), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def _name() -> str:
    return os.environ.get("OCIO") or "ocio://default"
