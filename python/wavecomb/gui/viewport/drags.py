# SPDX-License-Identifier: Apache-2.0
"""Actions of the mouse buttons and modifier keys in the viewport."""

from __future__ import annotations

from enum import Enum, auto

from PySide6.QtCore import Qt


class Drag(Enum):
    """Action that a press of a mouse button in the viewport starts."""

    NONE = auto()
    ORBIT = auto()
    PAN = auto()
    DOLLY = auto()
    SHIFT = auto()
    REGION = auto()
    PICK = auto()
    GIZMO = auto()


Left, Middle, Right = (
    Qt.MouseButton.LeftButton,
    Qt.MouseButton.MiddleButton,
    Qt.MouseButton.RightButton,
)
Alt, Control, Shift = (
    Qt.KeyboardModifier.AltModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
)


def drag_of(button: Qt.MouseButton, modifiers: Qt.KeyboardModifier) -> Drag:
    """Returns the action of a mouse button.

    Drags with the middle button work as in Blender; drags with Alt work as in usdview.
    """
    if button == Middle:
        if modifiers & Shift:
            return Drag.PAN
        return Drag.DOLLY if modifiers & Control else Drag.ORBIT
    if modifiers & Alt:
        return {Left: Drag.ORBIT, Right: Drag.DOLLY}.get(button, Drag.NONE)
    return {Left: Drag.PICK, Right: Drag.SHIFT}.get(button, Drag.NONE)
