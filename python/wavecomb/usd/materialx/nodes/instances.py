# SPDX-License-Identifier: Apache-2.0
"""Node graphs that are instances: compiled once for all instances that are fed alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.graphs.node import Value
from wavecomb.usd.looks.network import Source

Compile = Callable[[UsdShade.Shader, str, str], Value | None]
"""What an output of a shader gives, for a kind of value."""


class InstancedGraphs:
    """Sources of inputs in a material that holds instances of node graphs.

    A short document nests graphs to any depth: there are many more paths than graphs. Instances of
    one prototype whose inputs come from the same places have the same value, compiled once.

    Attributes:
        are_there: Whether the material holds any.
    """

    def __init__(self, material: Usd.Prim, compile_node: Compile) -> None:
        top = material.GetPrimInPrototype() if material.IsInstanceProxy() else material
        self.are_there = any(prim.IsInstance() for prim in Usd.PrimRange(top))
        self._compile = compile_node
        self._ends: dict[Sdf.Path, Usd.Attribute] = {}
        self._values: dict[tuple[Any, ...], Value | None] = {}

    def source(self, shader_input: UsdShade.Input, time: Usd.TimeCode) -> Source | None:
        """What feeds an input, as ``network.source_of``; the shader may be an instanced graph."""
        if not shader_input:
            return None
        end = self._end(shader_input.GetAttr())
        if UsdShade.Output.IsOutput(end):
            return Source(UsdShade.Shader(end.GetPrim()), UsdShade.Output(end).GetBaseName())
        value = end.Get(time)
        return None if value is None else Source(value=value, attribute=end)

    def value(self, graph: Usd.Prim, output: str, kind: str) -> Value | None:
        """What an output of an instanced graph gives."""
        node = UsdShade.NodeGraph(graph)
        fed_by = tuple((str(i.GetBaseName()), self._origin(i)) for i in node.GetInputs())
        key = (graph.GetPrototype().GetPath(), output, kind, fed_by)
        if key not in self._values:
            self._values[key] = self._compiled(node.GetOutput(output).GetAttr(), kind)
        return self._values[key]

    def _compiled(self, output: Usd.Attribute, kind: str) -> Value | None:
        inside = self._next(output)
        end = None if inside is None else self._end(inside)
        if end is None or not UsdShade.Output.IsOutput(end):
            return None
        shader = UsdShade.Shader(end.GetPrim())
        return self._compile(shader, UsdShade.Output(end).GetBaseName(), kind)

    def _end(self, attribute: Usd.Attribute) -> Usd.Attribute:
        """Where connections lead: to an output of a shader or of an instance, or to a value."""
        passed: list[Sdf.Path] = []
        seen: set[Sdf.Path] = set()
        while (path := attribute.GetPath()) not in self._ends and path not in seen:
            seen.add(path)
            passed.append(path)
            is_output = UsdShade.Output.IsOutput(attribute)
            prim = attribute.GetPrim()
            if is_output and (prim.IsInstance() or not prim.IsA(UsdShade.NodeGraph)):
                break
            following = self._next(attribute)
            if following is None:
                break
            attribute = following
        end = self._ends.get(attribute.GetPath(), attribute)
        self._ends.update(dict.fromkeys(passed, end))
        return end

    def _next(self, attribute: Usd.Attribute) -> Usd.Attribute | None:
        targets = attribute.GetConnections()
        found = attribute.GetStage().GetAttributeAtPath(targets[0]) if targets else None
        return found or None

    def _origin(self, graph_input: UsdShade.Input) -> str:
        """What an input of a graph is fed by: equal for inputs that have the same value."""
        end = self._end(graph_input.GetAttr())
        prim = end.GetPrim()
        if UsdShade.Output.IsOutput(end) or not prim.IsInstanceProxy():
            return str(end.GetPath())
        # A value that the prototype has is the same in all instances.
        return str(prim.GetPrimInPrototype().GetPath().AppendProperty(end.GetName()))
