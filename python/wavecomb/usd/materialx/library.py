# SPDX-License-Identifier: Apache-2.0
"""MaterialX's standard node definitions and their node graphs without nesting.

The library is read on first use; each definition is flattened only once.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

WIDTHS = {
    "float": 1, "integer": 1, "boolean": 1, "vector2": 2, "vector3": 3, "color3": 3, "vector4": 4,
    "color4": 4, "matrix33": 9, "matrix44": 16,
}  # fmt: skip
"""Number of components of a value by its MaterialX type."""

_reading = threading.RLock()


@functools.cache
def _read() -> Any:
    import MaterialX as mx

    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


def library() -> Any:
    """Returns the document of MaterialX's standard node definitions."""
    with _reading:
        return _read()


@dataclass(frozen=True)
class PortSource:
    """Source of a node input or graph output: a value, a graph input or a node's output.

    Attributes:
        type: Name of the MaterialX type of the value.
        value: Value as text; empty if there is none.
        interface: Name of the graph input that is the source.
        node: Name of the node in the graph that is the source.
        output: Name of the node's output; empty if the node has only one.
        place: Geometric property that is the source, such as "position", "normal" or "texcoord".
        space: Space of the geometric property, "object" or "world".
    """

    type: str
    value: str = ""
    interface: str = ""
    node: str = ""
    output: str = ""
    place: str = ""
    space: str = ""


@dataclass(frozen=True)
class FlatNode:
    """A node of a node graph without nesting.

    Attributes:
        category: Category of the node, such as "mix".
        identifier: Name of the node's definition, such as "ND_mix_color3".
        inputs: Sources of those inputs that the graph sets, by input name.
        outputs: Types of the node's outputs by name.
    """

    category: str
    identifier: str
    inputs: dict[str, PortSource]
    outputs: dict[str, str]


@dataclass(frozen=True)
class Definition:
    """A node definition of MaterialX's standard library.

    Attributes:
        identifier: Name of the definition, such as ``ND_mix_color3``.
        category: Category of the nodes with this definition, such as "mix".
        inputs: Default sources of the inputs by name.
        outputs: Types of the outputs by name.
    """

    identifier: str
    category: str
    inputs: dict[str, PortSource]
    outputs: dict[str, str]


@dataclass(frozen=True)
class FlatGraph:
    """A node graph without nested graphs.

    Attributes:
        definition: Definition that the graph implements.
        nodes: Nodes by name, in evaluation order.
        results: Sources of the graph's outputs, by output name.
    """

    definition: Definition
    nodes: dict[str, FlatNode]
    results: dict[str, PortSource]


@functools.cache
def definition_of(identifier: str) -> Definition | None:
    """Returns the definition with a given name; None if the library has none."""
    with _reading:
        nodedef = library().getNodeDef(identifier)
        if nodedef is None:
            return None
        inputs = {item.getName(): _default(item) for item in nodedef.getActiveInputs()}
        return Definition(identifier, nodedef.getNodeString(), inputs, _outputs(nodedef))


@functools.cache
def flat_graph(identifier: str, primitives: Collection[str]) -> FlatGraph | None:
    """Returns the node graph that implements a definition, without nested graphs.

    Args:
        identifier: Name of the definition.
        primitives: Categories of nodes that are not replaced by their graphs.

    Returns:
        Returns None if the library implements the definition in code or does not have the
        definition.
    """
    import MaterialX as mx

    definition = definition_of(identifier)
    if definition is None:
        return None
    with _reading:
        nodedef = library().getNodeDef(identifier)
        found = nodedef.getImplementation()
        if found is None or not found.isA(mx.NodeGraph):
            return None
        # Copy the graph to a document that may be modified. Flattening the copy does not change
        # nested graphs that do not implement a node definition.
        document = mx.createDocument()
        document.setDataLibrary(library())
        graph = document.addNodeGraph("flat")
        graph.copyContentFrom(found)
        graph.removeAttribute("nodedef")
        graph.flattenSubgraphs("", lambda node: node.getCategory() not in primitives)
        nodes = {node.getName(): _flat_node(node) for node in graph.getNodes()}
        results = {output.getName(): _port_source(output) for output in graph.getOutputs()}
    return FlatGraph(definition, _ordered(nodes), results)


def _ordered(nodes: dict[str, FlatNode]) -> dict[str, FlatNode]:
    """Returns the nodes of a graph in evaluation order."""
    done: dict[str, FlatNode] = {}
    stack = [(name, False) for name in reversed(nodes)]
    while stack:
        name, ready = stack.pop()
        if ready:
            done[name] = nodes[name]
        elif name not in done:
            stack.append((name, True))
            feeds = nodes[name].inputs.values()
            stack += [(f.node, False) for f in feeds if f.node in nodes and f.node not in done]
    return done


def _flat_node(node: Any) -> FlatNode:
    nodedef = node.getNodeDef()
    inputs = {item.getName(): _port_source(item) for item in node.getInputs()}
    identifier = "" if nodedef is None else nodedef.getName()
    outputs = {"out": node.getType()} if nodedef is None else _outputs(nodedef)
    return FlatNode(node.getCategory(), identifier, inputs, outputs)


def _outputs(nodedef: Any) -> dict[str, str]:
    return {output.getName(): output.getType() for output in nodedef.getActiveOutputs()}


def _port_source(item: Any) -> PortSource:
    node = item.getNodeName()
    if node:
        return PortSource(item.getType(), node=node, output=item.getOutputString())
    interface = item.getInterfaceName()
    if interface:
        return PortSource(item.getType(), interface=interface)
    return PortSource(item.getType(), value=item.getValueString())


def _default(item: Any) -> PortSource:
    place = item.getDefaultGeomProp()
    if place is None:
        return PortSource(item.getType(), value=item.getValueString())
    return PortSource(item.getType(), place=place.getGeomProp(), space=place.getSpace() or "object")
