# SPDX-License-Identifier: GPL-3.0-or-later
"""Shading normals of materials: normal maps, and baked bumps and displacements."""

from __future__ import annotations

from typing import Any

from .graph import Value, number
from .neutral import Surface
from .nodes import Nodes


def normal_of(n: Nodes, socket: Any) -> Value | None:
    """Returns the normal that drives an input in tangent space; None, after a message, if none."""
    link = next((k for k in socket.links if k.is_valid and not k.is_muted), None)
    if link is None or link.from_node.mute:
        return None
    node, source = link.from_node, link.from_socket
    if node.type == "REROUTE":
        return normal_of(n, node.inputs[0])
    if node.type == "NORMAL_MAP" and node.space == "TANGENT":
        value = n.socket(socket, "vector3")
        return value if value.constant is None else None
    if node.type in ("NEW_GEOMETRY", "TEX_COORD") and source.name == "Normal":
        return None
    return _baked(n, node, source, "normal", f"normal by the node {node.bl_label}")


def _baked(n: Nodes, node: Any, source: Any, kind: str, feature: str) -> Value | None:
    found = None if n.is_in_group else n.texture(node, source, kind)
    if found is None:
        n.miss(feature)
        return None
    texel = n.graph.to("vector3", found)
    return n.graph.node("normalmap_float", "vector3", in_=texel, scale=number(1), space="object")


def write_displacement(n: Nodes, material: Any, socket: Any, surface: Surface) -> None:
    """Renders displacement as a bump, as Blender does by default."""
    if not socket.links:
        return
    node, source = socket.links[0].from_node, socket.links[0].from_socket
    method = getattr(material, "displacement_method", None) or material.cycles.displacement_method
    if node.type != "DISPLACEMENT":
        n.miss(f"displacement by the node {node.bl_label}")
        return
    if "geometry_normal" in surface:
        n.miss("displacement of a material with a normal")
        return
    if method != "BUMP":
        n.approximate("displacement (a bump instead)")
    n.within([])
    value = _baked(n, node, source, "height", "displacement")
    if value is not None:
        surface["geometry_normal"] = value
