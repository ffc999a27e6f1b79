# SPDX-License-Identifier: Apache-2.0
"""Views of lists: whole rows are chosen, and the roles of `table_model` are painted."""

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
    """The colour of a ``ToneRole``."""
    return {"dim": theme.dim, "warning": theme.warning, "error": theme.error}[name]()


class RowDelegate(QStyledItemDelegate):
    """Paints ``ColourRole`` and ``ToneRole``."""

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        """As Qt has it."""
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
    """A list without a grid of which whole rows are chosen."""
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
    """A list of which whole rows are chosen, one at a time.

    Args:
        view: With its model.
        name: Object name.
        title: Accessible name.
        tip: Tooltip.
        stretch: Column that takes what room is left.
        widths: Of the others, in font heights.
    """
    show_rows(view, name, title, tip)
    view.setItemDelegate(RowDelegate(view))
    view.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    header = view.horizontalHeader()
    header.setSectionResizeMode(stretch, QHeaderView.ResizeMode.Stretch)
    for column, wide in widths.items():
        header.resizeSection(column, theme.em(wide))


def compact(view: QTableView, name: str, title: str, tip: str) -> None:
    """Rows of one line; long texts are cut in the middle, where paths say least."""
    show_rows(view, name, title, tip)
    view.setWordWrap(False)
    view.setTextElideMode(Qt.TextElideMode.ElideMiddle)
