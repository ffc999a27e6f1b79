# SPDX-License-Identifier: Apache-2.0
"""Materials and primvars that differ between instances of a prototype.

Instances with equal materials and primvars share a prototype. A prototype is read once for each
distinct set of primvar values if materials read primvars of the instances, or if a material bound
to an instance reads primvars of the prototype's meshes.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from wavecomb.usd.geometry.primvar import PrimvarError, from_attribute, in_linear
from wavecomb.usd.instances.group import Scope
from wavecomb.usd.materials.assignment import is_uniform
from wavecomb.usd.materials.bindings import bound_materials
from wavecomb.usd.materials.material import DEFAULT_COLOUR, INHERIT_MATERIAL, MaterialTable
from wavecomb.usd.materials.network import colour
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.traversal import InstancePrim, inherit

MAX_COLOURS = 256
"""Maximum number of materials to which a varying display colour is quantised."""


def quantise(colours: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Quantises colours (m, 3) to at most ``MAX_COLOURS``, and returns palette and indices (m,).

    Quantisation steps are uniform in the square root of the colour, which is nearly perceptually
    uniform.
    """
    colours = np.nan_to_num(np.asarray(colours, np.float64), nan=0.0, posinf=1.0, neginf=0.0)
    colours = np.maximum(colours, 0.0)
    top = max(1.0, float(colours.max(initial=0.0)))
    level = np.sqrt(colours / top)
    for steps in (4095, 31, 15, 7, 5):
        q = np.rint(level * steps).astype(np.int64)
        keys = (q[:, 0] * 4096 + q[:, 1]) * 4096 + q[:, 2]
        unique, index = np.unique(keys, return_inverse=True)
        if len(unique) <= MAX_COLOURS:
            break
    index = index.ravel()
    sizes = np.bincount(index)
    sums = [np.bincount(index, weights=colours[:, axis]) for axis in range(3)]
    return np.stack(sums, axis=1) / sizes[:, None], index


class InstanceMaterials:
    """Materials of native instances and of point instancers' instances."""

    def __init__(self, context: LoadContext, materials: MaterialTable) -> None:
        self.time, self.report = context.time, context.report
        self.binding_purposes = context.binding_purposes
        self.materials = materials

    def of_proxies(self, instance: Usd.Prim) -> tuple[str, ...]:
        """Returns material paths of all prims below an instance.

        Instances of a prototype with equal material paths may share one group of objects.
        """
        prims = [
            prim
            for prim in Usd.PrimRange(instance, Usd.TraverseInstanceProxies())
            if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)
        ]
        bound = bound_materials(prims, self.binding_purposes)
        return tuple(str(m.GetPath()) if m else "" for m in bound)

    def of_instance(self, instance: InstancePrim, scope: Scope) -> int:
        """Returns the material id for meshes of an instance that have no binding."""
        surface = None if instance.material is None else self.materials.surface(instance.material)
        if surface is not None and not surface.stand_in:
            return self.materials.add(surface)
        if scope.override or scope.bound:
            return INHERIT_MATERIAL
        for primvar in instance.inherited:
            if primvar.GetPrimvarName() == "displayColor":
                value = from_attribute(primvar.GetAttr(), "displayColor", self.time)
                if value is not None and len(value.values):
                    value = in_linear(value, self.report, instance.prim.GetPath())
                    return self.materials.plain(colour(value.values[0], DEFAULT_COLOUR))
        return INHERIT_MATERIAL if scope.inside else self.materials.plain()

    def of_instancer(self, instance: InstancePrim, count: int, scope: Scope) -> NDArray[np.uint32]:
        """Returns a material id (count,) per point instance, from displayColor."""
        if scope.bound or scope.override:
            return np.full(count, INHERIT_MATERIAL, np.uint32)
        inherited = inherit(instance.prim, instance.inherited)
        attribute = instance.prim.GetAttribute("primvars:displayColor")
        if attribute.HasAuthoredValue():
            attributes = [attribute]
        else:
            attributes = [p.GetAttr() for p in inherited if p.GetPrimvarName() == "displayColor"]
        for candidate in attributes:
            try:
                primvar = from_attribute(candidate, "displayColor", self.time)
            except PrimvarError as error:
                self.report.warn(f"{error}: ignored", instance.prim.GetPath())
                continue
            if primvar is None or primvar.values.shape[1] < 3:
                continue
            primvar = in_linear(primvar, self.report, instance.prim.GetPath())
            if len(primvar.values) == 1:
                return np.full(count, self.materials.plain(primvar.values[0]), np.uint32)
            if len(primvar.values) == count:
                palette, index = quantise(primvar.values[:, :3])
                ids = np.array([self.materials.plain(c) for c in palette], np.uint32)
                return ids[index]
            what = "point instancer displayColor does not match protoIndices: ignored"
            self.report.warn(what, instance.prim.GetPath())
        default = INHERIT_MATERIAL if scope.inside else self.materials.plain()
        return np.full(count, default, np.uint32)


MAX_VARIATIONS = 256
"""Maximum number of variants of a prototype; primvars of additional instances are ignored."""

_ARRAYS = {
    1: (Sdf.ValueTypeNames.FloatArray, Vt.FloatArray),
    2: (Sdf.ValueTypeNames.Float2Array, Vt.Vec2fArray),
    3: (Sdf.ValueTypeNames.Float3Array, Vt.Vec3fArray),
    4: (Sdf.ValueTypeNames.Float4Array, Vt.Vec4fArray),
}
_OF_INSTANCES = ("vertex", "varying", "uniform")


@dataclass(frozen=True)
class InstanceBinding:
    """Material and primvars that an instance passes to its prototype.

    Attributes:
        key: Key that is equal for instances with equal appearance; None if an instance passes
            nothing.
        inherited: Constant primvars of the instance.
        material: Material for prims without a binding, if it reads primvars of the prototype's
            meshes.
    """

    key: Hashable = None
    inherited: tuple[Any, ...] = ()
    material: UsdShade.Material | None = None

    def on(self, scope: Scope) -> Scope:
        """Returns the scope with the material and the primvars of the instance."""
        if self.key is None:
            return scope
        return replace(scope, material=self.material or scope.material, inherited=self.inherited)


PLAIN = InstanceBinding()


class InstanceBindings:
    """Finds the materials and primvars that instances pass to their prototypes."""

    def __init__(self, context: LoadContext, materials: MaterialTable) -> None:
        self._time, self._report = context.time, context.report
        self._binding_purposes = context.binding_purposes
        self._materials = materials
        self._reads: dict[Hashable, frozenset[str]] = {}
        self._known: dict[Sdf.Path, set[Hashable]] = {}
        self._made: dict[Hashable, Any] = {}
        self._values = Usd.Stage.CreateInMemory()

    def of_instance(self, instance: InstancePrim, proxy: Usd.Prim, scope: Scope) -> InstanceBinding:
        """Returns the material and primvars that a native instance passes to its prototype.

        ``proxy`` is the prim on which bindings are resolved.
        """
        material = instance.material or (scope.material if scope.bound or scope.override else None)
        if material is not None and is_uniform(self._materials.surface(material)):
            material = None
        if material is None and not instance.inherited:
            return PLAIN
        prototype = instance.prim.GetPrototype().GetPath()
        inside = Usd.PrimRange(proxy, Usd.TraverseInstanceProxies())
        reads = self._read_by((prototype, scope.alias and proxy.GetPath()), inside, material)
        return self._binding(prototype, reads, instance.inherited, material)

    def of_points(
        self,
        instance: InstancePrim,
        root: Usd.Prim,
        chosen: NDArray[np.intp],
        count: int,
        predicate: Any,
    ) -> Iterator[tuple[NDArray[np.bool_] | slice, InstanceBinding]]:
        """Yields sets of a prototype's instances that pass equal materials and primvars.

        Args:
            instance: The point instancer.
            root: The prototype.
            chosen: (k,) indices of instances in the authored arrays.
            count: Number of authored instances.
            predicate: Predicate of prims in prototypes.
        """
        inherited = inherit(instance.prim, instance.inherited)
        varying = [
            primvar
            for primvar in UsdGeom.PrimvarsAPI(instance.prim).GetPrimvarsWithAuthoredValues()
            if primvar.GetInterpolation() in _OF_INSTANCES
        ]
        if not inherited and not varying:
            yield slice(None), PLAIN
            return
        reads = self._read_by(root.GetPath(), Usd.PrimRange(root, predicate), None)
        columns = {}
        for primvar in varying:
            name = str(primvar.GetPrimvarName())
            values = self._each(primvar, name, count) if name in reads else None
            if values is not None:
                columns[name] = values[chosen]
        if not columns:
            yield slice(None), self._binding(root.GetPath(), reads, inherited, None)
            return
        rows = np.concatenate(list(columns.values()), axis=1)
        _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        which = which.reshape(-1)
        for number, at in enumerate(first):
            own = tuple(self._constant(name, v[at]) for name, v in columns.items())
            rest = [p for p in inherited if p.GetPrimvarName() not in columns]
            yield which == number, self._binding(root.GetPath(), reads, (*rest, *own), None)

    def _binding(
        self,
        prototype: Sdf.Path,
        reads: frozenset[str],
        inherited: Sequence[Any],
        material: UsdShade.Material | None,
    ) -> InstanceBinding:
        passed = tuple(p for p in inherited if str(p.GetPrimvarName()) in reads)
        if not passed and material is None:
            return PLAIN
        values = tuple((str(p.GetPrimvarName()), self._bytes(p)) for p in passed)
        key = (values, None if material is None else material.GetPath())
        known = self._known.setdefault(prototype, set())
        if key not in known and len(known) >= MAX_VARIATIONS:
            what = (
                f"primvars of instances in more than {MAX_VARIATIONS} ways (left out of the rest)"
            )
            self._report.missing(what, prototype)
            return PLAIN
        known.add(key)
        return InstanceBinding(key, passed, material)

    def _read_by(
        self, key: Hashable, inside: Any, material: UsdShade.Material | None
    ) -> frozenset[str]:
        """Returns names of primvars that ``material`` and materials of the prims read."""
        known = self._reads.get(key)
        if known is None:
            prims = [p for p in inside if p.IsA(UsdGeom.Gprim) or p.IsA(UsdGeom.Subset)]
            found = bound_materials(prims, self._binding_purposes)
            by_path = {m.GetPath(): m for m in found if m is not None}
            names = (self._names(m) for m in by_path.values())
            known = self._reads[key] = frozenset().union(*names)
        return known if material is None else known | self._names(material)

    def _names(self, material: UsdShade.Material) -> frozenset[str]:
        surface = self._materials.surface(material)
        graph = () if surface.graph is None else surface.graph.primvars
        names = (*surface.primvars.values(), *graph, *surface.emission_attributes())
        names += ("displayColor", "displayOpacity") if surface.stand_in else ()
        return frozenset((*names, *surface.texture_uvs.values(), *surface.object_reads))

    def _bytes(self, primvar: Any) -> bytes:
        try:
            value = from_attribute(primvar.GetAttr(), str(primvar.GetPrimvarName()), self._time)
        except PrimvarError:
            return b""
        return b"" if value is None else np.ascontiguousarray(value.values).tobytes()

    def _each(self, primvar: Any, name: str, count: int) -> NDArray[np.float32] | None:
        """Returns the values of a primvar, one per instance, (count, c).

        Returns None with a warning if the number of values is wrong.
        """
        path = primvar.GetAttr().GetPrim().GetPath()
        try:
            found = from_attribute(primvar.GetAttr(), name, self._time)
        except PrimvarError as error:
            self._report.warn(f"{error}: ignored", path)
            return None
        if found is None or found.values.dtype.kind not in "fiu" or found.values.shape[1] > 4:
            return None
        if len(found.values) != count:
            self._report.warn(f"primvar {name!r} does not match protoIndices: ignored", path)
            return None
        return np.asarray(in_linear(found, self._report, path).values, np.float32)

    def _constant(self, name: str, value: NDArray[np.float32]) -> Any:
        """Creates a constant primvar for prims to inherit."""
        key = (name, value.tobytes())
        if key not in self._made:
            prim = self._values.DefinePrim(f"/V{len(self._made)}")
            type_name, array = _ARRAYS[len(value)]
            primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, type_name, "constant")
            one = value if len(value) == 1 else value.reshape(1, -1)
            primvar.Set(array.FromNumpy(np.ascontiguousarray(one)))
            self._made[key] = primvar
        return self._made[key]
