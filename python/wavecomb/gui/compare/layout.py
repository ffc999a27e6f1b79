# SPDX-License-Identifier: Apache-2.0
"""Layout of the compare view: its panes, and the zoom and pan that apply to all panes."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSizeF

SIDE, WIPE, FLIP, DIFFERENCE, THREE = "side", "wipe", "flip", "difference", "three"
MODES = {
    SIDE: "Side by side",
    WIPE: "Wipe",
    FLIP: "Flip",
    DIFFERENCE: "Difference",
    THREE: "A, B and difference",
}
A, B, D = "A", "B", "D"
MOST_ZOOM = 64.0


class Layout:
    """Geometry of the panes, in device-independent points of the widget.

    Attributes:
        mode: View mode, one of ``MODES``.
        shown: Image that the flip view shows, "A" or "B".
        area: Area of the widget that the panes fill.
        size: Size of image A in pixels, or the size of image B if there is no A; None if there is
            no image.
        gap: Gap between panes.
        bar: Height of the free area below the difference map, where the colour bar is drawn.
        zoom: Zoom in points per pixel; None fits the whole image into the pane.
        centre: Point of the image in the middle of a pane, as a fraction of the image size.
    """

    def __init__(self) -> None:
        self.mode = SIDE
        self.shown = A
        self.area = QRectF(0, 0, 1, 1)
        self.size: QSizeF | None = None
        self.gap = 0.0
        self.bar = 0.0
        self.zoom: float | None = None
        self.centre = QPointF(0.5, 0.5)

    def panes(self) -> list[tuple[str, QRectF]]:
        """Returns the content of each pane ("A", "B" or "D") and the pane's rectangle."""
        which = {SIDE: (A, B), WIPE: (A,), FLIP: (self.shown,), DIFFERENCE: (D,), THREE: (A, B, D)}
        kinds = which[self.mode]
        gap = self.gap if len(kinds) > 1 else 0.0
        width = (self.area.width() - gap * (len(kinds) - 1)) / len(kinds)
        height = max(self.area.height() - (self.bar if D in kinds else 0.0), 1.0)
        return [(k, QRectF(i * (width + gap), 0, width, height)) for i, k in enumerate(kinds)]

    def pane_at(self, at: QPointF) -> QRectF:
        """Returns the pane at a point of the widget; outside all panes, the first pane."""
        panes = [rect for _, rect in self.panes()]
        return next((rect for rect in panes if rect.contains(at)), panes[0])

    def points_per_pixel(self) -> float:
        """Returns the current zoom in points per pixel."""
        if self.zoom is not None or self.size is None:
            return self.zoom or 1.0
        pane = self.panes()[0][1]
        return min(pane.width() / self.size.width(), pane.height() / self.size.height())

    def target(self, pane: QRectF, size: QSizeF | None = None) -> QRectF:
        """Returns the rectangle that the whole image covers in a pane.

        An image whose size differs from image A is aligned with A's top left corner.
        """
        reference = self.size or size or QSizeF(1, 1)
        scale = self.points_per_pixel()
        width, height = reference.width() * scale, reference.height() * scale
        corner = pane.center() - QPointF(self.centre.x() * width, self.centre.y() * height)
        own = size or reference
        return QRectF(corner, QSizeF(own.width() * scale, own.height() * scale))

    def share(self, at: QPointF, pane: QRectF) -> QPointF:
        """Converts a point of the widget to a fraction of the image in its pane."""
        target = self.target(pane)
        offset = at - target.topLeft()
        return QPointF(offset.x() / target.width(), offset.y() / target.height())

    def pixel_at(self, at: QPointF) -> tuple[int, int] | None:
        """Returns the column and row of the pixel at a point of the widget, or None."""
        if self.size is None:
            return None
        share = self.share(at, self.pane_at(at))
        if not (0.0 <= share.x() < 1.0 and 0.0 <= share.y() < 1.0):
            return None
        return int(share.x() * self.size.width()), int(share.y() * self.size.height())

    def fit(self) -> None:
        """Sets the zoom so that the whole image fits into the pane."""
        self.zoom, self.centre = None, QPointF(0.5, 0.5)

    def set_zoom(self, zoom: float, at: QPointF | None = None) -> None:
        """Sets the zoom in points per pixel, keeping the image point at ``at`` fixed."""
        pane = self.pane_at(at) if at is not None else None
        before = self.share(at, pane) if at is not None and pane is not None else None
        self.zoom = min(max(zoom, 1.0 / MOST_ZOOM), MOST_ZOOM)
        if before is not None and at is not None and pane is not None:
            self._centre(self.centre + before - self.share(at, pane))

    def pan(self, dx: float, dy: float) -> None:
        """Pans the image by a distance in points of the screen."""
        if self.size is not None:
            scale = self.zoom = self.points_per_pixel()
            step = QPointF(dx / (self.size.width() * scale), dy / (self.size.height() * scale))
            self._centre(self.centre - step)

    def _centre(self, centre: QPointF) -> None:
        self.centre = QPointF(min(max(centre.x(), 0.0), 1.0), min(max(centre.y(), 0.0), 1.0))
