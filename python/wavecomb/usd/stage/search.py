# SPDX-License-Identifier: Apache-2.0
"""Finds prims of a kind, those inside instances too, without a step for each instance."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from pxr import Sdf, Usd

Test = Callable[[Usd.Prim], bool]

_PROXIES = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


def every(stage: Usd.Stage, wanted: Test) -> Iterator[Usd.Prim]:
    """Such prims in the stage's order; in instances as proxies, one for each instance.

    Instances that hold none are passed by: a few of them, nested, may mean billions of prims.
    """
    holding = _holders(stage, wanted)
    walk = iter(Usd.PrimRange.Stage(stage, _PROXIES if holding else Usd.PrimDefaultPredicate))
    for prim in walk:
        if wanted(prim):
            yield prim
        if holding and prim.IsInstance() and prim.GetPrototype().GetPath() not in holding:
            walk.PruneChildren()


def _holders(stage: Usd.Stage, wanted: Test) -> set[Sdf.Path]:
    """Prototypes with such a prim in them, or in what they instance."""
    holding: set[Sdf.Path] = set()
    users: dict[Sdf.Path, list[Sdf.Path]] = {}
    for prototype in stage.GetPrototypes():
        path = prototype.GetPath()
        for prim in Usd.PrimRange(prototype):
            if prim != prototype and wanted(prim):
                holding.add(path)
            if prim.IsInstance():
                users.setdefault(prim.GetPrototype().GetPath(), []).append(path)
    found = list(holding)
    for path in found:
        for user in users.get(path, ()):
            if user not in holding:
                holding.add(user)
                found.append(user)
    return holding
