# SPDX-License-Identifier: GPL-3.0-or-later
"""Translates value nodes of Blender's materials to MaterialX."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .context import Translation
from .graph import Graph, Value, colour, number, vector

KINDS = {
    "VALUE": "float",
    "INT": "float",
    "BOOLEAN": "float",
    "RGBA": "color3",
    "VECTOR": "vector3",
}


class Nodes:
    """Translates the nodes of one material.

    Attributes:
        into: State of the scene translation.
        graph: MaterialX nodes of the material.
        owner: Name of the material, for messages.
        normal: Shading normal that the surface's normal input gave, if any.
    """

    def __init__(self, into: Translation, graph: Graph, owner: str) -> None:
        self.into, self.graph, self.owner = into, graph, owner
        self._known: dict[tuple[Any, ...], Value] = {}
        self._groups: list[Any] = []
        self._shader_depth = 0
        self._missed: list[str] = []

    def read(self, node: Any, name: str | int, kind: str | None = None) -> Value:
        """Returns the value of an input of a node."""
        return self.socket(node.inputs[name], kind)

    def socket(self, socket: Any, kind: str | None = None) -> Value:
        """Returns the value of an input socket, converted to ``kind``."""
        kind = kind or KINDS.get(socket.type, "float")
        own = KINDS.get(socket.type, kind)
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return self.graph.to(kind, self._constant(socket, own))
        found = self.output(link.from_node, link.from_socket)
        if found is None:
            return self.graph.to(kind, self._constant(socket, own))
        return self.graph.to(kind, found)

    @staticmethod
    def _constant(socket: Any, kind: str) -> Value:
        value: Any = getattr(socket, "default_value", 0.0)
        if kind == "float":
            return number(value if not hasattr(value, "__len__") else value[0])
        return colour(value) if kind == "color3" else vector(value)

    def output(self, node: Any, socket: Any) -> Value | None:
        """Returns the value of an output of a node; None, after a message, if not supported."""
        from .node_types import TYPES

        if node.mute:
            return self._bypassed(node, socket)
        if node.type == "REROUTE":
            return self.socket(node.inputs[0], KINDS.get(node.inputs[0].type, "color3"))
        if node.type == "GROUP":
            return self._group_or_baked(node, socket)
        if node.type == "GROUP_INPUT":
            return self._group_input(socket)
        key = (*(id(group) for group in self._groups), node.name, socket.identifier)
        if key not in self._known:
            made: Callable[[Nodes, Any, Any], Value | None] | None = TYPES.get(node.type)
            value = made(self, node, socket) if made is not None else None
            value = self._baked(node, socket) if value is None else value
            if value is None:
                return None
            self._known[key] = value
        return self._known[key]

    def _baked(self, node: Any, socket: Any) -> Value | None:
        """Returns a texture instead of a node that has no translation; None after a message."""
        text = f"node {node.bl_label} (the input's own value instead)"
        if len(self._groups) > self._shader_depth:
            self._missed.append(text)  # The group around it may be baked.
            return None
        found = None if self._groups else self.texture(node, socket, "value")
        if found is None:
            self.miss(text)
            return None
        kind = KINDS.get(socket.type, "color3")
        return self.graph.component(found, 0) if kind == "float" else self.graph.to(kind, found)

    def _group_or_baked(self, node: Any, socket: Any) -> Value | None:
        value = self._group(node, socket)
        if len(self._groups) > self._shader_depth or not self._missed:
            return value
        lines, self._missed = self._missed, []
        found = None if self._groups else self.texture(node, socket, "value")
        if found is not None:
            kind = KINDS.get(socket.type, "color3")
            return self.graph.component(found, 0) if kind == "float" else found
        for line in lines:
            self.miss(line)
        return value

    def texture(self, node: Any, socket: Any, kind: str) -> Value | None:
        """Returns the texture of an output that will be baked; None if it cannot be."""
        from .textures import LAYER, request

        file = request(self.into, self.owner, node, socket, kind)
        if file is None:
            return None
        where = self.graph.node("geompropvalue_vector2", "vector2", geomprop=LAYER)
        return self.graph.image("color3", file, "lin_rec709", where, "clamp")

    def _bypassed(self, node: Any, socket: Any) -> Value | None:
        for link in node.internal_links:
            if link.to_socket == socket:
                return self.socket(link.from_socket)
        return None

    def _group(self, node: Any, socket: Any) -> Value | None:
        """Returns the value of an output of a node group, from the nodes inside the group."""
        if node.node_tree is None:
            return None
        output = next((n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"), None)
        if output is None:
            return None
        inner = next((s for s in output.inputs if s.identifier == socket.identifier), None)
        if inner is None:
            return None
        self._groups.append(node)
        try:
            return self.socket(inner, KINDS.get(inner.type))
        finally:
            self._groups.pop()

    def _group_input(self, socket: Any) -> Value | None:
        """Returns the value of an input of a node group, from the nodes outside of the group."""
        if not self._groups:
            return None
        group = self._groups.pop()
        try:
            outer = next((s for s in group.inputs if s.identifier == socket.identifier), None)
            return None if outer is None else self.socket(outer, KINDS.get(outer.type))
        finally:
            self._groups.append(group)

    def shader(self, socket: Any) -> tuple[Any, list[Any]] | None:
        """Returns the shader node that drives a socket, with the enclosing groups of the node."""
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return None
        node, at = link.from_node, link.from_socket
        if node.type == "REROUTE":
            return self.shader(node.inputs[0])
        if node.type == "GROUP_INPUT" and self._groups:
            group = self._groups.pop()
            outer = next(s for s in group.inputs if s.identifier == at.identifier)
            return self.shader(outer)
        if node.type == "GROUP" and node.node_tree is not None:
            output = next((n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"), None)
            if output is None:
                return None
            self._groups.append(node)
            inner = next(s for s in output.inputs if s.identifier == at.identifier)
            return self.shader(inner)
        return node, list(self._groups)

    @property
    def is_in_group(self) -> bool:
        """Whether the nodes that are read are in a group."""
        return bool(self._groups)

    def within(self, groups: list[Any]) -> None:
        """Sets the enclosing groups of the nodes that are translated next."""
        self._groups = list(groups)
        self._shader_depth = len(groups)

    def miss(self, feature: str) -> None:
        """Reports a feature of the material that has no effect."""
        self.into.report.miss(feature, self.owner)

    def approximate(self, feature: str) -> None:
        """Reports a feature of the material that is approximated."""
        self.into.report.approximate(feature, self.owner)
