# SPDX-License-Identifier: Apache-2.0
"""Float layers to what a screen shows: exposure, views of OpenColorIO, false colours. No Qt."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.gui.viewport import ocio
from wavecomb.gui.viewport.frames import Frame
from wavecomb.picture import image
from wavecomb.picture.layer_view import Shown, show_layer

LINEAR, NEUTRAL = "Linear", "Neutral"
_NAN = (255, 0, 255)


@dataclass(frozen=True)
class Look:
    """How a layer is shown.

    Attributes:
        layer: Its name.
        exposure: In stops, of light.
        view: "Linear", "Neutral" or an OCIO view.
        low: Of the false colours; None: from the picture.
        high: Likewise.
    """

    layer: str = "beauty"
    exposure: float = 0.0
    view: str = LINEAR
    low: float | None = None
    high: float | None = None


def views() -> list[str]:
    """Names for ``Look.view``."""
    return [LINEAR, NEUTRAL, *ocio.views()]


def develop(rgb: NDArray[Any], exposure: float, view: str) -> NDArray[np.uint8]:
    """Linear Rec.709 to 8-bit codes.

    "Linear" and "Neutral" are ``wavecomb.picture.image.display`` with "clamp" and "neutral".

    Raises:
        WavecombError: There is no such view.
    """
    if view in (LINEAR, NEUTRAL):
        transfer: image.Transfer = "clamp" if view == LINEAR else "neutral"
        return image.display(rgb, exposure=exposure, tone_map=transfer)
    linear = np.asarray(rgb, np.float32)
    broken = np.isnan(linear).any(axis=2)
    finite = np.nan_to_num(linear, nan=0.0, posinf=65504.0, neginf=0.0)
    pixels = ocio.through_view(finite * np.float32(2.0**exposure), view)
    pixels[broken] = _NAN
    return pixels


def show(layer: NDArray[Any], look: Look) -> Shown:
    """A layer as the screen shows it.

    Args:
        layer: (height, width) or (height, width, channels).
        look: ``look.layer`` says what it is.
    """
    light = functools.partial(develop, exposure=look.exposure, view=look.view)
    return show_layer(layer, look.layer, light, low=look.low, high=look.high)


# ---- Turns a layer of a frame into what the screen shows. No Qt ----------------------------------


@dataclass(frozen=True)
class Developed:
    """A frame, how it is looked at, and what that gives."""

    frame: Frame
    look: Look
    shown: Shown


def develop_frame(frame: Frame, look: Look) -> Developed:
    """A layer of a frame for the screen; the beauty where it does not have the layer yet."""
    layer = frame.layer(look.layer)
    if layer is None:
        return Developed(frame, look, show(frame.beauty, replace(look, layer="beauty")))
    return Developed(frame, look, show(layer, look))
