# SPDX-License-Identifier: Apache-2.0
"""Light and shadow linking: the collections of lights."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pxr import Usd

if TYPE_CHECKING:
    from wavecomb import _core

_RULES = {
    Usd.Tokens.exclude: "exclude",
    Usd.Tokens.explicitOnly: "explicit",
    Usd.Tokens.expandPrims: "expand",
    Usd.Tokens.expandPrimsAndProperties: "expand",
}


class LinkTable:
    """Adds the sets of geometry that lights are linked to, equal ones once."""

    def __init__(self, builder: _core.SceneBuilder) -> None:
        self._builder = builder
        self._known: dict[tuple[tuple[str, str], ...], int] = {}

    def set_of(self, prim: Usd.Prim, name: str) -> int | None:
        """The set of a light's collection, lightLink or shadowLink; None: it names everything."""
        if not _is_authored(prim, name):
            return None
        collection = Usd.CollectionAPI(prim, name)
        rules = collection.ComputeMembershipQuery().GetAsPathExpansionRuleMap()
        root = prim.GetAttribute(f"collection:{name}:includeRoot")
        # Without the API applied there is no fallback: it is true for lights.
        named = {str(path): _RULES[rule] for path, rule in rules.items() if rule in _RULES}
        if not root or not root.HasAuthoredValue() or root.Get():
            named.setdefault("/", "expand")
        if all(rule != "exclude" for rule in named.values()) and named.get("/") == "expand":
            return None
        return self._set(named)

    def nothing(self) -> int:
        """The set that nothing is in."""
        return self._set({})

    def _set(self, named: dict[str, str]) -> int:
        key = tuple(sorted(named.items()))
        if key not in self._known:
            self._known[key] = self._builder.add_geometry_set(named)
        return self._known[key]


def _is_authored(prim: Usd.Prim, name: str) -> bool:
    for side in ("includes", "excludes"):
        relation = prim.GetRelationship(f"collection:{name}:{side}")
        if relation and relation.HasAuthoredTargets():
            return True
    root = prim.GetAttribute(f"collection:{name}:includeRoot")
    return bool(root and root.HasAuthoredValue())
