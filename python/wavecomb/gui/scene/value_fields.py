# SPDX-License-Identifier: Apache-2.0
"""Form fields for numbers and colours, with slider, number box, colour and reset buttons."""

from __future__ import annotations

from functools import partial
from typing import Any

from PySide6.QtCore import QEvent, QKeyCombination, QLocale, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QKeySequence, QPalette
from PySide6.QtWidgets import (
    QCheckBox,
    QColorDialog,
    QDoubleSpinBox,
    QHBoxLayout,
    QLineEdit,
    QSizePolicy,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scene.form_model import UNIT, Colour, Range
from wavecomb.gui.swatch import from_display, swatch, to_display
from wavecomb.gui.widgets import named

Control = Qt.KeyboardModifier.ControlModifier

SLIDER_STEPS = 1000
_BAR = 6
"""Width of the colour button's swatch, as a multiple of its height."""


def _is_history(event: Any) -> bool:
    """Returns whether a key event is a shortcut for undo or redo."""
    undo, redo = QKeySequence.StandardKey.Undo, QKeySequence.StandardKey.Redo
    if event.matches(undo) or event.matches(redo):
        return True
    return bool(event.keyCombination() == QKeyCombination(Control, Qt.Key.Key_Y))


class _Spin(QDoubleSpinBox):
    """Number box that emits changes while the user types and uses a point as decimal mark.

    The number box has no undo history. Undo and redo shortcuts reach the window.

    Signals:
        typing(bool): The user began (True) or finished typing a value into the field.
    """

    typing = Signal(bool)

    def __init__(self, bounds: Range, name: str) -> None:
        super().__init__()
        self._typed = False
        self.editingFinished.connect(self._done)
        self.setLocale(QLocale.c())
        self.setDecimals(bounds.decimals)
        self.setRange(bounds.low, bounds.high)
        self.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMinimumWidth(theme.em(3.4))

    def show_value(self, value: float) -> None:
        """Shows a value without emitting a signal.

        Extends the range of the number box if needed.
        """
        with QSignalBlocker(self):
            self.setRange(min(self.minimum(), value), max(self.maximum(), value))
            self.setValue(value)

    def event(self, event: QEvent) -> bool:
        """Passes the shortcuts for undo and redo on to the window."""
        if event.type() == QEvent.Type.ShortcutOverride and _is_history(event):
            event.ignore()
            return False
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Ignores undo and redo of the typed text, which would bypass the window's undo history."""
        if _is_history(event):
            event.ignore()
            return
        if event.text() and not self._typed:
            self._typed = True
            self.typing.emit(True)
        super().keyPressEvent(event)

    def _done(self) -> None:
        if self._typed:
            self._typed = False
            self.typing.emit(False)

    def wheelEvent(self, event: Any) -> None:
        """Changes the value only while the box has the focus.

        Otherwise scrolling a list would edit fields.
        """
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()


class Field(QWidget):
    """Base class of form fields: a row with a reset button.

    Signals:
        changed(value): The user changed the value: a number, a colour or a bool.
        reset(): The user wants to restore the value in the stage's files.
        typing(bool): The user began (True) or finished typing a value.
    """

    changed = Signal(object)
    reset = Signal()
    typing = Signal(bool)

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self.setObjectName(f"field-{name.replace(' ', '-')}")
        self.lines = QVBoxLayout(self)
        self.lines.setContentsMargins(0, 0, 0, 0)
        self.lines.setSpacing(theme.em(0.1))
        self.row = QHBoxLayout()
        self.lines.addLayout(self.row)
        self.back = named(QToolButton(), "reset", f"Reset {name}", "Reset to the stage's value")
        self.back.setText("\N{ANTICLOCKWISE OPEN CIRCLE ARROW}")
        self.back.setAutoRaise(True)
        self.back.clicked.connect(self.reset)

    def finish(self) -> None:
        """Adds the reset button at the end of the row."""
        self.row.addWidget(self.back)

    def value(self) -> Any:
        """Returns the shown value."""
        raise NotImplementedError

    def set_value(self, value: Any) -> None:
        """Shows a value without emitting a signal."""
        raise NotImplementedError

    def set_edited(self, edited: bool) -> None:
        """Enables the reset button if the field has an edit."""
        self.back.setEnabled(edited)


class NumberField(Field):
    """Form field of a slider and a number box."""

    def __init__(self, name: str, bounds: Range = UNIT) -> None:
        super().__init__(name)
        self.bounds = bounds
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, SLIDER_STEPS)
        self.slider.setPageStep(SLIDER_STEPS // 10)
        self.slider.setAccessibleName(f"{name}, slider")
        self.slider.setMinimumWidth(theme.em(3))
        self.spin = _Spin(bounds, name)
        self.row.addWidget(self.slider, 1)
        self.row.addWidget(self.spin)
        self.finish()
        self._place(self.spin.value())
        # Set a fixed width, because Qt would size the field for the largest possible value.
        widest = max(f"{bounds.soft_high:.{bounds.decimals}f}", "-0.000", key=len)
        text = self.spin.fontMetrics().horizontalAdvance(widest)
        self.spin.setFixedWidth(max(text + theme.em(2.2), theme.em(5)))
        self.spin.typing.connect(self.typing)
        self.slider.valueChanged.connect(self._on_slider)
        self.spin.valueChanged.connect(self._on_spin)

    def value(self) -> float:
        """Returns the value in the number box."""
        return self.spin.value()

    def set_value(self, value: float) -> None:
        """Shows a value without emitting a signal."""
        self.spin.show_value(value)
        self._place(value)

    def _place(self, value: float) -> None:
        with QSignalBlocker(self.slider):
            self.slider.setValue(round(self.bounds.share(value) * SLIDER_STEPS))

    def _on_slider(self, step: int) -> None:
        value = self.bounds.value_at(step / SLIDER_STEPS)
        with QSignalBlocker(self.spin):
            self.spin.setValue(value)
        self.changed.emit(self.spin.value())

    def _on_spin(self, value: float) -> None:
        self._place(value)
        self.changed.emit(value)


class SwitchField(Field):
    """Form field of a check box."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.box = QCheckBox()
        self.box.setAccessibleName(name)
        self.row.addWidget(self.box, 1)
        self.finish()
        self.box.toggled.connect(lambda on: self.changed.emit(on))

    def value(self) -> bool:
        """Returns whether the check box is checked."""
        return self.box.isChecked()

    def set_value(self, value: Any) -> None:
        """Shows a value without emitting a signal."""
        with QSignalBlocker(self.box):
            self.box.setChecked(bool(value))


class ColourField(Field):
    """Form field for a colour: a button that opens a colour dialog, and three linear numbers."""

    def __init__(self, name: str, bounds: Range = UNIT) -> None:
        super().__init__(name)
        self.button = named(
            QToolButton(),
            "colour",
            f"{name}, choose",
            "Choose a colour. The numbers are linear Rec.709",
        )
        self.button.clicked.connect(self._choose)
        self.button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.row.addWidget(self.button, 1)
        numbers = QHBoxLayout()
        numbers.setSpacing(theme.em(0.2))
        self.spins = [_Spin(bounds, f"{name}, {part}") for part in ("red", "green", "blue")]
        # Exact values of the three colour components. The input fields show rounded values, and
        # change an exact value only if the user types another value.
        self._parts = [0.0, 0.0, 0.0]
        for part, spin in enumerate(self.spins):
            spin.setButtonSymbols(QDoubleSpinBox.ButtonSymbols.NoButtons)
            numbers.addWidget(spin, 1)
            spin.valueChanged.connect(partial(self._on_spin, part))
            spin.typing.connect(self.typing)
        self.finish()
        self.lines.addLayout(numbers)
        self.dialog: QColorDialog | None = None
        self.set_value((0.0, 0.0, 0.0))
        theme.on_change(self._paint)

    def value(self) -> Colour:
        """Returns the shown colour."""
        r, g, b = self._parts
        return r, g, b

    def set_value(self, value: Colour) -> None:
        """Shows a colour without emitting a signal."""
        self._parts = [float(part) for part in value]
        for spin, part in zip(self.spins, value, strict=True):
            spin.show_value(part)
        self._paint()

    def _paint(self) -> None:
        self.button.setIcon(swatch(self.value(), theme.em(1), _BAR))
        self.button.setIconSize(QSize(_BAR * theme.em(1), theme.em(1)))

    def _on_spin(self, part: int, value: float) -> None:
        self._parts[part] = value
        self._paint()
        self.changed.emit(self.value())

    def _choose(self) -> None:
        """Opens a colour dialog that does not block the window.

        A colour brighter than white keeps its largest component.
        """
        before = self.value()
        peak = max(1.0, *before)
        r, g, b = (part / peak for part in before)
        dialog = QColorDialog(to_display((r, g, b)), self)
        dialog.setOption(QColorDialog.ColorDialogOption.DontUseNativeDialog)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle(self.name)

        def show(colour: QColor) -> None:
            r, g, b = from_display(colour)
            self.set_value((r * peak, g * peak, b * peak))
            self.changed.emit(self.value())

        def back() -> None:
            self.set_value(before)
            self.changed.emit(before)

        dialog.currentColorChanged.connect(show)
        dialog.rejected.connect(back)
        dialog.destroyed.connect(self._gone)
        self.dialog = dialog
        dialog.open()

    def _gone(self) -> None:
        self.dialog = None


class PlainText(QLineEdit):
    """Read-only line of text that can be copied as a whole, even if the line is too narrow."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.setReadOnly(True)
        self.setFrame(False)
        self.setToolTip(text)
        self.setMinimumWidth(theme.em(3))
        self.setCursorPosition(0)
        palette = self.palette()
        palette.setColor(QPalette.ColorRole.Base, Qt.GlobalColor.transparent)
        self.setPalette(palette)


class DrivenField(QWidget):
    """Placeholder for a parameter whose value comes from a texture or a primvar."""

    def __init__(self, name: str, driver: str) -> None:
        super().__init__()
        self.setObjectName(f"field-{name.replace(' ', '-')}")
        self.setAccessibleName(f"{name}: {driver}")
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(PlainText(driver), 1)
        self.setToolTip(
            f"{name} comes from {driver}, so it has no number; "
            "edit that source or the material network"
        )
