# SPDX-License-Identifier: Apache-2.0
"""Materials of the scene, with their parameters edited live."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QModelIndex, QObject, Qt
from PySide6.QtWidgets import (
    QLabel,
    QScrollArea,
    QSplitter,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.headed_model import HeadedModel, lay_out_rows
from wavecomb.gui.scene.material_form import Group, Rows, field_of
from wavecomb.gui.scene.value_fields import Field, PlainText, differs, swatch

if TYPE_CHECKING:
    from wavecomb._core import Scene
    from wavecomb.gui.scene.scene_edits import SceneEdits
    from wavecomb.usd.looks.parameters import Parameter

NAME, PROGRAM, RECORDS, COST = range(4)
HEADERS = ("Material", "Program", "Records", "ns")
TIPS = (
    "Prim of the material",
    "Shading code that it runs",
    "Hits that were shaded with it (statistics: records)",
    "Nanoseconds for each of them, measured (statistics: ns_per_record)",
)


@dataclass(frozen=True)
class Row:
    """A line of the list: a prim, or a material that the loader made.

    Attributes:
        path: The prim, "" where there is none.
        name: For people.
        program: Its shading code.
        ids: Materials of the scene.
    """

    path: str
    name: str
    program: str
    ids: tuple[int, ...]


def rows_of(scene: Scene, paths: tuple[str, ...]) -> list[Row]:
    """One row for each prim, and for each material without one."""
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
    """The list."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(HEADERS, parent, TIPS)
        self.rows: list[Row] = []
        self.colours: list[tuple[float, float, float]] = []
        self._figures: list[dict[str, Any]] = []

    def fill(self, rows: list[Row], colours: list[tuple[float, float, float]]) -> None:
        """Other rows."""
        self.beginResetModel()
        self.rows, self.colours, self._figures = rows, colours, []
        self.endResetModel()

    def recolour(self, colours: list[tuple[float, float, float]]) -> None:
        """Swatches after an edit."""
        if colours != self.colours:
            self.colours = colours
            self._tell(NAME, NAME)

    def count(self, figures: list[dict[str, Any]]) -> None:
        """Records and costs: ``materials`` of the statistics."""
        self._figures = figures
        self._tell(RECORDS, COST)

    def _tell(self, first: int, last: int) -> None:
        if self.rows:
            self.dataChanged.emit(self.index(0, first), self.index(len(self.rows) - 1, last))

    def row_count(self) -> int:
        """Materials."""
        return len(self.rows)

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """As Qt has it."""
        row, column = self.rows[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            if column == NAME:
                return row.name
            return row.program if column == PROGRAM else self._figure(row, column)
        if role == Qt.ItemDataRole.DecorationRole and column == NAME:
            return swatch(self.colours[index.row()], theme.em(1))
        if role == Qt.ItemDataRole.ToolTipRole:
            more = f"\n{len(row.ids)} of them: meshes bring values" if len(row.ids) > 1 else ""
            return (row.path or "made by the loader: of a display colour") + more
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


class MaterialsPanel(QWidget):
    """The list above, the parameters of the chosen one below."""

    def __init__(self, edits: SceneEdits, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._edits = edits
        self._session = edits.session
        self._row: Row | None = None
        self._folded: dict[str, bool] = {}
        self.fields: dict[str, Field] = {}
        self.groups: dict[str, Group] = {}
        self.model = MaterialsModel(self)
        self.view = QTableView()
        self._make_view()
        self.form = QScrollArea()
        self.form.setObjectName("material-form")
        self.form.setWidgetResizable(True)
        self.form.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)
        splitter = QSplitter(Qt.Orientation.Vertical)
        splitter.addWidget(self.view)
        splitter.addWidget(self.form)
        splitter.setSizes([theme.em(14), theme.em(18)])
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(splitter)
        edits.scene_changed.connect(self._fill)
        self._session.statistics.connect(lambda figures: self.model.count(figures["materials"]))
        edits.changed.connect(self._on_changed)
        self._fill()

    def _make_view(self) -> None:
        view = self.view
        view.setModel(self.model)
        lay_out_rows(
            view,
            "materials",
            "Materials",
            "Materials that are in use",
            stretch=NAME,
            widths={PROGRAM: 5.5, RECORDS: 6, COST: 3},
        )
        view.selectionModel().currentRowChanged.connect(lambda now, before: self._on_row(now))

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
        return self._row

    # ---- rows ----------------------------------------------------------------------------------

    def _colours(self, rows: list[Row]) -> list[tuple[float, float, float]]:
        scene = self._session.scene
        if scene is None:
            return [(0.0, 0.0, 0.0)] * len(rows)
        out = []
        for row in rows:
            values = scene.material(row.ids[0])
            name = "emission" if row.program == "emissive" else "base_color"
            r, g, b = values[name]
            out.append((r, g, b))
        return out

    def _fill(self) -> None:
        stage = self._edits.stage
        rows: list[Row] = []
        if stage is not None and self._edits.edits is not None:
            rows = rows_of(stage.scene, stage.material_paths)
        before = self._row
        self.model.fill(rows, self._colours(rows))
        again = None
        if before is not None:
            same = [
                i
                for i, row in enumerate(rows)
                if (row.path, row.name) == (before.path, before.name)
            ]
            again = same[0] if same else None
        if again is None and rows:
            again = 0
        self._row = None
        if again is None:
            self._show(None)
        else:
            self.view.selectRow(again)

    def _on_row(self, index: QModelIndex) -> None:
        self._show(self.model.rows[index.row()] if index.isValid() else None)

    # ---- parameters ----------------------------------------------------------------------------

    def _show(self, row: Row | None) -> None:
        """Makes the fields of a material."""
        self._edits.set_typing(False)
        self._row = row
        self.fields, self.groups = {}, {}
        inner = QWidget()
        column = QVBoxLayout(inner)
        margin = theme.em(0.4)
        column.setContentsMargins(margin, margin, margin, margin)
        if row is None:
            column.addWidget(QLabel("No stage is open"))
        else:
            title = PlainText(row.path or f"{row.name}: made by the loader")
            title.setObjectName("material-title")
            title.setAccessibleName("Material")
            column.addWidget(title)
            parameters = self._edits.parameters(row.path) if row.path else {}
            self._add_rows(column, row, parameters)
            if not parameters:
                column.addWidget(QLabel("Nothing to edit: it has no material prim."))
        column.addStretch(1)
        self.form.setWidget(inner)
        self._on_changed()

    def _add_rows(self, column: QVBoxLayout, row: Row, parameters: dict[str, Parameter]) -> None:
        """Fields, under the headings that MaterialX gives them."""
        plain = Rows()
        column.addWidget(plain)
        for parameter in parameters.values():
            rows = plain
            if parameter.definition is not None:
                title = parameter.definition.group
                if title not in self.groups:
                    self.groups[title] = self._group(title, parameters)
                    column.addWidget(self.groups[title])
                rows = self.groups[title].rows
            rows.add(parameter, self._field(row, parameter))

    def _group(self, title: str, parameters: dict[str, Parameter]) -> Group:
        """A heading, open where something below it is not as it is by default."""
        used = any(
            one.driven_by or one.value != one.definition.default
            for one in parameters.values()
            if one.definition is not None and one.definition.group == title
        )
        group = Group(title, opened=self._folded.get(title, used or title == "Base"))
        group.toggled.connect(self._folded.__setitem__)
        return group

    def _field(self, row: Row, parameter: Parameter) -> QWidget:
        slot, field = parameter.slot, field_of(parameter)
        if isinstance(field, Field):
            field.changed.connect(partial(self._edits.set_parameter, row.path, slot))
            field.reset.connect(partial(self._edits.set_parameter, row.path, slot, None))
            field.typing.connect(self._edits.set_typing)
            self.fields[slot] = field
        return field

    def _on_changed(self) -> None:
        """Brings fields and swatches up to what the stage says now."""
        self.model.recolour(self._colours(self.model.rows))
        row = self._row
        if row is None or not row.path:
            return
        now = self._edits.parameters(row.path)
        for slot, field in self.fields.items():
            parameter = now.get(slot)
            if parameter is None:
                continue
            value = self._edits.parameter_value(row.path, parameter)
            if value is None or parameter.driven_by:
                continue
            if differs(field.value(), value):
                field.set_value(value)
            field.set_edited(self._edits.is_edited(row.path, parameter))
