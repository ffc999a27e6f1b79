# SPDX-License-Identifier: Apache-2.0
"""Pixels as Qt has them; for the window's thread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage


def to_qimage(pixels: NDArray[np.uint8]) -> QImage:
    """(height, width, 3) 8-bit codes as an image that owns its data."""
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels)
    borrowed = QImage(data.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    return borrowed.convertToFormat(QImage.Format.Format_RGB32)
