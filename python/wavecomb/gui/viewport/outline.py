# SPDX-License-Identifier: Apache-2.0
"""Outline of the selected prims in the image, computed from the objects that the camera sees."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject
from PySide6.QtGui import QImage, QPainter

from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.worker import Worker

if TYPE_CHECKING:
    from wavecomb._core import Renderer
    from wavecomb.gui.viewport.picture_view import PictureView
    from wavecomb.gui.viewport.session import Session

MOST_PIXELS = 160_000
"""Largest image size at which an outline is computed. An outline of this size takes about 50 ms of
CPU time."""
COLOUR = (255, 154, 60)


def object_mask(renderer: Renderer, path: str, width: int, height: int) -> NDArray[np.bool_] | None:
    """Returns a mask of the pixels whose first hit is on a prim or below the prim.

    Returns None if the scene has no objects of the prim.

    Args:
        renderer: Renderer of the current scene, which may be rendering during the call.
        path: Path of the prim.
        width: Width of the mask in pixels.
        height: Height of the mask in pixels.
    """
    from wavecomb import _core
    from wavecomb.run.settings import make_settings

    twin = renderer.twin()
    below = (f"{path}/", f"{path}[")
    names = {name for name, _ in twin.scene.object_names if name == path or name.startswith(below)}
    if not names:
        return None
    settings = make_settings(
        (width, height), 1, aovs=("crypto_object",), max_depth=0, filter="box", costs="model"
    )
    seen = twin.render(settings).aovs["crypto_object"][:, :, 0]
    ids = np.array([_core.crypto_id(name) for name in names], np.uint32)
    return np.isin(np.ascontiguousarray(seen).view(np.uint32), ids)


def edges(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Returns a mask of the pixels that touch another mask from outside."""
    grown = mask.copy()
    for axis in (0, 1):
        for step in (1, -1):
            part = np.roll(mask, step, axis)
            part[(slice(None),) * axis + (0 if step == 1 else -1,)] = False
            grown |= part
    return grown & ~mask


class Outline(QObject):
    """Outline of the session's selection that is drawn over a view.

    Another thread computes the outline.
    """

    def __init__(self, session: Session, view: PictureView) -> None:
        super().__init__(view)
        self._session = session
        self._frame: Frame | None = None
        self._image: QImage | None = None
        self._worker = Worker("outline", self)
        self._worker.done.connect(self._take)
        session.selected.connect(lambda path: self._compute())

    @property
    def _view(self) -> PictureView:
        # The view is not stored in an attribute, because that would form a reference cycle.
        return cast("PictureView", self.parent())

    def close(self) -> None:
        """Ends the thread of the outline."""
        self._worker.close()

    @property
    def image(self) -> QImage | None:
        """The outline as an image with alpha; None if no selected prim is visible."""
        return self._image

    def follow(self, frame: Frame) -> None:
        """Updates the outline after a new frame was displayed."""
        known = self._frame
        self._frame = frame
        if known is None or (known.version, known.scale) != (frame.version, frame.scale):
            self._compute()

    def _compute(self) -> None:
        frame, renderer = self._frame, self._session.renderer
        path = (self._session.selection or "").partition("[")[0].rstrip("/")
        if not path or frame is None or renderer is None:
            self._worker.cancel()
            self._take(None, None)
            return
        scale = min(1.0, (MOST_PIXELS / (frame.width * frame.height)) ** 0.5)
        size = max(1, round(frame.width * scale)), max(1, round(frame.height * scale))
        self._worker.submit(partial(object_mask, renderer, path, *size))

    def _take(self, key: object, mask: NDArray[np.bool_] | None) -> None:
        self._image = None
        if mask is not None and mask.any():
            pixels = np.zeros((*mask.shape, 4), np.uint8)
            pixels[edges(mask)] = (*COLOUR, 255)
            high, wide = mask.shape
            image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGBA8888)
            self._image = image.copy()
        self._view.update()

    def paint(self, painter: QPainter) -> None:
        """Paints the outline over the picture."""
        if self._image is not None:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, True)
            painter.drawImage(self._view.picture_rect(), self._image)
