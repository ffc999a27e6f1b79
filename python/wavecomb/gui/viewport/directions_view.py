# SPDX-License-Identifier: Apache-2.0
"""View of a latlong map in false colours, with a ring around one direction."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from wavecomb.gui import theme
from wavecomb.gui.swatch import to_qimage
from wavecomb.image.layer_view import heat


class DirectionsView(QWidget):
    """View of an array with twice as many columns as rows. The view is empty until ``show_map``."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(theme.em(6))
        self._image: QImage | None = None
        self._mark: tuple[float, float] | None = None

    @property
    def image(self) -> QImage | None:
        """The shown map as an image, or None."""
        return self._image

    def sizeHint(self) -> QSize:
        """Returns a preferred size that is twice as wide as high."""
        return QSize(theme.em(20), theme.em(10))

    def show_map(
        self, values: NDArray[Any] | None, mark: tuple[float, float] | None = None
    ) -> None:
        """Shows an array in false colours from 0 to the array's maximum, with a ring.

        Args:
            values: Array with shape (height, 2 height); None clears the view.
            mark: Position of the ring as a fraction of width and height, or None.
        """
        self._image, self._mark = None, mark
        if values is not None:
            self._image = to_qimage(heat(values, "", 0.0, max(float(values.max()), 1e-30)).pixels)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draws the map as large as the widget allows, and then the ring."""
        if self._image is None:
            return
        wide = min(self.width(), 2 * self.height())
        left, top = 0.5 * (self.width() - wide), 0.5 * (self.height() - 0.5 * wide)
        area = QRectF(left, top, wide, 0.5 * wide)
        with QPainter(self) as painter:
            painter.drawImage(area, self._image)
            if self._mark is None:
                return
            place = QPointF(
                area.x() + self._mark[0] * area.width(), area.y() + self._mark[1] * area.height()
            )
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for colour, width in ((Qt.GlobalColor.black, 3.0), (Qt.GlobalColor.white, 1.4)):
                painter.setPen(QPen(colour, width))
                painter.drawEllipse(place, 0.4 * theme.em(), 0.4 * theme.em())
