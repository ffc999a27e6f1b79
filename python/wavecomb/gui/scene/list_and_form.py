# SPDX-License-Identifier: Apache-2.0
"""Panels of lights and of materials: each has a list, and a form for the selected row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QModelIndex, Qt
from PySide6.QtWidgets import QSplitter, QTableView, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.list_view import lay_out_rows
from wavecomb.gui.scene.form_model import FormModel
from wavecomb.gui.scene.form_view import FormView
from wavecomb.gui.scene.lights_model import KIND, ON, SOLO, LightForm, LightsModel
from wavecomb.gui.scene.materials_model import (
    COST,
    PROGRAM,
    RECORDS,
    MaterialForm,
    MaterialsModel,
    Row,
)
from wavecomb.gui.scene.value_fields import Field
from wavecomb.gui.table_model import HeadedModel

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits


class ListAndForm(QWidget):
    """Panel with a list of prims above a form that edits the selected prim.

    The same prim stays selected when the list is read again.

    Args:
        model: Table model of the list.
        form: Form model that edits the selected row.
        show: Function that makes the form show a row of the list; None clears the form.
        name: Object name in the singular, such as "light".
        title: Accessible name in the singular, such as "Light".
        tip: Tooltip of the list.
        widths: Widths of the columns after the first, in font heights.
    """

    def __init__(
        self,
        model: HeadedModel,
        form: FormModel,
        show: Callable[[Any], None],
        name: str,
        title: str,
        tip: str,
        widths: Mapping[int, float],
    ) -> None:
        super().__init__()
        model.setParent(self)
        form.setParent(self)
        self.model, self._show = model, show
        self.chosen: Any = None
        self._before: Any = None
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
        model.modelAboutToBeReset.connect(self._keep)
        model.modelReset.connect(self._choose_again)
        self._choose_again()

    @property
    def fields(self) -> dict[str, Field]:
        """Editable fields of the form by name."""
        return self.form.fields

    def choose_first(self, is_wanted: Callable[[Any], bool]) -> bool:
        """Selects the first row for which a function returns True.

        Returns whether there is such a row.
        """
        for number, row in enumerate(self.model.rows):
            if is_wanted(row):
                self.view.selectRow(number)
                return True
        return False

    def _on_row(self, index: QModelIndex, before: QModelIndex) -> None:
        self.chosen = self.model.rows[index.row()] if index.isValid() else None
        self._show(self.chosen)

    def _keep(self) -> None:
        self._before = self.chosen

    def _choose_again(self) -> None:
        rows = self.model.rows
        if rows:
            self.view.selectRow(rows.index(self._before) if self._before in rows else 0)
        else:
            self.chosen = None
            self._show(None)


class LightsPanel(ListAndForm):
    """Panel of the stage's lights.

    A light is identified by its path; "" is the default dome light.
    """

    def __init__(self, edits: SceneEdits) -> None:
        form = LightForm(edits)
        tip = "Lights of the stage, including those that are off"
        widths = {KIND: 5, ON: 3, SOLO: 3.4}
        super().__init__(LightsModel(edits), form, form.show_light, "light", "Light", tip, widths)

    def choose(self, path: str) -> bool:
        """Selects a light by its prim; returns whether the list contains it."""
        return self.choose_first(lambda light: light == path)


class MaterialsPanel(ListAndForm):
    """Panel of the materials that the scene uses."""

    chosen: Row | None

    def __init__(self, edits: SceneEdits) -> None:
        model, form = MaterialsModel(edits), MaterialForm(edits)
        tip, widths = "Materials in use", {PROGRAM: 5.5, RECORDS: 6, COST: 3}
        super().__init__(model, form, form.show_material, "material", "Material", tip, widths)

    def choose(self, path: str) -> bool:
        """Selects the material of a prim; returns whether the list contains it."""
        return self.choose_first(lambda row: row.path == path)
