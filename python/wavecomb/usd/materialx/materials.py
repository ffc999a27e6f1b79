# SPDX-License-Identifier: Apache-2.0
"""MaterialX materials as prims: an interface, its shaders, and the graphs that feed them."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from wavecomb.usd.materialx.files import Document
from wavecomb.usd.materialx.graphs import GRAPHS, Graphs, definition, implementation, is_closed
from wavecomb.usd.materialx.prims import TERMINALS, Prims, child, connect, valid

MATERIALS = Sdf.Path("/MaterialX/Materials")
SHADERS = Sdf.Path("/MaterialX/Shaders")


class Materials:
    """Writes materials.

    The inputs of its shaders are inputs of the material, so that layers above can change them; what
    feeds a shader is referenced below the material. Shaders themselves are in ``SHADERS``.
    """

    def __init__(self, document: Document, prims: Prims, graphs: Graphs) -> None:
        self._document = document
        self._prims = prims
        self._graphs = graphs

    def all(self) -> None:
        """All materials of the document."""
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
        """Writes a shader below a material; gives its output."""
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
        """The input of a material that a shader's comes from."""
        port = self._prims.port(material, "inputs", item.getName(), item.getType())
        connect(self._prims.port(shader, "inputs", item.getName(), item.getType()), port.path)
        return port

    def _source(self, material: Sdf.Path, item: Any) -> Sdf.Path | None:
        """What feeds the input of a shader: of the graphs, as they are below the material."""
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
        """A node graph below a material; with all the others where it is fed by one of them."""
        path = self._graphs.graph(graph)
        if is_closed(graph):
            below = child(material, path.name)
            self._prims.refer(below, path)
            return below
        self._graphs.loose()
        scope = child(material, GRAPHS.name)
        self._prims.refer(scope, GRAPHS)
        return path.ReplacePrefix(GRAPHS, scope)
