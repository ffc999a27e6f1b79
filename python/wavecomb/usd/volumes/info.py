# SPDX-License-Identifier: Apache-2.0
"""Descriptions of volumes and their grids, which ``wavecomb info`` prints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class GridFacts:
    """Description of a grid.

    Attributes:
        use: "density", "colour", "emission", "temperature" or "velocity".
        field: Name of the volume's field.
        file: File that holds the grid.
        grid: Name of the grid in the file.
        value: OpenVDB's name of the value type, such as "float", "half" or "vec3s".
        voxels: Number of active voxels.
        bytes: Memory of its bricks with their borders.
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
    """Description of a volume.

    Attributes:
        name: Prim path.
        count: Number of instances.
        low: Lowest corner of the bounds of all instances in world space.
        high: Highest corner.
        grids: Its grids; empty for a homogeneous volume.
    """

    name: str
    count: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    grids: tuple[GridFacts, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Returns plain data for JSON."""
        return {
            "name": self.name,
            "count": self.count,
            "bounds": [list(self.low), list(self.high)],
            "grids": [dict(vars(grid)) for grid in self.grids],
        }
