# SPDX-License-Identifier: Apache-2.0
"""List views that select whole rows and paint the data roles of ``table_model``."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
)

from wavecomb.gui import theme
from wavecomb.gui.swatch import swatch
from wavecomb.gui.table_model import ColourRole, ToneRole
from wavecomb.gui.widgets import named

Index = QModelIndex | QPersistentModelIndex


def tone(name: str) -> QColor:
    """Returns the colour of a value of ``ToneRole``."""
    return {"dim": theme.dim, "warning": theme.warning, "error": theme.error}[name]()


class RowDelegate(QStyledItemDelegate):
    """Delegate that paints the colour (``ColourRole``) and tone (``ToneRole``) of a cell."""

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        """Initialises the style option of a cell with its colour and tone."""
        super().initStyleOption(option, index)
        colour = index.data(ColourRole)
        if colour is not None:
            option.features |= QStyleOptionViewItem.ViewItemFeature.HasDecoration
            option.icon = swatch(colour, theme.em(1))
            option.decorationSize = QSize(theme.em(1), theme.em(1))
        name = index.data(ToneRole)
        if name:
            palette = QPalette(option.palette)
            palette.setColor(QPalette.ColorRole.Text, tone(name))
            option.palette = palette


def show_rows(view: QTableView, name: str, title: str, tip: str) -> None:
    """Sets up a list view without grid lines, in which a click selects a whole row."""
    named(view, name, title, tip)
    view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    view.setTabKeyNavigation(False)
    view.setShowGrid(False)
    view.setAlternatingRowColors(True)
    view.verticalHeader().hide()
    view.verticalHeader().setDefaultSectionSize(theme.em(1.6))


def lay_out_rows(
    view: QTableView,
    name: str,
    title: str,
    tip: str,
    *,
    stretch: int,
    widths: Mapping[int, float],
) -> None:
    """Sets up a list view in which one whole row at a time can be selected.

    Args:
        view: List view that already has its model.
        name: Object name of the view.
        title: Accessible name of the view.
        tip: Tooltip of the view.
        stretch: Column that takes the remaining width.
        widths: Widths of the fixed columns, in font heights.
    """
    show_rows(view, name, title, tip)
    view.setItemDelegate(RowDelegate(view))
    view.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    header = view.horizontalHeader()
    header.setSectionResizeMode(stretch, QHeaderView.ResizeMode.Stretch)
    for column, wide in widths.items():
        header.resizeSection(column, theme.em(wide))


def compact(view: QTableView, name: str, title: str, tip: str) -> None:
    """Limits table rows to one text line. Long texts such as paths are cut in the middle."""
    show_rows(view, name, title, tip)
    view.setWordWrap(False)
    view.setTextElideMode(Qt.TextElideMode.ElideMiddle)
