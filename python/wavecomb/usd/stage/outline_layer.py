# SPDX-License-Identifier: Apache-2.0
"""A layer in memory of the outline of a stage, made by calls: no text is parsed, no file opened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pxr import Sdf, Tf

from wavecomb.usd.stage.outline import MATRICES, NOTHING, ROWS, SPECIFIERS, Attribute, Outline

NOWHERE = "/dev/null/"
"""What assets of an outline begin with: nothing is below a file, so USD, which looks for every
asset whose value it is asked for, finds none. Their names end as the stage's."""

_OWN = "wavecomb"
"""Entry of a layer's customLayerData: of what it is the outline."""


def layer_of(outline: Outline, file: Path, content: str) -> Sdf.Layer:
    """The root layer of a stage that has what the outline says.

    Args:
        outline: Of a stage; its numbers are in range.
        file: The stage's.
        content: Tells outlines that differ apart.

    Raises:
        ValueError: USD does not take something in it.
    """
    layer = Sdf.Layer.CreateAnonymous("outline.usda")
    try:
        with Sdf.ChangeBlock():
            _Author(layer, outline).make()
    except (Tf.ErrorException, RuntimeError, TypeError, ValueError, OverflowError):
        raise ValueError("an outline that is no stage") from None
    layer.customLayerData = {
        _OWN: {"file": str(file.resolve()), "files": "\n".join(outline.files), "content": content}
    }
    return layer


def _own(layer: Sdf.Layer) -> dict[str, Any]:
    return dict(layer.customLayerData.get(_OWN, {})) if layer.anonymous else {}


def content_of(layer: Sdf.Layer) -> str:
    """What tells the outlines of root layers apart; "" of a layer that is none."""
    return str(_own(layer).get("content", ""))


def file_of(layer: Sdf.Layer) -> str:
    """The real path of a root layer, or of that which it is the outline of."""
    return str(layer.realPath or _own(layer).get("file", ""))


def other_files(layer: Sdf.Layer) -> list[str]:
    """Files of the stage that a layer is the outline of."""
    return [one for one in str(_own(layer).get("files", "")).split("\n") if one]


def points_of(spec: Any) -> int | None:
    """The points of a point instancer of an outline; None on a stage with all its files."""
    found = spec.GetCustomDataByKey(f"{_OWN}_points")
    return found if isinstance(found, int) else None


def instances_of(prim: Any) -> int:
    """Instances that share a prototype with one; those in an outline's prototypes are none."""
    held = prim.GetCustomDataByKey(f"{_OWN}_held")
    return len(prim.GetPrototype().GetInstances()) - (held if isinstance(held, int) else 0)


class _Author:
    def __init__(self, layer: Sdf.Layer, outline: Outline) -> None:
        self._layer = layer
        self._outline = outline
        self._specs: list[Sdf.PrimSpec] = []

    def make(self) -> None:
        outline, root = self._outline, self._layer.pseudoRoot
        for name, value in outline.facts.items():
            root.SetInfo(name, value)
        holder = None
        if len(outline.prototypes):
            holder = Sdf.PrimSpec(self._layer, outline.holder, Sdf.SpecifierClass)
        self._prims(holder)
        for prim in outline.hidden.nonzero()[0].tolist():
            spec = Sdf.AttributeSpec(self._specs[prim], "visibility", Sdf.ValueTypeNames.Token)
            spec.default = "invisible"
        for prim, count in outline.counts:
            self._specs[prim].customData[f"{_OWN}_points"] = count
        for top, count in enumerate(self._held()):
            if count:
                self._specs[int(outline.prototypes[top])].customData[f"{_OWN}_held"] = count
        self._variants()
        for one in outline.attributes:
            _author(self._specs[one.prim], one)
        self._bindings()

    def _held(self) -> list[int]:
        """Of each prototype, instances that are in prototypes."""
        outline = self._outline
        counts = [0] * len(outline.prototypes)
        inside = set(outline.prototypes.tolist())
        rows = zip(outline.parents.tolist(), outline.prototype.tolist(), strict=True)
        for prim, (parent, prototype) in enumerate(rows):
            if parent in inside:
                inside.add(prim)
                if prototype != NOTHING:
                    counts[prototype] += 1
        return counts

    def _prims(self, holder: Sdf.PrimSpec | None) -> None:
        outline, layer, specs = self._outline, self._layer, self._specs
        make, specifiers = Sdf.PrimSpec, [getattr(Sdf, name) for name in SPECIFIERS]
        schemas = [Sdf.TokenListOp.CreateExplicit(names) for _, names in outline.kinds]
        types = [name for name, _ in outline.kinds]
        applies = [bool(names) for _, names in outline.kinds]
        number_of = {prim: i for i, prim in enumerate(outline.prototypes.tolist())}
        arcs = [
            Sdf.PathListOp.CreateExplicit([Sdf.Path(f"/{outline.holder}/P{i}")])
            for i in range(len(number_of))
        ]
        rows = zip(
            outline.names, outline.parents.tolist(), outline.kind.tolist(),
            outline.specifier.tolist(), outline.prototype.tolist(), strict=True,
        )  # fmt: skip
        for i, (name, parent, kind, specifier, prototype) in enumerate(rows):
            if i in number_of:
                specs.append(make(holder, f"P{number_of[i]}", Sdf.SpecifierDef))
                continue
            above = layer if parent == NOTHING else specs[parent]
            spec = make(above, name, specifiers[specifier], types[kind])
            specs.append(spec)
            if applies[kind]:
                spec.SetInfo("apiSchemas", schemas[kind])
            if prototype != NOTHING:
                spec.SetInfo("inheritPaths", arcs[prototype])
                spec.instanceable = True

    def _variants(self) -> None:
        """Those of instances are their prototype's: they share one only if they agree."""
        outline = self._outline
        names: dict[int, list[str]] = {}
        choices: dict[tuple[int, str], str] = {}
        for one in outline.variants:
            prototype = int(outline.prototype[one.prim])
            prim = one.prim if prototype == NOTHING else int(outline.prototypes[prototype])
            if (prim, one.name) not in choices:
                choices[(prim, one.name)] = one.choice
                names.setdefault(prim, []).append(one.name)
                found = Sdf.VariantSetSpec(self._specs[prim], one.name)
                for choice in one.choices:
                    Sdf.VariantSpec(found, choice)
                if one.choice:
                    self._specs[prim].variantSelections[one.name] = one.choice
            elif choices[(prim, one.name)] != one.choice:
                self._specs[one.prim].variantSelections[one.name] = one.choice
        for prim, sets in names.items():
            self._specs[prim].SetInfo("variantSetNames", Sdf.StringListOp.CreateExplicit(sets))

    def _bindings(self) -> None:
        outline = self._outline
        targets = [[Sdf.Path(one)] for one in outline.materials]
        for prim, material in outline.bound.tolist():
            spec = Sdf.RelationshipSpec(self._specs[prim], "material:binding", False)
            spec.targetPathList.explicitItems = targets[material]
        for one in outline.relationships:
            spec = Sdf.RelationshipSpec(self._specs[one.prim], one.name, False)
            spec.targetPathList.explicitItems = [Sdf.Path(path) for path in one.targets]
            if one.strength:
                spec.SetInfo("bindMaterialAs", one.strength)


def _author(prim: Sdf.PrimSpec, one: Attribute) -> None:
    kind = Sdf.ValueTypeNames.Find(one.type_name)
    variability = Sdf.VariabilityUniform if one.uniform else Sdf.VariabilityVarying
    spec = Sdf.AttributeSpec(prim, one.name, kind, variability)
    if one.value is not None:
        spec.default = _value(kind, one.type_name, one.value)
    if one.connections:
        spec.connectionPathList.explicitItems = [Sdf.Path(path) for path in one.connections]
    if one.space:
        spec.SetInfo("colorSpace", one.space)


def _value(kind: Sdf.ValueTypeName, name: str, value: Any) -> Any:
    if name.endswith("[]"):
        whole = [_value(kind.scalarType, name[:-2], one) for one in value]
        return type(kind.defaultValue)(whole)
    if name == "asset":
        # In brackets stands what is in a package, which would be opened.
        return Sdf.AssetPath(NOWHERE + value.replace("[", "/").replace("]", "") if value else "")
    if name in ROWS:
        return kind.type.pythonClass(*value)
    if name in MATRICES:
        size = MATRICES[name]
        return kind.type.pythonClass([value[i : i + size] for i in range(0, size * size, size)])
    return value
