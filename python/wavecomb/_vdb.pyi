# SPDX-License-Identifier: Apache-2.0
"""Plug-in that reads .vdb and .nvdb files and writes .vdb files, for ``wavecomb.vdb`` only."""

from typing import Any

version: str
nano_version: int

class BrokenFile(ValueError):
    """The file is not a VDB file, is truncated, or has invalid content."""

class TooLarge(ValueError):
    """A grid exceeds the memory limit."""

def grids(path: str, heads: bool = False) -> list[dict[str, Any]]:
    """Returns the name and type (as bytes), the index and the half-float flag of each grid.

    Without ``heads``, also returns facts about the topology of each grid. Raises BrokenFile,
    OSError or MemoryError.
    """

def bricks(
    path: str, number: int, most_bytes: int, background_is_zero: bool, drops_empty: bool
) -> dict[str, Any]:
    """Returns the voxels of the grid at a position in the file.

    Raises the errors of ``grids``, and TooLarge.
    """

def write(path: str, grids: list[dict[str, Any]]) -> None:
    """Writes a .vdb file.

    Each grid has a name, origins (n, 3) int32, values (n, 512, channels) float32,
    index_to_object (16 numbers), boxes (first index, last index, value), and two flags: whether
    values are stored in 16 bits (half), and whether nodes of one value are stored as tiles. Raises
    OSError.
    """
