# SPDX-License-Identifier: Apache-2.0
"""Where groups that hold surfaces are placed in the world."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wavecomb.usd.geometry.view_size import Matrices

if TYPE_CHECKING:
    from wavecomb.usd.stage.group import Group

_MOST_PLACED = 1 << 20
"""Placements of a group that are looked at."""


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
