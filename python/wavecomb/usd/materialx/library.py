# SPDX-License-Identifier: Apache-2.0
"""The definitions that come with MaterialX, and its node graphs made flat.

The library is read once for the process, when something first asks for it; a definition is made
flat once.
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
"""Components of a value by its MaterialX type."""

_reading = threading.RLock()


@functools.cache
def _read() -> Any:
    import MaterialX as mx

    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


def library() -> Any:
    """The document of the node definitions that come with MaterialX."""
    with _reading:
        return _read()


@dataclass(frozen=True)
class Feed:
    """What feeds an input of a node, or an output of a graph: one of three.

    Attributes:
        type: MaterialX's name of its type.
        value: As the library writes it; "" where there is none.
        interface: An input of the graph.
        node: A node of the graph.
        output: Of that node; "" where it has one only.
        place: Where no other is given: position, normal, tangent, bitangent, viewdirection or
            texcoord.
        space: Of that place: object or world.
    """

    type: str
    value: str = ""
    interface: str = ""
    node: str = ""
    output: str = ""
    place: str = ""
    space: str = ""


@dataclass(frozen=True)
class Inner:
    """A node of a flat graph.

    Attributes:
        category: Without types.
        identifier: Name of its definition.
        inputs: What feeds those that the graph gives something.
        outputs: Their types by name.
    """

    category: str
    identifier: str
    inputs: dict[str, Feed]
    outputs: dict[str, str]


@dataclass(frozen=True)
class Definition:
    """A node of the library.

    Attributes:
        identifier: Its name, ``ND_...``.
        category: Of its nodes, without types.
        inputs: What its inputs are where nobody gives them a value.
        outputs: Their types by name.
    """

    identifier: str
    category: str
    inputs: dict[str, Feed]
    outputs: dict[str, str]


@dataclass(frozen=True)
class FlatGraph:
    """A node graph without node graphs in it.

    Attributes:
        definition: Which it implements.
        nodes: By name, each after those that feed it.
        results: What feeds the outputs, by name.
    """

    definition: Definition
    nodes: dict[str, Inner]
    results: dict[str, Feed]


@functools.cache
def definition_of(identifier: str) -> Definition | None:
    """The definition of that name; None where the library has none."""
    with _reading:
        nodedef = library().getNodeDef(identifier)
        if nodedef is None:
            return None
        inputs = {item.getName(): _default(item) for item in nodedef.getActiveInputs()}
        return Definition(identifier, nodedef.getNodeString(), inputs, _outputs(nodedef))


@functools.cache
def flat_graph(identifier: str, primitives: Collection[str]) -> FlatGraph | None:
    """The node graph that a definition stands for, made flat by MaterialX.

    Args:
        identifier: Name of the definition.
        primitives: Categories of nodes that are left as they are, frozen.

    Returns:
        None where the library implements the node in code, or has none of that name.
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
        # The graph's own content, in a document that may be changed. A graph in it that stands
        # for no definition keeps what its nodes read of its interface.
        document = mx.createDocument()
        document.setDataLibrary(library())
        graph = document.addNodeGraph("flat")
        graph.copyContentFrom(found)
        graph.removeAttribute("nodedef")
        graph.flattenSubgraphs("", lambda node: node.getCategory() not in primitives)
        nodes = {node.getName(): _inner(node) for node in graph.getNodes()}
        results = {output.getName(): _feed(output) for output in graph.getOutputs()}
    return FlatGraph(definition, _ordered(nodes), results)


def _ordered(nodes: dict[str, Inner]) -> dict[str, Inner]:
    """Nodes, each after those that feed it."""
    done: dict[str, Inner] = {}
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


def _inner(node: Any) -> Inner:
    nodedef = node.getNodeDef()
    inputs = {item.getName(): _feed(item) for item in node.getInputs()}
    identifier = "" if nodedef is None else nodedef.getName()
    outputs = {"out": node.getType()} if nodedef is None else _outputs(nodedef)
    return Inner(node.getCategory(), identifier, inputs, outputs)


def _outputs(nodedef: Any) -> dict[str, str]:
    return {output.getName(): output.getType() for output in nodedef.getActiveOutputs()}


def _feed(item: Any) -> Feed:
    node = item.getNodeName()
    if node:
        return Feed(item.getType(), node=node, output=item.getOutputString())
    interface = item.getInterfaceName()
    if interface:
        return Feed(item.getType(), interface=interface)
    return Feed(item.getType(), value=item.getValueString())


def _default(item: Any) -> Feed:
    place = item.getDefaultGeomProp()
    if place is None:
        return Feed(item.getType(), value=item.getValueString())
    return Feed(item.getType(), place=place.getGeomProp(), space=place.getSpace() or "object")
