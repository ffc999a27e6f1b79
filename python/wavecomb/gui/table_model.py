# SPDX-License-Identifier: Apache-2.0
"""Table models with sort keys.

Rows are replaced as a whole, which is efficient for thousands of rows.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, Qt
from PySide6.QtGui import QColor, QFont

ColourRole = Qt.ItemDataRole.UserRole + 10
"""Item data role of a linear colour, shown as a square before the text."""
ToneRole = Qt.ItemDataRole.UserRole + 11
"""Item data role of the tone of a cell's text: "dim", "warning", "error", or None."""


class HeadedModel(QAbstractTableModel):
    """Table model with fixed column titles. Subclasses implement ``data``.

    Args:
        headers: Titles of the columns.
        tips: Tooltips of the column titles; an empty tuple means that there are no tooltips.
    """

    def __init__(
        self, headers: Sequence[str], parent: QObject | None = None, tips: Sequence[str] = ()
    ) -> None:
        super().__init__(parent)
        self._headers, self._tips = headers, tips
        self.rows: list[Any] = []

    def fill(self, rows: Sequence[Any]) -> None:
        """Replaces all rows, which clears the selection."""
        self.beginResetModel()
        self.rows = list(rows)
        self.endResetModel()

    def tell(self, first: int, last: int) -> None:
        """Notifies views that cells in some columns have changed."""
        if self.rows:
            corners = self.index(0, first), self.index(len(self.rows) - 1, last)
            self.dataChanged.emit(*corners)

    def rowCount(self, parent: Any = None) -> int:
        """Returns the number of rows."""
        return 0 if parent is not None and parent.isValid() else len(self.rows)

    def columnCount(self, parent: Any = None) -> int:
        """Returns the number of columns."""
        return len(self._headers)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        """Returns the title or tooltip of a column."""
        if orientation != Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return self._headers[section]
        return self._tips[section] if self._tips and role == Qt.ItemDataRole.ToolTipRole else None


Cell = tuple[str, Any]
"""A table cell that holds a text and a sort key (``Qt.ItemDataRole.UserRole``). The tooltip of the
cell shows the whole text."""


class Table(HeadedModel):
    """Table model of rows of cells under a header.

    Columns in ``left`` hold text and align left. All other columns align right.
    """

    def __init__(
        self, header: Mapping[str, str], left: Collection[int], parent: QObject | None = None
    ) -> None:
        super().__init__(list(header), parent, list(header.values()))
        self._left = left
        self._bold: Collection[int] = ()
        self._colours: Mapping[tuple[int, int], QColor] = {}

    def replace(
        self,
        rows: Sequence[Sequence[Cell]],
        bold: Collection[int] = (),
        colours: Mapping[tuple[int, int], QColor] | None = None,
    ) -> None:
        """Replaces the rows, keeping selection and scroll position of rows that remain."""
        more = len(rows) - len(self.rows)
        if more > 0:
            self.beginInsertRows(QModelIndex(), len(self.rows), len(rows) - 1)
        elif more < 0:
            self.beginRemoveRows(QModelIndex(), len(rows), len(self.rows) - 1)
        self.rows, self._bold, self._colours = list(rows), bold, colours or {}
        if more > 0:
            self.endInsertRows()
        elif more < 0:
            self.endRemoveRows()
        self.tell(0, self.columnCount() - 1)

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Returns a cell's data."""
        row, column = index.row(), index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            return self.rows[row][column][0]
        if role == Qt.ItemDataRole.UserRole:
            return self.rows[row][column][1]
        if role == Qt.ItemDataRole.ToolTipRole:
            return str(self.rows[row][column][1]) if column in self._left else None
        if role == Qt.ItemDataRole.TextAlignmentRole:
            side = (
                Qt.AlignmentFlag.AlignLeft if column in self._left else Qt.AlignmentFlag.AlignRight
            )
            return int(side | Qt.AlignmentFlag.AlignVCenter)
        if role == Qt.ItemDataRole.FontRole and row in self._bold:
            font = QFont()
            font.setBold(True)
            return font
        if role == Qt.ItemDataRole.ForegroundRole:
            return self._colours.get((row, column))
        return None
