# SPDX-License-Identifier: Apache-2.0
"""All actions of the window in one table: text, shortcuts, what they do, where they stand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import shiboken6
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction, QKeySequence, QUndoStack
from PySide6.QtWidgets import QWidget

TITLE = "title"
"""Property: the text of an action as it was made, where it says more meanwhile."""


@dataclass(frozen=True)
class Entry:
    """One action.

    Attributes:
        name: Object name, "action.NAME".
        text: In the menu, with a mnemonic.
        call: What it does; gets the new state where the action can be checked.
        keys: Shortcuts; the first is shown in the menu.
        tip: What it does in a sentence.
        checkable: It is on or off.
        local: Works while the viewport has the focus; single keys would disturb typing elsewhere.
    """

    name: str
    text: str
    call: Callable[..., object]
    keys: Sequence[str] = ()
    tip: str = ""
    checkable: bool = False
    local: bool = False


def make_action(entry: Entry, window: QWidget, viewport: QWidget) -> QAction:
    """The action, at home in the window or in the viewport."""
    home = viewport if entry.local else window
    action = QAction(entry.text, home)
    action.setObjectName(f"action.{entry.name}")
    action.setShortcuts([QKeySequence(key) for key in entry.keys])
    tip = entry.tip or entry.text.replace("&", "").rstrip(".\u2026")
    action.setToolTip(tip)
    action.setProperty(TITLE, entry.text)
    action.setStatusTip(tip)
    action.setCheckable(entry.checkable)
    if entry.local:
        action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
    home.addAction(action)
    if entry.checkable:
        action.toggled.connect(entry.call)
    else:
        action.triggered.connect(lambda checked=False: entry.call())
    return action


def keypad(digit: int) -> tuple[str, str]:
    """A digit of either block of the keyboard."""
    return str(digit), f"Num+{digit}"


# ---- Actions that say what they would undo or redo, and the mark of what is not saved ------------


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
