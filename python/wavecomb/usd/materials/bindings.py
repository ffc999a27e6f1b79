# SPDX-License-Identifier: Apache-2.0
"""Resolves material bindings of prims."""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.stage.context import BINDING_PURPOSES


def bound_materials(
    prims: Sequence[Usd.Prim], purposes: Sequence[str] = BINDING_PURPOSES
) -> list[UsdShade.Material | None]:
    """Returns the material bound to each prim, computed in bulk.

    Tries each of ``purposes`` in turn; a binding of that purpose precedes an all-purpose binding.
    """
    if not prims:
        return []
    compute = UsdShade.MaterialBindingAPI.ComputeBoundMaterials
    found = list(compute(prims, purposes[0])[0])
    for purpose in purposes[1:]:
        bare = [i for i, material in enumerate(found) if not material]
        if bare:
            others = compute([prims[i] for i in bare], purpose)[0]
            for i, material in zip(bare, others, strict=True):
                found[i] = material
    return [material if material else None for material in found]


class BindingScan:
    """Search for bindings on a prim or its ancestors that affect prims inside an instance."""

    def __init__(self) -> None:
        self._cache: dict[Sdf.Path, tuple[bool, bool]] = {}

    def above(self, prim: Usd.Prim) -> tuple[bool, bool]:
        """Returns (has a stronger-than-descendants binding, has a collection binding).

        Both results cover the prim and its ancestors.
        """
        above: list[Usd.Prim] = []
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self._cache:
            above.append(prim)
            prim = prim.GetParent()
        nothing = (False, False)
        strong, collection = self._cache.get(prim.GetPath(), nothing) if prim else nothing
        for prim in reversed(above):
            for name in prim.GetAuthoredPropertyNames():
                if name.startswith("material:binding"):
                    if name.startswith("material:binding:collection"):
                        collection = True
                    strength = prim.GetRelationship(name).GetMetadata("bindMaterialAs")
                    strong = strong or strength == UsdShade.Tokens.strongerThanDescendants
            self._cache[prim.GetPath()] = (strong, collection)
        return strong, collection
