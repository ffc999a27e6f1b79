# SPDX-License-Identifier: Apache-2.0
"""Makes the outline of a composed stage: ``outline`` says what that is."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from wavecomb.usd.lights.light import KINDS as LIGHT_KINDS
from wavecomb.usd.stage.outline import (
    MATRICES,
    MOST_VALUES,
    NOTHING,
    OWN_FACTS,
    ROWS,
    SPECIFIERS,
    TYPES,
    Attribute,
    Outline,
    Relationship,
    Variants,
)

_HOLDER = "__prototypes"
_THERE = Usd.PrimIsActive & Usd.PrimIsLoaded
_SPECIFIERS = [getattr(Sdf, name) for name in SPECIFIERS]
_NODES = ("Material", "NodeGraph", "Shader")


def outline_of(stage: Usd.Stage, time: Usd.TimeCode) -> Outline:
    """The outline of a stage at a time.

    Of the session layer nothing stays but the variants that are selected in it: a program that
    holds an outline has edits of its own above it.
    """
    selected = _keep_selections(stage.GetSessionLayer())
    return _Outliner(stage, time).made(selected)


def _keep_selections(layer: Sdf.Layer) -> list[tuple[str, str, str]]:
    """Takes all properties out of a layer; gives the variants that it selects."""
    found: list[tuple[str, str, str]] = []
    prims: list[Sdf.PrimSpec] = []

    def visit(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.PrimSpec) and path.IsPrimPath():
            prims.append(spec)

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    with Sdf.ChangeBlock():
        for spec in prims:
            for one in list(spec.properties):
                spec.RemoveProperty(one)
            chosen = spec.variantSelections
            found.extend((str(spec.path), name, chosen[name]) for name in chosen.keys())  # noqa: SIM118
    return found


class _Kind:
    """What is to be read of prims of one type with the same schemas."""

    def __init__(self, number: int, prim: Usd.Prim, name: str, schemas: list[str]) -> None:
        self.number = number
        self.is_drawn = bool(prim.IsA(UsdGeom.Imageable))
        self.is_instancer = bool(prim.IsA(UsdGeom.PointInstancer))
        self.is_placed = bool(prim.IsA(UsdGeom.Camera)) or name in LIGHT_KINDS
        self.is_node = name in _NODES
        self.is_light = "LightAPI" in schemas or "MeshLightAPI" in schemas
        self.is_bound = "MaterialBindingAPI" in schemas
        self.has_collections = any(one.startswith("CollectionAPI:") for one in schemas)
        self.has_spaces = any(one.startswith("ColorSpace") for one in schemas)


class _Outliner:
    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode) -> None:
        self._stage = stage
        self._time = time
        self._xforms = UsdGeom.XformCache(time)
        self._names: list[str] = []
        self._parents: list[int] = []
        self._kind: list[int] = []
        self._specifier: list[int] = []
        self._hidden: list[int] = []
        self._prototype: list[int] = []
        self._kinds: dict[tuple[str, tuple[str, ...]], _Kind] = {}
        self._bound: list[tuple[int, int]] = []
        self._materials: dict[Sdf.Path, int] = {}
        self._attributes: list[Attribute] = []
        self._relationships: list[Relationship] = []
        self._variants: list[Variants] = []
        self._counts: list[tuple[int, int]] = []
        self._placed: list[tuple[Usd.Prim, int]] = []
        self._instances: dict[int, list[tuple[Usd.Prim, int]]] = {}
        roots = {prim.GetName() for prim in stage.GetPseudoRoot().GetAllChildren()}
        self._holder = _HOLDER
        while self._holder in roots:
            self._holder += "_"
        self._has_instances = bool(stage.GetPrototypes())
        self._of_prototype: dict[Sdf.Path, int] = {}
        self._prototypes: list[Usd.Prim] = []  # numbered as the stage's order has them

    def made(self, selected: list[tuple[str, str, str]]) -> Outline:
        for prim in self._stage.GetPseudoRoot().GetFilteredChildren(_THERE):
            self._subtree(prim)
        first = []
        for prim in self._prototypes:
            first.append(len(self._names))
            self._subtree(prim)
        self._transforms()
        root = self._stage.GetRootLayer()
        used = {one.realPath for one in self._stage.GetUsedLayers()}

        def ids(values: Any) -> Any:
            return np.array(values, np.uint32)

        return Outline(
            self._holder, self._names, ids(self._parents),
            [(name, list(schemas)) for name, schemas in self._kinds], ids(self._kind),
            np.array(self._specifier, np.uint8), np.array(self._hidden, np.uint8),
            ids(self._prototype), ids(first),
            ids(self._bound).reshape(-1, 2), [self._path(one) for one in self._materials],
            self._attributes, self._relationships, self._variants, self._counts,
            _facts(root), sorted(used - {""}), selected,
        )  # fmt: skip

    def _path(self, path: Sdf.Path) -> str:
        """A path of the stage; in prototypes that of the outline's."""
        text = str(path)
        if text.startswith("/__Prototype_"):
            top = path.GetPrefixes()[0]
            number = self._of_prototype.get(top)
            if number is not None:
                return f"/{self._holder}/P{number}{text[len(str(top)) :]}"
        return text

    def _subtree(self, top: Usd.Prim) -> None:
        above: list[int] = []
        walk = iter(Usd.PrimRange.PreAndPostVisit(top, _THERE))
        for prim in walk:
            if walk.IsPostVisit():
                above.pop()
                continue
            above.append(self._add(prim, above[-1] if above else NOTHING))

    def _add(self, prim: Usd.Prim, parent: int) -> int:
        number = len(self._names)
        info = prim.GetPrimTypeInfo()
        name, schemas = str(prim.GetTypeName()), tuple(map(str, info.GetAppliedAPISchemas()))
        kind = self._kinds.get((name, schemas))
        if kind is None:
            known = list(map(str, prim.GetAppliedSchemas()))
            kind = _Kind(len(self._kinds), prim, name, known)
            self._kinds[(name, schemas)] = kind
        self._names.append(prim.GetName() if parent != NOTHING or not prim.IsPrototype() else "P")
        self._parents.append(parent)
        self._kind.append(kind.number)
        self._specifier.append(_SPECIFIERS.index(prim.GetSpecifier()))
        instance = NOTHING
        if self._has_instances and prim.IsInstance():
            prototype = prim.GetPrototype()
            instance = self._of_prototype.setdefault(prototype.GetPath(), len(self._prototypes))
            if instance == len(self._prototypes):
                self._prototypes.append(prototype)
            self._instances.setdefault(instance, []).append((prim, number))
        self._prototype.append(instance)
        properties = prim.GetAuthoredPropertyNames()
        hides = False
        if "visibility" in properties:
            hides = prim.GetAttribute("visibility").Get(self._time) == "invisible"
        self._hidden.append(int(hides))
        # USD takes bindings without their schema, too, and warns.
        if kind.is_bound or kind.has_collections or "material:binding" in properties:
            self._relations(prim, number)
        if prim.HasVariantSets():
            self._variant_sets(prim, number)
        if kind.is_instancer:
            indices = UsdGeom.PointInstancer(prim).GetProtoIndicesAttr().Get(self._time)
            self._counts.append((number, 0 if indices is None else len(indices)))
        if kind.is_placed:
            self._placed.append((prim, number))
        if kind.is_node or kind.is_placed or kind.is_light or kind.has_spaces:
            self._attributes_of(prim, number, kind)
        return number

    def _attributes_of(self, prim: Usd.Prim, number: int, kind: _Kind) -> None:
        whole = kind.is_node or kind.is_placed
        for attribute in prim.GetAuthoredAttributes():
            name = attribute.GetName()
            if name.startswith("xformOp") or name == "visibility":
                continue
            if not whole and not name.startswith(("inputs:", "light:", "colorSpace")):
                continue
            type_name = str(attribute.GetTypeName())
            if type_name.removesuffix("[]") in TYPES:
                self._attributes.append(
                    Attribute(
                        number, name, type_name,
                        attribute.GetVariability() == Sdf.VariabilityUniform,
                        _plain(attribute.Get(self._time), type_name),
                        [self._path(path) for path in attribute.GetConnections()],
                        str(attribute.GetColorSpace()) if attribute.HasColorSpace() else "",
                    )
                )  # fmt: skip

    def _relations(self, prim: Usd.Prim, number: int) -> None:
        for relation in prim.GetAuthoredRelationships():
            name = relation.GetName()
            if not name.startswith(("material:binding", "collection:")):
                continue
            targets = relation.GetTargets()
            strength = str(relation.GetMetadata("bindMaterialAs") or "")
            if name == "material:binding" and len(targets) == 1 and not strength:
                material = self._materials.setdefault(targets[0], len(self._materials))
                self._bound.append((number, material))
            else:
                paths = [self._path(path) for path in targets]
                self._relationships.append(Relationship(number, name, paths, strength))
        for attribute in prim.GetAuthoredAttributes():
            name, type_name = attribute.GetName(), str(attribute.GetTypeName())
            if name.startswith("collection:") and type_name in ("token", "bool"):
                value = _plain(attribute.Get(self._time), type_name)
                self._attributes.append(Attribute(number, name, type_name, True, value, [], ""))

    def _variant_sets(self, prim: Usd.Prim, number: int) -> None:
        session = self._stage.GetSessionLayer()
        sets = prim.GetVariantSets()
        for name in sets.GetNames():
            one = sets.GetVariantSet(name)
            choice = one.GetVariantSelection()
            over = session.GetPrimAtPath(prim.GetPath())
            if over and name in over.variantSelections:
                choice = _own_selection(prim, name, session)
            self._variants.append(Variants(number, name, list(one.GetVariantNames()), choice))

    def _transforms(self) -> None:
        """Those of what is placed, and of what it is in."""
        done: set[int] = set()
        wanted = list(self._placed)
        while wanted:
            prim, number = wanted.pop()
            while number != NOTHING and number not in done:
                done.add(number)
                self._transform(prim, number)
                if prim.IsPrototype():
                    wanted.extend(self._instances.get(self._of_prototype[prim.GetPath()], ()))
                prim, number = prim.GetParent(), self._parents[number]

    def _transform(self, prim: Usd.Prim, number: int) -> None:
        if not prim.IsA(UsdGeom.Xformable):
            return
        matrix, resets = self._xforms.GetLocalTransformation(prim)
        values = [float(matrix[i][j]) for i in range(4) for j in range(4)]
        if not resets and values == _IDENTITY:
            return
        order = ["!resetXformStack!"] if resets else []
        own = "xformOp:transform"
        self._attributes += [
            Attribute(number, own, "matrix4d", False, values, [], ""),
            Attribute(number, "xformOpOrder", "token[]", True, [*order, own], [], ""),
        ]


_IDENTITY = [float(i == j) for i in range(4) for j in range(4)]


def _own_selection(prim: Usd.Prim, name: str, session: Sdf.Layer) -> str:
    """What is selected beneath the session layer."""
    for spec in prim.GetPrimStack():
        if spec.layer != session and name in spec.variantSelections:
            return str(spec.variantSelections[name])
    return ""


def _plain(value: Any, type_name: str) -> Any:
    """A value as JSON has it; None where it is too long, or not of its type."""
    if value is None:
        return None
    if type_name.endswith("[]"):
        if len(value) > MOST_VALUES:
            return None
        return [_plain(one, type_name[:-2]) for one in value]
    if type_name == "asset":
        return str(value.resolvedPath or value.path)
    if type_name in MATRICES:
        size = MATRICES[type_name]
        return [float(value[i][j]) for i in range(size) for j in range(size)]
    if type_name in ROWS:
        return list(value)
    return float(value) if type_name == "timecode" else value


def _facts(root: Sdf.Layer) -> dict[str, Any]:
    """Metadata of a root layer: flags, numbers and texts, and expression variables of such."""
    found: dict[str, Any] = {}
    for name in sorted(root.pseudoRoot.ListInfoKeys()):
        if name in OWN_FACTS:
            continue
        value = root.pseudoRoot.GetInfo(name)
        if isinstance(value, _PLAIN):
            found[name] = value
        elif name == "expressionVariables":
            found[name] = {key: one for key, one in value.items() if isinstance(one, _PLAIN)}
    return found


_PLAIN = (bool, int, float, str)
