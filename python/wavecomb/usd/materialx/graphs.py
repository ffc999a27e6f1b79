# SPDX-License-Identifier: Apache-2.0
"""Writes MaterialX nodes and node graphs as prims."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from wavecomb.usd.materialx.files import Document
from wavecomb.usd.materialx.prims import TERMINALS, Prims, child, connect, valid

GRAPHS = Sdf.Path("/MaterialX/NodeGraphs")
"""Path of the parent prim of all node graphs and of nodes outside of graphs."""

MAX_EXPANDED = 4096
"""Number of nodes of a graph, with nested graphs, above which nested graphs become USD instances.

Instances are needed since a short document may nest graphs into billions of nodes.
"""

_SMALL = 32
"""Number of nodes up to which a nested graph does not become an instance."""


def definition(node: Any) -> Any:
    """Returns the definition that matches a node best, or None."""
    found = node.getNodeDef()
    return found if found is not None else node.getNodeDef("", True)


def implementation(document: Document, nodedef: Any) -> Any:
    """Returns the node graph that implements a definition of the document, or None."""
    import MaterialX as mx

    if nodedef is None or nodedef.getName() not in document.definitions:
        return None
    found = nodedef.getImplementation()
    return found if found is not None and found.isA(mx.NodeGraph) else None


def output_name(node: Any, wanted: str) -> str:
    """Returns the name of the node output that a connection refers to."""
    nodedef = definition(node)
    names = [] if nodedef is None else [output.getName() for output in nodedef.getActiveOutputs()]
    return wanted if wanted and (wanted in names or not names) else next(iter(names), "out")


def output_path(graph: Sdf.Path, node: Any, wanted: str) -> Sdf.Path:
    """Returns the path of the node output that a connection refers to."""
    return _port(child(graph, node.getName()), "outputs", output_name(node, wanted))


def _port(prim: Sdf.Path, kind: str, name: str) -> Sdf.Path:
    return prim.AppendProperty(f"{kind}:{valid(name)}")


def is_closed(graph: Any) -> bool:
    """Returns whether no input of a node graph is connected to nodes outside of the graph."""
    return not any(item.getNodeName() or item.getNodeGraphString() for item in graph.getInputs())


class Graphs:
    """Writer of node graphs; each graph is written only once."""

    def __init__(self, document: Document, prims: Prims) -> None:
        self._document = document
        self._prims = prims
        self._written: set[Sdf.Path] = set()
        self._sizes: dict[str, int] = {}

    def all(self) -> None:
        """Writes all node graphs of the document, and the nodes outside of graphs."""
        for graph in self._document.graphs:
            self.graph(graph)
        if self._loose():
            self.loose()

    def graph(self, graph: Any) -> Sdf.Path:
        """Writes a node graph under its name, or the name of the definition that it implements."""
        nodedef = graph.getNodeDef()
        path = child(GRAPHS, (graph if nodedef is None else nodedef).getName())
        if path in self._written:
            return path
        self._written.add(path)
        prim = self._prims.define(path, "NodeGraph")
        for owner in (nodedef, graph):
            for item in [] if owner is None else owner.getActiveInputs():
                self._give(self._prims.port(prim, "inputs", item.getName(), item.getType()), item)
                # The nodes that a graph's inputs are connected to are siblings of the graph.
                self._join(prim, item, GRAPHS, self._document.root)
        for node in graph.getNodes():
            self._node(node, path, graph)
        for output in graph.getOutputs():
            port = self._prims.port(prim, "outputs", output.getName(), output.getType())
            self._connect(port, output, path, graph)
        return path

    def loose(self) -> Sdf.Path:
        """Writes the parent prim of all nodes outside of node graphs."""
        if GRAPHS not in self._written:
            self._written.add(GRAPHS)
            self._prims.define(GRAPHS)
            for node in self._loose():
                self._node(node, GRAPHS, self._document.root)
        return GRAPHS

    def _loose(self) -> list[Any]:
        """Returns nodes outside of graphs, except materials and shaders that only materials use."""
        nodes = self._document.root.getNodes()
        used = {
            item.getNodeName()
            for node in nodes
            if node.getType() != "material"
            for item in node.getInputs()
        }
        return [
            node
            for node in nodes
            if node.getType() != "material"
            and (node.getType() not in TERMINALS or node.getName() in used)
        ]

    def _node(self, node: Any, graph: Sdf.Path, container: Any) -> None:
        prim = self.instance(node, child(graph, node.getName()))
        for item in node.getInputs():
            port = self._prims.port(prim, "inputs", item.getName(), item.getType())
            self._give(port, item)
            self._join(prim, item, graph, container)
        nodedef = definition(node)
        for output in [] if nodedef is None else nodedef.getActiveOutputs():
            self._prims.port(prim, "outputs", output.getName(), output.getType())

    def instance(self, node: Any, path: Sdf.Path) -> Sdf.PrimSpec:
        """Writes the prim of a node, which is a shader or an instance of a node graph."""
        nodedef = definition(node)
        inside = implementation(self._document, nodedef)
        if inside is not None:
            spec = self._prims.refer(path, self.graph_of(nodedef, inside))
            spec.typeName = "NodeGraph"
            if self._is_deep() and self._nodes_in(inside) > _SMALL:
                spec.instanceable = True
            return spec
        prim = self._prims.define(path, "Shader")
        if nodedef is None:
            self._prims.report_skipped(
                node, f"MaterialX node {node.getCategory()} has no definition"
            )
        self._prims.identify(prim, node.getCategory() if nodedef is None else nodedef.getName())
        return prim

    def _is_deep(self) -> bool:
        """Returns whether any graph, with nested graphs, has over ``MAX_EXPANDED`` nodes."""
        return any(self._nodes_in(graph) > MAX_EXPANDED for graph in self._document.graphs)

    def _nodes_in(self, graph: Any) -> int:
        """Returns the number of nodes of a graph, including nested graphs."""
        name = graph.getName()
        if name not in self._sizes:
            # This check ends the recursion for a graph that contains itself.
            self._sizes[name] = 0
            total = 0
            for node in graph.getNodes():
                inside = implementation(self._document, definition(node))
                total += 1 if inside is None else self._nodes_in(inside)
            self._sizes[name] = total
        return self._sizes[name]

    def graph_of(self, nodedef: Any, inside: Any) -> Sdf.Path:
        """Writes the node graph that implements a definition."""
        path = self.graph(inside)
        prim = self._prims.define(path)
        for item in nodedef.getActiveInputs():
            if f"inputs:{valid(item.getName())}" not in prim.attributes:
                self._give(self._prims.port(prim, "inputs", item.getName(), item.getType()), item)
        return path

    def _give(self, port: Sdf.AttributeSpec, item: Any) -> None:
        makes_colour = True
        if item.getType() == "filename":
            owner = item.getParent()
            makes_colour = any(
                output.getType() in ("color3", "color4") for output in _outputs_of(owner)
            )
        self._prims.give(port, item, makes_colour=makes_colour)

    def _join(self, prim: Sdf.PrimSpec, item: Any, graph: Sdf.Path, container: Any) -> None:
        port = prim.attributes[f"inputs:{valid(item.getName())}"]
        if item.getInterfaceName():
            connect(port, _port(graph, "inputs", item.getInterfaceName()))
        else:
            self._connect(port, item, graph, container)

    def _connect(self, port: Sdf.AttributeSpec, item: Any, graph: Sdf.Path, container: Any) -> None:
        """Connects an input or output to the source that the MaterialX element names."""
        source = self.source(item, graph, container)
        if source is not None:
            connect(port, source)

    def source(self, item: Any, graph: Sdf.Path, container: Any) -> Sdf.Path | None:
        """Returns the path of an element's source; ``graph`` is the element's parent prim."""
        wanted = item.getOutputString()
        if item.getNodeName():
            node = container.getNode(item.getNodeName())
            if node is not None:
                return output_path(graph, node, wanted)
        elif item.getNodeGraphString():
            other = self._document.root.getNodeGraph(item.getNodeGraphString())
            if other is not None:
                path = self.graph(other)
                outputs = [output.getName() for output in other.getOutputs()]
                return _port(path, "outputs", wanted or next(iter(outputs), "out"))
        elif wanted:
            output = container.getOutput(wanted)
            if output is not None and output.getNodeName() and output is not item:
                return self.source(output, graph, container)
        else:
            return None
        self._prims.report_skipped(item, "MaterialX connection has no target (left out)")
        return None


def _outputs_of(element: Any) -> list[Any]:
    """Returns the outputs of a node, a definition or a graph."""
    import MaterialX as mx

    if element.isA(mx.Node):
        nodedef = definition(element)
        return [] if nodedef is None else list(nodedef.getActiveOutputs())
    return list(element.getOutputs()) if element.isA(mx.InterfaceElement) else []
