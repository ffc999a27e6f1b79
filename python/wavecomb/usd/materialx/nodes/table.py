# SPDX-License-Identifier: Apache-2.0
"""Handlers of MaterialX nodes by category; all other nodes are graphs of these."""

from __future__ import annotations

from wavecomb.usd.materialx.nodes import arithmetic, arnold, colours, geometric, images
from wavecomb.usd.materialx.nodes.node import Handler

PRIMITIVES: dict[str, Handler] = {
    name: handler
    for module in (arithmetic, arnold, colours, images, geometric)
    for name, handler in module.NODES.items()
}

CATEGORIES = frozenset(PRIMITIVES)
"""Node categories that are not expanded when library graphs are flattened."""
