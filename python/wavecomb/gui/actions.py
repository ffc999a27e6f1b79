# SPDX-License-Identifier: Apache-2.0
"""All actions of the window in one table: text, shortcuts, what they do, where they stand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QWidget

SEPARATOR = "-"
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
