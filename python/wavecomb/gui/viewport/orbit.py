# SPDX-License-Identifier: Apache-2.0
"""Camera poses and how they move: pure functions of NumPy arrays.

Transforms are in USD's row-vector convention: rows are right, up, back and position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.camera_table import camera_defaults, camera_parameters
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
