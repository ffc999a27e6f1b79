# SPDX-License-Identifier: Apache-2.0
"""Model of the variants of the selected prim. The model is independent of widgets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from wavecomb.gui.scene.stage_edits import VariantSet

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits


class VariantsModel(QObject):
    """Model of the variant sets of one prim.

    Signals:
        changed(): ``sets`` changed.

    Attributes:
        path: Path of the prim, or None.
        sets: Variant sets of the prim.
        editable: Whether variants can be selected. This is not possible inside an instance.
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
        """Shows another prim."""
        self.path = path
        self._read()

    def choose(self, name: str, choice: str | None) -> None:
        """Selects a variant; None restores the selection in the stage's files."""
        if self.path is not None:
            self._edits.select_variant(self.path, name, choice)

    def tip(self, name: str) -> str:
        """Returns a tooltip that names the variant set or says why it cannot be edited."""
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
