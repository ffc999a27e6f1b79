# SPDX-License-Identifier: Apache-2.0
"""Light and shadow linking: the collections of lights."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pxr import Usd

from wavecomb.usd.stage.collections import Collections, Rules
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core


class LinkTable:
    """Adds the sets of geometry that lights are linked to, equal ones once."""

    def __init__(self, builder: _core.SceneBuilder, report: LoadReport) -> None:
        self._builder = builder
        self._collections = Collections(report)
        self._known: dict[tuple[tuple[str, str], ...], int] = {}

    def set_of(self, prim: Usd.Prim, name: str) -> int | None:
        """The set of a light's collection, lightLink or shadowLink; None: it names everything."""
        rules = self._collections.rules(prim, name)
        return None if rules is None else self._set(rules)

    def nothing(self) -> int:
        """The set that nothing is in."""
        return self._set({})

    def _set(self, rules: Rules) -> int:
        key = tuple(sorted(rules.items()))
        if key not in self._known:
            self._known[key] = self._builder.add_geometry_set(rules)
        return self._known[key]
