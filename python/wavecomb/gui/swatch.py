# SPDX-License-Identifier: Apache-2.0
"""Conversion of linear colours to screen colours, and of pixels to Qt images."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPixmap

from wavecomb.gui import theme

Colour = tuple[float, float, float]


def to_display(colour: Colour) -> QColor:
    """Converts a linear colour to sRGB, clipped to 0 to 1."""
    linear = np.clip(np.asarray(colour, float), 0.0, 1.0)
    low, high = 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055
    r, g, b = np.where(linear <= 0.0031308, low, high)
    return QColor.fromRgbF(float(r), float(g), float(b))


def from_display(colour: QColor) -> Colour:
    """Converts an sRGB colour to a linear one."""
    shown = np.array([colour.redF(), colour.greenF(), colour.blueF()])
    low, high = shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4
    r, g, b = np.where(shown <= 0.04045, low, high)
    return float(r), float(g), float(b)


def swatch(colour: Colour, size: int, wide: int = 1) -> QIcon:
    """Makes an icon filled with a colour; its width is ``wide`` times its height.

    A frame around the colour makes the icon visible on any background.
    """
    ratio = 2.0
    pixmap = QPixmap(round(size * wide * ratio), round(size * ratio))
    pixmap.setDevicePixelRatio(ratio)
    peak = max(*colour, 1e-30)
    shown = colour if peak <= 1.0 else tuple(c / peak for c in colour)
    pixmap.fill(to_display((shown[0], shown[1], shown[2])))
    with QPainter(pixmap) as painter:
        painter.setPen(theme.dim())
        painter.drawRect(0, 0, wide * size - 1, size - 1)
    icon = QIcon(pixmap)
    # Use the same pixmap for selected rows, since Qt would tint the icon otherwise.
    icon.addPixmap(pixmap, QIcon.Mode.Selected)
    return icon


# ---- Conversion of pixels to Qt images, on the window's thread
# ------------------------------------


def to_qimage(pixels: NDArray[np.uint8]) -> QImage:
    """Converts 8-bit values with shape (height, width, 3) to an image that owns its data."""
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels)
    borrowed = QImage(data.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    return borrowed.convertToFormat(QImage.Format.Format_RGB32)
