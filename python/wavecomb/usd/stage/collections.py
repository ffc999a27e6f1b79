# SPDX-License-Identifier: Apache-2.0
"""Membership of USD collections, by relationships or by a ``membershipExpression``."""

from __future__ import annotations

from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade

from wavecomb.usd.stage.report import LoadReport, first_message

Rules = dict[str, str]
"""Rule for each path: exclude, explicit (only that path) or expand (the path and all below it)."""

MAX_PRIMS = 1 << 20
"""Most prims at which an expression is evaluated; nested instancing may create billions."""

_RULES = {
    Usd.Tokens.exclude: "exclude",
    Usd.Tokens.explicitOnly: "explicit",
    Usd.Tokens.expandPrims: "expand",
    Usd.Tokens.expandPrimsAndProperties: "expand",
}


class Collections:
    """Reader of a stage's collections as rules for paths."""

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
            # The map is empty for an expression and complete for relationships.
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
        # Without the applied API schema, includeRoot has no fallback; for lights it is true.
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
    """Evaluates a query at each prim and returns a rule for each change of membership.

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
        # Materials are never members.
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
