# SPDX-License-Identifier: Apache-2.0
"""What is rendered: camera, size, samples, depth, denoising, region; pause, stop, restart."""

from __future__ import annotations

from PySide6.QtCore import QSize, Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QLabel, QToolBar, QWidget

from wavecomb.api import MAX_EDGE
from wavecomb.gui import theme
from wavecomb.gui.viewport.orbit import Pose
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.gui.widgets import caption, named, set_quietly, whole
from wavecomb.usd import LoadedStage

FREE = "Free camera"
MOST_SPP = 1 << 20
MOST_DEPTH = 1024


class RenderBar(QToolBar):
    """The controls of a render that are used most.

    Signals:
        fit_wanted(): The size of the viewport is wanted as the picture's.
    """

    fit_wanted = Signal()

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__("Render", parent)
        self.setObjectName("render")
        self._session = session
        setup = session.setup
        self.camera = named(
            QComboBox(), "render.camera", "Camera",
            "Look through a camera of the stage; moving the view leaves it",
        )  # fmt: skip
        self.camera.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.camera.setMinimumContentsLength(14)
        self.camera.addItem(FREE, None)
        self.camera.activated.connect(self._camera_chosen)
        change = session.change
        self.wide = whole(
            "render.width", "Width", "Of the picture, pixels", 1, MAX_EDGE, setup.width,
            lambda value: change(width=value),
        )  # fmt: skip
        self.high = whole(
            "render.height", "Height", "Of the picture, pixels", 1, MAX_EDGE, setup.height,
            lambda value: change(height=value),
        )  # fmt: skip
        self.spp = whole(
            "render.spp", "Samples per pixel", "Samples per pixel; with adaptive sampling the most",
            1, MOST_SPP, setup.spp, lambda value: change(spp=value),
        )  # fmt: skip
        self.depth = whole(
            "render.depth", "Depth", "Longest path, in scatterings", 0, MOST_DEPTH, setup.max_depth,
            lambda value: change(max_depth=value),
        )  # fmt: skip
        self.denoise = named(
            QCheckBox("Denoise"), "render.denoise", "Denoise",
            "Show the picture without its noise, by Open Image Denoise (Shift+D)",
        )  # fmt: skip
        self.denoise.toggled.connect(self._denoise_toggled)
        self._fill()
        session.opened.connect(self._opened)
        session.camera_changed.connect(self._camera_changed)
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

    def _opened(self, stage: LoadedStage) -> None:
        self.camera.clear()
        self.camera.addItem(FREE, None)
        names = [path.rpartition("/")[2] for path in stage.cameras]
        for path, name in zip(stage.cameras, names, strict=True):
            self.camera.addItem(name if names.count(name) == 1 else path, path)
        self._camera_changed(self._session.pose)

    def _camera_chosen(self, index: int) -> None:
        self._session.use_camera(self.camera.itemData(index))

    def _camera_changed(self, pose: Pose | None) -> None:
        index = self.camera.findData(pose.path) if pose is not None and pose.path else 0
        self.camera.setCurrentIndex(max(index, 0))
        path = self.camera.currentData()
        self.camera.setStatusTip(path or "")

    # ---- settings --------------------------------------------------------------------------------

    def _denoise_toggled(self, on: bool) -> None:
        if on:
            from wavecomb.errors import WavecombError
            from wavecomb.picture.denoise import check_denoiser

            try:
                check_denoiser()
            except WavecombError as error:
                self._session.failed.emit(str(error))
                self.denoise.setChecked(False)
                return
        self._session.change(denoise=on)

    def _setup_changed(self, setup: Setup) -> None:
        for box, value in (
            (self.wide, setup.width), (self.high, setup.height), (self.spp, setup.spp),
            (self.depth, setup.max_depth),
        ):  # fmt: skip
            set_quietly(box, value)
        self.denoise.blockSignals(True)
        self.denoise.setChecked(setup.denoise)
        self.denoise.blockSignals(False)
