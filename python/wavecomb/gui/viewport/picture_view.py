# SPDX-License-Identifier: Apache-2.0
"""Widget that shows an image with zoom, pan and, at large zoom, a pixel grid."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFont,
    QFontMetricsF,
    QImage,
    QPainter,
    QPaintEvent,
    QPen,
    QResizeEvent,
)
from PySide6.QtWidgets import QWidget

from wavecomb.gui import theme
from wavecomb.gui.swatch import to_qimage
from wavecomb.image.layer_view import Legend, ramp

_BEHIND = QColor(0, 0, 0, 190)
_TEXT = QColor(240, 240, 240)


def legend_text(legend: Legend) -> str:
    """Returns the title of a false-colour legend, and whether the legend's scale is logarithmic."""
    return f"{legend.title}, logarithmic" if legend.logarithmic else legend.title


def paint_legend(painter: QPainter, area: QRect, legend: Legend, font: QFont) -> None:
    """Draws the title, colours and numbers of a legend into the lower left corner of an area."""
    metrics = QFontMetricsF(font)
    line = metrics.height()
    ticks = legend.ticks()
    widest = max(metrics.horizontalAdvance(label) for _, label in ticks)
    title = legend_text(legend)
    wide = max((widest + line) * (len(ticks) - 1), metrics.horizontalAdvance(title) - widest)
    wide = min(wide, area.width() - widest - 2.0 * line)
    if wide < 4 * line:
        return
    pad = 0.5 * line
    high = 2.9 * line + 2 * pad
    box = QRectF(pad, area.height() - high - pad, wide + widest + 2 * pad, high)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(_BEHIND)
    painter.drawRoundedRect(box, 0.3 * line, 0.3 * line)
    left, top = box.x() + pad + 0.5 * widest, box.y() + pad
    painter.setFont(font)
    painter.setPen(_TEXT)
    painter.drawText(QPointF(box.x() + pad, top + metrics.ascent()), title)
    bar = QRectF(left, top + 1.15 * line, wide, 0.6 * line)
    painter.drawImage(bar, to_qimage(ramp(256)[None]))
    end = -1e9
    for t, label in ticks:
        x = left + t * wide
        extent = metrics.horizontalAdvance(label)
        if x - 0.5 * extent < end:
            continue
        painter.drawLine(QPointF(x, bar.bottom()), QPointF(x, bar.bottom() + 0.15 * line))
        painter.drawText(
            QPointF(x - 0.5 * extent, bar.bottom() + 0.2 * line + metrics.ascent()), label
        )
        end = x + 0.5 * extent + 0.4 * line


LEAST_ZOOM, MOST_ZOOM = 1 / 16, 64.0
GRID_ZOOM = 10.0
"""Smallest zoom at which a pixel grid is drawn, in device pixels per image pixel."""


class PictureView(QWidget):
    """View of an image with a given size in pixels. A smaller image is stretched to that size.

    Signals:
        zoom_changed(float): The zoom changed. The argument is in device pixels per image pixel.
    """

    zoom_changed = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._image: QImage | None = None
        self._legend: Legend | None = None
        self._size = QSize(1, 1)
        self._zoom: float | None = None
        self._shift = QPointF(0.0, 0.0)
        self.setMinimumSize(theme.em(12), theme.em(9))
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def set_picture(self, image: QImage | None, size: QSize, legend: Legend | None = None) -> None:
        """Sets the image.

        Args:
            image: The image; None clears the view.
            size: Size in pixels at which the image is shown. The image may be smaller.
            legend: Legend of the image's false colours, or None.
        """
        self._image, self._legend = image, legend
        if size != self._size:
            self._size = size
            self._keep_inside()
            self.zoom_changed.emit(self.zoom())
        self.update()

    def image(self) -> QImage | None:
        """Returns the shown image, or None."""
        return self._image

    def legend(self) -> Legend | None:
        """Returns the legend of the shown false colours, or None."""
        return self._legend

    # ---- position of the image
    # -------------------------------------------------------------------------

    def zoom(self) -> float:
        """Returns the zoom in device pixels per image pixel."""
        return self._fitting() if self._zoom is None else self._zoom

    def is_fitted(self) -> bool:
        """Returns whether the image is fitted to the widget."""
        return self._zoom is None

    def set_zoom(self, zoom: float | None, about: QPointF | None = None) -> None:
        """Sets the zoom in device pixels per image pixel; None fits the image to the widget.

        Args:
            zoom: The zoom, which is clamped to the allowed range.
            about: Point of the widget whose image point stays fixed; None means the centre of the
                widget.
        """
        place = about if about is not None else QPointF(self.rect().center())
        before = self.to_picture(place)
        self._zoom = None if zoom is None else min(max(zoom, LEAST_ZOOM), MOST_ZOOM)
        if zoom is None:
            self._shift = QPointF(0.0, 0.0)
        else:
            self._shift += place - self.from_picture(before)
        self._keep_inside()
        self.zoom_changed.emit(self.zoom())
        self.update()

    def shift(self, by: QPointF) -> None:
        """Pans the image by a distance in device-independent pixels."""
        if self._zoom is None:
            self._zoom = self._fitting()
        self._shift += by
        self._keep_inside()
        self.update()

    def picture_rect(self) -> QRectF:
        """Returns the rectangle of the whole image in the widget."""
        k = self.zoom() / self.devicePixelRatioF()
        wide, high = self._size.width() * k, self._size.height() * k
        middle = QPointF(self.width() / 2, self.height() / 2) + self._shift
        corner = middle - QPointF(wide / 2, high / 2)
        ratio = self.devicePixelRatioF()
        # Align the image with device pixels, so that each image pixel covers exactly one device
        # pixel at a zoom of 100 %.
        x, y = round(corner.x() * ratio) / ratio, round(corner.y() * ratio) / ratio
        return QRectF(x, y, wide, high)

    def to_picture(self, place: QPointF) -> QPointF:
        """Converts a point of the widget to image coordinates in pixels."""
        rect = self.picture_rect()
        return QPointF(
            (place.x() - rect.x()) / rect.width() * self._size.width(),
            (place.y() - rect.y()) / rect.height() * self._size.height(),
        )

    def from_picture(self, place: QPointF) -> QPointF:
        """Converts image coordinates in pixels to a point of the widget."""
        rect = self.picture_rect()
        return QPointF(
            rect.x() + place.x() / self._size.width() * rect.width(),
            rect.y() + place.y() / self._size.height() * rect.height(),
        )

    def _fitting(self) -> float:
        ratio = self.devicePixelRatioF()
        room = (
            self.width() * ratio / self._size.width(),
            self.height() * ratio / self._size.height(),
        )
        return max(min(room), LEAST_ZOOM)

    def _keep_inside(self) -> None:
        """Limits panning, so that a part of the image stays visible."""
        k = self.zoom() / self.devicePixelRatioF()
        for get, put, size, own in (
            (self._shift.x, self._shift.setX, self._size.width(), self.width()),
            (self._shift.y, self._shift.setY, self._size.height(), self.height()),
        ):
            most = 0.5 * (size * k + own) - min(40.0, 0.5 * own)
            put(min(max(get(), -most), most))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Adapts the panning after the widget was resized, so that the image stays visible."""
        super().resizeEvent(event)
        self._keep_inside()
        self.zoom_changed.emit(self.zoom())

    # ---- painting ------------------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paints background, image, pixel grid, the overlay of subclasses, and the legend."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), theme.surround())
        if self._image is not None:
            rect = self.picture_rect()
            reduced = self._image.width() < self._size.width()
            smooth = reduced or self.zoom() < 1.0
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, smooth)
            painter.drawImage(rect, self._image)
            if self.zoom() >= GRID_ZOOM:
                self._paint_grid(painter, event.rect())
        self.paint_over(painter)
        if self._image is not None and self._legend is not None:
            paint_legend(painter, self.rect(), self._legend, self.font())
        painter.end()

    def paint_over(self, painter: QPainter) -> None:
        """Paints an overlay over the image; subclasses override this method."""

    def _paint_grid(self, painter: QPainter, dirty: QRect) -> None:
        area = self.picture_rect().intersected(QRectF(dirty))
        first, last = self.to_picture(area.topLeft()), self.to_picture(area.bottomRight())
        pen = QPen(QColor(128, 128, 128, 110))
        pen.setCosmetic(True)
        painter.setPen(pen)
        for column in range(int(first.x()), int(last.x()) + 2):
            x = self.from_picture(QPointF(column, 0)).x()
            painter.drawLine(QPointF(x, area.top()), QPointF(x, area.bottom()))
        for row in range(int(first.y()), int(last.y()) + 2):
            y = self.from_picture(QPointF(0, row)).y()
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
