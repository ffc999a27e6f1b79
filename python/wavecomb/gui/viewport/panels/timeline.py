# SPDX-License-Identifier: Apache-2.0
"""Timeline of an animated stage: a slider for the frame, and a button that plays the animation."""

from __future__ import annotations

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QHBoxLayout, QSlider, QSpinBox, QWidget

from wavecomb.gui import theme
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.session import Session
from wavecomb.gui.widgets import named, set_quietly, tool

_PLAY, _STOP = "\u25b6", "\u25a0"


class Timeline(QWidget):
    """Timeline bar, which is visible for stages with a frame range.

    While the timeline plays, each frame is shown as a reduced image. The timeline plays at most at
    the frame rate of the stage, and repeats the frame range. When playing stops, the current frame
    is rendered at full size.
    """

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("timeline")
        self._session = session
        self._waiting = False
        self.play = tool("timeline.play", _PLAY, "Play or stop (Shift+Space)")
        self.slider = named(
            QSlider(Qt.Orientation.Horizontal), "timeline.slider", "Frame slider", "Frame"
        )
        self.frame = named(QSpinBox(), "timeline.frame", "Frame", "Frame; Enter renders it")
        self.frame.setKeyboardTracking(False)
        self.slider.setTracking(True)
        row = QHBoxLayout(self)
        row.setContentsMargins(theme.em(0.4), 0, theme.em(0.4), 0)
        for widget, stretch in ((self.play, 0), (self.slider, 1), (self.frame, 0)):
            row.addWidget(widget, stretch)
        self._beat = QTimer(self)
        self._beat.timeout.connect(self._next)
        self.play.clicked.connect(self.toggle)
        self.slider.valueChanged.connect(self._choose)
        self.slider.sliderReleased.connect(session.restart)
        self.frame.valueChanged.connect(self._choose)
        session.opened.connect(lambda stage: self._opened())
        session.frame.connect(self._rendered)
        session.failed.connect(lambda line: self._stop())
        self.hide()

    @property
    def is_playing(self) -> bool:
        """Whether the timeline is playing."""
        return self._beat.isActive()

    def _opened(self) -> None:
        usd, stage = self._session.usd, self._session.stage
        if usd is None or stage is None:
            return
        first, last = usd.GetStartTimeCode(), usd.GetEndTimeCode()
        is_animated = usd.HasAuthoredTimeCodeRange() and last > first
        self.setVisible(is_animated)
        if not is_animated:
            self._stop()
            return
        for box in (self.slider, self.frame):
            box.blockSignals(True)
            box.setRange(round(first), round(last))
            box.blockSignals(False)
        self._beat.setInterval(round(1000.0 / max(usd.GetFramesPerSecond(), 1.0)))
        self._show(round(first if stage.frame is None else stage.frame))

    def _show(self, frame: int) -> None:
        if not self.slider.isSliderDown():
            set_quietly(self.slider, frame)
        set_quietly(self.frame, frame)

    def _choose(self, frame: int) -> None:
        """Shows a frame of the animation.

        The image is reduced while the timeline plays or is dragged.
        """
        self._waiting = True
        self._session.show_time(frame, moving=self.is_playing or self.slider.isSliderDown())
        self._show(frame)

    def toggle(self) -> None:
        """Starts or stops playing the timeline."""
        if self.is_playing:
            self._stop()
            self._session.restart()
        elif self.isVisible():
            self.play.setText(_STOP)
            self._waiting = False
            self._beat.start()

    def _stop(self) -> None:
        self._beat.stop()
        self.play.setText(_PLAY)

    def _rendered(self, frame: Frame) -> None:
        if frame.version == self._session.version and not self._session.is_reading:
            self._waiting = False

    def _next(self) -> None:
        if not self._waiting:
            now, last = self.frame.value(), self.frame.maximum()
            self._choose(now + 1 if now < last else self.frame.minimum())
