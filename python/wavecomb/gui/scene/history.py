# SPDX-License-Identifier: Apache-2.0
"""Undo history of edits on Qt's undo stack. Changes of one drag or typed value are merged."""

from __future__ import annotations

import time as clock
import weakref
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from wavecomb.gui.scene.stage_edits import Step

MERGE_S = 0.7
"""Largest interval, in seconds, between changes of a value that are merged into one undo step."""
_EDIT = 1
"""Command id that Qt compares to find commands that may merge."""


class EditCommand(QUndoCommand):
    """An undo command.

    Args:
        step: The undo step that the command applies.
        history: The history that the command belongs to.
        stretch: Number that is equal in two commands that may merge.
        typing: Whether the undo step is part of typing a value.
        moment: Time of the undo step in seconds.
    """

    def __init__(
        self, step: Step, history: History, stretch: int, typing: bool, moment: float
    ) -> None:
        super().__init__(step.label)
        self.step, self.stretch, self.typing, self.moment = step, stretch, typing, moment
        # Qt owns the undo commands. If a command held a strong reference to the history, the
        # history and its undo stack would never be deleted.
        self._history = weakref.ref(history)

    def redo(self) -> None:
        """Applies the undo step. Qt also calls this when the command is pushed."""
        if (history := self._history()) is not None:
            history.step.emit(self.step)

    def undo(self) -> None:
        """Reverts the undo step."""
        if (history := self._history()) is not None:
            history.step.emit(self.step.inverse())

    def id(self) -> int:
        """Returns the id by which Qt finds commands that may merge."""
        return _EDIT if self.step.drags else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Merges a later command if both are part of one drag or one typed value."""
        if not isinstance(other, EditCommand) or other.stretch != self.stretch:
            return False
        quick = other.typing or other.moment - self.moment < MERGE_S
        if not quick or not other.step.after.keys() <= self.step.after.keys():
            return False
        self.step, self.moment = self.step.then(other.step), other.moment
        return True


class History(QObject):
    """Undo history of one stage.

    Signals:
        step(Step): Asks the receiver to apply a step. On undo, the step is the inverse of the
            original step.

    Attributes:
        stack: Qt's undo stack. The stack is in its clean state while all edits are saved.
        now: Function that returns the time in seconds, which tells whether changes belong to one
            drag.
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
        """Applies an undo step and adds it to the history.

        Merges the step with the previous step if both belong to one drag.
        """
        command = EditCommand(step, self, self._stretch, self._typing, self.now())
        self.stack.push(command)

    def set_typing(self, typing: bool) -> None:
        """Marks the start (True) and end (False) of typing a value.

        All changes in between become one undo step.
        """
        self._typing = typing
        self._stretch += 1

    def undo(self) -> None:
        """Undoes the last step, if there is one."""
        self._stretch += 1
        self.stack.undo()

    def redo(self) -> None:
        """Redoes the last undone step, if there is one."""
        self._stretch += 1
        self.stack.redo()

    def clear(self) -> None:
        """Removes all undo steps."""
        self._stretch += 1
        self.stack.clear()
