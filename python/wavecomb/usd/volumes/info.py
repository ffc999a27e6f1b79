# SPDX-License-Identifier: Apache-2.0
"""What there is to say of a volume that was read: ``wavecomb info`` lists it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class GridFacts:
    """A grid of a volume.

    Attributes:
        use: "density", "colour", "emission", "temperature" or "velocity".
        field: Name of the relationship.
        file: Where it is read from.
        grid: Its name there.
        value: "float", "half", "vec3s" ... as OpenVDB calls it.
        voxels: That are active.
        bytes: That its bricks take in memory, with their borders.
    """

    use: str
    field: str
    file: str
    grid: str
    value: str
    voxels: int
    bytes: int


@dataclass(frozen=True)
class VolumeFacts:
    """A volume.

    Attributes:
        name: Prim path.
        count: How often it is placed.
        low: Least corner of all of it in the world.
        high: Greatest corner.
        grids: None of a homogeneous one.
    """

    name: str
    count: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    grids: tuple[GridFacts, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "name": self.name,
            "count": self.count,
            "bounds": [list(self.low), list(self.high)],
            "grids": [dict(vars(grid)) for grid in self.grids],
        }
