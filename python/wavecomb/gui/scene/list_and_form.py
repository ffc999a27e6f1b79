# SPDX-License-Identifier: Apache-2.0
"""A list above, the fields of what is chosen in it below."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QModelIndex, Qt, Signal
from PySide6.QtWidgets import QSplitter, QTableView, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.list_view import lay_out_rows
from wavecomb.gui.scene.form_model import FormModel
from wavecomb.gui.scene.form_view import FormView
from wavecomb.gui.scene.value_fields import Field
from wavecomb.gui.table_model import HeadedModel


class ListAndForm(QWidget):
    """What the panels of lights and materials share.

    Args:
        model: Of the list.
        form: Of the fields.
        name: Of objects: "light".
        title: For people: "Light".
        tip: Of the list.
        widths: Of the list's columns but the first, in font heights.

    Signals:
        row_chosen(int): A row of the list, -1 for none.
    """

    row_chosen = Signal(int)

    def __init__(
        self,
        model: HeadedModel,
        form: FormModel,
        name: str,
        title: str,
        tip: str,
        widths: Mapping[int, float],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.view = QTableView()
        self.view.setModel(model)
        lay_out_rows(self.view, f"{name}s", f"{title}s", tip, stretch=0, widths=widths)
        self.form = FormView(form, name, title)
        splitter = QSplitter(Qt.Orientation.Vertical)
        splitter.addWidget(self.view)
        splitter.addWidget(self.form)
        splitter.setSizes([theme.em(15), theme.em(16)])
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(splitter)
        self.view.selectionModel().currentRowChanged.connect(self._on_row)

    @property
    def fields(self) -> dict[str, Field]:
        """Fields that can be edited, by name."""
        return self.form.fields

    def _on_row(self, index: QModelIndex, before: QModelIndex) -> None:
        self.row_chosen.emit(index.row() if index.isValid() else -1)
