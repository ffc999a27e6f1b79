# SPDX-License-Identifier: Apache-2.0
"""How large the edges of meshes are in the picture, over all their instances."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.picture.output import camera_window, pixel_aspect
from wavecomb.usd.cameras.camera import View
from wavecomb.usd.geometry.cage import Cage

if TYPE_CHECKING:
    from wavecomb.usd.stage.group import Group

Matrices = NDArray[np.float64]

NEAREST = 16
"""Placements of a mesh that are measured edge by edge; the others look smaller than these."""

_MOST_PLACED = 1 << 20
"""Placements of a group that are looked at."""


class ViewSize:
    """Measures in pixels of one view."""

    def __init__(self, view: View, size: tuple[int, int]) -> None:
        """``size``: of the picture, width and height."""
        x0, x1, y0, y1 = camera_window(view.options, *size)
        half = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        self.centre = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        self.half = half
        # The longer way where pixels are not square: more is refined, not less.
        shape = pixel_aspect(view.options, *size)
        self.pixels = size[0] / (2.0 * half[0]) * (shape if shape > 1.0 + 1e-5 else 1.0)
        self.projection = str(view.options.get("projection", "perspective"))
        self.to_camera = np.linalg.inv(np.asarray(view.transform, np.float64))

    def edges(self, cage: Cage, bounds: NDArray[Any], placed: Matrices) -> float:
        """The largest mean length in pixels of a cage's edges (``_core.edge_pixels``).

        Args:
            cage: What is measured.
            bounds: (2, 3), in its group.
            placed: (k, 4, 4) from its group to the world.
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
        """The placements in which a bounding sphere looks largest, those in the picture first."""
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


def placements(world: Group) -> dict[int, Matrices]:
    """Where the groups that hold surfaces are placed: id of a group -> (k, 4, 4).

    Of each group ``_MOST_PLACED`` count: instances in instances may multiply them.
    """
    order: list[Group] = []
    _after_its_users(world, set(), order)
    found: dict[int, Matrices] = {id(world): np.eye(4)[None]}
    for group in reversed(order):
        placed = found[id(group)]
        for child, transforms in group.surfaced:
            some = transforms[: max(1, _MOST_PLACED // len(placed))]
            every = (some[:, None] @ placed[None]).reshape(-1, 4, 4)
            known = found.get(id(child))
            both = every if known is None else np.concatenate([known, every])
            found[id(child)] = both[:_MOST_PLACED]
    return found


def _after_its_users(group: Group, met: set[int], order: list[Group]) -> None:
    """Groups that hold surfaces: each before those that it is placed in."""
    met.add(id(group))
    for child, _ in group.surfaced:
        if id(child) not in met:
            _after_its_users(child, met, order)
    order.append(group)
