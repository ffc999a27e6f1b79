# SPDX-License-Identifier: Apache-2.0
"""Lights of the stage: on, alone, intensity, exposure, colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from wavecomb.gui.scene.lights_model import KIND, ON, SOLO, LightForm, LightsModel
from wavecomb.gui.scene.list_and_form import ListAndForm

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits


class LightsPanel(ListAndForm):
    """The list above, the values of the chosen light below."""

    def __init__(self, edits: SceneEdits, parent: QWidget | None = None) -> None:
        model, form = LightsModel(edits), LightForm(edits)
        super().__init__(
            model,
            form,
            "light",
            "Light",
            "Lights of the stage; those that are off are listed, too",
            {KIND: 5, ON: 3, SOLO: 3.4},
            parent,
        )
        self.model, self.light = model, form
        model.setParent(self)
        form.setParent(self)
        self._before: str | None = None
        self.row_chosen.connect(self._choose_row)
        self.model.modelAboutToBeReset.connect(self._keep)
        self.model.modelReset.connect(self._choose_again)
        self._choose_again()

    def choose(self, path: str) -> bool:
        """Chooses a light by its prim; whether there is such a one."""
        if path not in self.model.paths:
            return False
        self.view.selectRow(self.model.paths.index(path))
        return True

    @property
    def chosen(self) -> str | None:
        """Path of the light that is chosen, "" of the soft dome."""
        return self.light.path

    def _keep(self) -> None:
        self._before = self.light.path

    def _choose_again(self) -> None:
        if not self.choose(self._before or "") and self.model.paths:
            self.view.selectRow(0)
        if not self.model.paths:
            self.light.show_light(None)

    def _choose_row(self, row: int) -> None:
        self.light.show_light(self.model.paths[row] if row >= 0 else None)
