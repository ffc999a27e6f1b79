# SPDX-License-Identifier: Apache-2.0
"""Small controls that panels share; each has a tooltip, an accessible name and an object name."""

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
    """Gives a widget its object name, accessible name and tooltip."""
    widget.setObjectName(name)
    widget.setAccessibleName(title)
    widget.setToolTip(tip)
    return widget


def tool(name: str, text: str, tip: str, parent: QWidget | None = None) -> QToolButton:
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


def search_field(name: str, title: str, tip: str, hint: str) -> QLineEdit:
    """A line to type what is looked for; ``hint`` stands in it while it is empty."""
    field = named(QLineEdit(), name, title, tip)
    field.setPlaceholderText(hint)
    field.setClearButtonEnabled(True)
    return field


def caption(text: str, buddy: QWidget) -> QLabel:
    """The label of a control; its mnemonic leads there."""
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
    """Shows a dialog for the name of a file, and returns at once.

    Args:
        parent: The dialog belongs to it.
        title: Of the dialog.
        kinds: Filter, such as "USD (*.usda *.usdc)".
        take: Called with the name that the user chose.
        start: Folder or file to begin with.
        mode: An existing file, or a folder.
        ending: Of a file to be written, without the dot; "": the file is to be read.
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
    """Base of widgets that files can be dropped on."""

    def takes(self, path: str) -> bool:
        """Whether a file that is dragged is of a kind that is taken."""
        return True

    def take_files(self, paths: list[str], at: QPointF) -> None:
        """Files were dropped at a point of the widget."""

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accepts the drag of files that are taken."""
        if self._taken(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Takes the files."""
        paths = self._taken(event)
        if paths:
            event.acceptProposedAction()
            self.take_files(paths, event.position())

    def _taken(self, event: QDropEvent) -> list[str]:
        paths = [url.toLocalFile() for url in event.mimeData().urls() if url.isLocalFile()]
        return [path for path in paths if self.takes(path)]


def set_quietly(box: QSpinBox | QDoubleSpinBox | QSlider, value: float) -> None:
    """Sets a value without telling anybody."""
    box.blockSignals(True)
    box.setValue(value)  # type: ignore[arg-type]
    box.blockSignals(False)


def set_text_colour(label: QLabel, colour: QColor) -> None:
    """Sets the colour of the text alone; the rest goes on following the application."""
    palette = label.palette()
    palette.setColor(label.foregroundRole(), colour)
    label.setPalette(palette)
