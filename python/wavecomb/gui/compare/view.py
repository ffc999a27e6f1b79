# SPDX-License-Identifier: Apache-2.0
"""View of two images and their difference.

The modes are side by side, wipe and flip; all panes share zoom and pan.
"""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from wavecomb.gui import theme
from wavecomb.gui.compare.layout import DIFFERENCE, THREE, WIPE, A, B, D, Layout
from wavecomb.gui.swatch import to_qimage
from wavecomb.gui.widgets import TakesFiles
from wavecomb.image.compare.heatmap import Scale
from wavecomb.image.files import image


def paint_label(
    painter: QPainter, pane: QRectF, text: str, *, middle: bool = False, right: bool = False
) -> None:
    """Paints a wrapped text on a dark background in a corner or in the middle of a pane."""
    if not text or pane.width() < theme.em(2):
        return
    pad = theme.em(0.35)
    room = pane.adjusted(pad, pad, -pad, -pad)
    wrap = int(Qt.TextFlag.TextWordWrap | Qt.AlignmentFlag.AlignCenter)
    metrics = painter.fontMetrics()
    if middle:
        box = QRectF(metrics.boundingRect(room.adjusted(pad, 0, -pad, 0).toRect(), wrap, text))
    else:
        text = metrics.elidedText(text, Qt.TextElideMode.ElideMiddle, int(room.width() - 2 * pad))
        width = metrics.horizontalAdvance(text)
        left = room.right() - width - pad if right else room.left() + pad
        box = QRectF(left, room.top() + pad / 2, width, metrics.height())
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(0, 0, 0, 170))
    painter.drawRoundedRect(box.adjusted(-pad, -pad / 2, pad, pad / 2), pad, pad)
    painter.setPen(QColor("white"))
    painter.drawText(box, wrap if middle else int(Qt.AlignmentFlag.AlignCenter), text)
    painter.restore()


def paint_bar(painter: QPainter, area: QRectF, scale: Scale) -> None:
    """Paints the title, colour ramp and tick labels of a colour scale.

    Leaves out labels that would overlap.
    """
    metrics = painter.fontMetrics()
    pad = theme.em(0.4)
    left, width = area.left() + pad, max(area.width() - 2 * pad, 1.0)
    top = area.top() + pad / 2
    painter.save()
    painter.fillRect(area, theme.surface())
    painter.setPen(theme.text())
    title = metrics.elidedText(scale.title, Qt.TextElideMode.ElideRight, int(width))
    painter.drawText(QPointF(left, top + metrics.ascent()), title)
    top += metrics.height()
    ramp = QRectF(left, top, width, theme.em(0.6))
    painter.drawImage(ramp, to_qimage(image.display(np.asarray(scale.colours)[None])))
    baseline = ramp.bottom() + metrics.ascent()
    end = -1e9
    for place, label in sorted(scale.ticks):
        extent = metrics.horizontalAdvance(label)
        x = min(max(left + place * width - extent / 2, left), left + width - extent)
        if x > end:
            painter.drawText(QPointF(x, baseline), label)
            end = x + extent + pad
    painter.restore()


ZOOM_STEP = 1.25
_PAN_STEP = 0.1
"""Distance that one press of an arrow key pans, as a fraction of the visible area."""


class CompareView(TakesFiles, QWidget):
    """Widget that draws the images of a comparison, independent of the images' sources.

    Signals:
        hovered(x, y): Column and row of the pixel under the mouse; -1, -1 if there is none.
        flipped(which): The flip view changed to image "A" or "B".
        wiped(fraction): The wipe line moved to ``fraction`` of the width; 0 is the left edge.
        dropped(which, paths): Files were dropped on image "A" or "B", given by ``which``.
    """

    hovered = Signal(int, int)
    flipped = Signal(str)
    wiped = Signal(float)
    dropped = Signal(str, list)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("compareView")
        self.setAccessibleName("Pictures A and B")
        self.setToolTip(
            "Wheel or + and -: zoom. Drag or arrows: pan. 0: whole picture, 1: pixel by pixel.\n"
            "Wipe: drag the line, or arrows. Flip: F or Space."
        )
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAcceptDrops(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(theme.em(12), theme.em(8))
        self._layout = Layout()
        self.wipe = 0.5
        self.names = {A: "A", B: "B", D: "A - B"}
        self.message = ""
        self._images: dict[str, QImage | None] = {A: None, B: None, D: None}
        self._scale: Scale | None = None
        self._cursor: tuple[int, int] | None = None
        self._drag: QPointF | None = None
        self._wiping = False

    # ---- what is shown -------------------------------------------------------------------------

    def set_image(self, which: str, image: QImage | None) -> None:
        """Sets the displayed image "A", "B", or the difference map "D"."""
        self._images[which] = image
        self.update()

    def image(self, which: str) -> QImage | None:
        """Returns the image that ``set_image`` has set for "A", "B" or "D"."""
        return self._images[which]

    def set_scale(self, scale: Scale | None) -> None:
        """Sets the colour scale of the difference map."""
        self._scale = scale
        self.update()

    def set_mode(self, mode: str) -> None:
        """Sets the view mode, one of ``layout.MODES``."""
        self._layout.mode = mode
        self.update()

    def set_message(self, message: str) -> None:
        """Shows a message in place of the difference map; the text "" removes the message."""
        self.message = message
        self.update()

    def flip(self) -> None:
        """Switches between image A and image B in the flip view."""
        self._layout.shown = B if self.shown == A else A
        self.flipped.emit(self.shown)
        self.update()

    def set_wipe(self, fraction: float) -> None:
        """Moves the wipe line to a fraction of the width."""
        self.wipe = min(max(fraction, 0.0), 1.0)
        self.wiped.emit(self.wipe)
        self.update()

    def fit(self) -> None:
        """Sets the zoom so that the whole image is visible."""
        self._arranged().fit()
        self.update()

    def set_zoom(self, zoom: float, at: QPointF | None = None) -> None:
        """Sets the zoom in points per pixel, keeping the image point at ``at`` fixed."""
        self._arranged().set_zoom(zoom, at)
        self.update()

    @property
    def mode(self) -> str:
        """The current view mode, one of ``layout.MODES``."""
        return self._layout.mode

    @property
    def shown(self) -> str:
        """The image that the flip view shows, "A" or "B"."""
        return self._layout.shown

    @property
    def zoom(self) -> float | None:
        """The chosen zoom in points per pixel; None fits the whole image."""
        return self._layout.zoom

    def points_per_pixel(self) -> float:
        """Returns the current zoom in points per pixel."""
        return self._arranged().points_per_pixel()

    def pixel_at(self, at: QPointF) -> tuple[int, int] | None:
        """Returns the column and row of the image pixel at a point of the widget."""
        return self._arranged().pixel_at(at)

    def target(self, number: int) -> QRectF:
        """Returns the rectangle of the image in a pane."""
        layout = self._arranged()
        return layout.target(layout.panes()[number][1])

    def _arranged(self) -> Layout:
        """Returns the layout of the panes for the current sizes of widget and images."""
        layout = self._layout
        layout.area = QRectF(self.rect())
        there = [image for image in (self._images[A], self._images[B]) if image is not None]
        layout.size = QSizeF(there[0].size()) if there else None
        layout.gap = theme.em(0.3)
        layout.bar = theme.em(3.2) if self._scale is not None else 0
        return layout

    def _panes(self) -> list[tuple[str, QRectF]]:
        return self._arranged().panes()

    def _line_x(self) -> float:
        return self._panes()[0][1].width() * self.wipe

    # ---- painting ------------------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paints the panes, the wipe line, labels and the colour bar."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), theme.surround())
        for which, pane in self._panes():
            self._paint_pane(painter, which, pane)
        if self.mode == WIPE:
            self._paint_wipe(painter)
        if self._scale is not None and self.mode in (DIFFERENCE, THREE):
            pane = self._panes()[-1][1]
            area = QRectF(pane.left(), pane.bottom(), pane.width(), self.height() - pane.bottom())
            paint_bar(painter, area, self._scale)
        if self.hasFocus():
            painter.setPen(QPen(theme.accent(), 1.0))
            painter.drawRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5))

    def _paint_pane(self, painter: QPainter, which: str, pane: QRectF) -> None:
        self._paint_image(painter, which, pane, pane)
        if which == D and self.message:
            paint_label(painter, pane, self.message, middle=True)
        elif self._images[which] is None:
            empty = "no difference yet" if which == D else f"{which}: drop a picture here"
            paint_label(painter, pane, empty, middle=True)
        if self.mode != WIPE:
            paint_label(painter, pane, self.names[which])
        if self._cursor is not None and len(self._panes()) > 1:
            self._paint_cursor(painter, pane)

    def _paint_image(self, painter: QPainter, which: str, pane: QRectF, clip: QRectF) -> None:
        image = self._images[which]
        if image is None:
            return
        painter.save()
        painter.setClipRect(clip)
        smooth = self.points_per_pixel() * self.devicePixelRatioF() < 1.0
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, smooth)
        painter.drawImage(self._arranged().target(pane, QSizeF(image.size())), image)
        painter.restore()

    def _paint_cursor(self, painter: QPainter, pane: QRectF) -> None:
        if self._cursor is None:
            return
        target, scale = self._arranged().target(pane), self.points_per_pixel()
        x, y = self._cursor
        box = QRectF(target.left() + x * scale, target.top() + y * scale, scale, scale)
        arm = max(theme.em(0.3), 3)
        painter.save()
        painter.setClipRect(pane)
        painter.setPen(QPen(Qt.GlobalColor.white, 1.0))
        painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Difference)
        painter.drawRect(box.adjusted(-arm, -arm, arm, arm))
        painter.restore()

    def _paint_wipe(self, painter: QPainter) -> None:
        pane = self._panes()[0][1]
        x = self._line_x()
        right = QRectF(x, pane.top(), pane.width() - x, pane.height())
        painter.fillRect(right, theme.surround())
        self._paint_image(painter, B, pane, right)
        for width, colour in ((3.0, Qt.GlobalColor.black), (1.0, Qt.GlobalColor.white)):
            painter.setPen(QPen(colour, width))
            painter.drawLine(QPointF(x, pane.top()), QPointF(x, pane.bottom()))
        paint_label(painter, QRectF(pane.left(), pane.top(), x, pane.height()), self.names[A])
        paint_label(painter, right, self.names[B], right=True)

    # ---- events --------------------------------------------------------------------------------

    def _pan(self, dx: float, dy: float) -> None:
        self._arranged().pan(dx, dy)
        self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Starts dragging the wipe line or the image."""
        at = event.position()
        left = event.button() == Qt.MouseButton.LeftButton
        near = abs(at.x() - self._line_x()) <= max(theme.em(0.5), 6)
        self._wiping = self.mode == WIPE and left and near
        self._drag = at

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Moves the wipe line or the image in a drag.

        Without a drag, reports the pixel under the mouse.
        """
        at = event.position()
        if self._wiping:
            self.set_wipe(at.x() / max(self._panes()[0][1].width(), 1.0))
        elif self._drag is not None and event.buttons() != Qt.MouseButton.NoButton:
            self._pan(at.x() - self._drag.x(), at.y() - self._drag.y())
            self._drag = at
        elif self.mode == WIPE:
            near = abs(at.x() - self._line_x()) <= max(theme.em(0.5), 6)
            shape = Qt.CursorShape.SplitHCursor if near else Qt.CursorShape.ArrowCursor
            self.setCursor(shape)
        else:
            self.unsetCursor()
        self._hover(self.pixel_at(at))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Ends dragging the wipe line or the image."""
        self._drag, self._wiping = None, False

    def leaveEvent(self, event: object) -> None:
        """Reports that no image pixel is under the mouse."""
        self._hover(None)

    def _hover(self, pixel: tuple[int, int] | None) -> None:
        if pixel != self._cursor:
            self._cursor = pixel
            self.hovered.emit(*(pixel or (-1, -1)))
            self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zooms the image about the pixel under the mouse."""
        steps = event.angleDelta().y() / 120.0
        if steps:
            self.set_zoom(self.points_per_pixel() * ZOOM_STEP**steps, event.position())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Handles keys that zoom, pan, move the wipe line or flip the images."""
        key, keys = Qt.Key(event.key()), Qt.Key
        steps = {
            keys.Key_Left: (-1, 0),
            keys.Key_Right: (1, 0),
            keys.Key_Up: (0, -1),
            keys.Key_Down: (0, 1),
        }
        if key in (keys.Key_F, keys.Key_Space):
            self.flip()
        elif key in (keys.Key_Plus, keys.Key_Equal):
            self.set_zoom(self.points_per_pixel() * ZOOM_STEP)
        elif key == keys.Key_Minus:
            self.set_zoom(self.points_per_pixel() / ZOOM_STEP)
        elif key in (keys.Key_0, keys.Key_Home):
            self.fit()
        elif key == keys.Key_1:
            self.set_zoom(1.0 / self.devicePixelRatioF())
        elif key in steps:
            self._arrow(*steps[key], event.modifiers())
        else:
            super().keyPressEvent(event)

    def _arrow(self, dx: int, dy: int, modifiers: Qt.KeyboardModifier) -> None:
        if self.mode == WIPE and dx:
            far = bool(modifiers & Qt.KeyboardModifier.ShiftModifier)
            self.set_wipe(self.wipe + dx * (0.1 if far else 0.01))
        else:
            pane = self._panes()[0][1]
            self._pan(-dx * _PAN_STEP * pane.width(), -dy * _PAN_STEP * pane.height())

    def focusInEvent(self, event: object) -> None:
        """Repaints the widget, so that its focus frame appears or disappears."""
        self.update()

    focusOutEvent = focusInEvent

    def take_files(self, paths: list[str], at: QPointF) -> None:
        """Emits ``dropped``.

        Files on the left half of the widget replace image A, files on the right half replace image
        B.
        """
        self.dropped.emit(A if at.x() < self.width() / 2 else B, paths)
