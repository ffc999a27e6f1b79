# SPDX-License-Identifier: Apache-2.0
"""List of keyboard shortcuts, which is built from the window's actions."""

from __future__ import annotations

import importlib.metadata

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QMessageBox,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.actions import TITLE
from wavecomb.gui.widgets import named, search_field

MOUSE = (
    ("Orbit about the point under the cursor", "Middle drag, Alt+Left drag"),
    ("Pan", "Shift+Middle drag"),
    ("Dolly", "Wheel, Ctrl+Middle drag, Alt+Right drag"),
    ("Select the prim under the cursor", "Left click"),
    ("Zoom the picture", "Ctrl+Wheel"),
    ("Pan the picture", "Right drag"),
    ("Orbit by 15 degrees", "Arrow keys, in the viewport"),
    ("Pan by a tenth of the picture", "Shift+arrow keys, in the viewport"),
    ("Dolly in, out", "PgUp, PgDown, in the viewport"),
)
"""Mouse and keyboard controls of the viewport that are not actions of the window."""


def plain_text(action: QAction) -> str:
    """Returns the text of an action without mnemonic marks and trailing dots."""
    text = str(action.property(TITLE) or action.text())
    return text.replace("&", "").rstrip(".\u2026")


def listed(window: QWidget) -> list[tuple[str, str]]:
    """Lists the actions of a window that have shortcuts, then the controls of the viewport."""
    rows = []
    for action in window.findChildren(QAction):
        keys = [key.toString(QKeySequence.SequenceFormat.NativeText) for key in action.shortcuts()]
        if keys and action.objectName().startswith("action."):
            rows.append((plain_text(action), ", ".join(keys)))
    return [*dict.fromkeys(rows), *MOUSE]


class ShortcutsDialog(QDialog):
    """Dialog with a searchable list of shortcuts."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self.setObjectName("shortcuts")
        self.setWindowTitle("Keyboard shortcuts")
        self._rows = listed(window)
        self.search = search_field(
            "shortcuts.search", "Search", "Shows the rows that contain this text", "Search"
        )
        self.search.textChanged.connect(self._filter)
        self.table = named(QTableWidget(len(self._rows), 2), "shortcuts.table", "Shortcuts", "")
        self.table.setHorizontalHeaderLabels(["What", "Keys"])
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setAlternatingRowColors(True)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
        for row, texts in enumerate(self._rows):
            for column, text in enumerate(texts):
                self.table.setItem(row, column, QTableWidgetItem(text))
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        layout.addWidget(self.search)
        layout.addWidget(self.table)
        layout.addWidget(buttons)
        self.resize(theme.em(36), theme.em(34))

    def _filter(self, text: str) -> None:
        for row, texts in enumerate(self._rows):
            found = any(text.lower() in each.lower() for each in texts)
            self.table.setRowHidden(row, not found)


# ---- Help > About: versions of Wavecomb and its dependencies
# ---------------------------------------


_PARTS = ("usd-core", "numpy", "openimageio", "PySide6-Essentials", "pyqtgraph", "pyoidn")


def about_text() -> str:
    """Returns the versions as lines of text."""
    from wavecomb.isa import library_text
    from wavecomb.version import version

    parts = []
    for name in _PARTS:
        try:
            parts.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            parts.append(f"{name}: not installed")
    return (
        f"Wavecomb {version()}\nCPU wavefront path tracer for OpenUSD stages\n"
        f"{library_text()}\n\n" + "\n".join(parts) + "\n\nApache License 2.0"
    )


def make_about(parent: QWidget) -> QMessageBox:
    """Creates the dialog without showing it."""
    box = QMessageBox(parent)
    box.setObjectName("about")
    box.setWindowTitle("About Wavecomb")
    box.setText(about_text())
    return box
