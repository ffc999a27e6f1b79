# SPDX-License-Identifier: Apache-2.0
"""Status bar with the progress of the render and of background work."""

from __future__ import annotations

from PySide6.QtWidgets import QLabel, QProgressBar, QStatusBar, QWidget

from wavecomb.gui import theme
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.session import Session
from wavecomb.gui.widgets import named


def frame_text(frame: Frame, state: str) -> str:
    """Describes the progress of a render in a line."""
    done = frame.status.get("samples_done", 0)
    if frame.scale > 1:
        return f"preview at 1/{frame.scale} of the size"
    setup = frame.setup
    pixels = setup.width * setup.height
    if setup.region is not None:
        x0, y0, x1, y1 = setup.region
        pixels = (x1 - x0) * (y1 - y0)
    seconds = frame.status.get("seconds", 0.0)
    parts = [f"{done / pixels:.3g} of {setup.spp} samples a pixel"]
    if seconds:
        parts += [f"{seconds:.1f} s", f"{done / seconds / 1e6:.2f} M samples/s"]
    if (error := frame.status.get("error")) is not None:
        parts.append(f"error {100.0 * error:.2g} %")
    return f"{state}: {', '.join(parts)}"


class StatusLine(QStatusBar):
    """Status bar with render progress, render state and background work."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("status")
        self._session = session
        self.progress = named(QProgressBar(), "status.progress", "Progress", "Render progress")
        self.progress.setFixedWidth(theme.em(10))
        self.progress.setRange(0, 1000)
        self.progress.setTextVisible(False)
        self.text = named(QLabel("no stage"), "status.text", "State of the render", "")
        self.work = named(QLabel(), "status.work", "Background work", "")
        self.addWidget(self.progress)
        self.addWidget(self.text, 1)
        self.addPermanentWidget(self.work)
        session.frame.connect(lambda frame: self._refresh())
        session.state_changed.connect(lambda state: self._refresh())
        session.busy.connect(self._busy)

    def _busy(self, what: str) -> None:
        self.work.setText(f"{what} \u2026" if what else "")

    def _refresh(self) -> None:
        frame = self._session.last_frame
        if frame is None:
            self.text.setText(self._session.state)
            return
        self.text.setText(frame_text(frame, self._session.state))
        done, total = frame.status.get("samples_done", 0), frame.status.get("samples_total", 0)
        if frame.scale > 1:
            share = 0.0
        else:
            share = done / total if total else float(frame.final)
        self.progress.setValue(round(1000 * min(share, 1.0)))
