# SPDX-License-Identifier: Apache-2.0
"""Membership of prims in USD collections, assets and light groups."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pxr import Kind, Sdf, Tf, Usd, UsdGeom, UsdShade

from wavecomb.usd.materials.draw_item import Parent
from wavecomb.usd.stage.report import LoadReport, first_message

Rules = dict[str, str]
"""Rule for a prim path: exclude, explicit (only this prim) or expand (also all descendants)."""

MAX_PRIMS = 1 << 20
"""Maximum number of prims at which an expression is evaluated; nested instancing may create
billions."""

_RULES = {
    Usd.Tokens.exclude: "exclude",
    Usd.Tokens.explicitOnly: "explicit",
    Usd.Tokens.expandPrims: "expand",
    Usd.Tokens.expandPrimsAndProperties: "expand",
}


class Collections:
    """Reader that converts the collections of a stage to rules for prim paths."""

    def __init__(self, report: LoadReport) -> None:
        self._report = report
        self._by_expression: dict[str, Rules | None] = {}

    def rules(self, prim: Usd.Prim, name: str) -> Rules | None:
        """Returns the rules of a collection; None means that it includes all prims.

        Args:
            prim: The prim with the collection.
            name: Instance name, such as lightLink. A collection that is not authored includes all
                prims.
        """
        if not _is_authored(prim, name):
            return None
        collection = Usd.CollectionAPI(prim, name)
        try:
            query = collection.ComputeMembershipQuery()
            # The path rule map is empty if the collection is defined by a membership expression.
            # Otherwise, the map contains all rules of the collection's relationships.
            if _has_expression(collection) and not query.GetAsPathExpansionRuleMap():
                return self._of_expression(collection, query)
        except Tf.ErrorException as error:
            what = f"{name}: its membershipExpression cannot be evaluated ({first_message(error)})"
            self._report.warn(f"{what}: it has no members", prim.GetPath())
            return {}
        self._warn_of_ignored(collection, query, name)
        found = {
            str(path): _RULES[rule]
            for path, rule in query.GetAsPathExpansionRuleMap().items()
            if rule in _RULES
        }
        root = prim.GetAttribute(f"collection:{name}:includeRoot")
        # Without the applied API schema, includeRoot has no fallback value; for the collections of
        # lights, the fallback is true.
        if not root or not root.HasAuthoredValue() or root.Get():
            found.setdefault("/", "expand")
        if all(rule != "exclude" for rule in found.values()) and found.get("/") == "expand":
            return None
        return found

    def _of_expression(
        self, collection: Usd.CollectionAPI, query: Usd.UsdCollectionMembershipQuery
    ) -> Rules | None:
        expression = collection.ResolveCompleteMembershipExpression().GetText()
        if expression not in self._by_expression:
            rules, is_whole = _evaluated(collection.GetPrim().GetStage(), query)
            if not is_whole:
                what = f"membershipExpression beyond {MAX_PRIMS} prims (cut there)"
                self._report.missing(what, collection.GetPath())
            self._by_expression[expression] = rules
        return self._by_expression[expression]

    def _warn_of_ignored(
        self, collection: Usd.CollectionAPI, query: Usd.UsdCollectionMembershipQuery, name: str
    ) -> None:
        """Warns of expressions that OpenUSD ignores in a collection."""
        prim = collection.GetPrim()
        if _has_expression(collection):
            what = f"{name}: its membershipExpression has no effect beside includes, excludes or "
            self._report.warn(f"{what}includeRoot (set includeRoot to 0)", prim.GetPath())
        for path in query.GetIncludedCollections():
            other = Usd.CollectionAPI.GetCollection(prim.GetStage(), path)
            if other and other.IsInExpressionMode() and _has_expression(other):
                what = f"{name} includes {path}, which has a membershipExpression: left out, as in "
                self._report.warn(f"{what}OpenUSD (name it in an expression)", prim.GetPath())


def _has_expression(collection: Usd.CollectionAPI) -> bool:
    attribute = collection.GetMembershipExpressionAttr()
    return bool(attribute and attribute.HasAuthoredValue())


def _is_authored(prim: Usd.Prim, name: str) -> bool:
    for side in ("includes", "excludes"):
        relation = prim.GetRelationship(f"collection:{name}:{side}")
        if relation and relation.HasAuthoredTargets():
            return True
    names = (f"collection:{name}:includeRoot", f"collection:{name}:membershipExpression")
    return any((one := prim.GetAttribute(n)) and one.HasAuthoredValue() for n in names)


def _evaluated(
    stage: Usd.Stage, query: Usd.UsdCollectionMembershipQuery
) -> tuple[Rules | None, bool]:
    """Evaluates a query at each prim; returns rules for prims that differ from their parents.

    The second result says whether all prims were evaluated. A point instancer is a member with all
    of its instances, so its prototypes are not evaluated.
    """
    rules: Rules = {}
    member: dict[Sdf.Path, bool] = {}
    prims = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    walk = iter(prims)
    for count, prim in enumerate(walk):
        if count >= MAX_PRIMS:
            return rules, False
        # Materials are never members of a light's collection.
        if prim.IsA(UsdShade.NodeGraph):
            walk.PruneChildren()
            continue
        path = prim.GetPath()
        inside = bool(query.IsPathIncluded(path))
        if inside != member.get(path.GetParentPath(), False):
            rules[str(path)] = "expand" if inside else "exclude"
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()
        else:
            member[path] = inside
    return None if member and all(member.values()) else rules, True


OTHER = "other"
"""Name of the group of lights without an authored group."""
MAX_LIGHT_GROUPS = 63
"""Maximum number of named light groups that the core supports."""
PRIMVAR = "wavecomb:lightGroup"
_LIGHT_GROUPS = (
    "wavecomb:lightGroup",
    "inputs:ri:light:lightGroup",
    "ri:light:lightGroup",
    "inputs:karma:light:lpetag",
    "karma:light:lpetag",
    "primvars:karma:object:lpetag",
    "primvars:arnold:aov",
)
"""Light group attributes of Wavecomb, RenderMan, Karma and Arnold, read if there is no primvar."""


def light_group(prim: Usd.Prim, inherited: Sequence[Any] | None = None) -> str:
    """Returns the light group of a light or emissive mesh; "" if it has none.

    ``primvars:wavecomb:lightGroup`` is inherited from ancestors like all primvars. Light group
    attributes of other renderers are read on the prim itself only.

    Args:
        prim: The light or mesh.
        inherited: Primvars of the prim's ancestors, if they are known.
    """
    if inherited is None:
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(PRIMVAR)
        value = primvar.Get() if primvar and primvar.HasValue() else None
    else:
        value = prim.GetAttribute(f"primvars:{PRIMVAR}").Get()
        for primvar in inherited if value is None else ():
            if primvar.GetPrimvarName() == PRIMVAR:
                value = primvar.Get()
    for name in _LIGHT_GROUPS if value is None else ():
        value = prim.GetAttribute(name).Get()
        if value:
            break
    return str(value) if value else ""


class LightGroups:
    """Light groups of a stage, limited in number and named by valid channel names."""

    def __init__(self, report: LoadReport) -> None:
        self._report = report
        self._names: dict[str, str] = {}

    def of(self, prim: Usd.Prim, inherited: Sequence[Any] | None = None) -> str:
        """Returns a prim's light group with invalid characters as "_"; "" if it has none."""
        name = light_group(prim, inherited)
        channel = re.sub(r"[^A-Za-z0-9_]", "_", name)
        if channel in ("", OTHER):
            return ""
        if channel not in self._names and len(self._names) == MAX_LIGHT_GROUPS:
            what = f"more than {MAX_LIGHT_GROUPS} light groups: light of the rest is in {OTHER!r}"
            self._report.warn(what, prim.GetPath())
            return ""
        first = self._names.setdefault(channel, name)
        if first != name:
            what = f"light groups {first!r} and {name!r} are one: channels call both {channel!r}"
            self._report.warn(what, prim.GetPath())
        return channel


def _is_asset(prim: Usd.Prim) -> bool:
    """Returns whether the kind of a prim is component or derived from it."""
    kind = prim.GetKind()
    return bool(kind) and Kind.Registry.IsA(kind, Kind.Tokens.component)


class Assets:
    """Finds the assets that contain prims. An asset is a prim of kind component."""

    def __init__(self) -> None:
        self._known: dict[Sdf.Path, int] = {Sdf.Path.absoluteRootPath: 0}

    def length_below(self, prim: Usd.Prim, path: str, parent: Parent | None) -> int:
        """Returns ``length`` of the prim, computed faster from the cached length of its parent."""
        if parent is None:
            return self.length(prim)
        if _is_asset(prim):
            return len(path)
        chain: list[Parent] = []
        while parent.asset is None and parent.above is not None and not _is_asset(parent.prim):
            chain.append(parent)
            parent = parent.above
        if parent.asset is None:
            parent.asset = self.length(parent.prim)
        for one in chain:
            one.asset = parent.asset
        return parent.asset

    def length(self, prim: Usd.Prim) -> int:
        """Returns the length of the asset's path within the prim's path; 0 if there is no asset."""
        above: list[Sdf.Path] = []
        length: int | None = 0
        while prim:
            path = prim.GetPath()
            length = self._known.get(path)
            if length is not None:
                break
            above.append(path)
            if _is_asset(prim):
                length = len(str(path))
                break
            prim = prim.GetParent()
        self._known.update(dict.fromkeys(above, length or 0))
        return length or 0
