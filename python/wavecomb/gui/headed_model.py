# SPDX-License-Identifier: Apache-2.0
"""What the lists of the scene panel share: a model with a header, and a view of whole rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QObject, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from wavecomb.gui import theme
from wavecomb.gui.widgets import named


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


def lay_out_rows(
    view: QTableView,
    name: str,
    title: str,
    tip: str,
    *,
    stretch: int,
    widths: Mapping[int, float],
) -> None:
    """A list of which whole rows are chosen, one at a time.

    Args:
        view: With its model.
        name: Object name.
        title: Accessible name.
        tip: Tooltip.
        stretch: Column that takes what room is left.
        widths: Of the others, in font heights.
    """
    named(view, name, title, tip)
    view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    view.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    view.setTabKeyNavigation(False)
    view.setShowGrid(False)
    view.setAlternatingRowColors(True)
    view.verticalHeader().hide()
    view.verticalHeader().setDefaultSectionSize(theme.em(1.6))
    header = view.horizontalHeader()
    header.setSectionResizeMode(stretch, QHeaderView.ResizeMode.Stretch)
    for column, wide in widths.items():
        header.resizeSection(column, theme.em(wide))
