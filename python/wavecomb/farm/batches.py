# SPDX-License-Identifier: Apache-2.0
"""Batches of work, each of which is done by one Dask task."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from wavecomb.farm.job import Task

_BATCH_S = 0.5
"""Time that a batch of small tiles should take, in seconds."""
_MIN_BATCHES = 4
"""Smallest number of batches for each worker, so that workers finish at about the same time."""


@dataclass
class Batch:
    """Work of one Dask task: tiles to render, or an image to plan or to assemble.

    Attributes:
        tiles: Tiles to render; empty for work on a whole image.
        image: Index of the image to plan or to assemble, or -1.
        attempt: Number that is different for each repetition of the same work.
        is_plan: Whether the work consists of the image's pilot renders.
    """

    tiles: list[Task]
    image: int = -1
    attempt: int = 0
    is_plan: bool = False

    def work(self, checks: Mapping[int, int]) -> tuple[Callable[..., dict[str, Any]], str, Any]:
        """Returns the function in ``farm.tasks`` to call, its name in keys, and its last argument.

        Args:
            checks: Number of error checks of each image.
        """
        from wavecomb.farm.tasks import assemble_image, plan_image, render_tiles

        if self.tiles:
            tiles = [(task.image, task.tile, checks[task.image]) for task in self.tiles]
            return render_tiles, "tiles", tiles
        if self.is_plan:
            return plan_image, "plan", self.image
        return assemble_image, "assembly", self.image


def batch_size(tile_s: float, waiting: int, workers: int) -> int:
    """Returns the number of tiles of the next batch.

    Args:
        tile_s: Time to render a tile, in seconds; 0 if unknown.
        waiting: Number of tiles that are not submitted yet.
        workers: Number of workers.
    """
    wanted = _BATCH_S / tile_s if tile_s else 1
    most = waiting / (_MIN_BATCHES * max(1, workers))
    return max(1, int(min(wanted, most)))
