# SPDX-License-Identifier: Apache-2.0
"""Keeps the textures of a stage within a limit of memory, by the core's store of tiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavecomb.errors import WavecombError
from wavecomb.machine import temporary_folder
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core
    from wavecomb.usd.looks.texture_cache import TextureCache

MEGABYTE = 1_000_000


def texture_store(
    limit: float | None, reuse: TextureCache | None, report: LoadReport
) -> _core.TextureStore | None:
    """What keeps textures within ``limit`` MB; None: nothing does.

    That of ``reuse`` where it has the same limit, so that the limit is for what is shared too.

    Raises:
        WavecombError: The limit cannot be.
    """
    from wavecomb import _core

    if limit is None:
        return None
    bytes_ = int(min(limit * MEGABYTE, 2**63))
    if reuse is not None and reuse.store is not None and reuse.store.limit_bytes == bytes_:
        return reuse.store
    obstacle = _core.TextureStore.obstacle()
    if obstacle:
        report.note(f"texture limit {limit:g} MB: kept by leaving out mip levels, as {obstacle}")
        return None
    try:
        return _core.TextureStore(bytes_, temporary_folder())
    except ValueError as error:
        raise WavecombError(str(error)) from None
