# SPDX-License-Identifier: Apache-2.0
"""Tables of runs as data: sorted by any column, filtered by words. No widgets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QSortFilterProxyModel, Qt

from wavecomb.bench.columns import Column
from wavecomb.gui.headed_model import ToneRole

_Index = QModelIndex


def cell_text(value: Any) -> str:
    """A value for people; nothing where it was not measured."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else ""
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number}" for key, number in value.items())
    return str(value)


def sort_key(value: Any) -> tuple[int, Any]:
    """Numbers by size, before texts; what was not measured last."""
    if value is None or value == "":
        return 2, ""
    if isinstance(value, (bool, int, float)):
        return 0, float(value)
    return 1, cell_text(value).lower()


class RunsModel(QAbstractTableModel):
    """Rows of runs.csv, or of another table with columns."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._columns: Sequence[Column] = ()
        self._rows: Sequence[Mapping[str, Any]] = ()

    def set_rows(self, columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> None:
        """Shows other rows."""
        self.beginResetModel()
        self._columns, self._rows = columns, rows
        self.endResetModel()

    def row(self, number: int) -> Mapping[str, Any]:
        """A row by its place in the file."""
        return self._rows[number]

    def value(self, row: int, column: int) -> Any:
        """As it was read."""
        return self._rows[row].get(self._columns[column].name)

    def longest_texts(self) -> list[str]:
        """The longest text of each column, title and cells."""
        cells = (
            (self.headerData(k, Qt.Orientation.Horizontal) or "", column.name)
            for k, column in enumerate(self._columns)
        )
        return [
            max((title, *(cell_text(row.get(name)) for row in self._rows)), key=len)
            for title, name in cells
        ]

    def rowCount(self, parent: Any = _Index()) -> int:  # noqa: B008
        """Qt's."""
        return 0 if parent.isValid() else len(self._rows)

    def columnCount(self, parent: Any = _Index()) -> int:  # noqa: B008
        """Qt's."""
        return 0 if parent.isValid() else len(self._columns)

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Qt's."""
        value = self.value(index.row(), index.column())
        if role == Qt.ItemDataRole.DisplayRole:
            return cell_text(value)
        if role == Qt.ItemDataRole.TextAlignmentRole and isinstance(value, (int, float)):
            return int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        row = self._rows[index.row()]
        if role == ToneRole:
            return (
                "error"
                if row.get("status") == "failed"
                else "warning"
                if row.get("noisy")
                else None
            )
        if role == Qt.ItemDataRole.ToolTipRole:
            why = row.get("error") or ("disturbed by other work" if row.get("noisy") else "")
            return f"{cell_text(value)}\n{why}" if why else cell_text(value)
        return None

    def headerData(
        self,
        section: int,
        orientation: Qt.Orientation,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> Any:
        """Name, unit and meaning of a column."""
        if orientation != Qt.Orientation.Horizontal or section >= len(self._columns):
            return None
        column = self._columns[section]
        if role == Qt.ItemDataRole.DisplayRole:
            return column.name
        if role == Qt.ItemDataRole.ToolTipRole:
            return f"{column.meaning}\nUnit: {column.unit}" if column.unit else column.meaning
        return None


class RunsProxy(QSortFilterProxyModel):
    """Rows that hold all words of the filter, in any column."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._words: list[str] = []

    def set_words(self, text: str) -> None:
        """Upper and lower case are alike; a word with a dash before it must not be there."""
        self._words = text.lower().split()
        self.invalidate()

    def filterAcceptsRow(self, row: int, parent: Any) -> bool:
        """Qt's."""
        if not self._words:
            return True
        model = self.sourceModel()
        assert isinstance(model, RunsModel)
        texts = [cell_text(model.value(row, k)).lower() for k in range(model.columnCount())]
        for word in self._words:
            unwanted = word.startswith("-") and len(word) > 1
            if any(word[unwanted:] in text for text in texts) == unwanted:
                return False
        return True

    def lessThan(self, left: Any, right: Any) -> bool:
        """Qt's."""
        model = self.sourceModel()
        assert isinstance(model, RunsModel)
        keys = [sort_key(model.value(index.row(), index.column())) for index in (left, right)]
        return keys[0] < keys[1]
