# SPDX-License-Identifier: Apache-2.0
"""List of the cameras that can be selected: a free camera, then the cameras of the stage.

No widgets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QAbstractListModel, QModelIndex, QObject, Qt, Signal

from wavecomb.gui.viewport.navigate import Pose
from wavecomb.gui.viewport.session import Session

if TYPE_CHECKING:
    from wavecomb.usd import LoadedStage

FREE = "Free camera"
_ROOT = QModelIndex()


class CamerasModel(QAbstractListModel):
    """List of camera names.

    ``Qt.ItemDataRole.UserRole`` holds the path, or None for the free camera.

    Signals:
        moved(): Another camera became the current camera, which changes ``row``.
    """

    moved = Signal()

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.paths: list[str | None] = [None]
        session.opened.connect(self._fill)
        session.camera_changed.connect(self._on_moved)
        if session.stage is not None:
            self._fill(session.stage)

    @property
    def row(self) -> int:
        """Row of the current camera."""
        pose = self._session.pose
        path = pose.path if pose is not None else None
        return self.paths.index(path) if path in self.paths else 0

    def choose(self, row: int) -> None:
        """Makes the camera in a row of the list the current camera."""
        self._session.use_camera(self.paths[row])

    def _fill(self, stage: LoadedStage | None) -> None:
        self.beginResetModel()
        self.paths = [None, *(stage.cameras if stage is not None else ())]
        self.endResetModel()
        self.moved.emit()

    def _on_moved(self, pose: Pose | None) -> None:
        self.moved.emit()

    def rowCount(self, parent: Any = _ROOT) -> int:
        """Returns the number of cameras."""
        return 0 if parent.isValid() else len(self.paths)

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Returns the name or the path of a camera for an item data role."""
        path = self.paths[index.row()]
        if role == Qt.ItemDataRole.UserRole:
            return path
        if role == Qt.ItemDataRole.ToolTipRole:
            return path
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        if path is None:
            return FREE
        name = path.rpartition("/")[2]
        same = sum(one is not None and one.rpartition("/")[2] == name for one in self.paths)
        return name if same == 1 else path
