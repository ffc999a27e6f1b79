# SPDX-License-Identifier: Apache-2.0
"""Combo boxes for the variant sets of the selected prim."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QComboBox, QFormLayout, QWidget

from wavecomb.gui.scene.variants_model import VariantsModel
from wavecomb.gui.widgets import named

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits

STAGE_CHOICE = "as in the stage"


class VariantBar(QWidget):
    """A combo box for each variant set of the selected prim."""

    def __init__(self, edits: SceneEdits) -> None:
        super().__init__()
        self.model = VariantsModel(edits, self)
        self.combos: dict[str, QComboBox] = {}
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self.model.changed.connect(self._fill)
        self.hide()

    def show_prim(self, path: str | None) -> None:
        """Shows the variant sets of another prim."""
        self.model.show_prim(path)

    def _fill(self) -> None:
        model = self.model
        self._clear()
        for one in model.sets:
            combo = named(
                QComboBox(), f"variant-{one.name}", f"Variant {one.name}", model.tip(one.name)
            )
            combo.addItem(STAGE_CHOICE, None)
            for choice in one.choices:
                combo.addItem(choice, choice)
            combo.setCurrentIndex(combo.findData(one.choice) if one.choice else 0)
            combo.setEnabled(model.editable)
            combo.activated.connect(partial(self._choose, one.name, combo))
            self._form.addRow(one.name, combo)
            self.combos[one.name] = combo
        self.setVisible(bool(model.sets))

    def _clear(self) -> None:
        """Removes all rows.

        Qt deletes the old widgets later, because one of them may still be handling the event that
        caused this call.
        """
        self.combos = {}
        while self._form.rowCount():
            row = self._form.takeRow(0)
            for item in (row.labelItem, row.fieldItem):  # type: ignore[attr-defined]
                widget = item.widget() if item is not None else None
                if widget is not None:
                    widget.hide()
                    widget.deleteLater()

    def _choose(self, name: str, combo: QComboBox, number: int) -> None:
        self.model.choose(name, combo.itemData(number))
