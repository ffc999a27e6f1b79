# SPDX-License-Identifier: Apache-2.0
"""The eye beside a prim that says whether it is visible."""

from __future__ import annotations

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRectF, QSize
from PySide6.QtGui import QPainter, QPainterPath, QPen
from PySide6.QtWidgets import QStyledItemDelegate, QStyleOptionViewItem

from wavecomb.gui import theme
from wavecomb.gui.scene.scene_model import StateRole
from wavecomb.gui.scene.visibility import HIDDEN, NOT_DRAWN, VISIBLE


class EyeDelegate(QStyledItemDelegate):
    """Paints an eye: open, crossed out, or faint where something above hides the prim."""

    def sizeHint(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QSize:
        """As Qt has it: rows are high enough to be hit."""
        return QSize(theme.em(2), theme.em(1.5))

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """As Qt has it."""
        super().paint(painter, option, index)
        seen = index.data(StateRole)
        if seen == NOT_DRAWN or seen is None:
            return
        size = min(option.rect.height() * 0.8, option.rect.width())
        box = QRectF(0, 0, size, size * 0.6)
        box.moveCenter(QRectF(option.rect).center())
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colour = theme.text() if seen in (VISIBLE, HIDDEN) else theme.dim()
        painter.setPen(QPen(colour, size / 12))
        left, right = box.center().x() - box.width() / 2, box.center().x() + box.width() / 2
        middle = box.center().y()
        lid = QPainterPath()
        lid.moveTo(left, middle)
        lid.quadTo(box.center().x(), box.top() - box.height() * 0.4, right, middle)
        lid.quadTo(box.center().x(), box.bottom() + box.height() * 0.4, left, middle)
        painter.drawPath(lid)
        if seen == VISIBLE:
            painter.setBrush(colour)
        pupil = size * 0.14
        painter.drawEllipse(box.center(), pupil, pupil)
        if seen != VISIBLE:
            painter.drawLine(box.bottomLeft(), box.topRight())
        painter.restore()
