# SPDX-License-Identifier: Apache-2.0
"""Small controls that have a tooltip, an accessible name and an object name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFileDialog,
    QLabel,
    QLineEdit,
    QSlider,
    QSpinBox,
    QToolButton,
    QWidget,
)

W = TypeVar("W", bound=QWidget)


def named(widget: W, name: str, title: str, tip: str) -> W:
    """Sets the object name, accessible name and tooltip of a widget."""
    widget.setObjectName(name)
    widget.setAccessibleName(title)
    widget.setToolTip(tip)
    return widget


def tool(name: str, text: str, tip: str, parent: QWidget | None = None) -> QToolButton:
    """Creates a small button."""
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
    *,
    changed: Callable[[float], object],
    decimals: int = 2,
) -> QDoubleSpinBox:
    """Creates a number box whose value takes effect when editing ends."""
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
    """Creates a combo box that calls ``chosen`` only when the user selects an entry."""
    box = named(QComboBox(), name, title, tip)
    box.addItems(list(entries))
    box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
    box.textActivated.connect(chosen)
    return box


def search_field(name: str, title: str, tip: str, hint: str) -> QLineEdit:
    """Creates a search field, which shows ``hint`` while it is empty."""
    field = named(QLineEdit(), name, title, tip)
    field.setPlaceholderText(hint)
    field.setClearButtonEnabled(True)
    return field


def caption(text: str, buddy: QWidget) -> QLabel:
    """Creates a label whose keyboard mnemonic moves the focus to ``buddy``."""
    label = QLabel(text)
    label.setBuddy(buddy)
    label.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
    return label


def ask_file(
    parent: QWidget,
    title: str,
    kinds: str,
    take: Callable[[str], object],
    *,
    start: str = "",
    mode: QFileDialog.FileMode = QFileDialog.FileMode.ExistingFile,
    ending: str = "",
) -> None:
    """Opens a file dialog that does not block the window.

    Args:
        parent: Parent of the dialog.
        title: Title of the dialog.
        kinds: Filter of file names, such as "USD (*.usda *.usdc)".
        take: Function that is called with the chosen file name.
        start: Initial folder or file of the dialog.
        mode: Whether to choose an existing file or a folder.
        ending: File extension of a file to write, without the dot; "" means that a file is read.
    """
    dialog = QFileDialog(parent, title, start, kinds)
    if ending:
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(ending)
    else:
        dialog.setFileMode(mode)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.fileSelected.connect(take)
    dialog.open()


class TakesFiles:
    """Base class of widgets that accept dropped files."""

    def takes(self, path: str) -> bool:
        """Returns whether a dragged file has an accepted kind."""
        return True

    def take_files(self, paths: list[str], at: QPointF) -> None:
        """Handles files that were dropped at a point of the widget."""

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accepts a drag if its files have an accepted kind."""
        if self._taken(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Handles dropped files."""
        paths = self._taken(event)
        if paths:
            event.acceptProposedAction()
            self.take_files(paths, event.position())

    def _taken(self, event: QDropEvent) -> list[str]:
        paths = [url.toLocalFile() for url in event.mimeData().urls() if url.isLocalFile()]
        return [path for path in paths if self.takes(path)]


def set_quietly(box: QSpinBox | QDoubleSpinBox | QSlider, value: float) -> None:
    """Sets the value of a widget without emitting signals."""
    box.blockSignals(True)
    box.setValue(value)  # type: ignore[arg-type]
    box.blockSignals(False)


def set_text_colour(label: QLabel, colour: QColor) -> None:
    """Sets the text colour of a label. All other colours still follow the application."""
    palette = label.palette()
    palette.setColor(label.foregroundRole(), colour)
    label.setPalette(palette)
