# SPDX-License-Identifier: Apache-2.0
"""What a comparison draws over its pictures: labels, and the bar of a difference map."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter

from wavecomb.gui import theme
from wavecomb.gui.swatch import to_qimage
from wavecomb.picture import image
from wavecomb.picture.heatmap import Scale


def paint_label(
    painter: QPainter, pane: QRectF, text: str, *, middle: bool = False, right: bool = False
) -> None:
    """Text on a dark ground in a corner of a pane, or in its middle, wrapped."""
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
    """Title, ramp and numbers; numbers that would overlap are left out."""
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
