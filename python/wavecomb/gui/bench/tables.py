# SPDX-License-Identifier: Apache-2.0
"""A table of runs with its filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QLabel,
    QLineEdit,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.bench.columns import Column
from wavecomb.gui import theme
from wavecomb.gui.bench.runs_model import RunsModel, RunsProxy
from wavecomb.gui.list_view import RowDelegate


class _View(QTableView):
    """Ctrl+C copies the rows that are chosen, with tabs."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Copies."""
        if not event.matches(QKeySequence.StandardKey.Copy):
            super().keyPressEvent(event)
            return
        model = self.model()
        rows = sorted({index.row() for index in self.selectedIndexes()})
        lines = [
            "\t".join(str(model.index(row, k).data()) for k in range(model.columnCount()))
            for row in rows
        ]
        QGuiApplication.clipboard().setText("\n".join(lines))


class RunsTable(QWidget):
    """Filter above, table below.

    Signals:
        activated(dict): A row was double-clicked, or Enter was pressed on it.
    """

    activated = Signal(object)

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.model = RunsModel(self)
        self.proxy = RunsProxy(self)
        self.proxy.setSourceModel(self.model)
        self.filter = QLineEdit(self)
        self.filter.setObjectName(f"{name}Filter")
        self.filter.setAccessibleName("Filter")
        self.filter.setPlaceholderText("Filter: words that a row holds, -word that it does not")
        self.filter.setToolTip("All words must be in a row; a word with - before it must not")
        self.filter.setClearButtonEnabled(True)
        self.filter.textChanged.connect(self._filter)
        self.view = _View(self)
        self.view.setObjectName(f"{name}View")
        self.view.setAccessibleName("Table")
        self.view.setToolTip("Click a heading to sort. Ctrl+C copies the chosen rows")
        self.view.setModel(self.proxy)
        self.view.setItemDelegate(RowDelegate(self.view))
        self.view.setSortingEnabled(True)
        self.view.setAlternatingRowColors(True)
        self.view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.view.setTabKeyNavigation(False)
        self.view.setWordWrap(False)
        self.view.verticalHeader().hide()
        self.view.verticalHeader().setDefaultSectionSize(theme.em(1.5))
        self.view.activated.connect(
            lambda index: self.activated.emit(self.model.row(self.proxy.mapToSource(index).row()))
        )
        self.count = QLabel(self)
        self.count.setObjectName(f"{name}Count")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        for widget in (self.filter, self.view, self.count):
            column.addWidget(widget)

    def set_rows(self, columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> None:
        """Shows other rows, in their own order."""
        self.model.set_rows(columns, rows)
        self.view.sortByColumn(-1, Qt.SortOrder.AscendingOrder)
        # Qt's own resizing asks for each cell many times: seconds for a large sitting.
        metrics = self.view.fontMetrics()
        for k, text in enumerate(self.model.longest_texts()):
            wide = metrics.horizontalAdvance(text) + theme.em(2)
            self.view.setColumnWidth(k, min(wide, theme.em(22)))
        self._filter(self.filter.text())

    def _filter(self, text: str) -> None:
        self.proxy.set_words(text)
        shown, there = self.proxy.rowCount(), self.model.rowCount()
        self.count.setText(f"{there} rows" if shown == there else f"{shown} of {there} rows")
