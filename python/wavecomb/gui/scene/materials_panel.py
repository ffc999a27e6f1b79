# SPDX-License-Identifier: Apache-2.0
"""Materials of the scene, with their parameters edited live."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from wavecomb.gui.scene.form_view import Group
from wavecomb.gui.scene.list_and_form import ListAndForm
from wavecomb.gui.scene.materials_model import (
    COST,
    PROGRAM,
    RECORDS,
    MaterialForm,
    MaterialsModel,
    Row,
)

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits


class MaterialsPanel(ListAndForm):
    """The list above, the parameters of the chosen one below."""

    def __init__(self, edits: SceneEdits, parent: QWidget | None = None) -> None:
        model, form = MaterialsModel(edits), MaterialForm(edits)
        super().__init__(
            model,
            form,
            "material",
            "Material",
            "Materials that are in use",
            {PROGRAM: 5.5, RECORDS: 6, COST: 3},
            parent,
        )
        self.model, self.material = model, form
        model.setParent(self)
        form.setParent(self)
        self._before: Row | None = None
        self.row_chosen.connect(self._choose_row)
        self.model.modelAboutToBeReset.connect(self._keep)
        self.model.modelReset.connect(self._choose_again)
        self._choose_again()

    # ---- what is chosen ------------------------------------------------------------------------

    def choose(self, path: str) -> None:
        """Chooses the material of a prim, if it is in use."""
        for number, row in enumerate(self.model.rows):
            if row.path == path:
                self.view.selectRow(number)
                return

    def choose_id(self, material: int) -> None:
        """Chooses a material by its number in the scene."""
        for number, row in enumerate(self.model.rows):
            if material in row.ids:
                self.view.selectRow(number)
                return

    @property
    def chosen(self) -> Row | None:
        """The row that is chosen."""
        return self.material.row

    @property
    def groups(self) -> dict[str, Group]:
        """Headings of the chosen one's parameters, by title."""
        return self.form.groups

    def _keep(self) -> None:
        self._before = self.material.row

    def _choose_again(self) -> None:
        place = self.model.place(self._before)
        if place is None:
            self.material.show_material(None)
        else:
            self.view.selectRow(place)

    def _choose_row(self, row: int) -> None:
        self.material.show_material(self.model.rows[row] if row >= 0 else None)
