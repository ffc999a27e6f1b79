# SPDX-License-Identifier: Apache-2.0
"""Small controls that panels share; each has a tooltip, an accessible name and an object name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QLabel, QSpinBox, QToolButton, QWidget

W = TypeVar("W", bound=QWidget)


def named(widget: W, name: str, title: str, tip: str) -> W:
    """Gives a widget its object name, accessible name and tooltip."""
    widget.setObjectName(name)
    widget.setAccessibleName(title)
    widget.setToolTip(tip)
    return widget


def tool(name: str, text: str, tip: str, parent: QWidget) -> QToolButton:
    """A small button."""
    button = named(QToolButton(parent), name, tip, tip)
    button.setText(text)
    return button


def real(
    name: str,
    title: str,
    tip: str,
    low: float,
    high: float,
    step: float,
    value: float,
    changed: Callable[[float], object],
    decimals: int = 2,
) -> QDoubleSpinBox:
    """A number that is taken when editing ends."""
    box = named(QDoubleSpinBox(), name, title, tip)
    box.setKeyboardTracking(False)
    box.setDecimals(decimals)
    box.setRange(low, high)
    box.setSingleStep(step)
    box.setValue(value)
    box.valueChanged.connect(changed)
    return box


def choice(
    name: str, title: str, tip: str, entries: Sequence[str], chosen: Callable[[str], object]
) -> QComboBox:
    """One of several; told when a person chooses, not when it is set."""
    box = named(QComboBox(), name, title, tip)
    box.addItems(list(entries))
    box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
    box.textActivated.connect(chosen)
    return box


def caption(text: str, buddy: QWidget) -> QLabel:
    """The label of a control; its mnemonic leads there."""
    label = QLabel(text)
    label.setBuddy(buddy)
    label.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
    return label


def set_quietly(box: QSpinBox | QDoubleSpinBox, value: float) -> None:
    """Sets a value without telling anybody."""
    box.blockSignals(True)
    box.setValue(value)  # type: ignore[arg-type]
    box.blockSignals(False)


def set_text_colour(label: QLabel, colour: QColor) -> None:
    """Sets the colour of the text alone; the rest goes on following the application."""
    palette = label.palette()
    palette.setColor(label.foregroundRole(), colour)
    label.setPalette(palette)
