# SPDX-License-Identifier: Apache-2.0
"""Fields for numbers and colours that are edited live: slider, number, colour button, reset."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from PySide6.QtCore import QLocale, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QPainter, QPixmap
from PySide6.QtWidgets import (
    QColorDialog,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QSlider,
    QToolButton,
    QWidget,
)

from wavecomb.gui import theme

Colour = tuple[float, float, float]

SLIDER_STEPS = 1000


@dataclass(frozen=True)
class Range:
    """What a parameter can be.

    Attributes:
        low: Least value.
        high: Greatest value.
        soft_low: Left end of the slider.
        soft_high: Right end of the slider.
        decimals: Of the number.
        logarithmic: The slider's steps are ratios; its left end is 0 then where low is.
    """

    low: float
    high: float
    soft_low: float
    soft_high: float
    decimals: int = 3
    logarithmic: bool = False


UNIT = Range(0.0, 1.0, 0.0, 1.0)


def to_display(colour: Colour) -> QColor:
    """A linear colour as a screen shows it, clipped."""
    linear = np.clip(np.asarray(colour, float), 0.0, 1.0)
    low, high = 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055
    r, g, b = np.where(linear <= 0.0031308, low, high)
    return QColor.fromRgbF(float(r), float(g), float(b))


def from_display(colour: QColor) -> Colour:
    """The linear colour of one on the screen."""
    shown = np.array([colour.redF(), colour.greenF(), colour.blueF()])
    low, high = shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4
    r, g, b = np.where(shown <= 0.04045, low, high)
    return float(r), float(g), float(b)


def swatch(colour: Colour, size: int) -> QIcon:
    """A square of a colour, framed so that it is seen on any background."""
    ratio = 2.0
    pixmap = QPixmap(round(size * ratio), round(size * ratio))
    pixmap.setDevicePixelRatio(ratio)
    peak = max(*colour, 1e-30)
    shown = colour if peak <= 1.0 else tuple(c / peak for c in colour)
    pixmap.fill(to_display((shown[0], shown[1], shown[2])))
    with QPainter(pixmap) as painter:
        painter.setPen(theme.dim())
        painter.drawRect(0, 0, size - 1, size - 1)
    return QIcon(pixmap)


class _Spin(QDoubleSpinBox):
    """A number that changes as it is typed, with the point as decimal mark."""

    def __init__(self, bounds: Range, name: str) -> None:
        super().__init__()
        self.setLocale(QLocale.c())
        self.setDecimals(bounds.decimals)
        self.setRange(bounds.low, bounds.high)
        self.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMinimumWidth(theme.em(4.2))

    def wheelEvent(self, event: Any) -> None:
        """Only where it has the focus: lists are scrolled over it."""
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()


class Field(QWidget):
    """What is common: a row with a reset button.

    Signals:
        changed(value): By the user: a number or a colour.
        reset(): The value of the stage is wanted.
    """

    changed = Signal(object)
    reset = Signal()

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self.setObjectName(f"field-{name.replace(' ', '-')}")
        self.row = QHBoxLayout(self)
        self.row.setContentsMargins(0, 0, 0, 0)
        self.back = QToolButton()
        self.back.setObjectName("reset")
        self.back.setText("\N{ANTICLOCKWISE OPEN CIRCLE ARROW}")
        self.back.setAutoRaise(True)
        self.back.setToolTip("Back to the value of the stage")
        self.back.setAccessibleName(f"Reset {name}")
        self.back.clicked.connect(self.reset)

    def finish(self) -> None:
        """Adds the reset button, last."""
        self.row.addWidget(self.back)

    def set_edited(self, edited: bool) -> None:
        """Whether there is something to reset."""
        self.back.setEnabled(edited)


class NumberField(Field):
    """A slider and a number."""

    def __init__(self, name: str, bounds: Range = UNIT) -> None:
        super().__init__(name)
        self.bounds = bounds
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, SLIDER_STEPS)
        self.slider.setPageStep(SLIDER_STEPS // 10)
        self.slider.setAccessibleName(f"{name}, slider")
        self.slider.setMinimumWidth(theme.em(5))
        self.spin = _Spin(bounds, name)
        self.row.addWidget(self.slider, 1)
        self.row.addWidget(self.spin)
        self.finish()
        self._place(self.spin.value())
        self.slider.valueChanged.connect(self._on_slider)
        self.spin.valueChanged.connect(self._on_spin)

    def value(self) -> float:
        """What the number says."""
        return self.spin.value()

    def set_value(self, value: float) -> None:
        """Shows a value; tells nobody."""
        with QSignalBlocker(self.spin):
            self.spin.setValue(value)
        self._place(value)

    def _place(self, value: float) -> None:
        low, high = self.bounds.soft_low, self.bounds.soft_high
        if self.bounds.logarithmic:
            share = math.log(max(value, low) / low) / math.log(high / low)
        else:
            share = (value - low) / (high - low)
        with QSignalBlocker(self.slider):
            self.slider.setValue(round(min(max(share, 0.0), 1.0) * SLIDER_STEPS))

    def _on_slider(self, step: int) -> None:
        share = step / SLIDER_STEPS
        low, high = self.bounds.soft_low, self.bounds.soft_high
        if not self.bounds.logarithmic:
            value = low + share * (high - low)
        elif step == 0:
            value = self.bounds.low
        else:
            value = low * (high / low) ** share
        with QSignalBlocker(self.spin):
            self.spin.setValue(value)
        self.changed.emit(self.spin.value())

    def _on_spin(self, value: float) -> None:
        self._place(value)
        self.changed.emit(value)


class ColourField(Field):
    """A button that shows the colour and opens a dialog, and three linear numbers."""

    def __init__(self, name: str, bounds: Range = UNIT) -> None:
        super().__init__(name)
        self.button = QToolButton()
        self.button.setObjectName("colour")
        self.button.setToolTip("Choose a colour. The numbers are linear Rec.709")
        self.button.setAccessibleName(f"{name}, choose")
        self.button.clicked.connect(self._choose)
        self.row.addWidget(self.button)
        self.spins = [_Spin(bounds, f"{name}, {part}") for part in ("red", "green", "blue")]
        # Exact; the fields show rounded ones, and only what is typed counts.
        self._parts = [0.0, 0.0, 0.0]
        for part, spin in enumerate(self.spins):
            self.row.addWidget(spin, 1)
            spin.valueChanged.connect(partial(self._on_spin, part))
        self.finish()
        self.dialog: QColorDialog | None = None
        self.set_value((0.0, 0.0, 0.0))
        theme.on_change(self._paint)

    def value(self) -> Colour:
        """What is shown."""
        r, g, b = self._parts
        return r, g, b

    def set_value(self, value: Colour) -> None:
        """Shows a colour; tells nobody."""
        self._parts = [float(part) for part in value]
        for spin, part in zip(self.spins, value, strict=True):
            with QSignalBlocker(spin):
                spin.setValue(part)
        self._paint()

    def _paint(self) -> None:
        self.button.setIcon(swatch(self.value(), theme.em(1)))

    def _on_spin(self, part: int, value: float) -> None:
        self._parts[part] = value
        self._paint()
        self.changed.emit(self.value())

    def _choose(self) -> None:
        """Opens the dialog, which blocks nothing; a colour brighter than white keeps its peak."""
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


class DrivenField(QWidget):
    """What stands for a parameter that a texture or a primvar gives."""

    def __init__(self, name: str, driver: str) -> None:
        super().__init__()
        self.setObjectName(f"field-{name.replace(' ', '-')}")
        self.setAccessibleName(f"{name}: {driver}")
        label = QLabel(driver)
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        label.setEnabled(False)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(label, 1)
        self.setToolTip(
            f"{name} comes from {driver}, so there is no number to change; "
            "edit that, or the network of the material"
        )
