# SPDX-License-Identifier: Apache-2.0
"""Models of the scene's materials: a list with shading costs, and a form that edits one material.

No widgets.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Qt

from wavecomb.core_table import material_parameters as known_parameters
from wavecomb.gui.scene.form_model import (
    COLOUR,
    DRIVEN,
    NUMBER,
    SWITCH,
    UNIT,
    Colour,
    FieldRow,
    FormModel,
    Range,
)
from wavecomb.gui.table_model import ColourRole, HeadedModel

if TYPE_CHECKING:
    from wavecomb._core import Scene
    from wavecomb.gui.scene.scene_edits import SceneEdits
    from wavecomb.usd.materials.parameters import Parameter

NAME, PROGRAM, RECORDS, COST = range(4)
HEADERS = ("Material", "Program", "Records", "ns")
TIPS = (
    "Prim of the material",
    "Shading program of the material",
    "Number of shaded hits (statistics: records)",
    "Measured nanoseconds per hit (statistics: ns_per_record)",
)


RANGES = {
    "emission": Range(0.0, 1e6, 0.0, 10.0),
    "ior": Range(0.01, 100.0, 1.0, 3.0),
    "conductor_eta": Range(0.0, 100.0, 0.0, 5.0),
    "conductor_k": Range(0.0, 100.0, 0.0, 10.0),
}
"""Ranges of UsdPreviewSurface parameters whose range is not 0 to 1."""

LABELS = {"conductor_eta": "eta", "conductor_k": "k"}


@dataclass(frozen=True)
class Row:
    """A row of the list, for a material prim or for a material that the loader created.

    Attributes:
        path: Path of the material prim, or "" if there is none.
        name: Displayed name of the material.
        program: Shading program of the material.
        ids: Indices of the scene's materials that come from this prim.
    """

    path: str
    name: str
    program: str = field(compare=False)
    ids: tuple[int, ...] = field(compare=False)


def rows_of(scene: Scene, paths: tuple[str, ...]) -> list[Row]:
    """Returns a row for each material prim, and a row for each material that has no prim."""
    by_path: dict[str, list[int]] = {}
    for number, path in enumerate(paths):
        by_path.setdefault(path or f"#{number}", []).append(number)
    out = []
    for key, ids in by_path.items():
        name, program = scene.materials[ids[0]]
        path = "" if key.startswith("#") else key
        out.append(Row(path, path.rpartition("/")[2] or name or "material", program, tuple(ids)))
    return out


class MaterialsModel(HeadedModel):
    """List of materials."""

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(HEADERS, parent, TIPS)
        self._edits = edits
        self.colours: list[Colour] = []
        self._figures: list[dict[str, Any]] = []
        edits.scene_changed.connect(self.read)
        edits.changed.connect(self.recolour)
        edits.session.statistics.connect(self.count)
        self.read()

    def read(self) -> None:
        """Reads the materials of the scene."""
        stage = self._edits.stage
        rows: list[Row] = []
        if stage is not None and self._edits.edits is not None:
            rows = rows_of(stage.scene, stage.material_paths)
        self._figures, self.colours = [], self._read_colours(rows)
        self.fill(rows)

    def recolour(self) -> None:
        """Updates the colour swatches after an edit."""
        colours = self._read_colours(self.rows)
        if colours != self.colours:
            self.colours = colours
            self.tell(NAME, NAME)

    def count(self, statistics: dict[str, Any]) -> None:
        """Updates hit counts and costs from the entry ``materials`` of the render statistics."""
        self._figures = statistics["materials"]
        self.tell(RECORDS, COST)

    def _read_colours(self, rows: list[Row]) -> list[Colour]:
        scene = self._edits.session.scene
        if scene is None:
            return [(0.0, 0.0, 0.0)] * len(rows)
        out = []
        for row in rows:
            values = scene.material(row.ids[0])
            r, g, b = values["emission" if row.program == "emissive" else "base_color"]
            out.append((r, g, b))
        return out

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Returns the data of a cell for a role, which may be ``ColourRole``."""
        row, column = self.rows[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            if column == NAME:
                return row.name
            return row.program if column == PROGRAM else self._figure(row, column)
        if role == ColourRole and column == NAME:
            return self.colours[index.row()]
        if role == Qt.ItemDataRole.ToolTipRole:
            more = f"\n{len(row.ids)} versions: meshes override values" if len(row.ids) > 1 else ""
            return (row.path or "made by the loader from a display colour") + more
        if role == Qt.ItemDataRole.TextAlignmentRole and column in (RECORDS, COST):
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None

    def _figure(self, row: Row, column: int) -> str:
        known = [self._figures[i] for i in row.ids if i < len(self._figures)]
        records = sum(one["records"] for one in known)
        if column == RECORDS:
            return f"{records:,}" if known else ""
        timed = sum(one["timed_records"] for one in known)
        spent = sum(one["timed_records"] * one["ns_per_record"] for one in known)
        return f"{spent / timed:.0f}" if timed else ""


class MaterialForm(FormModel):
    """Form that edits one material under the group headings of its MaterialX definition.

    Attributes:
        row: The list's row of the edited material; None if no material is shown.
    """

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(edits.set_typing, parent)
        self._edits = edits
        self.row: Row | None = None
        self._now: dict[str, Parameter] = {}
        edits.changed.connect(self._on_changed)
        self.show_material(None)

    def show_material(self, row: Row | None) -> None:
        """Shows another material; None shows no material."""
        self._edits.set_typing(False)
        self.row = row
        self._read()
        self.rows = [row_of(parameter) for parameter in self._now.values()]
        self.title = self.note = ""
        if row is None:
            self.note = "No stage is open"
        else:
            self.title = row.path or f"{row.name}: made by the loader"
            if not self.rows:
                self.note = "Nothing to edit: it has no material prim."
        self.remade.emit()

    def _read(self) -> None:
        path = self.row.path if self.row is not None else ""
        self._now = self._edits.parameters(path) if path else {}

    def _on_changed(self) -> None:
        self._read()
        self.changed.emit()

    def value(self, name: str) -> Any:
        """Returns the value that a field shows; None means that the field must not change."""
        parameter = self._now.get(name)
        if parameter is None or parameter.driven_by or self.row is None:
            return None
        return self._edits.parameter_value(self.row.path, parameter)

    def is_edited(self, name: str) -> bool:
        """Returns whether a field has an edit that the user can reset."""
        parameter = self._now.get(name)
        if parameter is None or self.row is None:
            return False
        return self._edits.is_edited(self.row.path, parameter)

    def set_value(self, name: str, value: Any) -> None:
        """Edits a field; the value None resets the field to the value in the stage's files."""
        if self.row is not None:
            self._edits.set_parameter(self.row.path, name, value)

    def is_open(self, group: str) -> bool:
        """Returns whether a heading is open. The heading "base" is open initially."""
        return self._folds.get(group, group == "Base" or super().is_open(group))


def range_of(parameter: Parameter) -> Range:
    """Returns the range of a parameter."""
    one = parameter.definition
    if one is None:
        row = known_parameters().get(parameter.name)
        if row is not None and row.least is not None and row.most is not None:
            return Range(row.least, row.most, row.least, row.most)
        return RANGES.get(parameter.name, UNIT)
    decimals = 1 if one.soft_high >= 100.0 else 3
    return Range(one.low, one.high, one.soft_low, one.soft_high, decimals)


def row_of(parameter: Parameter) -> FieldRow:
    """Returns the field of a parameter.

    If a texture or primvar sets the parameter, the field names that source.
    """
    name, one = parameter.name, parameter.definition
    title = name.replace("_", " ")
    driver, kind = "", NUMBER
    if parameter.driven_by or parameter.value is None:
        driver, kind = parameter.driven_by or parameter.reason, DRIVEN
    elif isinstance(parameter.value, bool):
        kind = SWITCH
    elif isinstance(parameter.value, tuple):
        kind = COLOUR
    if parameter.attribute is not None:
        tip = f"{name}: edits {parameter.attribute}"
    else:
        why = parameter.reason
        tip = f"{name}: only in the picture, edits cannot be saved: {why}"
    return FieldRow(
        name,
        one.label if one is not None else LABELS.get(name, title),
        kind,
        None if kind == DRIVEN else parameter.value,
        title,
        range_of(parameter),
        one.default if one is not None else None,
        driver,
        one.group if one is not None else "",
        tip,
    )
