# SPDX-License-Identifier: Apache-2.0
"""Handles over the viewport's image that move, rotate and scale the selected light or object."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom
from PySide6.QtCore import QObject, QPointF, QRectF, QSizeF, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from wavecomb.gui.scene.transforms import Placement, moves_alone
from wavecomb.gui.viewport.navigate import project, rotation
from wavecomb.usd.cameras.framing import corners

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits
    from wavecomb.gui.viewport.frames import Frame
    from wavecomb.gui.viewport.picture_view import PictureView
    from wavecomb.gui.viewport.session import Session

Array = NDArray[np.float64]
MOVE, ROTATE, SCALE = "move", "rotate", "scale"
LENGTH = 80.0
"""Length of a handle in device-independent pixels."""
REACH = 8.0
"""Largest distance between mouse and handle at which a click hits the handle, in device-independent
pixels."""
_COLOURS = {"x": "#e8594f", "y": "#7ac74f", "z": "#5b9bf0", "all": "#e0e0e0"}
_ACTIVE = "#ffd24a"
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1]


@dataclass(frozen=True)
class Anchor:
    """The selected prim at the start of a drag, in scene space.

    Attributes:
        pivot: Point (3,) that stays fixed during rotation and scaling.
        axes: Directions (3, 3) of the handles, one per row.
        bounds: Corners (2, 3) of the prim's bounding box, or None for a light without a size.
        placement: Transform of the prim on the stage at the start of the drag.
        live: Whether the render is updated during the drag, not only at its end.
    """

    pivot: Array
    axes: Array
    bounds: Array | None
    placement: Placement
    live: bool


class Gizmo(QObject):
    """Gizmo of the viewport, whose handles edit the transform of the selected prim.

    Signals:
        mode_changed(str): New mode, "move", "rotate" or "scale", or "" if the handles are hidden.
    """

    mode_changed = Signal(str)

    def __init__(self, view: PictureView, session: Session, edits: SceneEdits) -> None:
        super().__init__(view)
        self._session, self._edits = session, edits
        self.mode = ""
        self._anchor: Anchor | None = None
        self._handle = ""
        self._start = QPointF()
        self._change = np.eye(4)
        self._is_late = False  # Whether the rendered scene may lack an edit.
        for told in (self._session.selected, self._session.opened):
            told.connect(lambda *_: self._refresh())
        edits.changed.connect(self._on_changed)
        self._session.frame.connect(self._on_frame)

    @property
    def _view(self) -> PictureView:
        # The view is not stored in an attribute, because that would form a reference cycle.
        return cast("PictureView", self.parent())

    def set_mode(self, mode: str) -> None:
        """Shows the handles of a mode. If that mode is already active, hides the handles."""
        self.mode = "" if mode == self.mode else mode
        self.mode_changed.emit(self.mode)
        self._refresh()

    def _refresh(self) -> None:
        if not self._handle:
            self._anchor = self._find() if self.mode else None
            self._change = np.eye(4)
            self._view.update()

    def _on_changed(self) -> None:
        """Moves a light's handles at once, but an object's handles only with the next frame."""
        self._is_late = True
        if self._anchor is None or self._anchor.bounds is None:
            self._refresh()

    def _on_frame(self, frame: Frame) -> None:
        if self._is_late and frame.version == self._session.version:
            self._is_late = False
            self._refresh()

    def _find(self) -> Anchor | None:
        path = (self._session.selection or "").partition("[")[0].rstrip("/")
        stage, placement = self._session.stage, self._edits.placement(path)
        if stage is None or placement is None:
            return None
        prim = self._edits.prim(path)
        world = np.array(UsdGeom.XformCache(self._edits.time).GetLocalToWorldTransform(prim))
        pivot, bounds = world[3, :3] - stage.origin, None
        axes = np.eye(3)
        if not moves_alone(prim, self._edits.time):
            bounds = self._session.selected_bounds()
            pivot = pivot if bounds is None else bounds.mean(axis=0)
        if self.mode == SCALE:
            sizes = np.linalg.norm(world[:3, :3], axis=1, keepdims=True)
            axes = world[:3, :3] / np.maximum(sizes, 1e-12)
        return Anchor(pivot, axes, bounds, placement, self._edits.can_follow(prim.GetPath()))

    # ---- places of the handles -----------------------------------------------------------------

    def _pixels(self, points: Array) -> Array | None:
        """Returns widget positions (n, 2) of scene points (n, 3)."""
        pose, setup = self._session.pose, self._session.setup
        if pose is None:
            return None
        found = project(pose, points, (setup.width, setup.height))
        if found is None:
            return None
        places = [self._view.from_picture(QPointF(*point)) for point in found]
        return np.array([(place.x(), place.y()) for place in places])

    def _reach(self, anchor: Anchor) -> float:
        """Returns the length of a handle in scene units; 0 if the pivot is behind the camera."""
        pose = self._session.pose
        if pose is None:
            return 0.0
        ends = self._pixels(np.stack([anchor.pivot, anchor.pivot + pose.right]))
        return 0.0 if ends is None else LENGTH / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)

    def handles(self) -> dict[str, Array]:
        """Returns the handles by name. Each handle is a polyline (n, 2) in widget coordinates."""
        anchor = self._anchor
        if anchor is None or not self.mode or (length := self._reach(anchor)) == 0.0:
            return {}
        pivot = anchor.pivot @ self._change[:3, :3] + self._change[3, :3]
        lines = {}
        angles = np.linspace(0.0, 2.0 * np.pi, 49)
        for k, name in enumerate("xyz"):
            u, v = anchor.axes[k - 2], anchor.axes[k - 1]
            ring = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v
            rod = np.linspace(0.15, 1.0, 2)[:, None] * anchor.axes[k]
            lines[name] = pivot + length * (ring if self.mode == ROTATE else rod)
        if self.mode != ROTATE:
            lines["all"] = pivot[None, :]
        pixels = {name: self._pixels(points) for name, points in lines.items()}
        return {name: one for name, one in pixels.items() if one is not None}

    def _hit(self, place: QPointF) -> str:
        """Returns the name of the handle at a point of the widget, or ""."""
        at = np.array([place.x(), place.y()])
        near = {name: _distance(at, line) for name, line in self.handles().items()}
        name = min(near, key=lambda one: near[one], default="")
        return name if name and near[name] <= REACH else ""

    # ---- drags ---------------------------------------------------------------------------------

    def press(self, place: QPointF) -> bool:
        """Starts a drag if a handle is at a point of the widget.

        Returns whether a drag was started.
        """
        self._handle = self._hit(place)
        self._start, self._change = place, np.eye(4)
        if self._handle and self._anchor is not None and self._anchor.live:
            self._edits.history.set_typing(True)  # the whole drag becomes one undo step
            self._edits.dragging = True
        return bool(self._handle)

    def drag(self, place: QPointF) -> None:
        """Continues a drag.

        If possible, the render follows at once, otherwise at the end of the drag.
        """
        anchor = self._anchor
        if anchor is None:
            return
        self._change = self._changed(anchor, place)
        if anchor.live and self._edits.can_follow(anchor.placement.path):
            self._author(anchor)
        self._view.update()

    def release(self) -> None:
        """Ends a drag."""
        handle, self._handle = self._handle, ""
        if self._anchor is not None and handle:
            if not np.array_equal(self._change, np.eye(4)):
                self._author(self._anchor)
            if self._anchor.live:
                self._edits.history.set_typing(False)
        self._edits.dragging = False
        self._session.settle()
        if not self._is_late:
            self._refresh()

    def _author(self, anchor: Anchor) -> None:
        stage = self._session.stage
        if stage is None:
            return
        origin = np.eye(4)
        origin[3, :3] = stage.origin
        change = np.linalg.inv(origin) @ self._change @ origin
        self._edits.move(anchor.placement, Gf.Matrix4d(change.tolist()))

    def _changed(self, anchor: Anchor, place: QPointF) -> Array:
        """Returns the transform (4, 4) of a drag to a point, in scene space for row vectors."""
        out, length, pose = np.eye(4), self._reach(anchor), self._session.pose
        centre = self._pixels(anchor.pivot[None, :])
        if pose is None or centre is None:
            return out
        k, by = "xyz".find(self._handle), place - self._start
        if self.mode == ROTATE:
            axis = anchor.axes[k]
            ends = [math.atan2(centre[0, 1] - at.y(), at.x() - centre[0, 0])
                    for at in (self._start, place)]  # fmt: skip
            towards = 1.0 if axis @ (pose.position - anchor.pivot) >= 0.0 else -1.0
            out[:3, :3] = rotation(axis, towards * (ends[1] - ends[0]))
        elif k < 0 and self.mode == MOVE:
            across = by.x() * pose.right - by.y() * pose.up
            out[3, :3] = length / LENGTH * across
            return out
        elif k < 0:
            out[:3, :3] *= 1.01 ** (by.x() - by.y())
        else:
            rod = self._pixels(anchor.pivot + np.array([[0.0], [length]]) * anchor.axes[k])
            if rod is None:
                return out
            rod = rod[1] - rod[0]
            amount = float(np.array([by.x(), by.y()]) @ rod) / max(float(rod @ rod), 100.0)
            if self.mode == MOVE:
                out[3, :3] = length * amount * anchor.axes[k]
                return out
            factors = np.ones(3)
            factors[k] = max(1.0 + amount, 0.01)
            out[:3, :3] = np.linalg.inv(anchor.axes) @ np.diag(factors) @ anchor.axes
        out[3, :3] = anchor.pivot - anchor.pivot @ out[:3, :3]
        return out

    # ---- painting ------------------------------------------------------------------------------

    def paint(self, painter: QPainter) -> None:
        """Paints the handles, and the bounding box of an object that is dragged."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, True)
        anchor = self._anchor
        if self._handle and anchor is not None and anchor.bounds is not None:
            box = corners(anchor.bounds) @ self._change[:3, :3] + self._change[3, :3]
            if (ends := self._pixels(box)) is not None:
                painter.setPen(QPen(QColor(_ACTIVE), 1.0, Qt.PenStyle.DashLine))
                for a, b in _EDGES:
                    painter.drawLine(QPointF(*ends[a]), QPointF(*ends[b]))
        for name, line in self.handles().items():
            colour = QColor(_ACTIVE if name == self._handle else _COLOURS[name])
            points = [QPointF(*point) for point in line]
            for pen in (QPen(QColor(0, 0, 0, 150), 4.0), QPen(colour, 2.0)):
                painter.setPen(pen)
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.drawPolyline(QPolygonF(points))
            if self.mode != ROTATE:
                painter.setBrush(colour)
                size = 5.0
                if self.mode == MOVE:
                    painter.drawEllipse(points[-1], size, size)
                else:
                    corner = points[-1] - QPointF(size, size)
                    painter.drawRect(QRectF(corner, QSizeF(2 * size, 2 * size)))


def _distance(at: Array, line: Array) -> float:
    """Returns the distance of a point to a polyline (n, 2)."""
    if len(line) == 1:
        return float(np.linalg.norm(line[0] - at))
    start, along = line[:-1], np.diff(line, axis=0)
    t = ((at - start) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-12)
    nearest = start + np.clip(t, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(nearest - at, axis=1).min())
