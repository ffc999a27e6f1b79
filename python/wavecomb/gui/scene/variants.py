# SPDX-License-Identifier: Apache-2.0
"""The variants of the prim that is selected: as data, and a combo for each set."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QComboBox, QFormLayout, QWidget

from wavecomb.gui.scene.stage_edits import VariantSet

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits

STAGE_CHOICE = "as in the stage"


class VariantsModel(QObject):
    """Variant sets of one prim.

    Signals:
        changed(): ``sets`` says something else.

    Attributes:
        path: Of the prim, or None.
        sets: Its variant sets.
        editable: Whether they can be chosen: not inside an instance.
    """

    changed = Signal()

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._edits = edits
        self.path: str | None = None
        self.sets: list[VariantSet] = []
        self.editable = False
        edits.changed.connect(self._read)
        edits.reset.connect(self._forget)

    def show_prim(self, path: str | None) -> None:
        """Another prim."""
        self.path = path
        self._read()

    def choose(self, name: str, choice: str | None) -> None:
        """Selects a variant; None: what the stage itself selects."""
        if self.path is not None:
            self._edits.select_variant(self.path, name, choice)

    def tip(self, name: str) -> str:
        """What choosing does, or why it cannot be done."""
        if self.editable:
            return f"Variant {name} of {self.path}"
        return "Inside an instance: choose variants of the instance itself"

    def _forget(self) -> None:
        self.show_prim(None)

    def _read(self) -> None:
        prim = self._edits.prim(self.path or "")
        self.editable = bool(prim) and not prim.IsInstanceProxy()
        self.sets = []
        if prim and self._edits.edits is not None:
            self.sets = self._edits.edits.variant_sets(prim.GetPath())
        self.changed.emit()


class VariantBar(QWidget):
    """A combo for each variant set of the prim that is selected."""

    def __init__(self, edits: SceneEdits) -> None:
        super().__init__()
        self.model = VariantsModel(edits, self)
        self.combos: dict[str, QComboBox] = {}
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self.model.changed.connect(self._fill)
        self.hide()

    def show_prim(self, path: str | None) -> None:
        """Another prim."""
        self.model.show_prim(path)

    def _fill(self) -> None:
        model = self.model
        while self._form.rowCount():
            self._form.removeRow(0)
        self.combos = {}
        for one in model.sets:
            combo = QComboBox()
            combo.setObjectName(f"variant-{one.name}")
            combo.setAccessibleName(f"Variant {one.name}")
            combo.setToolTip(model.tip(one.name))
            combo.addItem(STAGE_CHOICE, None)
            for choice in one.choices:
                combo.addItem(choice, choice)
            combo.setCurrentIndex(combo.findData(one.choice) if one.choice else 0)
            combo.setEnabled(model.editable)
            combo.activated.connect(partial(self._choose, one.name, combo))
            self._form.addRow(one.name, combo)
            self.combos[one.name] = combo
        self.setVisible(bool(model.sets))

    def _choose(self, name: str, combo: QComboBox, number: int) -> None:
        self.model.choose(name, combo.itemData(number))
