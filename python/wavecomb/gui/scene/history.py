# SPDX-License-Identifier: Apache-2.0
"""Steps of undo: Qt's stack, and commands that join where they are one drag or one value typed."""

from __future__ import annotations

import time as clock
import weakref
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from wavecomb.gui.scene.stage_edits import Step

MERGE_S = 0.7
"""Changes of one thing that follow each other faster are one step of undo."""
_EDIT = 1
"""Commands of other kinds do not join."""


class EditCommand(QUndoCommand):
    """A step that can be taken back.

    Args:
        step: What.
        history: Whose.
        stretch: Steps of another one never join.
        typing: Whether the stretch is a value that is being typed.
        moment: Seconds.
    """

    def __init__(
        self, step: Step, history: History, stretch: int, typing: bool, moment: float
    ) -> None:
        super().__init__(step.label)
        self.step, self.stretch, self.typing, self.moment = step, stretch, typing, moment
        # Qt keeps commands, and these must not keep what keeps the stack.
        self._history = weakref.ref(history)

    def redo(self) -> None:
        """Makes it, the first time too."""
        if (history := self._history()) is not None:
            history.step.emit(self.step)

    def undo(self) -> None:
        """Takes it back."""
        if (history := self._history()) is not None:
            history.step.emit(self.step.inverse())

    def id(self) -> int:
        """Qt asks those with the same to join."""
        return _EDIT if self.step.drags else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Takes in a later one, if both are parts of one drag or of one value typed."""
        if not isinstance(other, EditCommand) or other.stretch != self.stretch:
            return False
        quick = other.typing or other.moment - self.moment < MERGE_S
        if not quick or other.step.after.keys() != self.step.after.keys():
            return False
        self.step, self.moment = self.step.then(other.step), other.moment
        return True


class History(QObject):
    """The steps of one stage.

    Signals:
        step(Step): Is to be made now: a new one, one that is done again, or the inverse of one.

    Attributes:
        stack: Qt's; it is clean where the edits are as they were saved.
        now: The clock, for telling drags from single changes.
    """

    step = Signal(object)

    def __init__(
        self, parent: QObject | None = None, now: Callable[[], float] = clock.monotonic
    ) -> None:
        super().__init__(parent)
        self.stack = QUndoStack(self)
        self.now = now
        self._stretch = 0
        self._typing = False

    def push(self, step: Step) -> None:
        """Makes a step; it is part of the one before where both are one drag."""
        command = EditCommand(step, self, self._stretch, self._typing, self.now())
        self.stack.push(command)

    def set_typing(self, typing: bool) -> None:
        """Between True and False all changes of one thing are one step, however slow they are."""
        self._typing = typing
        self._stretch += 1

    def undo(self) -> None:
        """Takes the last step back, if there is one."""
        self._stretch += 1
        self.stack.undo()

    def redo(self) -> None:
        """Makes the step again that was taken back last, if there is one."""
        self._stretch += 1
        self.stack.redo()

    def clear(self) -> None:
        """Forgets all steps."""
        self._stretch += 1
        self.stack.clear()
