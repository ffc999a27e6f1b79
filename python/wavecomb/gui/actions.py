# SPDX-License-Identifier: Apache-2.0
"""Actions of the window: their texts, shortcuts, callbacks and positions in menus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import shiboken6
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction, QKeySequence, QUndoStack
from PySide6.QtWidgets import QWidget

TITLE = "title"
"""Name of a property of QAction that stores the original text if the text changes."""


@dataclass(frozen=True)
class Entry:
    """An action of the window.

    Attributes:
        name: Object name without the prefix "action.".
        text: Text in the menu, with a mnemonic.
        call: Callback. A checkable action passes its new checked state to the callback.
        keys: Shortcuts of the action; the menu shows the first.
        tip: Description in a sentence.
        checkable: Whether the action can be on or off.
        local: Whether the shortcut works only while the viewport has the focus. Shortcuts of a
            single key are local, because they would otherwise interfere with typing.
    """

    name: str
    text: str
    call: Callable[..., object]
    keys: Sequence[str] = ()
    tip: str = ""
    checkable: bool = False
    local: bool = False


def make_action(entry: Entry, window: QWidget, viewport: QWidget) -> QAction:
    """Creates the QAction, whose parent is the window or, for a local shortcut, the viewport."""
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
    """Returns the shortcuts for a digit key in the number row and on the keypad."""
    return str(digit), f"Num+{digit}"


# ---- Texts of undo and redo, and the mark for unsaved edits
# ----------------------------------------


class HistoryActions(QObject):
    """Updates the texts of the actions Undo and Redo, such as "Undo intensity of /Key".

    Args:
        stack: Undo stack, whose texts are appended to the actions' texts.
        undo: The undo action.
        redo: The redo action.
        parent: Qt parent.
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
        # The undo stack emits signals even while Qt destroys it and its actions.
        if shiboken6.isValid(action):
            action.setText(f"{self._texts[action]} {what.replace('&', '&&')}".rstrip())


class UnsavedMark(QObject):
    """Updates the mark in the window's title that indicates unsaved edits."""

    def __init__(self, stack: QUndoStack, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        stack.cleanChanged.connect(self._tell)
        self._tell(stack.isClean())

    def _tell(self, clean: bool) -> None:
        if shiboken6.isValid(self._window):
            self._window.setWindowModified(not clean)
