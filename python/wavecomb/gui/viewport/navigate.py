# SPDX-License-Identifier: Apache-2.0
"""Camera movements (orbit, pan, dolly, frame), as functions that return a new camera pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.core_table import camera_defaults, camera_parameters
from wavecomb.image.files.render_output import camera_window
from wavecomb.usd.cameras.framing import fit, fit_flat

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

UPS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Pose:
    """A camera pose, with the parameters that ``Renderer.edit(camera=...)`` accepts.

    Attributes:
        to_world: Camera-to-world matrix (4, 4) for row vectors. The camera looks along -z.
        window: Image window x0, x1, y0, y1. For a perspective camera, it lies on the plane z = -1;
            for an orthographic camera, across the axis; for a latlong camera, the values are angles
            in radians.
        others: Values of the other ``camera_parameters()`` that differ from their defaults.
        path: Path of the camera prim that has this pose; None for a free camera.
    """

    to_world: Matrix
    window: tuple[float, float, float, float]
    others: Mapping[str, Any] = field(default_factory=dict)
    path: str | None = None

    def options(self) -> dict[str, Any]:
        """Returns the arguments for ``Renderer.edit``."""
        here = {"transform": self.to_world, "window": self.window}
        return {**here, **camera_defaults(), **self.others}

    def value(self, name: str) -> Any:
        """Returns the value of a camera parameter from ``others``, or else its default."""
        return self.others[name] if name in self.others else camera_parameters()[name].default

    def changed(self, **others: Any) -> Pose:
        """Returns a copy of the pose with some camera parameters in ``others`` replaced."""
        return replace(self, others={**self.others, **others})

    @property
    def projection(self) -> str:
        """Projection of the camera: "perspective", "orthographic" or "latlong"."""
        return str(self.value("projection"))

    def fitted(self, width: int, height: int) -> tuple[float, float, float, float]:
        """Returns the image window for an image of the given size."""
        return camera_window(self.options(), width, height)

    def around(self, before: Sequence[float], now: Sequence[float]) -> Pose:
        """Converts the pose to a scene space with another origin.

        The world position does not change.
        """
        if tuple(before) == tuple(now):
            return self
        to_world = self.to_world.copy()
        to_world[3, :3] += np.subtract(before, now)
        return replace(self, to_world=to_world)

    @property
    def position(self) -> Vector:
        """Position of the camera in scene space."""
        return self.to_world[3, :3]

    @property
    def right(self) -> Vector:
        """Unit vector of the camera's x axis, to the right in the image."""
        return self.to_world[0, :3]

    @property
    def up(self) -> Vector:
        """Unit vector of the camera's y axis, upwards in the image."""
        return self.to_world[1, :3]

    @property
    def back(self) -> Vector:
        """Unit vector of the camera's z axis, opposite to the view direction."""
        return self.to_world[2, :3]

    def depth_of(self, point: Vector) -> float:
        """Returns the distance of a point along the view direction; negative behind the camera."""
        return float((self.position - point) @ self.back)


def pose_of(to_world: Matrix, values: Mapping[str, Any], path: str | None) -> Pose:
    """Returns the pose for a mapping with values of ``camera_parameters()``."""
    others = {name: values[name] for name in camera_defaults() if name in values}
    return Pose(to_world, tuple(values["window"]), others, path)


def pose_of_scene(camera: dict[str, Any], path: str | None) -> Pose:
    """Returns the pose of a scene's camera, ``Scene.camera``."""
    return pose_of(np.array(camera["to_world"], np.float64), camera, path)


STEEPEST = math.radians(89.9)
"""Largest elevation angle of an orbit, in radians. At the poles, the camera's up direction would be
undefined."""
VIEWS = ("front", "back", "right", "left", "top", "bottom")


def orbit(pose: Pose, pivot: Vector, yaw: float, pitch: float, up_axis: str) -> Pose:
    """Rotates the camera about a point like a turntable, with a level horizon.

    Args:
        pose: Initial pose.
        pivot: Centre of the orbit, which keeps its position in the image.
        yaw: Radians about the stage's up axis; positive moves the camera to its right.
        pitch: Radians about the camera's right; positive raises the camera.
        up_axis: "X", "Y" or "Z".
    """
    up = np.array(UPS[up_axis])
    elevation = math.asin(float(np.clip(pose.back @ up, -1.0, 1.0)))
    # If the camera is already steeper than `STEEPEST`, it can only rotate towards the horizon.
    low, high = min(-STEEPEST, elevation), max(STEEPEST, elevation)
    pitch = min(max(elevation + pitch, low), high) - elevation
    turn = rotation(pose.right, -pitch) @ rotation(up, yaw)
    return _placed(pose, pose.to_world[:3, :3] @ turn, pivot + (pose.position - pivot) @ turn)


def pan(pose: Pose, depth: float, across: float, upwards: float, size: tuple[float, float]) -> Pose:
    """Moves the camera so that scene points at ``depth`` follow the cursor.

    Args:
        pose: Initial pose.
        depth: Distance along the view direction, positive.
        across: Cursor movement to the right, in pixels.
        upwards: Cursor movement upwards, in pixels.
        size: Width and height of the image, in the same pixels.
    """
    x0, x1, y0, y1 = pose.fitted(*map(round, size))
    if pose.projection == "orthographic":
        depth = 1.0
    right = -across * depth * (x1 - x0) / size[0]
    up = -upwards * depth * (y1 - y0) / size[1]
    return _placed(pose, pose.to_world[:3, :3], pose.position + right * pose.right + up * pose.up)


def dolly(pose: Pose, pivot: Vector, factor: float) -> Pose:
    """Moves the camera so that its distance to a point is multiplied by ``factor`` > 0.

    For an orthographic camera, scales the image window instead of moving the camera.
    """
    if pose.projection == "orthographic":
        return replace(_scaled(pose, factor), path=None)
    return _placed(pose, pose.to_world[:3, :3], pivot + (pose.position - pivot) * factor)


def frame(pose: Pose, points: Matrix, aspect: float) -> Pose:
    """Moves the camera so that points fill the image up to a margin. Keeps the view direction.

    Args:
        pose: Initial pose.
        points: Points with shape (n, 3), such as the corners of a box.
        aspect: Width / height of the image.
    """
    return _framed(pose, pose.to_world[:3, :3], points, aspect)


def view(pose: Pose, name: str, points: Matrix, up_axis: str, aspect: float) -> Pose:
    """Views all points (n, 3) from a side, which is one of ``VIEWS``."""
    up = np.array(UPS[up_axis])
    # As in `usd.camera.frame_points`, the front is +Z, or -Y if Z is up.
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
    """Rotates the camera by half a turn about the vertical axis through a point."""
    turn = rotation(np.array(UPS[up_axis]), math.pi)
    return _placed(pose, pose.to_world[:3, :3] @ turn, pivot + (pose.position - pivot) @ turn)


def _framed(pose: Pose, axes: Matrix, points: Matrix, aspect: float) -> Pose:
    low, high = points.min(axis=0), points.max(axis=0)
    centre = 0.5 * (low + high)
    if pose.projection == "latlong":  # a latlong camera at the centre of the bounds sees all points
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
    # If the camera window is off-axis, its centre is not on the viewing axis, so shift the camera
    # sideways.
    shift = -0.5 * (x0 + x1) * depth * axes[0] - 0.5 * (y0 + y1) * depth * axes[1]
    framed = _placed(pose, axes, place + shift)
    near = min(framed.value("near_clip"), 1e-3 * distance)
    far = max(framed.value("far_clip"), distance + 2.0 * size)
    return framed.changed(near_clip=near, far_clip=far)


def _scaled(pose: Pose, factor: float) -> Pose:
    """Returns the pose with its image window scaled about (0, 0)."""
    x0, x1, y0, y1 = (factor * edge for edge in pose.window)
    return replace(pose, window=(x0, x1, y0, y1))


def rotation(axis: Vector, angle: float) -> Matrix:
    """Returns the rotation (3, 3) about a unit vector, for row vectors, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return turn.T


def _placed(pose: Pose, axes: Matrix, position: Vector) -> Pose:
    """Returns a free camera with these axes as matrix rows, after making them orthonormal."""
    back = axes[2] / np.linalg.norm(axes[2])
    right = np.cross(axes[1], back)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = right, np.cross(back, right), back
    to_world[3, :3] = position
    return replace(pose, to_world=to_world, path=None)


def project(pose: Pose, points: Matrix, size: tuple[int, int]) -> Matrix | None:
    """Returns pixel positions (n, 2) of points (n, 3), or None if any point is behind the camera.

    Args:
        pose: Pose of the camera, which must not be a latlong camera.
        points: Points in scene space, with shape (n, 3).
        size: Width and height of the image.
    """
    local = (np.asarray(points, float) - pose.position) @ pose.to_world[:3, :3].T
    depth = -local[:, 2]
    if pose.projection == "latlong" or (depth <= 1e-6).any():
        return None
    if pose.projection == "orthographic":
        depth = np.ones_like(depth)
    x0, x1, y0, y1 = pose.fitted(*size)
    across, up = local[:, 0] / depth, local[:, 1] / depth
    return np.stack([(across - x0) / (x1 - x0) * size[0], (y1 - up) / (y1 - y0) * size[1]], axis=1)
