# SPDX-License-Identifier: Apache-2.0
"""Lights of the stage: on, alone, intensity, exposure, colour."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QModelIndex, QObject, Qt
from PySide6.QtWidgets import (
    QFormLayout,
    QLabel,
    QScrollArea,
    QSplitter,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.headed_model import HeadedModel, lay_out_rows
from wavecomb.gui.scene.scene_edits import LIGHT_INPUTS
from wavecomb.gui.scene.value_fields import (
    ColourField,
    Field,
    NumberField,
    PlainText,
    Range,
    differs,
    swatch,
)
from wavecomb.gui.scene.visibility import uneditable

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits

NAME, KIND, ON, SOLO = range(4)
HEADERS = ("Light", "Kind", "On", "Solo")
SOFT_DOME = "soft dome"

RANGES = {
    "intensity": Range(0.0, 1e9, 1e-3, 1e5, 4, logarithmic=True),
    "exposure": Range(-30.0, 30.0, -10.0, 10.0, 2),
    "color": Range(0.0, 1e4, 0.0, 1.0),
}
TIPS = {
    "intensity": "What the colour is multiplied by",
    "exposure": "Stops: one more is twice as bright",
    "color": "Linear Rec.709; the colour temperature of the stage comes on top",
}


class LightsModel(HeadedModel):
    """The list: lights that are switched off are in it, too."""

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(HEADERS, parent)
        self._edits = edits
        self.paths: list[str] = []

    def fill(self) -> None:
        """Reads which lights there are."""
        stage = self._edits.stage
        self.beginResetModel()
        self.paths = []
        if stage is not None and self._edits.edits is not None:
            self.paths = list(dict.fromkeys((*stage.lights, *stage.light_paths)))
        self.endResetModel()

    def refresh(self) -> None:
        """What rows say may have changed."""
        if self.paths:
            last = self.index(len(self.paths) - 1, len(HEADERS) - 1)
            self.dataChanged.emit(self.index(0, 0), last)

    def row_count(self) -> int:
        """Lights."""
        return len(self.paths)

    def flags(self, index: Any) -> Qt.ItemFlag:
        """As Qt has it: what can be switched has a box."""
        flags = super().flags(index)
        if index.column() in (ON, SOLO) and self._switch(self.paths[index.row()]):
            flags |= Qt.ItemFlag.ItemIsUserCheckable
        return flags

    def _switch(self, path: str) -> bool:
        return bool(path) and not uneditable(self._edits.prim(path))

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """As Qt has it."""
        path, column = self.paths[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            if column == NAME:
                return path.rpartition("/")[2] or SOFT_DOME
            return self._kind(path) if column == KIND else None
        if role == Qt.ItemDataRole.CheckStateRole and column in (ON, SOLO) and self._switch(path):
            on = self._edits.solo == path if column == SOLO else not self._edits.is_hidden(path)
            return Qt.CheckState.Checked if on else Qt.CheckState.Unchecked
        if role == Qt.ItemDataRole.DecorationRole and column == NAME:
            return swatch(self._edits.light_value(path, "color"), theme.em(1))
        if role == Qt.ItemDataRole.ForegroundRole and path and self._edits.is_hidden(path):
            return theme.dim()
        if role == Qt.ItemDataRole.ToolTipRole:
            return self._tip(path, column)
        return None

    def _kind(self, path: str) -> str:
        prim = self._edits.prim(path)
        return str(prim.GetTypeName()).removesuffix("_1").removesuffix("Light") if prim else "Dome"

    def _tip(self, path: str, column: int) -> str:
        if not path:
            return "Added because the stage has no light; it is not on the stage"
        if column == ON:
            return "Switches the light: its visibility on the stage"
        return "Shows this light alone, or all again" if column == SOLO else path

    def setData(self, index: Any, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """As Qt has it: boxes switch lights."""
        if role != Qt.ItemDataRole.CheckStateRole:
            return False
        path = self.paths[index.row()]
        on = Qt.CheckState(value) == Qt.CheckState.Checked
        if index.column() == ON:
            self._edits.set_visible([path], on)
        else:
            self._edits.solo_light(path if on else None, [one for one in self.paths if one])
        return True


class LightsPanel(QWidget):
    """The list above, the values of the chosen light below."""

    def __init__(self, edits: SceneEdits, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._edits = edits
        self._session = edits.session
        self._path: str | None = None
        self.fields: dict[str, Field] = {}
        self.model = LightsModel(edits, self)
        self.view = QTableView()
        self._make_view()
        self.form = QScrollArea()
        self.form.setObjectName("light-form")
        self.form.setWidgetResizable(True)
        splitter = QSplitter(Qt.Orientation.Vertical)
        splitter.addWidget(self.view)
        splitter.addWidget(self.form)
        splitter.setSizes([theme.em(16), theme.em(12)])
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(splitter)
        edits.scene_changed.connect(self._fill)
        edits.changed.connect(self._on_changed)
        self._fill()

    def _make_view(self) -> None:
        view = self.view
        view.setModel(self.model)
        lay_out_rows(
            view,
            "lights",
            "Lights",
            "Lights of the stage; those that are off are listed, too",
            stretch=NAME,
            widths={KIND: 5, ON: 3, SOLO: 3.4},
        )
        view.selectionModel().currentRowChanged.connect(lambda now, before: self._on_row(now))

    def choose(self, path: str) -> bool:
        """Chooses a light by its prim; whether there is such a one."""
        if path not in self.model.paths:
            return False
        self.view.selectRow(self.model.paths.index(path))
        return True

    @property
    def chosen(self) -> str | None:
        """Path of the light that is chosen, "" of the soft dome."""
        return self._path

    def _fill(self) -> None:
        before = self._path
        self.model.fill()
        paths = self.model.paths
        self._path = None
        if paths:
            self.view.selectRow(paths.index(before) if before in paths else 0)
        else:
            self._show(None)

    def _on_row(self, index: QModelIndex) -> None:
        self._show(self.model.paths[index.row()] if index.isValid() else None)

    def _show(self, path: str | None) -> None:
        self._path = path
        self.fields = {}
        inner = QWidget()
        form = QFormLayout(inner)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        if path is None:
            form.addRow(QLabel("No light"))
        else:
            title = PlainText(path or f"{SOFT_DOME}: the stage has no light")
            title.setObjectName("light-title")
            title.setAccessibleName("Light")
            form.addRow(title)
            for name in LIGHT_INPUTS:
                form.addRow("colour" if name == "color" else name, self._field(path, name))
        self.form.setWidget(inner)
        self._on_changed()

    def _field(self, path: str, name: str) -> Field:
        bounds = RANGES[name]
        field = ColourField(name, bounds) if name == "color" else NumberField(name, bounds)
        reason = self._edits.light_reason(path)
        where = f"in the picture only, it cannot be saved: {reason}" if reason else "on the stage"
        field.setToolTip(f"{TIPS[name]} ({where})")
        field.changed.connect(partial(self._edits.set_light, path, name))
        field.typing.connect(self._edits.set_typing)
        field.reset.connect(partial(self._edits.set_light, path, name, None))
        self.fields[name] = field
        return field

    def _on_changed(self) -> None:
        self.model.refresh()
        if self._path is None or self._edits.edits is None:
            return
        for name, field in self.fields.items():
            value = self._edits.light_value(self._path, name)
            if differs(field.value(), value):
                field.set_value(value)
            field.set_edited(self._edits.light_is_edited(self._path, name))
