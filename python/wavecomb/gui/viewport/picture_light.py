# SPDX-License-Identifier: Apache-2.0
"""Coloured indicator that shows whether the image has stayed bit-identical."""

from __future__ import annotations

from functools import partial
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QWidget

from wavecomb.gui import theme
from wavecomb.gui.compare.same_picture import (
    PictureBook,
    PictureRevision,
    Verdict,
    even_samples,
    fingerprint,
    picture_key,
)
from wavecomb.gui.scheduling.choices import scheduling_of
from wavecomb.gui.viewport.session import Frame, Session
from wavecomb.gui.widgets import set_text_colour
from wavecomb.gui.worker import Errands

WAITING = "Waits until each pixel has all samples"


class PictureLight(QWidget):
    """Indicator that compares the bits of each finished image with images from earlier settings.

    An image is compared when every pixel has the same number of samples, or when an adaptive render
    ends. The bits are hashed on another thread, so that the window does not wait.
    """

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._revision = PictureRevision(session, self)
        self._marks = Errands("fingerprint", self)
        self.book = PictureBook()
        self.verdict = Verdict("none", "No picture yet")
        self._last: Any = None
        self._dot = QLabel()
        self._text = QLabel()
        self._text.setWordWrap(True)
        self._text.setObjectName("same_picture_text")
        self._text.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._dot, 0, Qt.AlignmentFlag.AlignTop)
        layout.addWidget(self._text, 1)
        self.setObjectName("same_picture")
        self.setAccessibleName("Same picture")
        self.setToolTip(
            "Compares the bits of each finished picture with an earlier one of "
            "the same scene, camera and samples, but other scheduling settings."
        )
        session.frame.connect(self._take)
        session.edited.connect(self._wait)
        theme.on_change(self._retell)
        self._retell()

    def _wait(self, version: int) -> None:
        if self._session.stage is not None:
            self._show(Verdict("waiting", WAITING))

    def _take(self, frame: Frame) -> None:
        samples = frame.layers.get("samples")
        if frame.scale != 1 or samples is None or frame.status.get("preview"):
            return
        region = frame.setup.region
        beauty = frame.beauty
        if region is not None:
            x0, y0, x1, y1 = region
            beauty, samples = beauty[y0:y1, x0:x1], samples[y0:y1, x0:x1]
        place: Any = even_samples(samples)
        whole = frame.final and not frame.status.get("cancelled")
        if not place and not whole:
            return
        if not place:
            place = f"to the end, {frame.setup.spp} at most"
        key = picture_key(vars(frame.setup), self._revision.value())
        mine = (frame.version, place)
        if mine == self._last:
            return
        self._last = mine
        settings = scheduling_of(frame.setup)

        tell = partial(self._tell, key, place, settings, frame.version)
        if key is None:
            tell("")
        else:
            self._marks.submit(partial(_mark, beauty, samples), tell, self._session.failed.emit)

    def shutdown(self) -> None:
        """Ends the hashing thread."""
        self._marks.close()

    def _tell(
        self, key: Any, place: Any, settings: dict[str, Any], version: int, mark: str
    ) -> None:
        verdict = self.book.add(key, place, mark, settings)
        # If no earlier image is comparable to the new image, keep the verdict for the previous
        # image with fewer samples.
        weaker = verdict.kind == "first" and self.verdict.kind in ("same", "different")
        if verdict.kind == "different" or (version == self._session.version and not weaker):
            self._show(verdict)

    def _show(self, verdict: Verdict) -> None:
        self.verdict = verdict
        self._retell()

    def _retell(self) -> None:
        kind = self.verdict.kind
        colour = {
            "same": QColor("#2ea36a"),
            "different": theme.error(),
        }.get(kind, theme.dim())
        set_text_colour(self._dot, colour)
        self._dot.setText("\u25cf" if kind in ("same", "different") else "\u25cb")
        more = f" ({self.book.checked} checked)" if kind == "same" else ""
        self._text.setText(self.verdict.text + more)
        self.setAccessibleDescription(self._text.text())


def _mark(beauty: NDArray[Any], samples: NDArray[Any]) -> str:
    return fingerprint(beauty) + fingerprint(samples)
