# SPDX-License-Identifier: Apache-2.0
"""Undo history of camera movements, separate from the history of edits.

Camera movements do not change the stage, so they have a separate undo history. In a common history,
undoing an edit would first revert all later camera movements. A stage that was only viewed would
also count as unsaved.
"""

from __future__ import annotations

import time as clock
import weakref

from PySide6.QtCore import QObject
from PySide6.QtGui import QUndoCommand, QUndoStack

from wavecomb.gui.viewport.navigate import Pose
from wavecomb.gui.viewport.session import Session

MERGE_S = 0.7
"""Largest interval, in seconds, between camera movements that merge into one undo step."""
_MOVE = 2


class MoveCommand(QUndoCommand):
    """Undo command of a camera movement from one pose to another.

    The camera has already moved when the command is created.
    """

    def __init__(self, before: Pose, after: Pose, history: ViewHistory, moment: float) -> None:
        super().__init__("view" if after.path is None else f"camera {after.path}")
        self.before, self.after, self.moment = before, after, moment
        self._history = weakref.ref(history)
        self._there = True

    def redo(self) -> None:
        """Moves the camera to the pose after the movement."""
        history = self._history()
        if history is not None and not self._there:
            history.go(self.after)
        self._there = False

    def undo(self) -> None:
        """Moves the camera back to the pose before the movement."""
        if (history := self._history()) is not None:
            history.go(self.before)

    def id(self) -> int:
        """Returns the command id that Qt compares to find commands that may merge.

        The choice of another camera is always a separate undo step.
        """
        return _MOVE if self.after.path is None else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Merges a later camera movement if both belong to the same drag."""
        if not isinstance(other, MoveCommand) or other.moment - self.moment >= MERGE_S:
            return False
        self.after, self.moment = other.after, other.moment
        return True


class ViewHistory(QObject):
    """Undo history of the poses of a session's camera.

    Attributes:
        stack: Undo stack of the camera movements.
        now: Function that returns the time in seconds, used to detect movements of the same drag.
    """

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.stack = QUndoStack(self)
        self.now = clock.monotonic
        self._session = session
        self._pose = session.pose
        self._usd: object = session.usd
        session.opened.connect(self._on_opened)
        session.camera_changed.connect(self._on_moved)

    def go(self, pose: Pose) -> None:
        """Moves the camera to a pose without adding an undo step."""
        self._pose = pose
        self._session.set_camera(pose)

    def _on_opened(self, stage: object) -> None:
        self._pose = self._session.pose
        if self._usd is not self._session.usd:
            self._usd = self._session.usd
            self.stack.clear()

    def _on_moved(self, pose: Pose | None) -> None:
        before, self._pose = self._pose, pose
        if pose is None or before is None or pose is before:
            return
        self.stack.push(MoveCommand(before, pose, self, self.now()))
