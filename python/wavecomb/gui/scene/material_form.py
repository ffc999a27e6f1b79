# SPDX-License-Identifier: Apache-2.0
"""The fields of one material: what kind each parameter's is, and where it stands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFormLayout, QLabel, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.scene.value_fields import (
    UNIT,
    ColourField,
    DrivenField,
    Field,
    NumberField,
    Range,
    SwitchField,
)

if TYPE_CHECKING:
    from wavecomb.usd.looks.parameters import Parameter

RANGES = {
    "emission": Range(0.0, 1e6, 0.0, 10.0),
    "ior": Range(0.01, 100.0, 1.0, 3.0),
    "conductor_eta": Range(0.0, 100.0, 0.0, 5.0),
    "conductor_k": Range(0.0, 100.0, 0.0, 10.0),
}
"""Of parameters of UsdPreviewSurface that are not within 0 and 1."""

LABELS = {"conductor_eta": "eta", "conductor_k": "k"}
LABEL_EM = 6.2
"""Width of the names, the same in all groups."""


def range_of(parameter: Parameter) -> Range:
    """What a parameter can be."""
    one = parameter.definition
    if one is None:
        return RANGES.get(parameter.slot, UNIT)
    decimals = 1 if one.soft_high >= 100.0 else 3
    return Range(one.low, one.high, one.soft_low, one.soft_high, decimals)


def name_of(parameter: Parameter) -> str:
    """For people: all of it, with its group."""
    return parameter.slot.replace("_", " ")


def field_of(parameter: Parameter) -> Field | DrivenField:
    """The field of a parameter; one that only says what drives it where there is no value."""
    name = name_of(parameter)
    if parameter.driven_by or parameter.value is None:
        return DrivenField(name, parameter.driven_by or parameter.reason)
    if isinstance(parameter.value, bool):
        field: Field = SwitchField(name)
    elif isinstance(parameter.value, tuple):
        field = ColourField(name, range_of(parameter))
    else:
        field = NumberField(name, range_of(parameter))
    field.set_value(parameter.value)
    field.setToolTip(_tip(parameter))
    return field


def _tip(parameter: Parameter) -> str:
    name = parameter.slot
    if parameter.attribute is not None:
        return f"{name}: edits {parameter.attribute}"
    return f"{name}: in the picture only, edits of it cannot be saved: {parameter.reason}"


class Rows(QWidget):
    """Names and fields below each other."""

    def __init__(self) -> None:
        super().__init__()
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._form.setHorizontalSpacing(theme.em(0.4))
        self._form.setVerticalSpacing(theme.em(0.25))

    def add(self, parameter: Parameter, field: QWidget) -> None:
        """A row more."""
        one = parameter.definition
        plain = LABELS.get(parameter.slot, parameter.slot.replace("_", " "))
        label = QLabel(one.label if one is not None else plain)
        label.setWordWrap(True)
        label.setFixedWidth(theme.em(LABEL_EM))
        label.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop)
        label.setContentsMargins(0, theme.em(0.25), 0, 0)
        label.setToolTip(field.toolTip())
        label.setBuddy(field)
        self._form.addRow(label, field)


class Group(QWidget):
    """Rows under a heading that folds them away.

    Signals:
        toggled(str, bool): Somebody folded this group, or opened it.
    """

    toggled = Signal(str, bool)

    def __init__(self, title: str, *, opened: bool) -> None:
        super().__init__()
        self.title = title
        self.head = QToolButton()
        self.head.setObjectName(f"group-{title.lower().replace(' ', '-')}")
        self.head.setAccessibleName(f"{title}, inputs")
        self.head.setToolTip("Fold, or open")
        self.head.setText(title)
        self.head.setAutoRaise(True)
        self.head.setCheckable(True)
        self.head.setChecked(opened)
        self.head.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.head.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        font = self.head.font()
        font.setBold(True)
        self.head.setFont(font)
        self.rows = Rows()
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
