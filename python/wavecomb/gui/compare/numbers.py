# SPDX-License-Identifier: Apache-2.0
"""Tables with the difference values of a comparison, and the pixel values under the mouse."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.compare.differences import Numbers, pixel_rows, rows
from wavecomb.gui.compare.picture_sides import Side


class _Table(QTableWidget):
    """Table of two columns, for names and values. Ctrl+C copies the whole table as text."""

    def __init__(self, name: str, accessible: str, parent: QWidget) -> None:
        super().__init__(0, 2, parent)
        self.setObjectName(name)
        self.setAccessibleName(accessible)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setWordWrap(True)
        self.verticalHeader().hide()
        self.horizontalHeader().hide()
        header = self.horizontalHeader()
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)

    def set_rows(self, found: list[tuple[str, str, str]]) -> None:
        """Fills the table with rows of (name, value, tooltip)."""
        self.setRowCount(len(found))
        for row, (name, value, tip) in enumerate(found):
            for column, text in enumerate((name, value)):
                item = self.item(row, column)
                if item is None:
                    item = QTableWidgetItem()
                    self.setItem(row, column, item)
                item.setText(text)
                item.setToolTip(tip)

    def text(self) -> str:
        """Returns the whole table as text for the clipboard."""
        lines = []
        for row in range(self.rowCount()):
            cells = [self.item(row, column) for column in range(2)]
            lines.append("\t".join(cell.text() if cell is not None else "" for cell in cells))
        return "\n".join(lines)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Copies the table when the user presses Ctrl+C."""
        if event.matches(QKeySequence.StandardKey.Copy):
            QGuiApplication.clipboard().setText(self.text())
        else:
            super().keyPressEvent(event)


class NumbersPanel(QWidget):
    """Panel with a table of difference values above a table of pixel values."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("compareNumbers")
        self._verdict = QLabel(self)
        self._verdict.setObjectName("verdict")
        self._verdict.setWordWrap(True)
        self._table = _Table("numbers", "How A differs from B", self)
        self._table.setToolTip("B is the reference. Ctrl+C copies all")
        self._pixel = _Table("pixel", "Values of the pixel under the mouse", self)
        self._pixel.setToolTip("Linear values of the pixel under the mouse")
        self._pixel.setMinimumHeight(theme.em(6))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._verdict)
        column.addWidget(self._table, 3)
        column.addWidget(self._pixel, 1)
        self.set_numbers(None, "")
        self.set_pixel(None, None, "beauty", -1, -1)

    def set_numbers(self, found: Numbers | None, message: str) -> None:
        """Shows the difference values of a comparison, or ``message`` if there are none."""
        listed = rows(found) if found is not None else []
        self._verdict.setText(f"{found.layer}: {listed[0][1]}" if found is not None else message)
        font = self._verdict.font()
        font.setBold(found is not None)
        self._verdict.setFont(font)
        self._verdict.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._table.set_rows(listed[1:])

    def set_pixel(self, a: Side | None, b: Side | None, layer: str, x: int, y: int) -> None:
        """Shows the values of both images at a pixel. A negative ``x`` clears the values."""
        if x < 0:
            self._pixel.set_rows([("Pixel", "move the mouse over a picture", "")])
            return
        values = pixel_rows(a, b, layer, x, y)
        at = [("Pixel", f"{x}, {y}", "Column and row from the top left, from 0")]
        self._pixel.set_rows([*at, *((name, value, layer) for name, value in values.items())])
