# SPDX-License-Identifier: Apache-2.0
"""View of a form model: a field for each row, under collapsible headings."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QFormLayout,
    QLabel,
    QScrollArea,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scene.form_model import COLOUR, DRIVEN, SWITCH, FieldRow, FormModel, differs
from wavecomb.gui.scene.value_fields import (
    ColourField,
    DrivenField,
    Field,
    NumberField,
    PlainText,
    SwitchField,
)
from wavecomb.gui.widgets import named

LABEL_EM = 6.2
"""Width of the field labels, the same in all groups of fields."""


def field_of(row: FieldRow) -> Field | DrivenField:
    """Creates the field of a form row.

    A driven row gets a field that only names the value's source.
    """
    if row.kind == DRIVEN:
        return DrivenField(row.title, row.driver)
    if row.kind == SWITCH:
        field: Field = SwitchField(row.title)
    elif row.kind == COLOUR:
        field = ColourField(row.title, row.bounds)
    else:
        field = NumberField(row.title, row.bounds)
    field.set_value(row.value)
    field.setToolTip(row.tip)
    return field


class FormView(QScrollArea):
    """View of the fields of a form model, rebuilt when the rows change.

    Attributes:
        fields: Editable fields of the form by name.
        groups: Groups of fields by title.
    """

    def __init__(self, model: FormModel, name: str, title: str) -> None:
        super().__init__()
        self._model = model
        self._name, self._title = name, title
        self.fields: dict[str, Field] = {}
        self.groups: dict[str, Group] = {}
        self.setObjectName(f"{name}-form")
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)
        model.remade.connect(self._make)
        model.changed.connect(self._show)
        self._make()

    def _make(self) -> None:
        model = self._model
        self.fields, self.groups = {}, {}
        inner = QWidget()
        column = QVBoxLayout(inner)
        margin = theme.em(0.4)
        column.setContentsMargins(margin, margin, margin, margin)
        if model.title:
            title = PlainText(model.title)
            title.setObjectName(f"{self._name}-title")
            title.setAccessibleName(self._title)
            column.addWidget(title)
        for name in model.groups():
            rows = Rows()
            if name:
                self.groups[name] = group = Group(name, rows, opened=model.is_open(name))
                group.toggled.connect(model.fold)
                column.addWidget(group)
            else:
                column.addWidget(rows)
            for row in model.rows:
                if row.group == name:
                    rows.add(row, self._field(row))
        if model.note:
            column.addWidget(QLabel(model.note))
        column.addStretch(1)
        self.setWidget(inner)
        self._show()

    def _field(self, row: FieldRow) -> QWidget:
        field, model = field_of(row), self._model
        if isinstance(field, Field):
            field.changed.connect(partial(model.set_value, row.name))
            field.reset.connect(partial(model.set_value, row.name, None))
            field.typing.connect(model.set_typing)
            self.fields[row.name] = field
        return field

    def _show(self) -> None:
        """Updates the fields with the values of the form model."""
        for name, field in self.fields.items():
            value = self._model.value(name)
            if value is None:
                continue
            if differs(field.value(), value):
                field.set_value(value)
            field.set_edited(self._model.is_edited(name))


class Rows(QWidget):
    """Form rows with labels and fields, one below the other."""

    def __init__(self) -> None:
        super().__init__()
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._form.setHorizontalSpacing(theme.em(0.4))
        self._form.setVerticalSpacing(theme.em(0.25))

    def add(self, row: FieldRow, field: QWidget) -> None:
        """Adds a row with a label and a field to the form."""
        label = QLabel(row.label)
        label.setWordWrap(True)
        label.setFixedWidth(theme.em(LABEL_EM))
        label.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop)
        label.setContentsMargins(0, theme.em(0.25), 0, 0)
        label.setToolTip(field.toolTip())
        label.setBuddy(field)
        self._form.addRow(label, field)


class Group(QWidget):
    """Group of form rows under a heading that collapses the rows.

    Signals:
        toggled(str, bool): The user opened (True) or closed (False) the group with the given title.
    """

    toggled = Signal(str, bool)

    def __init__(self, title: str, rows: Rows, *, opened: bool) -> None:
        super().__init__()
        self.title = title
        self.head = named(
            QToolButton(),
            f"group-{title.lower().replace(' ', '-')}",
            f"{title}, inputs",
            "Collapse or expand",
        )
        self.head.setText(title)
        self.head.setAutoRaise(True)
        self.head.setCheckable(True)
        self.head.setChecked(opened)
        self.head.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.head.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        font = self.head.font()
        font.setBold(True)
        self.head.setFont(font)
        self.rows = rows
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(theme.em(0.2))
        column.addWidget(self.head)
        column.addWidget(self.rows)
        self.head.toggled.connect(self._fold)
        self._fold(opened)

    def _fold(self, opened: bool) -> None:
        arrow = Qt.ArrowType.DownArrow if opened else Qt.ArrowType.RightArrow
        self.head.setArrowType(arrow)
        self.rows.setVisible(opened)
        self.toggled.emit(self.title, opened)
