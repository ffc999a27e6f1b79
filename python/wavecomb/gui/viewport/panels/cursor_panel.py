# SPDX-License-Identifier: Apache-2.0
"""Base class of panels that show data of one pixel, which is under the cursor or was clicked."""

from __future__ import annotations

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QCheckBox, QWidget

from wavecomb.gui.viewport.session import Session


class CursorPanel(QWidget):
    """Panel whose data is updated shortly after the pixel or the image changes.

    Attributes:
        follow: Check box; while it is checked, the panel shows the pixel under the cursor.
    """

    def __init__(
        self, session: Session, name: str, later_ms: int, parent: QWidget | None = None
    ) -> None:
        """Creates the panel.

        ``name`` is the object name of the panel and the prefix of its widgets' object names.
        """
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
        """Handles a change of the pixel under the cursor."""
        if self.follow.isChecked() and pixel is not None:
            self.pick(pixel)

    def pick(self, pixel: tuple[int, int]) -> None:
        """Handles a clicked pixel."""
        self._pixel = pixel
        self._soon()

    def _soon(self) -> None:
        if not self._timer.isActive():
            self._timer.start()

    def _fill(self) -> None:
        """Shows the data of the chosen pixel in the panel."""
        raise NotImplementedError
