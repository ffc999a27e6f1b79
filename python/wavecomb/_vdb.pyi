# SPDX-License-Identifier: Apache-2.0
"""The plug-in that reads .vdb and .nvdb files; ``wavecomb.vdb`` is its door."""

from typing import Any

version: str
nano_version: int

class BrokenFile(ValueError):
    """The file is none, ends too early, or holds what no library wrote."""

class TooLarge(ValueError):
    """A grid takes more memory than it may."""

def grids(path: str, heads: bool = False) -> list[dict[str, Any]]:
    """Of each grid name, index, type (bytes) and half, and unless ``heads`` what its topology says.

    Raises BrokenFile, OSError, MemoryError."""

def bricks(
    path: str, number: int, most_bytes: int, background_is_zero: bool, drops_empty: bool
) -> dict[str, Any]:
    """The voxels of the grid at a place in the file. Raises as ``grids``, and TooLarge."""
