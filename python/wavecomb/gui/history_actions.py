# SPDX-License-Identifier: Apache-2.0
"""Actions that say what they would undo or redo, and the mark of what is not saved."""

from __future__ import annotations

import shiboken6
from PySide6.QtCore import QObject
from PySide6.QtGui import QAction, QUndoStack
from PySide6.QtWidgets import QWidget


class HistoryActions(QObject):
    """Makes two actions follow a stack: "Undo intensity of /Key".

    Args:
        stack: Its texts come after the actions' own.
        undo: Its first action.
        redo: Its second action.
        parent: Lives as long.
    """

    def __init__(self, stack: QUndoStack, undo: QAction, redo: QAction, parent: QObject) -> None:
        super().__init__(parent)
        self._texts = {action: action.text() for action in (undo, redo)}
        self._undo, self._redo = undo, redo
        stack.undoTextChanged.connect(self._tell_undo)
        stack.redoTextChanged.connect(self._tell_redo)
        stack.canUndoChanged.connect(undo.setEnabled)
        stack.canRedoChanged.connect(redo.setEnabled)
        undo.setEnabled(stack.canUndo())
        redo.setEnabled(stack.canRedo())
        self._tell_undo(stack.undoText())
        self._tell_redo(stack.redoText())

    def _tell_undo(self, what: str) -> None:
        self._tell(self._undo, what)

    def _tell_redo(self, what: str) -> None:
        self._tell(self._redo, what)

    def _tell(self, action: QAction, what: str) -> None:
        if shiboken6.isValid(action):  # a stack that goes empties itself
            action.setText(f"{self._texts[action]} {what.replace('&', '&&')}".rstrip())


class UnsavedMark(QObject):
    """The window's title has a mark where the edits are not as they were saved."""

    def __init__(self, stack: QUndoStack, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        stack.cleanChanged.connect(self._tell)
        self._tell(stack.isClean())

    def _tell(self, clean: bool) -> None:
        if shiboken6.isValid(self._window):
            self._window.setWindowModified(not clean)
