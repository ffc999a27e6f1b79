# SPDX-License-Identifier: Apache-2.0
"""Measures mesh edges and strand widths in pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.files.render_output import camera_window, pixel_aspect
from wavecomb.usd.cameras.camera import View
from wavecomb.usd.geometry.cage import Cage

if TYPE_CHECKING:
    pass

Matrices = NDArray[np.float64]

NEAREST = 16
"""Instances of a mesh that are measured edge by edge; the remaining ones appear smaller."""


class ViewSize:
    """Conversion of lengths to pixels of one view.

    Attributes:
        pixels: Pixels per unit of the camera's window.
        per_length: Pixels per unit of length where ``distances`` is 1.
    """

    def __init__(self, view: View, size: tuple[int, int]) -> None:
        """``size`` is the width and height of the image."""
        x0, x1, y0, y1 = camera_window(view.options, *size)
        half = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        self.centre = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        self.half = half
        # For pixels that are not square, use the finer direction, so that more is refined, not
        # less.
        shape = pixel_aspect(view.options, *size)
        self.pixels = size[0] / (2.0 * half[0]) * (shape if shape > 1.0 + 1e-5 else 1.0)
        self.projection = str(view.options.get("projection", "perspective"))
        all_round = self.projection == "latlong"
        self.per_length = size[0] / (2.0 * np.pi) if all_round else self.pixels
        self.to_camera = np.linalg.inv(np.asarray(view.transform, np.float64))

    def distances(self, points: NDArray[Any], to_world: Matrices) -> NDArray[np.float64]:
        """Returns the distances (n,) by which lengths at points (n, 3) of a prim appear reduced.

        For a perspective camera this is the depth in front of it, or the distance behind it. For a
        latlong camera it is the distance, and for an orthographic camera 1.
        """
        if self.projection == "orthographic":
            return np.ones(len(points))
        to_camera = to_world @ self.to_camera
        seen = points @ to_camera[:3, :3] + to_camera[3, :3]
        away = np.linalg.norm(seen, axis=1)
        if self.projection == "perspective":
            away = np.where(seen[:, 2] < 0, -seen[:, 2], away)
        return np.asarray(away, np.float64)

    def edges(self, cage: Cage, bounds: NDArray[Any], placed: Matrices) -> float:
        """Returns the largest mean edge length of a cage in pixels (``_core.edge_pixels``).

        Args:
            cage: The cage.
            bounds: (2, 3) bounds in the space of its group.
            placed: (k, 4, 4) transforms from its group to the world.
        """
        from wavecomb import _core

        if len(placed) > NEAREST:
            placed = placed[self._largest(bounds, placed)]
        transforms = np.array(cage.matrix) @ placed
        return _core.edge_pixels(
            cage.points, cage.counts, cage.indices, np.ascontiguousarray(transforms),
            np.ascontiguousarray(self.to_camera), self.centre, self.half, self.pixels,
            self.projection,
        )  # fmt: skip

    def _largest(self, bounds: NDArray[Any], placed: Matrices) -> NDArray[np.intp]:
        """Returns the instances whose bounding spheres appear largest, visible ones first."""
        centre = 0.5 * (bounds[0] + bounds[1]).astype(np.float64)
        radius = 0.5 * float(np.linalg.norm(bounds[1] - bounds[0]))
        linear = placed[:, :3, :3]
        scale = np.sqrt(np.einsum("kij,kij->ki", linear, linear).max(axis=1))
        world = centre @ linear + placed[:, 3, :3]
        seen = world @ self.to_camera[:3, :3] + self.to_camera[3, :3]
        reach = radius * scale
        distance = np.maximum(np.linalg.norm(seen, axis=1) - reach, 0.01 * reach + 1e-30)
        depth = np.maximum(-seen[:, 2] + reach, 0.0)
        if self.projection == "latlong":
            return np.argsort(-scale / distance, kind="stable")[:NEAREST]
        if self.projection == "orthographic":
            distance = np.ones_like(distance)
            depth = (depth > 0).astype(np.float64)
        aside = [
            np.abs(seen[:, axis] - self.centre[axis] * depth) - reach <= self.half[axis] * depth
            for axis in (0, 1)
        ]
        weight = np.where((depth > 0) & aside[0] & aside[1], 1.0, 0.125)
        return np.argsort(-weight * scale / distance, kind="stable")[:NEAREST]
