# SPDX-License-Identifier: Apache-2.0
"""Checks before reading that the meshes of a stage fit into memory."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Usd

from wavecomb.errors import WavecombError
from wavecomb.run.isolation import memory, time_limit
from wavecomb.usd.materials.assignment import DrawItem

MIN_BYTES = 20
"""Least memory per mesh point in bytes: half a triangle of 12 bytes plus about 32 bytes in the

acceleration structure.
"""

_SHARE = 8
"""The check is skipped if layers are smaller than 1 / ``_SHARE`` of the available memory."""


class MemoryCheck:
    """Memory check for the meshes of one stage.

    Points of a .usdc file stay in it until they are read.
    """

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode) -> None:
        layer = stage.GetRootLayer()
        self.file = layer.realPath or layer.identifier
        self.time = time
        self.is_enabled = time_limit.loaded_layers()[1] > memory.available_bytes() // _SHARE

    def check(self, draws: Iterable[DrawItem]) -> None:
        """Raises WavecombError if meshes that are not read yet need more memory than available."""
        if not self.is_enabled:
            return
        points = 0
        for draw in draws:
            if draw.kind == "mesh":
                points += len(draw.prim.GetAttribute("points").Get(self.time) or ())
        needed, there = points * MIN_BYTES, memory.available_bytes()
        if needed > there:
            raise WavecombError(
                f"{self.file}: meshes of {points:,} points need at least "
                f"{needed / memory.MEGABYTE:,.0f} MB where {there / memory.MEGABYTE:,.0f} MB are "
                f"left{memory.describe_limit()}; give more memory, or leave parts out by --mask or "
                "--payloads"
            )
