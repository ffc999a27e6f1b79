# SPDX-License-Identifier: Apache-2.0
"""Renders the same image with several settings in turn, then restores the original settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from wavecomb.gui.viewport.session import Frame, Session

LIMIT_MS = 20_000
"""Time limit of a step in milliseconds. A render that takes longer is ended, and counts with the
samples that it has."""


class Rounds(QObject):
    """Sequence of renders with different settings.

    Each step lasts until the render ends, or ``LIMIT_MS`` milliseconds.

    If anything else changes the settings, the sequence ends without restoring the original
    settings.

    Signals:
        moved(int, int): Number of finished steps and total number of steps.
        ended(bool): The sequence ended; True if all steps were finished.
    """

    moved = Signal(int, int)
    ended = Signal(bool)

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._steps: list[Mapping[str, Any]] = []
        self._done = 0
        self._before: Mapping[str, Any] = {}
        self._version = -1
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self._next)
        session.frame.connect(self._look)
        session.edited.connect(self._check)
        session.failed.connect(self._fail)
        session.state_changed.connect(self._look_at_state)

    @property
    def running(self) -> bool:
        """Whether a sequence is running."""
        return bool(self._steps)

    def start(self, steps: Sequence[Mapping[str, Any]]) -> None:
        """Starts the sequence.

        Each step gives values for fields of the setup. All steps must give the same fields.
        """
        if not steps or self.running or self._session.stage is None:
            return
        self._steps = list(steps)
        self._before = {name: getattr(self._session.setup, name) for name in steps[0]}
        self._done = 0
        self.moved.emit(0, len(steps))
        self._begin()

    def stop(self) -> None:
        """Stops the sequence and restores the original settings."""
        if self.running:
            self._end(False, put_back=True)

    def _begin(self) -> None:
        session = self._session
        # With the version -1, the handler of setting changes ignores the following change, which
        # this object makes.
        self._version = -1
        version = session.version
        if not session.change(**self._steps[self._done]):
            # The change failed, and the signal `failed` of the session has ended the sequence of
            # renders.
            return
        if session.version == version:
            # The render already has these settings, so it must be restarted explicitly.
            session.restart()
        self._version = session.version
        self._timer.start(LIMIT_MS)

    def _look(self, frame: Frame) -> None:
        ours = self.running and frame.version == self._version
        if ours and frame.final and frame.scale == 1 and not frame.status.get("cancelled"):
            self._version = -1  # Ignore frames that show the same render after denoising.
            self._timer.start(0)

    def _next(self) -> None:
        if not self.running:
            return
        self._done += 1
        self.moved.emit(self._done, len(self._steps))
        if self._done < len(self._steps):
            self._begin()
        else:
            self._end(True, put_back=True)

    def _check(self, version: int) -> None:
        if self.running and self._version not in (-1, version):
            self._end(False, put_back=False)

    def _look_at_state(self, state: str) -> None:
        if self.running and state == "stopped":
            self._end(False, put_back=False)

    def _fail(self, message: str) -> None:
        if self.running:
            self._end(False, put_back=True)

    def _end(self, whole: bool, *, put_back: bool) -> None:
        self._timer.stop()
        self._steps = []
        self._version = -1
        if put_back:
            self._session.change(**self._before)
        self.ended.emit(whole)
