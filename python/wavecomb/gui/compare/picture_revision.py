# SPDX-License-Identifier: Apache-2.0
"""Tells whether what is looked at has changed: stage, camera, materials, lights."""

from __future__ import annotations

import hashlib
import pickle

from PySide6.QtCore import QObject

from wavecomb.gui.viewport.session import Session


class PictureRevision(QObject):
    """A name for scene and camera: the same again when an edit is taken back."""

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._opened = 0
        session.opened.connect(self._count)

    def value(self) -> str:
        """The name of what is looked at now."""
        session = self._session
        camera = session.pose.options() if session.pose is not None else None
        edits = (
            sorted(session.material_edits.items()),
            sorted(session.light_edits.items()),
            camera,
        )
        return f"{self._opened}-{hashlib.blake2b(pickle.dumps(edits), digest_size=8).hexdigest()}"

    def _count(self, stage: object) -> None:
        self._opened += 1
