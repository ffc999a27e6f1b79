# SPDX-License-Identifier: Apache-2.0
"""How a camera moves: orbit, pan, dolly, frame. Pure functions of poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.camera_table import camera_defaults, camera_parameters
from wavecomb.picture.output import camera_window
from wavecomb.usd.cameras.framing import fit, fit_flat

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

UPS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Pose:
    """A camera as ``Renderer.edit(camera=...)`` takes it.

    Attributes:
        to_world: (4, 4), row vectors; looks along -z.
        window: x0, x1, y0, y1 on the plane z = -1; of an orthographic camera across its axis, of a
            latlong one in radians.
        others: The other ones of ``camera_parameters()``, where they are not the default.
        path: Camera prim that this is; None: a free camera.
    """

    to_world: Matrix
    window: tuple[float, float, float, float]
    others: Mapping[str, Any] = field(default_factory=dict)
    path: str | None = None

    def options(self) -> dict[str, Any]:
        """For ``Renderer.edit``."""
        here = {"transform": self.to_world, "window": self.window}
        return {**here, **camera_defaults(), **self.others}

    def value(self, name: str) -> Any:
        """A value of ``others``, or its default."""
        return self.others[name] if name in self.others else camera_parameters()[name].default

    def changed(self, **others: Any) -> Pose:
        """With other values of ``others``."""
        return replace(self, others={**self.others, **others})

    @property
    def projection(self) -> str:
        """Perspective, orthographic or latlong."""
        return str(self.value("projection"))

    def fitted(self, width: int, height: int) -> tuple[float, float, float, float]:
        """The window as a picture of this size shows it."""
        return camera_window(self.options(), width, height)

    def around(self, before: Sequence[float], now: Sequence[float]) -> Pose:
        """The same place in the world for a scene that is built around another origin."""
        if tuple(before) == tuple(now):
            return self
        to_world = self.to_world.copy()
        to_world[3, :3] += np.subtract(before, now)
        return replace(self, to_world=to_world)

    @property
    def position(self) -> Vector:
        """In the scene's space."""
        return self.to_world[3, :3]

    @property
    def right(self) -> Vector:
        """Unit vector."""
        return self.to_world[0, :3]

    @property
    def up(self) -> Vector:
        """Unit vector."""
        return self.to_world[1, :3]

    @property
    def back(self) -> Vector:
        """Unit vector, away from what is looked at."""
        return self.to_world[2, :3]

    def depth_of(self, point: Vector) -> float:
        """Distance of a point along the axis; negative behind."""
        return float((self.position - point) @ self.back)


def pose_of(to_world: Matrix, values: Mapping[str, Any], path: str | None) -> Pose:
    """The pose of a camera with these values of ``camera_parameters()``, and maybe others."""
    others = {name: values[name] for name in camera_defaults() if name in values}
    return Pose(to_world, tuple(values["window"]), others, path)


def pose_of_scene(camera: dict[str, Any], path: str | None) -> Pose:
    """The pose of ``Scene.camera``."""
    return pose_of(np.array(camera["to_world"], np.float64), camera, path)


STEEPEST = math.radians(89.9)
"""An orbit stops short of the poles, where the way up is lost."""
VIEWS = ("front", "back", "right", "left", "top", "bottom")


def orbit(pose: Pose, pivot: Vector, yaw: float, pitch: float, up_axis: str) -> Pose:
    """Turns about a point, the horizon stays level: a turntable.

    Args:
        pose: From.
        pivot: Stays where it is in the picture.
        yaw: Radians about the stage's up; above 0: the camera moves to its right.
        pitch: Radians about the camera's right; above 0: the camera rises.
        up_axis: "X", "Y" or "Z".
    """
    up = np.array(UPS[up_axis])
    elevation = math.asin(float(np.clip(pose.back @ up, -1.0, 1.0)))
    # A camera that is steeper than that already may only turn back.
    low, high = min(-STEEPEST, elevation), max(STEEPEST, elevation)
    pitch = min(max(elevation + pitch, low), high) - elevation
    turn = rotation(pose.right, -pitch) @ rotation(up, yaw)
    return _placed(pose, pose.to_world[:3, :3] @ turn, pivot + (pose.position - pivot) @ turn)


def pan(pose: Pose, depth: float, across: float, upwards: float, size: tuple[float, float]) -> Pose:
    """Shifts the camera so that what lies at ``depth`` moves along with the cursor.

    Args:
        pose: From.
        depth: Along the axis, above 0.
        across: Pixels that the cursor moved to the right.
        upwards: Pixels that it moved up.
        size: Of the picture in the same pixels.
    """
    x0, x1, y0, y1 = pose.fitted(*map(round, size))
    if pose.projection == "orthographic":
        depth = 1.0
    right = -across * depth * (x1 - x0) / size[0]
    up = -upwards * depth * (y1 - y0) / size[1]
    return _placed(pose, pose.to_world[:3, :3], pose.position + right * pose.right + up * pose.up)


def dolly(pose: Pose, pivot: Vector, factor: float) -> Pose:
    """Moves towards a point: the distance is multiplied by ``factor``, above 0.

    Nearer is no larger to an orthographic camera: its window is.
    """
    if pose.projection == "orthographic":
        return replace(_scaled(pose, factor), path=None)
    return _placed(pose, pose.to_world[:3, :3], pivot + (pose.position - pivot) * factor)


def frame(pose: Pose, points: Matrix, aspect: float) -> Pose:
    """Looks the same way, from where points fill the picture but for a margin.

    Args:
        pose: From.
        points: (n, 3), such as the corners of a box.
        aspect: Width / height of the picture.
    """
    return _framed(pose, pose.to_world[:3, :3], points, aspect)


def view(pose: Pose, name: str, points: Matrix, up_axis: str, aspect: float) -> Pose:
    """From a side, with points (n, 3) whole in the picture: a name of ``VIEWS``."""
    up = np.array(UPS[up_axis])
    # As `usd.camera.frame_points`: the front is +Z, or -Y where Z is up.
    front = np.array({"Z": (0.0, -1.0, 0.0)}.get(up_axis, (0.0, 0.0, 1.0)))
    right = np.cross(up, front)
    back, above = {
        "front": (front, up),
        "back": (-front, up),
        "right": (right, up),
        "left": (-right, up),
        "top": (up, -front),
        "bottom": (-up, front),
    }[name]
    return _framed(pose, np.stack([np.cross(above, back), above, back]), points, aspect)


def opposite(pose: Pose, pivot: Vector, up_axis: str) -> Pose:
    """From the other side of a point."""
    turn = rotation(np.array(UPS[up_axis]), math.pi)
    return _placed(pose, pose.to_world[:3, :3] @ turn, pivot + (pose.position - pivot) @ turn)


def _framed(pose: Pose, axes: Matrix, points: Matrix, aspect: float) -> Pose:
    low, high = points.min(axis=0), points.max(axis=0)
    centre = 0.5 * (low + high)
    if pose.projection == "latlong":  # all is in the picture: from the middle
        return _placed(pose, axes, centre)
    x0, x1, y0, y1 = pose.fitted(round(1000 * aspect), 1000)
    half = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    size = float(np.linalg.norm(high - low))
    if pose.projection == "orthographic":
        place, scale = fit_flat(points, axes, half)
        pose = _scaled(pose, scale)
        x0, x1, y0, y1 = (scale * edge for edge in (x0, x1, y0, y1))
        distance, depth = size or 1.0, 1.0
        place = place + distance * axes[2]
    else:
        place = fit(points, axes, half)
        distance = depth = float((place - centre) @ axes[2])
    # A window that is off the axis looks past the centre.
    shift = -0.5 * (x0 + x1) * depth * axes[0] - 0.5 * (y0 + y1) * depth * axes[1]
    framed = _placed(pose, axes, place + shift)
    near = min(framed.value("near_clip"), 1e-3 * distance)
    far = max(framed.value("far_clip"), distance + 2.0 * size)
    return framed.changed(near_clip=near, far_clip=far)


def _scaled(pose: Pose, factor: float) -> Pose:
    """With a window ``factor`` times as large about its own (0, 0)."""
    x0, x1, y0, y1 = (factor * edge for edge in pose.window)
    return replace(pose, window=(x0, x1, y0, y1))


def rotation(axis: Vector, angle: float) -> Matrix:
    """For row vectors, (3, 3), right-handed about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return turn.T


def _placed(pose: Pose, axes: Matrix, position: Vector) -> Pose:
    """A free camera with these axes (rows) made exactly orthonormal."""
    back = axes[2] / np.linalg.norm(axes[2])
    right = np.cross(axes[1], back)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = right, np.cross(back, right), back
    to_world[3, :3] = position
    return replace(pose, to_world=to_world, path=None)
