# SPDX-License-Identifier: Apache-2.0
"""Writes MaterialX materials and looks as prims, with shaders and material assignments.

Looks assign materials to collections, whose prim paths are written below
``/MaterialX/Collections``. If a model references a look, USD maps these paths to paths below the
model. Each look is a variant in the variant set ``LookVariant`` of ``/ModelRoot``.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.materialx.files import Document
from wavecomb.usd.materialx.graphs import GRAPHS, Graphs, definition, implementation, is_closed
from wavecomb.usd.materialx.prims import (
    TERMINALS,
    Prims,
    ReportSkipped,
    child,
    connect,
    usd_type,
    usd_value,
    valid,
)

COLLECTIONS = Sdf.Path("/MaterialX/Collections")
LOOKS = Sdf.Path("/MaterialX/Looks")
MODEL = Sdf.Path("/ModelRoot")


def write_looks(document: Document, layer: Sdf.Layer, report_skipped: ReportSkipped) -> None:
    """Adds the looks of a document to the layer that contains its materials."""
    looks = document.root.getLooks()
    if not looks:
        return
    writer = _LooksWriter(document.root, Usd.Stage.Open(layer), report_skipped)
    for collection in document.root.getCollections():
        writer.collection(collection, ())
    for look in looks:
        writer.look(look, ())


class _LooksWriter:
    """Writer of collections and looks; each one is written only once."""

    def __init__(self, root: Any, stage: Usd.Stage, report_skipped: ReportSkipped) -> None:
        self._root = root
        self._stage = stage
        self._report_skipped = report_skipped
        self._collections: dict[str, str] = {}
        self._written: set[str] = set()
        variants = stage.DefinePrim(MODEL).GetVariantSets().AddVariantSet("LookVariant")
        self._variants = variants

    def collection(self, element: Any, above: tuple[str, ...]) -> str:
        """Writes a collection and returns its instance name.

        ``above`` lists the collections that include this collection.
        """
        name = element.getName()
        if name in self._collections:
            return self._collections[name]
        api = self._new(valid(name))
        self._collections[name] = valid(name)
        for other in element.getIncludeCollections():
            if other.getName() in (*above, name):
                self._report_skipped(element, "MaterialX collection includes itself (left out)")
                continue
            inside = self.collection(other, (*above, name))
            api.IncludePath(COLLECTIONS.AppendProperty(f"collection:{inside}"))
        prefix = element.getActiveGeomPrefix()
        for include, text in ((True, element.getIncludeGeom()), (False, element.getExcludeGeom())):
            for path in self._geometry(element, prefix, text):
                relation = api.CreateIncludesRel() if include else api.CreateExcludesRel()
                relation.AddTarget(path)
        return self._collections[name]

    def _new(self, name: str) -> Usd.CollectionAPI:
        return Usd.CollectionAPI.Apply(self._stage.DefinePrim(COLLECTIONS), name)

    def _geometry(self, element: Any, prefix: str, text: str) -> list[Sdf.Path]:
        """Returns the prim paths in a list of geometry names; reports and skips name patterns."""
        found = []
        for word in (part.strip() for part in text.split(",")):
            name = prefix + word
            if not word:
                continue
            if Sdf.Path.IsValidPathString(name) and Sdf.Path(name).IsAbsoluteRootOrPrimPath():
                found.append(Sdf.Path(name).ReplacePrefix(Sdf.Path.absoluteRootPath, COLLECTIONS))
            else:
                self._report_skipped(
                    element, f"MaterialX geometry {name} is no path of a prim (left out)"
                )
        return found

    def _assigned(self, assign: Any) -> str | None:
        """Returns the name of the collection that gets a material; None means the whole model."""
        if assign.getCollectionString():
            collection = self._root.getCollection(assign.getCollectionString())
            if collection is not None:
                return self.collection(collection, ())
            self._report_skipped(
                assign, "MaterialX collection does not exist (material not assigned)"
            )
            return ""
        if not assign.getGeom():
            return None
        prefix = assign.getActiveGeomPrefix()
        paths = sorted(set(self._geometry(assign, prefix, assign.getGeom())))
        key = f"geom {','.join(map(str, paths))}"
        if key not in self._collections:
            count = sum(name.startswith("geom ") for name in self._collections)
            api = self._new(f"geom_{count + 1}")
            for path in paths:
                api.CreateIncludesRel().AddTarget(path)
            self._collections[key] = f"geom_{count + 1}"
        return self._collections[key]

    def look(self, look: Any, above: tuple[str, ...]) -> Sdf.Path:
        """Writes a look; ``above`` lists the looks that inherit from this look."""
        import MaterialX as mx

        name = look.getName()
        path = child(LOOKS, name)
        if name in self._written:
            return path
        self._written.add(name)
        prim = self._stage.DefinePrim(path)
        base = look.getInheritsFrom()
        if base is not None and base.isA(mx.Look) and base.getName() not in (*above, name):
            prim.GetReferences().AddInternalReference(self.look(base, (*above, name)))
        assigned = [(item, self._assigned(item)) for item in look.getMaterialAssigns()]
        if self._stage.GetPrimAtPath(COLLECTIONS):
            prim.GetReferences().AddInternalReference(COLLECTIONS)
        binding = UsdShade.MaterialBindingAPI.Apply(prim)
        order = []
        for item, collection in assigned:
            relation = None if collection == "" else self._bind(look, item, binding, collection)
            if relation:
                order.append(relation.GetName())
        if order:
            prim.SetPropertyOrder([*order, *prim.GetPropertyOrder()])
        self._variants.AddVariant(valid(name))
        self._variants.SetVariantSelection(valid(name))
        with self._variants.GetVariantEditContext():
            self._stage.GetPrimAtPath(MODEL).GetReferences().AddInternalReference(path)
        self._variants.ClearVariantSelection()
        return path

    def _bind(
        self, look: Any, item: Any, binding: UsdShade.MaterialBindingAPI, collection: str | None
    ) -> Usd.Relationship | None:
        """Binds a material to a collection in a look, or to the whole model."""
        material = child(MATERIALS, item.getMaterial())
        if not self._stage.GetPrimAtPath(material):
            self._report_skipped(
                item, f"MaterialX material {item.getMaterial()} does not exist (not assigned)"
            )
            return None
        scope = binding.GetPath().AppendChild("Materials")
        name = valid(item.getName())
        while self._stage.GetPrimAtPath(scope.AppendChild(name)):
            name += "_1"
        prim = self._stage.DefinePrim(scope.AppendChild(name))
        prim.GetReferences().AddInternalReference(material)
        chosen = {v.getVariantSetString(): v.getVariantString() for v in look.getVariantAssigns()}
        for element in item.getChildren():
            if element.getCategory() == "variantassign":
                chosen[element.getAttribute("variantset")] = element.getAttribute("variant")
        for variant_set, variant in chosen.items():
            if self._variant(material, variant_set, variant):
                prim.GetVariantSet(valid(variant_set)).SetVariantSelection(valid(variant))
        bound = UsdShade.Material(self._stage.GetPrimAtPath(prim.GetPath()))
        if collection is None:
            binding.Bind(bound)
            return binding.GetDirectBindingRel()
        api = Usd.CollectionAPI(binding.GetPrim(), collection)
        binding.Bind(api, bound, name)
        return binding.GetCollectionBindingRel(name)

    def _variant(self, material: Sdf.Path, variant_set: str, variant: str) -> bool:
        """Writes a material variant, with other input values; returns whether it exists."""
        found = self._root.getVariantSet(variant_set)
        element = None if found is None else found.getVariant(variant)
        if element is None:
            return False
        prim = self._stage.GetPrimAtPath(material)
        choices = prim.GetVariantSets().AddVariantSet(valid(variant_set))
        choices.AddVariant(valid(variant))
        choices.SetVariantSelection(valid(variant))
        with choices.GetVariantEditContext():
            for item in element.getChildren():
                kind = item.getAttribute("type")
                usd = usd_type(kind)
                if item.getCategory() != "input" or usd is None:
                    continue
                try:
                    value = usd_value(item.getAttribute("value"), kind)
                except ValueError as error:
                    self._report_skipped(item, f"MaterialX value {error} (left out)")
                    continue
                UsdShade.Material(prim).CreateInput(valid(item.getName()), usd).Set(value)
        choices.ClearVariantSelection()
        return True


MATERIALS = Sdf.Path("/MaterialX/Materials")
SHADERS = Sdf.Path("/MaterialX/Shaders")


class Materials:
    """Writer of materials.

    The inputs of shaders become inputs of the material, so that stronger layers can override them.
    Nodes that drive a shader are referenced below the material. All shaders are written below
    ``SHADERS``.
    """

    def __init__(self, document: Document, prims: Prims, graphs: Graphs) -> None:
        self._document = document
        self._prims = prims
        self._graphs = graphs

    def all(self) -> None:
        """Writes all materials of the document."""
        import MaterialX as mx

        for material in self._document.root.getMaterialNodes():
            path = child(MATERIALS, material.getName())
            prim = self._prims.define(path, "Material")
            version = Sdf.AttributeSpec(prim, "config:mtlx:version", Sdf.ValueTypeNames.String)
            version.default = self._document.root.getVersionString()
            for kind, terminal in TERMINALS.items():
                for shader in mx.getShaderNodes(material, kind):
                    source = self._shader(prim, shader, kind)
                    name = terminal if terminal == "light" else f"mtlx:{terminal}"
                    known = prim.attributes.get(f"outputs:{name}")
                    output = known or Sdf.AttributeSpec(
                        prim, f"outputs:{name}", Sdf.ValueTypeNames.Token
                    )
                    connect(output, source)

    def _shader(self, material: Sdf.PrimSpec, shader: Any, kind: str) -> Sdf.Path:
        """Writes a shader below a material; returns the path of its output."""
        import MaterialX as mx

        container = shader.getParent()
        if container.isA(mx.NodeGraph):
            graph = self._below(material.path, container)
            for output in container.getOutputs():
                if output.getNodeName() == shader.getName():
                    return graph.AppendProperty(f"outputs:{valid(output.getName())}")
        path = child(material.path, shader.getName())
        nodedef = definition(shader)
        inside = implementation(self._document, nodedef)
        output = TERMINALS[kind]
        if inside is None:
            shared = child(SHADERS, shader.getName())
            if not self._prims.layer.GetPrimAtPath(shared):
                self._prims.port(self._graphs.instance(shader, shared), "outputs", output, kind)
            prim = self._prims.refer(path, shared)
            prim.typeName = "Shader"
        else:
            prim = self._graphs.instance(shader, path)
            outputs = nodedef.getActiveOutputs()
            output = valid(outputs[0].getName()) if outputs else "out"
        for item in [] if nodedef is None else nodedef.getActiveInputs():
            self._interface(material, prim, item)
        for item in shader.getInputs():
            self._prims.give(self._interface(material, prim, item), item)
            source = self._source(material.path, item)
            if source is not None:
                connect(prim.attributes[f"inputs:{valid(item.getName())}"], source)
        return path.AppendProperty(f"outputs:{output}")

    def _interface(
        self, material: Sdf.PrimSpec, shader: Sdf.PrimSpec, item: Any
    ) -> Sdf.AttributeSpec:
        """Connects a shader input to a new input of the material; returns the material's input."""
        port = self._prims.port(material, "inputs", item.getName(), item.getType())
        connect(self._prims.port(shader, "inputs", item.getName(), item.getType()), port.path)
        return port

    def _source(self, material: Sdf.Path, item: Any) -> Sdf.Path | None:
        """Returns the path, below the material, of the output that drives a shader input."""
        source = self._graphs.source(item, GRAPHS, self._document.root)
        if source is None:
            return None
        graph = self._document.root.getNodeGraph(item.getNodeGraphString())
        if graph is not None:
            return source.ReplacePrefix(self._graphs.graph(graph), self._below(material, graph))
        self._graphs.loose()
        below = child(material, GRAPHS.name)
        self._prims.refer(below, GRAPHS)
        return source.ReplacePrefix(GRAPHS, below)

    def _below(self, material: Sdf.Path, graph: Any) -> Sdf.Path:
        """References a node graph below a material, together with nodes that drive it."""
        path = self._graphs.graph(graph)
        if is_closed(graph):
            below = child(material, path.name)
            self._prims.refer(below, path)
            return below
        self._graphs.loose()
        scope = child(material, GRAPHS.name)
        self._prims.refer(scope, GRAPHS)
        return path.ReplacePrefix(GRAPHS, scope)
