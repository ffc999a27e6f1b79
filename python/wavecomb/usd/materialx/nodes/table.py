# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that are written here, by category; all others are graphs of these."""

from __future__ import annotations

from wavecomb.usd.materialx.nodes import (
    arithmetic,
    arnold,
    channels,
    colours,
    compositing,
    conditions,
    hair,
    hextiles,
    images,
    matrices,
    places,
    procedures,
    spaces,
)
from wavecomb.usd.materialx.nodes.call import Handler

PRIMITIVES: dict[str, Handler] = {
    **arithmetic.NODES,
    **arnold.NODES,
    **channels.NODES,
    **colours.NODES,
    **compositing.NODES,
    **conditions.NODES,
    **hair.NODES,
    **hextiles.NODES,
    **images.NODES,
    **matrices.NODES,
    **places.NODES,
    **procedures.NODES,
    **spaces.NODES,
}
"""What compiles a category."""

CATEGORIES = frozenset(PRIMITIVES)
"""Categories of nodes that graphs of the library keep."""
