# SPDX-License-Identifier: Apache-2.0
"""Stages that were opened before, in the settings and in a menu."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QSettings, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu

MOST = 10


class RecentStages(QObject):
    """The files, the last first.

    Args:
        settings: Where they are kept.
        menu: That lists them.

    Signals:
        chosen(str): A file of the menu.
    """

    chosen = Signal(str)

    def __init__(self, settings: QSettings, menu: QMenu) -> None:
        super().__init__(menu)
        self._settings, self._menu = settings, menu
        self._fill()

    def names(self) -> list[str]:
        """All of them."""
        value: Any = self._settings.value("recent", [])
        return [value] if isinstance(value, str) else [str(path) for path in value or []]

    def add(self, path: Path) -> None:
        """Another, or one that comes first again."""
        name = str(path.resolve())
        others = [other for other in self.names() if other != name]
        self._settings.setValue("recent", [name, *others][:MOST])
        self._fill()

    def _fill(self) -> None:
        self._menu.clear()
        names = self.names()
        self._menu.setEnabled(bool(names))
        for name in names:
            action = QAction(name.replace("&", "&&"), self._menu)
            self._menu.addAction(action)
            action.triggered.connect(lambda checked=False, name=name: self.chosen.emit(name))
