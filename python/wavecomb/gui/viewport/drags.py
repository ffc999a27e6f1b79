# SPDX-License-Identifier: Apache-2.0
"""Mouse buttons and modifiers of the viewport."""

from __future__ import annotations

from enum import Enum, auto

from PySide6.QtCore import Qt


class Drag(Enum):
    """Action that a mouse button starts."""

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
    """Returns the action of a button, as in Blender (middle button) and usdview (Alt)."""
    if button == Middle:
        if modifiers & Shift:
            return Drag.PAN
        return Drag.DOLLY if modifiers & Control else Drag.ORBIT
    if modifiers & Alt:
        return {Left: Drag.ORBIT, Right: Drag.DOLLY}.get(button, Drag.NONE)
    return {Left: Drag.PICK, Right: Drag.SHIFT}.get(button, Drag.NONE)
