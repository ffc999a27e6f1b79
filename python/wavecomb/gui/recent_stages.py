# SPDX-License-Identifier: Apache-2.0
"""Recently opened stages, kept in the settings and shown in a menu."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QSettings, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

MOST = 10


class RecentStages(QMenu):
    """Menu of the recently opened files, the latest first.

    Args:
        settings: Storage of the list of files.
        parent: Parent window of the menu.

    Signals:
        chosen(str): Emitted with the path of the file that the user chose.
    """

    chosen = Signal(str)

    def __init__(self, settings: QSettings, parent: QWidget | None = None) -> None:
        super().__init__("Open &recent", parent)
        self._settings = settings
        self._fill()

    def names(self) -> list[str]:
        """Returns all recently opened files."""
        value: Any = self._settings.value("recent", [])
        return [value] if isinstance(value, str) else [str(path) for path in value or []]

    def add(self, path: Path) -> None:
        """Adds a file as the first entry of the list."""
        name = str(path.resolve())
        others = [other for other in self.names() if other != name]
        self._settings.setValue("recent", [name, *others][:MOST])
        self._fill()

    def _fill(self) -> None:
        self.clear()
        names = self.names()
        self.setEnabled(bool(names))
        for name in names:
            action = QAction(name.replace("&", "&&"), self)
            self.addAction(action)
            action.triggered.connect(lambda checked=False, name=name: self.chosen.emit(name))
