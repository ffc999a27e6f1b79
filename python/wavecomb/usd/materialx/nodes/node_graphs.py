# SPDX-License-Identifier: Apache-2.0
"""Compiles nodes that MaterialX's library implements as graphs, by compiling the graphs.

Nodes that have a handler are compiled by the handler instead.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from wavecomb.usd.graphs.surface_parameters import NORMAL, NUMBER
from wavecomb.usd.graphs.values import Value, numbers
from wavecomb.usd.materials.network import Source
from wavecomb.usd.materialx.library import WIDTHS, FlatGraph, FlatNode, PortSource
from wavecomb.usd.materialx.nodes import arithmetic, arnold, colours, geometric, images
from wavecomb.usd.materialx.nodes.node import Handler, NodeCall

PRIMITIVES: dict[str, Handler] = {
    name: handler
    for module in (arithmetic, arnold, colours, images, geometric)
    for name, handler in module.NODES.items()
}

CATEGORIES = frozenset(PRIMITIVES)
"""Categories of nodes that have a handler and are not replaced by library graphs."""

NOT_NUMBERS = ("string", "filename", "geomname")
"""MaterialX types of inputs that hold text."""


_PLACES = ("texcoord", "st", "position", "normal", "index", "octaves", "style")
"""Names of inputs that are read as plain numbers, independent of the use of the node's output."""


def _kind(category: str, name: str, kind: str) -> str:
    """Returns the use of the value of a node's input."""
    if category == "normalmap" and name == "in":
        return NORMAL
    return NUMBER if name in _PLACES else kind


class ExpandedGraph:
    """Library graph that is compiled in place of a node."""

    def __init__(self, call: NodeCall, graph: FlatGraph, spread: int = 0) -> None:
        """``spread`` is the width of numbers in graphs that act per component; 0 otherwise."""
        self.call = call
        self._graph = graph
        self._spread = spread
        self._done: dict[tuple[str, str, str], Value | None] = {}

    def output(self, name: str) -> Value | None:
        """Returns the value of an output of the graph."""
        result = self._graph.results.get(name) or next(iter(self._graph.results.values()))
        nodes, interfaces = self._needed(result)
        # Evaluate interface inputs first and then nodes in order of their dependencies, which
        # avoids deep recursion in long graphs.
        for interface, kind in interfaces:
            self.call.inputs.find(interface, kind)
        for node, output, kind in nodes:
            self._node(node, output, kind)
        return self.source_value(result, self.call.kind)

    def _needed(
        self, result: PortSource
    ) -> tuple[list[tuple[str, str, str]], list[tuple[str, str]]]:
        """Returns the nodes (in evaluation order) and graph inputs that an output needs."""
        nodes: dict[tuple[str, str, str], None] = {}
        interfaces: dict[tuple[str, str], None] = {}
        stack = [(result, self.call.kind)]
        while stack:
            feed, kind = stack.pop()
            if feed.interface:
                interfaces[feed.interface, kind] = None
            elif feed.node in self._graph.nodes and (feed.node, feed.output, kind) not in nodes:
                nodes[feed.node, feed.output, kind] = None
                inner = self._graph.nodes[feed.node]
                for name, one in inner.inputs.items():
                    stack.append((one, _kind(inner.category, name, kind)))
        places = {name: i for i, name in enumerate(self._graph.nodes)}
        return sorted(nodes, key=lambda one: places[one[0]]), list(interfaces)

    def _node(self, name: str, output: str, kind: str) -> Value | None:
        key = (name, output, kind)
        if key not in self._done:
            inner = self._graph.nodes[name]
            output = output if output in inner.outputs else next(iter(inner.outputs), "out")
            width = WIDTHS.get(inner.outputs.get(output, ""), 0)
            width = self._spread if self._spread and width == 1 else width
            networks = self.call.networks
            call = NodeCall(
                networks, _LibraryInputs(self, inner), inner.category, inner.identifier, output,
                width, kind,
            )  # fmt: skip
            self._done[key] = networks.compiled(call)
        return self._done[key]

    def source_value(self, feed: PortSource, kind: str) -> Value | None:
        """Returns the value of a source."""
        if feed.node:
            return self._node(feed.node, feed.output, kind)
        if feed.interface:
            outside = self.call.inputs.find(feed.interface, kind)
            if outside is not None:
                return outside
            default = self._graph.definition.inputs.get(feed.interface)
            return None if default is None else self.source_value(default, kind)
        if feed.place:
            return self.call.at_place(feed.place, feed.space)
        return literal(feed)

    def source(self, feed: PortSource) -> Source | None:
        """Returns the source of a text input."""
        if feed.interface:
            outside = self.call.inputs.source(feed.interface)
            default = self._graph.definition.inputs.get(feed.interface)
            return outside if outside is not None or default is None else self.source(default)
        value = _word(feed)
        return None if value is None else Source(value=value)

    def is_given(self, feed: PortSource) -> bool:
        """Returns whether the source of an input is set, as opposed to a default."""
        return self.call.inputs.has(feed.interface) if feed.interface else True


class _LibraryInputs:
    """Inputs of a node inside a library graph; implements ``node.Inputs``."""

    def __init__(self, body: ExpandedGraph, node: FlatNode) -> None:
        self._body = body
        self._node = node

    @property
    def path(self) -> Sdf.Path:
        """Path of the prim that the graph replaces, for messages."""
        return self._body.call.inputs.path

    def find(self, name: str, kind: str) -> Value | None:
        """Returns the value of a node input; None if it is not set."""
        feed = self._node.inputs.get(name)
        return None if feed is None else self._body.source_value(feed, kind)

    def source(self, name: str) -> Source | None:
        """Returns the source of a node input that holds text."""
        feed = self._node.inputs.get(name)
        return None if feed is None else self._body.source(feed)

    def has(self, name: str) -> bool:
        """Returns whether an input is set."""
        feed = self._node.inputs.get(name)
        return feed is not None and self._body.is_given(feed)

    def names(self) -> list[str]:
        """Returns the names of inputs that are set."""
        return list(self._node.inputs)


def literal(feed: PortSource) -> Value | None:
    """Parses the numbers in the text of a source's value; returns None for text values."""
    if not feed.value or feed.type in NOT_NUMBERS:
        return None
    if feed.type == "boolean":
        return numbers(float(feed.value.strip() == "true"))
    try:
        return numbers(*(float(word) for word in feed.value.replace(",", " ").split()))
    except ValueError:
        return None


def _word(feed: PortSource) -> Any:
    return feed.value if feed.type in NOT_NUMBERS and feed.value else None
