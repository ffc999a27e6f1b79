# SPDX-License-Identifier: Apache-2.0
"""Camera poses and how they move: pure functions of NumPy arrays.

Transforms are in USD's row-vector convention: rows are right, up, back and position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.picture.output import camera_window

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
        lens_radius: 0: all is sharp.
        focus_distance: Along the axis.
        near_clip: Along the axis.
        far_clip: Along the axis.
        projection: perspective, orthographic or latlong.
        conform: What gives way where the shapes of window and picture differ.
        pixel_aspect: Width of a pixel / its height.
        clip_planes: Further ones, (a, b, c, d) in the camera's space.
        exposure: What light is multiplied by.
        path: Camera prim that this is; None: a free camera.
    """

    to_world: Matrix
    window: tuple[float, float, float, float]
    lens_radius: float = 0.0
    focus_distance: float = 1.0
    near_clip: float = 0.0
    far_clip: float = 1e30
    projection: str = "perspective"
    conform: str = "expandAperture"
    pixel_aspect: float = 1.0
    clip_planes: tuple[tuple[float, ...], ...] = ()
    exposure: float = 1.0
    path: str | None = None

    def options(self) -> dict[str, Any]:
        """For ``Renderer.edit``."""
        return {
            "transform": self.to_world,
            "window": self.window,
            "lens_radius": self.lens_radius,
            "focus_distance": self.focus_distance,
            "near_clip": self.near_clip,
            "far_clip": self.far_clip,
            "projection": self.projection,
            "conform": self.conform,
            "pixel_aspect": self.pixel_aspect,
            "clip_planes": [list(plane) for plane in self.clip_planes],
            "exposure": self.exposure,
        }

    def fitted(self, width: int, height: int) -> tuple[float, float, float, float]:
        """The window as a picture of this size shows it."""
        return camera_window(self.options(), width, height)

    @property
    def position(self) -> Vector:
        """In world space."""
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


def pose_of_scene(camera: dict[str, Any], path: str | None) -> Pose:
    """The pose of ``Scene.camera``."""
    return Pose(
        np.array(camera["to_world"], np.float64),
        tuple(camera["window"]),
        camera.get("lens_radius", 0.0),
        camera.get("focus_distance", 1.0),
        camera["near_clip"],
        camera["far_clip"],
        camera.get("projection", "perspective"),
        camera.get("conform", "expandAperture"),
        camera.get("pixel_aspect", 1.0),
        tuple(map(tuple, camera.get("clip_planes", ()))),
        camera.get("exposure", 1.0),
        path,
    )
