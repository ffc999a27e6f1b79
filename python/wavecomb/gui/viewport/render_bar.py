# SPDX-License-Identifier: Apache-2.0
"""Tool bar of the render: camera, size, samples, depth, denoising, region; pause, stop, restart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from PySide6.QtCore import QSize
from PySide6.QtWidgets import (
    QCheckBox,
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

_MOST: dict[str, dict[str, Any]] = {"width": {"most": MAX_EDGE}, "height": {"most": MAX_EDGE}}
_NAMES = {"max_depth": "depth"}
"""Names of controls that differ from those of their settings."""


class RenderBar(QToolBar):
    """Tool bar with the most used controls of a render."""

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
        self.wide, self.high, self.spp, self.depth = (
            self._box(name) for name in ("width", "height", "spp", "max_depth")
        )
        self.denoise = named(
            QCheckBox("Denoise"), "render.denoise", "Denoise",
            "Denoise the picture with Open Image Denoise (Shift+D)",
        )  # fmt: skip
        self.denoise.toggled.connect(self._denoise_toggled)
        self._fill()
        session.setup_changed.connect(self._setup_changed)
        self._setup_changed(setup)

    def _fill(self) -> None:
        self.setMovable(False)
        self.setIconSize(QSize(theme.em(1.1), theme.em(1.1)))
        self.addWidget(self.camera)
        self.addSeparator()
        for text, box in (
            (" &Width ", self.wide), (" \u00d7 ", self.high), (" &Samples ", self.spp),
            (" &Depth ", self.depth),
        ):  # fmt: skip
            self.addWidget(QLabel(text) if text == " \u00d7 " else caption(text, box))
            self.addWidget(box)
        self.addSeparator()
        self.addWidget(self.denoise)
        self.addSeparator()

    # ---- cameras ---------------------------------------------------------------------------------

    def _camera_changed(self) -> None:
        self.camera.setCurrentIndex(self.cameras.row)
        self.camera.setStatusTip(self.camera.currentData() or "")

    # ---- settings --------------------------------------------------------------------------------

    def _box(self, name: str) -> QSpinBox:
        box = control_of(replace(number(name), **_MOST.get(name, {})), self._change)
        assert isinstance(box, QSpinBox)
        box.setObjectName(f"render.{_NAMES.get(name, name)}")
        box.setGroupSeparatorShown(False)
        box.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        return box

    def _change(self, name: str, value: Any) -> None:
        self._session.change(**{name: value})

    def _denoise_toggled(self, on: bool) -> None:
        if on:
            from wavecomb.errors import WavecombError
            from wavecomb.image.denoise import check_denoiser

            try:
                check_denoiser()
            except WavecombError as error:
                self._session.failed.emit(str(error))
                self.denoise.setChecked(False)
                return
        self._session.change(denoise=on)

    def _setup_changed(self, setup: Setup) -> None:
        for box in (self.wide, self.high, self.spp, self.depth):
            show_control(box, getattr(setup, str(box.property("field"))))
        self.denoise.blockSignals(True)
        self.denoise.setChecked(setup.denoise)
        self.denoise.blockSignals(False)
