# SPDX-License-Identifier: Apache-2.0
"""Viewport: shows the live image, and controls the camera by mouse and keyboard."""

from __future__ import annotations

from functools import partial

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPen,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from wavecomb.gui import theme
from wavecomb.gui.swatch import to_qimage
from wavecomb.gui.viewport import navigate
from wavecomb.gui.viewport.display import Developed, Look, develop_frame
from wavecomb.gui.viewport.drags import Control, Drag, Left, Shift, drag_of
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.gizmo import Gizmo
from wavecomb.gui.viewport.navigate import Pose, Vector
from wavecomb.gui.viewport.outline import Outline
from wavecomb.gui.viewport.picture_view import PictureView
from wavecomb.gui.viewport.session import Session
from wavecomb.gui.worker import Worker
from wavecomb.usd.cameras.framing import corners

ORBIT_RADIANS = 0.008
"""Rotation in radians per device-independent pixel; 400 pixels are about half a turn."""
DOLLY_STEP = 0.88
"""Factor by which one notch of the mouse wheel multiplies the distance to the pivot."""
ZOOM_STEP = 1.25
KEY_RADIANS = np.radians(15.0)
CLICK_PIXELS = 4

EMPTY = (
    "Open a stage: Ctrl+O, or drop a USD file here\n\n"
    "wavecomb scene cornell -o cornell.usda   writes an example"
)


class Viewport(PictureView):
    """View that shows a session's frames and moves its camera.

    Attributes:
        look: Display settings.
        frame_shown: The displayed frame, or None.
        marked: Outline that is drawn around the selected prims.
        gizmo: Handles that edit the selected prim, or None if there is no scene panel.

    Signals:
        hovered(object): The mouse moved. The argument is the pixel (x, y) under the mouse, or None.
        picked(object): The user clicked a pixel. The argument is the pixel's position (x, y).
        shown(Frame, Look): A new frame or new display settings are displayed.
        failed(str): An error occurred. The argument is a message of one line.
        region_mode_changed(bool): Whether the next drag chooses the render region.
    """

    hovered = Signal(object)
    picked = Signal(object)
    shown = Signal(object, object)
    failed = Signal(str)
    region_mode_changed = Signal(bool)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("viewport")
        self.setAccessibleName("Viewport")
        self.setAccessibleDescription("The live picture; arrow keys orbit, Shift+arrows pan")
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.session = session
        self.frame_shown: Frame | None = None
        self._frame: Frame | None = None
        self.set_look(Look())
        self._drag = Drag.NONE
        self._last = QPointF()
        self._pressed = QPointF()
        self._pivot: Vector | None = None
        self._region_mode = False
        self._region_from: QPointF | None = None
        self._message = EMPTY
        self.marked = Outline(session, self)
        self.gizmo: Gizmo | None = None
        self._developer = Worker("develop", self)
        self._developer.done.connect(self._developed)
        self._developer.failed.connect(self._tell_failed)
        session.frame.connect(self._take)
        session.opened.connect(lambda stage: self._forget_pivot())
        theme.on_change(self.update)

    def close_threads(self) -> None:
        """Ends the viewport's threads before the window is destroyed."""
        self._developer.close()
        self.marked.close()

    def set_look(self, look: Look) -> None:
        """Sets the display settings: layer, exposure and tone mapping."""
        self.look = look
        self.session.beauty_only = look.layer in ("beauty", "denoised")
        if self._frame is not None:
            self._take(self._frame)

    def set_message(self, message: str = EMPTY) -> None:
        """Sets the text that is shown while there is no image."""
        self._message = message
        self.update()

    def _take(self, frame: Frame) -> None:
        self._frame = frame
        self._developer.submit(partial(develop_frame, frame, self.look))

    def _developed(self, key: object, found: Developed) -> None:
        frame, shown = found.frame, found.shown
        if frame.version < self.session.oldest:
            return
        self.frame_shown = frame
        size = frame.setup.width, frame.setup.height
        self.set_picture(to_qimage(shown.pixels), QSize(*size), shown.legend)
        self.marked.follow(frame)
        self.shown.emit(frame, found.look)

    def _tell_failed(self, key: object, line: str) -> None:
        self.failed.emit(line)

    # ---- the camera ----------------------------------------------------------------------------

    def _forget_pivot(self) -> None:
        self._pivot = None

    def pivot(self) -> Vector:
        """Returns the point that the camera orbits.

        The pivot is the scene point last used under the cursor, or the scene's centre.
        """
        if self._pivot is None:
            bounds = self.bounds()
            self._pivot = 0.5 * (bounds[0] + bounds[1])
        return self._pivot

    def bounds(self) -> np.ndarray:
        """Returns the bounding box of the scene, with shape (2, 3)."""
        scene = self.session.scene
        bounds = np.array(scene.bounds if scene is not None else [[-1.0] * 3, [1.0] * 3], float)
        if not np.isfinite(bounds).all() or (bounds[1] < bounds[0]).any():
            return np.array([[-1.0] * 3, [1.0] * 3])
        return bounds

    def outline(self) -> np.ndarray:
        """Returns points (n, 3) that enclose the scene.

        The points are the scene's outline or, without an outline, the corners of its bounding box.
        """
        stage = self.session.stage
        if stage is not None and stage.outline is not None:
            return stage.outline
        return corners(self.bounds())

    def aspect(self) -> float:
        """Returns width / height of the image."""
        return self.session.setup.width / self.session.setup.height

    def _aim(self, place: QPointF) -> None:
        """Makes the scene point under the cursor the pivot of later camera movements."""
        at = self.to_picture(place)
        hit = self.session.pick(at.x(), at.y())
        if hit is not None and hit.get("position") is not None:
            self._pivot = np.array(hit["position"], float)

    def _pose(self) -> Pose | None:
        return self.session.pose

    def orbit(self, yaw: float, pitch: float, *, moving: bool = False) -> None:
        """Orbits the camera about the pivot by angles in radians."""
        if (pose := self._pose()) is not None:
            up = self.session.up_axis
            moved = navigate.orbit(pose, self.pivot(), yaw, pitch, up)
            self.session.set_camera(moved, moving=moving)

    def pan(self, across: float, upwards: float, *, moving: bool = False) -> None:
        """Pans the camera by a distance in device-independent pixels."""
        if (pose := self._pose()) is not None:
            depth = pose.depth_of(self.pivot())
            if depth <= 0.0:
                depth = float(np.linalg.norm(pose.position - self.pivot())) or 1.0
            rect = self.picture_rect()
            size = rect.width(), rect.height()
            moved = navigate.pan(pose, depth, across, upwards, size)
            self.session.set_camera(moved, moving=moving)

    def dolly(self, factor: float, *, moving: bool = False) -> None:
        """Moves the camera so that its distance to the pivot is multiplied by a factor."""
        if (pose := self._pose()) is not None:
            self.session.set_camera(navigate.dolly(pose, self.pivot(), factor), moving=moving)

    def frame_all(self) -> None:
        """Moves the camera so that the whole scene is in the image."""
        self._frame_points(self.outline())

    def frame_selected(self) -> None:
        """Moves the camera so that the selected prim (or the whole scene) is visible."""
        bounds = self.session.selected_bounds()
        self._frame_points(self.outline() if bounds is None else corners(bounds))

    def _frame_points(self, points: np.ndarray) -> None:
        if (pose := self._pose()) is not None:
            self._pivot = 0.5 * (points.min(axis=0) + points.max(axis=0))
            self.session.set_camera(navigate.frame(pose, points, self.aspect()))

    def view_from(self, name: str) -> None:
        """Views the scene from a side: "front", "back", "right", "left", "top" or "bottom"."""
        if (pose := self._pose()) is not None:
            points = self.outline()
            self._pivot = 0.5 * (points.min(axis=0) + points.max(axis=0))
            up = self.session.up_axis
            self.session.set_camera(navigate.view(pose, name, points, up, self.aspect()))

    def view_opposite(self) -> None:
        """Moves the camera to the opposite side of the pivot."""
        if (pose := self._pose()) is not None:
            up = self.session.up_axis
            self.session.set_camera(navigate.opposite(pose, self.pivot(), up))

    # ---- the region ----------------------------------------------------------------------------

    def set_region_mode(self, on: bool) -> None:
        """Sets whether the next drag with the left button chooses the render region."""
        if on == self._region_mode:
            return
        self._region_mode = on
        self._region_from = None
        self.setCursor(Qt.CursorShape.CrossCursor if on else Qt.CursorShape.ArrowCursor)
        self.region_mode_changed.emit(on)
        self.update()

    def _region_of(self, end: QPointF) -> tuple[int, int, int, int] | None:
        assert self._region_from is not None
        a, b = self.to_picture(self._region_from), self.to_picture(end)
        setup = self.session.setup
        x0, x1 = sorted((a.x(), b.x()))
        y0, y1 = sorted((a.y(), b.y()))
        left, right = max(0, int(np.floor(x0))), min(setup.width, int(np.ceil(x1)))
        top, bottom = max(0, int(np.floor(y0))), min(setup.height, int(np.ceil(y1)))
        if right - left < 2 or bottom - top < 2:
            return None
        return left, top, right, bottom

    def clear_region(self) -> None:
        """Removes the render region, so that the whole image is rendered."""
        self.set_region_mode(False)
        if self.session.setup.region is not None:
            self.session.change(region=None)

    # ---- events --------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Starts a drag."""
        if self._drag is not Drag.NONE:
            return
        place = event.position()
        drag = drag_of(event.button(), event.modifiers())
        if self._region_mode and event.button() == Left:
            drag, self._region_from = Drag.REGION, place
        elif drag is Drag.PICK and self.gizmo is not None and self.gizmo.press(place):
            drag = Drag.GIZMO
        self._drag, self._last, self._pressed = drag, place, place
        if drag in (Drag.ORBIT, Drag.PAN, Drag.DOLLY):
            self._aim(place)
        event.accept()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Continues a drag, or reports the pixel under the cursor."""
        place = event.position()
        by = place - self._last
        self._last = place
        if self._drag is Drag.ORBIT:
            self.orbit(-by.x() * ORBIT_RADIANS, by.y() * ORBIT_RADIANS, moving=True)
        elif self._drag is Drag.PAN:
            self.pan(by.x(), -by.y(), moving=True)
        elif self._drag is Drag.DOLLY:
            self.dolly(1.01 ** (by.y() - by.x()), moving=True)
        elif self._drag is Drag.SHIFT:
            self.shift(by)
        elif self._drag is Drag.REGION:
            self.update()
        elif self._drag is Drag.GIZMO and self.gizmo is not None:
            self.gizmo.drag(place)
        self.hovered.emit(self._pixel(place))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Ends a mouse drag."""
        drag, self._drag = self._drag, Drag.NONE
        place = event.position()
        if drag in (Drag.ORBIT, Drag.PAN, Drag.DOLLY):
            self.session.settle()
        elif drag is Drag.GIZMO and self.gizmo is not None:
            self.gizmo.release()
        elif drag is Drag.REGION:
            region = self._region_of(place)
            self.set_region_mode(False)
            if region is not None:
                self.session.change(region=region)
        elif drag is Drag.PICK and (place - self._pressed).manhattanLength() <= CLICK_PIXELS:
            self._click(place)
        event.accept()

    def _click(self, place: QPointF) -> None:
        at = self.to_picture(place)
        hit = self.session.pick(at.x(), at.y())
        self.session.select(hit.get("object") if hit is not None else None)
        if pixel := self._pixel(place):
            self.picked.emit(pixel)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Dollies towards the point under the cursor. With Ctrl, zooms the image instead."""
        notches = event.angleDelta().y() / 120.0
        if notches:
            if event.modifiers() & Control:
                self.set_zoom(self.zoom() * ZOOM_STEP**notches, event.position())
            else:
                self._aim(event.position())
                self.dolly(DOLLY_STEP**notches, moving=True)
        event.accept()

    def leaveEvent(self, event: object) -> None:
        """Reports that the cursor is over no pixel."""
        self.hovered.emit(None)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Orbits or pans by arrow keys, dollies by page keys, and leaves region mode by Escape."""
        key, shift = event.key(), bool(event.modifiers() & Shift)
        step = float(KEY_RADIANS)
        ways = {
            Qt.Key.Key_Left: (-1, 0),
            Qt.Key.Key_Right: (1, 0),
            Qt.Key.Key_Up: (0, 1),
            Qt.Key.Key_Down: (0, -1),
        }
        if key in ways:
            x, y = ways[Qt.Key(key)]
            if shift:
                self.pan(-x * self.width() / 10, -y * self.width() / 10)
            else:
                self.orbit(x * step, y * step)
        elif key == Qt.Key.Key_PageUp:
            self.dolly(DOLLY_STEP)
        elif key == Qt.Key.Key_PageDown:
            self.dolly(1.0 / DOLLY_STEP)
        elif key == Qt.Key.Key_Escape and self._region_mode:
            self._drag = Drag.NONE
            self.set_region_mode(False)
        else:
            super().keyPressEvent(event)

    def _pixel(self, place: QPointF) -> tuple[int, int] | None:
        at = self.to_picture(place)
        x, y = int(np.floor(at.x())), int(np.floor(at.y()))
        setup = self.session.setup
        return (x, y) if 0 <= x < setup.width and 0 <= y < setup.height else None

    # ---- painting ------------------------------------------------------------------------------

    def paint_over(self, painter: QPainter) -> None:
        """Paints outline, gizmo and region over the image, or a message if there is no image."""
        if self.image() is None:
            painter.setPen(QColor("#d8d8d8"))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, self._message)
            return
        self.marked.paint(painter)
        if self.gizmo is not None:
            self.gizmo.paint(painter)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        if self._region_mode and self._drag is Drag.REGION and self._region_from is not None:
            self._paint_box(painter, QRectF(self._region_from, self._last).normalized(), True)
        region = self.session.setup.region
        if region is not None:
            x0, y0, x1, y1 = region
            corners = self.from_picture(QPointF(x0, y0)), self.from_picture(QPointF(x1, y1))
            self._paint_box(painter, QRectF(*corners), False)

    def _paint_box(self, painter: QPainter, box: QRectF, filled: bool) -> None:
        painter.setBrush(QColor(255, 255, 255, 30) if filled else Qt.BrushStyle.NoBrush)
        for colour, style in (
            (QColor(0, 0, 0, 200), Qt.PenStyle.SolidLine),
            (QColor("#ff9a3c"), Qt.PenStyle.DashLine),
        ):
            pen = QPen(colour, 1.0, style)
            pen.setCosmetic(True)
            painter.setPen(pen)
            painter.drawRect(box)

    def sizeHint(self) -> QSize:
        """Returns the preferred size of the viewport."""
        return QSize(theme.em(50), theme.em(34))
