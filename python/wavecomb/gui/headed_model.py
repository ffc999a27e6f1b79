# SPDX-License-Identifier: Apache-2.0
"""What models of lists share: fixed headers, and roles for what a view paints. No widgets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QObject, Qt

ColourRole = Qt.ItemDataRole.UserRole + 10
"""A linear colour, shown as a square before the text."""
ToneRole = Qt.ItemDataRole.UserRole + 11
"""The tone of the text: "dim", "warning", "error", or None."""


class HeadedModel(QAbstractTableModel):
    """A table under fixed headers; subclasses have ``row_count`` and ``data``.

    Args:
        headers: Titles of the columns.
        tips: Tooltips of the titles; none where it is empty.
    """

    def __init__(
        self, headers: Sequence[str], parent: QObject | None = None, tips: Sequence[str] = ()
    ) -> None:
        super().__init__(parent)
        self._headers, self._tips = headers, tips

    def row_count(self) -> int:
        """How many rows there are."""
        raise NotImplementedError

    def tell(self, first: int, last: int) -> None:
        """Some columns say something else now."""
        if self.row_count():
            corners = self.index(0, first), self.index(self.row_count() - 1, last)
            self.dataChanged.emit(*corners)

    def rowCount(self, parent: Any = None) -> int:
        """As Qt has it."""
        return 0 if parent is not None and parent.isValid() else self.row_count()

    def columnCount(self, parent: Any = None) -> int:
        """As Qt has it."""
        return len(self._headers)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        """As Qt has it."""
        if orientation != Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return self._headers[section]
        return self._tips[section] if self._tips and role == Qt.ItemDataRole.ToolTipRole else None
