# SPDX-License-Identifier: Apache-2.0
"""Conversion of float layers to screen pixels: exposure, OpenColorIO views, false colours.

Independent of Qt.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb import ocio
from wavecomb.gui.viewport.frames import Frame
from wavecomb.image.files import image
from wavecomb.image.layer_view import DisplayLayer, show_layer

LINEAR, NEUTRAL = "Linear", "Neutral"
_NAN = (255, 0, 255)


@dataclass(frozen=True)
class Look:
    """Settings for displaying a layer.

    Attributes:
        layer: Name of the layer.
        exposure: Exposure of colour layers, in stops.
        view: Tone mapping: "Linear", "Neutral", or the name of an OCIO view.
        low: Lower end of the false colours; None means the minimum of the image.
        high: Upper end of the false colours; None means the maximum of the image.
    """

    layer: str = "beauty"
    exposure: float = 0.0
    view: str = LINEAR
    low: float | None = None
    high: float | None = None


def views() -> list[str]:
    """Returns the names that ``Look.view`` can have."""
    return [LINEAR, NEUTRAL, *ocio.views()]


def develop(rgb: NDArray[Any], exposure: float, view: str) -> NDArray[np.uint8]:
    """Converts linear Rec.709 colours to 8-bit display values.

    "Linear" and "Neutral" use ``image.display`` with the transfers "clamp" and "neutral".

    Raises:
        WavecombError: ``view`` is not the name of a view.
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


def show(layer: NDArray[Any], look: Look) -> DisplayLayer:
    """Converts a layer to screen pixels.

    Args:
        layer: Array with shape (height, width) or (height, width, channels).
        look: Display settings; ``look.layer`` is the name of the layer.
    """
    light = functools.partial(develop, exposure=look.exposure, view=look.view)
    return show_layer(layer, look.layer, light, low=look.low, high=look.high)


# ---- Conversion of a layer of a frame to screen pixels. Independent of Qt
# -------------------------


@dataclass(frozen=True)
class Developed:
    """A frame, its display settings, and the resulting screen pixels."""

    frame: Frame
    look: Look
    shown: DisplayLayer


def develop_frame(frame: Frame, look: Look) -> Developed:
    """Converts a layer of a frame to screen pixels.

    Converts the beauty instead if the frame lacks the layer.
    """
    layer = frame.layer(look.layer)
    if layer is None:
        return Developed(frame, look, show(frame.beauty, replace(look, layer="beauty")))
    return Developed(frame, look, show(layer, look))
