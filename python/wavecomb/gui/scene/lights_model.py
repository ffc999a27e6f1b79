# SPDX-License-Identifier: Apache-2.0
"""Models of the stage's lights: a list with on/off switches, and a form that edits one light.

No widgets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Qt

from wavecomb.gui.scene.form_model import FieldRow, FormModel
from wavecomb.gui.scene.light_inputs import LightInput
from wavecomb.gui.scene.visibility import uneditable
from wavecomb.gui.table_model import ColourRole, HeadedModel, ToneRole

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits

NAME, KIND, ON, SOLO = range(4)
HEADERS = ("Light", "Kind", "On", "Solo")
SOFT_DOME = "soft dome"


class LightsModel(HeadedModel):
    """List model of the paths of the stage's lights. Includes lights that are switched off."""

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(HEADERS, parent)
        self._edits = edits
        edits.scene_changed.connect(self.read)
        edits.changed.connect(self.refresh)
        self.read()

    def read(self) -> None:
        """Reads the lights of the stage."""
        stage = self._edits.stage
        paths: dict[str, None] = {}
        if stage is not None and self._edits.edits is not None:
            paths = dict.fromkeys((*stage.lights, *stage.light_paths))
        self.fill(list(paths))

    def refresh(self) -> None:
        """Updates the cells of all lights."""
        self.tell(0, len(HEADERS) - 1)

    def flags(self, index: Any) -> Qt.ItemFlag:
        """Returns the item flags of a cell; a cell with a light's on/off switch has a check box."""
        flags = super().flags(index)
        if index.column() in (ON, SOLO) and self._switch(self.rows[index.row()]):
            flags |= Qt.ItemFlag.ItemIsUserCheckable
        return flags

    def _switch(self, path: str) -> bool:
        return bool(path) and not uneditable(self._edits.prim(path))

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Returns the data of a cell for a role, which may be ``ColourRole`` or ``ToneRole``."""
        path, column = self.rows[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            if column == NAME:
                return path.rpartition("/")[2] or SOFT_DOME
            return self._kind(path) if column == KIND else None
        if role == Qt.ItemDataRole.CheckStateRole and column in (ON, SOLO) and self._switch(path):
            on = self._edits.solo == path if column == SOLO else not self._edits.is_hidden(path)
            return Qt.CheckState.Checked if on else Qt.CheckState.Unchecked
        if role == ColourRole and column == NAME:
            return self._edits.light_value(path, "color")
        if role == ToneRole and path and self._edits.is_hidden(path):
            return "dim"
        if role == Qt.ItemDataRole.ToolTipRole:
            return self._tip(path, column)
        return None

    def _kind(self, path: str) -> str:
        prim = self._edits.prim(path)
        return str(prim.GetTypeName()).removesuffix("_1").removesuffix("Light") if prim else "Dome"

    def _tip(self, path: str, column: int) -> str:
        if not path:
            return "Added because the stage has no light; not part of the stage"
        if column == ON:
            return "Switches the light on or off, by its visibility on the stage"
        return "Shows only this light, or all lights again" if column == SOLO else path

    def setData(self, index: Any, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Switches a light on or off by its check box."""
        if role != Qt.ItemDataRole.CheckStateRole:
            return False
        path = self.rows[index.row()]
        on = Qt.CheckState(value) == Qt.CheckState.Checked
        if index.column() == ON:
            self._edits.set_visible([path], on)
        else:
            self._edits.solo_light(path if on else None, [one for one in self.rows if one])
        return True


class LightForm(FormModel):
    """Form that edits one light.

    Attributes:
        path: Path of the light's prim; "" for the default dome light; None if no light is shown.
    """

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(edits.set_typing, parent)
        self._edits = edits
        self.path: str | None = None
        edits.changed.connect(self.changed)
        self.show_light(None)

    def show_light(self, path: str | None) -> None:
        """Shows another light; None shows no light."""
        self._edits.set_typing(False)
        self.path = path
        self.note = "No light" if path is None else ""
        self.title = "" if path is None else path or f"{SOFT_DOME}: the stage has no light"
        fields = self._edits.light_fields(path) if path is not None else []
        self.rows = [self._row(path, one) for one in fields] if path is not None else []
        self.remade.emit()

    def _row(self, path: str, one: LightInput) -> FieldRow:
        reason = self._edits.light_reason(path)
        where = f"only in the picture, cannot be saved: {reason}" if reason else "on the stage"
        return FieldRow(
            one.name,
            one.label,
            one.kind,
            self._edits.light_value(path, one.name),
            one.label,
            one.bounds,
            one.default,
            group=one.group,
            tip=f"{one.tip} ({where})",
        )

    def value(self, name: str) -> Any:
        """Returns the value that a field shows, or None while there is no stage."""
        if self.path is None or self._edits.edits is None:
            return None
        return self._edits.light_value(self.path, name)

    def is_edited(self, name: str) -> bool:
        """Returns whether a field has an edit that can be reset."""
        return self.path is not None and self._edits.light_is_edited(self.path, name)

    def set_value(self, name: str, value: Any) -> None:
        """Edits a field; the value None resets the field to the value in the stage's files."""
        if self.path is not None:
            self._edits.set_light(self.path, name, value)
