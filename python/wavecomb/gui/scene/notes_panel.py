# SPDX-License-Identifier: Apache-2.0
"""Panel of the loader's findings: unsupported features, stage errors, choices of the loader."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, Qt
from PySide6.QtGui import QGuiApplication, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.list_view import RowDelegate, show_rows
from wavecomb.gui.scene.notes_model import KIND, KINDS, WHAT, NotesFilter, NotesModel, Row, rows_of
from wavecomb.gui.widgets import named, search_field

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session
    from wavecomb.usd import LoadedStage


class NotesPanel(QWidget):
    """List of the loader's findings with a filter.

    A double click selects the prim of a finding. Ctrl+C copies the selected lines.
    """

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.model = NotesModel(self)
        self._filter = NotesFilter(self)
        self._filter.setSourceModel(self.model)
        self.kinds = named(
            QComboBox(), "notes-kind", "Kind of finding", "Which findings are listed"
        )
        self.kinds.addItem("All", "")
        for kind in KINDS:
            self.kinds.addItem(kind.capitalize(), kind)
        tip = "Shows the findings that contain this text"
        self.field = search_field("notes-filter", "Filter findings", tip, "Filter")
        self.view = QTableView()
        self._make_view()
        self.count = QLabel()
        self.count.setObjectName("notes-count")
        top = QHBoxLayout()
        top.addWidget(self.kinds)
        top.addWidget(self.field, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(top)
        layout.addWidget(self.view, 1)
        layout.addWidget(self.count)
        self.kinds.currentIndexChanged.connect(lambda number: self._refilter())
        self.field.textChanged.connect(lambda text: self._refilter())
        session.opened.connect(self.fill)
        session.noted.connect(self.fill)
        if session.stage is not None:
            self.fill(session.stage)
        self._refilter()

    def _make_view(self) -> None:
        view = self.view
        view.setModel(self._filter)
        view.setItemDelegate(RowDelegate(view))
        tip = "Double click selects the prim; Ctrl+C copies"
        show_rows(view, "notes", "Findings of the loader", tip)
        view.setSortingEnabled(True)
        view.sortByColumn(-1, Qt.SortOrder.AscendingOrder)
        view.setWordWrap(False)
        header = view.horizontalHeader()
        header.setStretchLastSection(True)
        header.resizeSection(KIND, theme.em(6.5))
        header.resizeSection(WHAT, theme.em(16))
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        view.doubleClicked.connect(self._on_double_click)
        copy = QShortcut(QKeySequence(QKeySequence.StandardKey.Copy), view)
        copy.setContext(Qt.ShortcutContext.WidgetShortcut)
        copy.activated.connect(self.copy)

    def fill(self, stage: LoadedStage | None) -> None:
        """Lists the findings of a stage."""
        self.model.fill(rows_of(stage) if stage is not None else [])
        self._refilter()

    def _refilter(self) -> None:
        self._filter.set(self.kinds.currentData(), self.field.text().strip())
        shown, there = self._filter.rowCount(), len(self.model.rows)
        self.count.setText(f"{shown} of {there}" if there else "no findings for this stage")

    def _row(self, index: QModelIndex) -> Row:
        return self.model.rows[self._filter.mapToSource(index).row()]

    def _on_double_click(self, index: QModelIndex) -> None:
        place = self._row(index).place
        if place.startswith("/"):
            self._session.select(place)

    def copy(self) -> None:
        """Copies the selected lines to the clipboard, or all lines if none is selected."""
        chosen = self.view.selectionModel().selectedRows()
        if not chosen:
            chosen = [self._filter.index(row, 0) for row in range(self._filter.rowCount())]
        lines = [self._row(index).line() for index in sorted(chosen)]
        QGuiApplication.clipboard().setText("\n".join(lines))
