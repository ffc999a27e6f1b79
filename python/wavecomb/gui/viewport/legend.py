# SPDX-License-Identifier: Apache-2.0
"""The bar that says what false colours mean."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter

from wavecomb.gui.swatch import to_qimage
from wavecomb.picture.layer_view import Legend, ramp

_BEHIND = QColor(0, 0, 0, 190)
_TEXT = QColor(240, 240, 240)


def legend_text(legend: Legend) -> str:
    """The title with the kind of scale."""
    return f"{legend.title}, logarithmic" if legend.logarithmic else legend.title


def paint_legend(painter: QPainter, area: QRect, legend: Legend, font: QFont) -> None:
    """Draws title, colours and numbers into the lower left of an area."""
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
