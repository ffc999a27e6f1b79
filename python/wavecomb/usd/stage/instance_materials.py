# SPDX-License-Identifier: Apache-2.0
"""What instances wear: materials for the meshes in them that have none of their own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from wavecomb.usd.geometry.primvar import PrimvarError, from_attribute, in_linear
from wavecomb.usd.looks.colour import quantise
from wavecomb.usd.looks.material import (
    DEFAULT_COLOUR,
    INHERIT_MATERIAL,
    MaterialTable,
    bound_materials,
)
from wavecomb.usd.looks.network import colour
from wavecomb.usd.stage.group import Scope
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.traverse import Placed, Traversal


class InstanceMaterials:
    """Finds the materials of native instances and of point instancers."""

    def __init__(self, traversal: Traversal, materials: MaterialTable, report: LoadReport) -> None:
        self.traversal = traversal
        self.time = traversal.time
        self.materials = materials
        self.report = report

    def of_proxies(self, instance: Usd.Prim) -> tuple[str, ...]:
        """Material paths of all below an instance: tells which instances may share a group."""
        prims = [
            prim
            for prim in Usd.PrimRange(instance, Usd.TraverseInstanceProxies())
            if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)
        ]
        bound = bound_materials(prims, self.traversal.binding_purposes)
        return tuple(str(m.GetPath()) if m else "" for m in bound)

    def of_instance(self, placed: Placed, scope: Scope) -> int:
        """The id for the meshes of an instance that have none of their own."""
        surface = None if placed.material is None else self.materials.surface(placed.material)
        if surface is not None and not surface.stand_in:
            return self.materials.add(surface)
        if scope.override or scope.bound:
            return INHERIT_MATERIAL
        for primvar in placed.inherited:
            if primvar.GetPrimvarName() == "displayColor":
                value = from_attribute(primvar.GetAttr(), "displayColor", self.time)
                if value is not None and len(value.values):
                    value = in_linear(value, self.report, placed.prim.GetPath())
                    return self.materials.plain(colour(value.values[0], DEFAULT_COLOUR))
        return INHERIT_MATERIAL if scope.inside else self.materials.plain()

    def of_instancer(self, placed: Placed, count: int, scope: Scope) -> NDArray[np.uint32]:
        """(count,) ids for the instances of a point instancer: by its displayColor."""
        if scope.bound or scope.override:
            return np.full(count, INHERIT_MATERIAL, np.uint32)
        inherited = self.traversal.inherit(placed.prim, placed.inherited)
        attribute = placed.prim.GetAttribute("primvars:displayColor")
        if attribute.HasAuthoredValue():
            attributes = [attribute]
        else:
            attributes = [p.GetAttr() for p in inherited if p.GetPrimvarName() == "displayColor"]
        for candidate in attributes:
            try:
                primvar = from_attribute(candidate, "displayColor", self.time)
            except PrimvarError as error:
                self.report.warn(f"{error}: ignored", placed.prim.GetPath())
                continue
            if primvar is None or primvar.values.shape[1] < 3:
                continue
            primvar = in_linear(primvar, self.report, placed.prim.GetPath())
            if len(primvar.values) == 1:
                return np.full(count, self.materials.plain(primvar.values[0]), np.uint32)
            if len(primvar.values) == count:
                palette, index = quantise(primvar.values[:, :3])
                ids = np.array([self.materials.plain(c) for c in palette], np.uint32)
                return ids[index]
            what = "point instancer displayColor does not match protoIndices: ignored"
            self.report.warn(what, placed.prim.GetPath())
        default = INHERIT_MATERIAL if scope.inside else self.materials.plain()
        return np.full(count, default, np.uint32)
