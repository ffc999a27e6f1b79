# SPDX-License-Identifier: Apache-2.0
"""A panel about one pixel: that under the cursor, or the one that was clicked."""

from __future__ import annotations

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QCheckBox, QWidget

from wavecomb.gui.viewport.session import Session


class CursorPanel(QWidget):
    """Is filled anew, a moment later, when the pixel or the picture is another.

    Attributes:
        follow: Whether the pixel is that under the cursor.
    """

    def __init__(
        self, session: Session, name: str, later_ms: int, parent: QWidget | None = None
    ) -> None:
        """``name``: of the object, and of what is in it."""
        super().__init__(parent)
        self.setObjectName(name)
        self._session = session
        self._pixel: tuple[int, int] | None = None
        self.follow = QCheckBox("Follow the cursor")
        self.follow.setObjectName(f"{name}.follow")
        self.follow.setChecked(True)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(later_ms)
        self._timer.timeout.connect(self._fill)
        session.frame.connect(lambda frame: self._soon())

    def hover(self, pixel: tuple[int, int] | None) -> None:
        """The cursor is over this pixel."""
        if self.follow.isChecked() and pixel is not None:
            self.pick(pixel)

    def pick(self, pixel: tuple[int, int]) -> None:
        """This pixel was clicked."""
        self._pixel = pixel
        self._soon()

    def _soon(self) -> None:
        if not self._timer.isActive():
            self._timer.start()

    def _fill(self) -> None:
        """Shows what there is of the pixel."""
        raise NotImplementedError
