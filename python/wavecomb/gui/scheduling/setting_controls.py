# SPDX-License-Identifier: Apache-2.0
"""Controls that show and change a setting without storing the value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, Qt
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QLabel,
    QSizePolicy,
    QSpinBox,
    QWidget,
)

from wavecomb.gui.scheduling.choices import Choice, Number

Changed = Callable[[str, Any], None]
"""Type of a function that is called with a field name and the value that the user chose."""


class _CalmWheel(QObject):
    """Event filter that ignores wheel events until the control has the focus."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Ignores wheel events while the control does not have the focus."""
        is_wheel = event.type() == QEvent.Type.Wheel
        passes = is_wheel and isinstance(watched, QWidget) and not watched.hasFocus()
        if passes:
            event.ignore()
        return passes


def calm(widget: QWidget) -> None:
    """Makes a widget react to the mouse wheel only while it has the focus.

    Otherwise, scrolling a panel would change settings and restart the render.
    """
    widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_CalmWheel(widget))


class ChoiceBox(QComboBox):
    """Combo box of a setting with named values. The value 0 is shown as "auto"."""

    def __init__(self, choice: Choice, changed: Changed, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.field = choice.field
        self._tip = choice.tip
        self.setObjectName(choice.field)
        self.setAccessibleName(choice.label)
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(10)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        calm(self)
        self.fill(choice.values)
        self.currentIndexChanged.connect(lambda index: self._retell())
        self.activated.connect(lambda index: changed(self.field, self.itemData(index)))

    def fill(self, values: Mapping[Any, str]) -> None:
        """Replaces the values that the combo box offers."""
        with QSignalBlocker(self):
            self.clear()
            for value, tip in values.items():
                self.add(value, value_text(value), tip)
        self._retell()

    def add(self, value: Any, text: str, tip: str) -> None:
        """Adds a value to the combo box."""
        self.addItem(text, value)
        self.setItemData(self.count() - 1, tip, Qt.ItemDataRole.ToolTipRole)

    def show_value(self, value: Any) -> None:
        """Shows a value without emitting a change.

        Adds the value to the combo box if it is missing there.
        """
        index = self.find(value)
        with QSignalBlocker(self):
            if index < 0:
                self.add(value, value_text(value), "Set elsewhere.")
                index = self.count() - 1
            self.setCurrentIndex(index)
        self._retell()

    def find(self, value: Any) -> int:
        """Returns the index of a value in the combo box, or -1 if the value is not offered."""
        for index in range(self.count()):
            data = self.itemData(index)
            if data is value or (type(data) is type(value) and data == value):
                return index
        return -1

    def _retell(self) -> None:
        now = self.itemData(self.currentIndex(), Qt.ItemDataRole.ToolTipRole)
        text = f"{self._tip}\n\n{self.currentText()}: {now}" if now else self._tip
        self.setToolTip(text)
        self.setAccessibleDescription(text)


def number_box(number: Number, changed: Changed) -> QSpinBox | QDoubleSpinBox:
    """Creates a number box whose value takes effect when typing ends."""
    box: QSpinBox | QDoubleSpinBox
    if number.decimals:
        box = QDoubleSpinBox()
        box.setDecimals(number.decimals)
        box.setRange(number.least, number.most)
        box.setSingleStep(number.step)
    else:
        box = QSpinBox()
        box.setRange(int(number.least), int(number.most))
        box.setSingleStep(int(number.step))
        box.setGroupSeparatorShown(True)
    box.setObjectName(number.field)
    box.setAccessibleName(number.label)
    box.setToolTip(number.tip + (f" 0: {number.zero}." if number.zero else ""))
    box.setSpecialValueText(number.zero)
    box.setSuffix(number.suffix)
    box.setKeyboardTracking(False)
    box.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
    calm(box)
    box.setProperty("field", number.field)
    box.valueChanged.connect(lambda value: changed(number.field, value))
    return box


def control_of(row: Choice | Number, changed: Changed) -> Control:
    """Creates the control of a setting, for all tool bars and panels."""
    return ChoiceBox(row, changed) if isinstance(row, Choice) else number_box(row, changed)


def add_row(form: QFormLayout, label: str, control: QWidget, field: QWidget | None = None) -> None:
    """Adds a control and a label with the same tooltip to a form.

    Args:
        form: The form to which the control is added.
        label: Text of the label.
        control: The control.
        field: Widget that contains the control and further buttons; None means the control itself.
    """
    text = QLabel(label)
    text.setBuddy(control)
    text.setToolTip(control.toolTip())
    form.addRow(text, field or control)


def show_control(control: Control, value: Any) -> None:
    """Shows a value without emitting a change."""
    if isinstance(control, ChoiceBox):
        control.show_value(value)
    else:
        show_number(control, value)


def show_number(box: QSpinBox | QDoubleSpinBox, value: float) -> None:
    """Shows a value without emitting a change."""
    with QSignalBlocker(box):
        if isinstance(box, QSpinBox):
            box.setValue(int(value))
        else:
            box.setValue(value)


Control = ChoiceBox | QSpinBox | QDoubleSpinBox


def value_text(value: Any) -> str:
    """Formats a value for display.

    >>> value_text(0), value_text(65536), value_text("slot")
    ('auto', '65\u202f536', 'slot')
    """
    if isinstance(value, int):
        return "auto" if value == 0 else f"{value:,}".replace(",", "\u202f")
    return str(value)
