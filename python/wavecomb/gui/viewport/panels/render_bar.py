# SPDX-License-Identifier: Apache-2.0
"""Tool bar of the render: camera, image size and region; buttons to pause, stop and restart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from PySide6.QtCore import QSize
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QSizePolicy,
    QSpinBox,
    QToolBar,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scheduling.choices import number
from wavecomb.gui.scheduling.setting_controls import control_of, show_control
from wavecomb.gui.viewport.cameras_model import CamerasModel
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.gui.widgets import caption, named
from wavecomb.run.settings import MAX_EDGE


class RenderBar(QToolBar):
    """Tool bar with the most frequently used controls of a render."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__("Render", parent)
        self.setObjectName("render")
        self._session = session
        setup = session.setup
        self.camera = named(
            QComboBox(), "render.camera", "Camera",
            "Camera of the view; moving the view changes to a free camera",
        )  # fmt: skip
        self.camera.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.camera.setMinimumContentsLength(14)
        self.cameras = CamerasModel(session, self)
        self.camera.setModel(self.cameras)
        self.camera.activated.connect(self.cameras.choose)
        self.cameras.moved.connect(self._camera_changed)
        self.wide, self.high = (self._box(name) for name in ("width", "height"))
        self._fill()
        session.setup_changed.connect(self._setup_changed)
        self._setup_changed(setup)

    def _fill(self) -> None:
        self.setMovable(False)
        self.setIconSize(QSize(theme.em(1.1), theme.em(1.1)))
        self.addWidget(self.camera)
        self.addSeparator()
        for label, box in (
            (caption(" &Size ", self.wide), self.wide),
            (QLabel(" \u00d7 "), self.high),
        ):
            self.addWidget(label)
            self.addWidget(box)
        self.addSeparator()

    # ---- cameras ---------------------------------------------------------------------------------

    def _camera_changed(self) -> None:
        self.camera.setCurrentIndex(self.cameras.row)
        self.camera.setStatusTip(self.camera.currentData() or "")

    # ---- settings --------------------------------------------------------------------------------

    def _box(self, name: str) -> QSpinBox:
        box = control_of(replace(number(name), most=MAX_EDGE), self._change)
        assert isinstance(box, QSpinBox)
        box.setObjectName(f"render.{name}")
        box.setGroupSeparatorShown(False)
        box.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        return box

    def _change(self, name: str, value: Any) -> None:
        self._session.change(**{name: value})

    def _setup_changed(self, setup: Setup) -> None:
        for box in (self.wide, self.high):
            show_control(box, getattr(setup, str(box.property("field"))))
