# SPDX-License-Identifier: Apache-2.0
"""Compiles networks of MaterialX nodes in a stage to value graphs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdShade

from wavecomb.image.working_space import from_rec709
from wavecomb.usd.graphs.surface_parameters import COLOURS, NORMAL
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.materials.network import Source, holds_colour, read_colour, shader_id, source_of
from wavecomb.usd.materialx.library import WIDTHS, FlatGraph, definition_of, flat_graph
from wavecomb.usd.materialx.nodes import arnold
from wavecomb.usd.materialx.nodes.node import OF_MATRICES, Handler, NodeCall
from wavecomb.usd.materialx.nodes.node_graphs import CATEGORIES, PRIMITIVES, ExpandedGraph
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.materials.texture import TextureTable

MAX_DEPTH = 100
"""Longest chain of connected nodes."""

MAX_NODES = 10_000
"""Maximum number of nodes in the networks of a material.

In instanced node graphs, whose prim paths are long, the limit is ten times lower.
"""

PER_COMPONENT = {"overlay": "ND_overlay_float"}
"""Nodes that act on each component; the library's graph of the float node is used for all types."""

_WIDTH_OF_TYPE = {
    "float": 1, "half": 1, "double": 1, "int": 1, "bool": 1, "float2": 2, "texCoord2f": 2,
    "float3": 3, "color3f": 3, "vector3f": 3, "normal3f": 3, "point3f": 3, "float4": 4,
    "color4f": 4, "matrix3d": 9, "matrix4d": 16,
}  # fmt: skip
_FIRST_CHOICES = (
    "in",
    "input",
    "input1",
    "in1",
    "bg",
    "base",
    "fg",
    "color1",
    "color",
    "value",
    "default",
)


def category_of(identifier: str) -> tuple[str, int]:
    """Returns node category and output width, such as ("mix", 3) for ``ND_mix_color3``.

    The width is 0 if it cannot be derived from the definition's name.
    """
    words = identifier.removeprefix("ND_").split("_")
    at = next((n for n in range(len(words), 0, -1) if "_".join(words[:n]) in CATEGORIES), 0)
    if not at and (definition := definition_of(identifier)) is not None:
        return definition.category, WIDTHS.get(next(iter(definition.outputs.values()), ""), 0)
    at = at or 1
    widths = [
        width
        for w in words[at:]
        for name, width in WIDTHS.items()
        # Variant suffixes such as FA, I, B or FC do not change the output type.
        if w.startswith(name) and (w == name or w[len(name) :].isupper())
    ]
    return "_".join(words[:at]), widths[-1] if widths else 0


def primitive(category: str, identifier: str) -> Handler | None:
    """Returns the handler that compiles a node; None if there is none."""
    if "_matrix" in identifier and category not in OF_MATRICES:
        return None
    return PRIMITIVES.get(category)


class _TooManyNodes(Exception):
    """Raised if the networks of a material have more nodes than supported."""


class Networks:
    """Compiler of one material's shader networks to values; each node is compiled once."""

    def __init__(
        self, material: Usd.Prim, time: Usd.TimeCode, textures: TextureTable, report: LoadReport
    ) -> None:
        self.material = material
        self.time = time
        self.textures = textures
        self.report = report
        self.make = Expressions()
        self.converts = False
        self.uv_names: list[str] = []
        self.primvars: list[str] = []
        self._done: dict[tuple[Any, ...], Value | None] = {}
        self._path: list[tuple[Any, ...]] = []
        self._instances = InstancedGraphs(material, self.node)

    def in_working_space(self) -> Networks:
        """Returns a copy of the networks whose colour constants are in the working space.

        The copy reports no problems.
        """
        other = Networks(self.material, self.time, self.textures, LoadReport())
        other.make, other.converts, other.uv_names = self.make, True, self.uv_names
        other.primvars = self.primvars
        return other

    def input(self, shader: UsdShade.Shader, name: str, kind: str) -> Value | None:
        """Returns the value of an input; None if the input has no valid connection or value."""
        source = self.source(shader, name)
        if source is None:
            return None
        if source.is_value:
            return self._constant(source.value, source.attribute, kind)
        return None if source.shader is None else self.node(source.shader, source.output, kind)

    def source(self, shader: UsdShade.Shader, name: str) -> Source | None:
        """Returns the source of an input as ``source_of`` does, but stops at instanced node graphs.

        The source's shader may be an instanced node graph.
        """
        if self._instances.are_there:
            return self._instances.source(shader.GetInput(name), self.time)
        return source_of(shader, name, self.time)

    def node(self, shader: UsdShade.Shader, output: str, kind: str) -> Value | None:
        """Returns the value of a node's output."""
        prim = shader.GetPrim()
        if prim.IsInstance() and prim.IsA(UsdShade.NodeGraph):
            return self._instances.value(prim, output, kind)
        key = (shader.GetPath(), output, kind)
        if key in self._done:
            return self._done[key]
        if key in self._path or len(self._path) > MAX_DEPTH:
            what = "shading network that is cyclic or too deep (cut there)"
            self.report.warn(what, shader.GetPath())
            return None
        most = MAX_NODES // 10 if self._instances.are_there else MAX_NODES
        if len(self._done) >= most:
            raise _TooManyNodes
        self._path.append(key)
        try:
            value = self.compiled(self._call(shader, output, kind))
        except _TooManyNodes:
            if len(self._path) > 1:
                raise
            what = f"shading network of more than {most} nodes (left out)"
            self.report.missing(what, self.material.GetPath())
            return None
        finally:
            self._path.pop()
        self._done[key] = value
        return value

    def primvar(self, name: str, otherwise: Value) -> Value:
        """Returns a placeholder that is replaced by the value of the primvar on each mesh."""
        if name not in self.primvars:
            self.primvars.append(name)
        return self.make.primvar(self.primvars.index(name), otherwise)

    def _call(self, shader: UsdShade.Shader, output: str, kind: str) -> NodeCall:
        identifier = shader_id(shader)
        is_known = identifier.startswith("ND_")
        category, width = category_of(identifier) if is_known else ("", 0)
        category = category or arnold.category_of(identifier)
        declared = shader.GetOutput(output)
        if declared:
            width = _WIDTH_OF_TYPE.get(str(declared.GetTypeName()), width)
        return NodeCall(self, _StageInputs(self, shader), category, identifier, output, width, kind)

    def compiled(self, call: NodeCall) -> Value | None:
        """Compiles the output of a node in the stage or in a library graph."""
        handler = primitive(call.category, call.identifier)
        if handler is not None:
            value = handler(call)
        elif (graph := _graph_of(call)) is not None:
            is_wide = call.category in PER_COMPONENT and call.width > 1
            value = ExpandedGraph(call, graph, call.width if is_wide else 0).output(call.output)
        else:
            value = self._nearest(call)
        return None if value is None else fit(value, call.width or len(value))

    def _nearest(self, call: NodeCall) -> Value | None:
        """Replaces an unknown node by the first of its inputs that has a value."""
        given = call.inputs.names()
        first = [name for name in _FIRST_CHOICES if name in given]
        for name in (*first, *(name for name in given if name not in first)):
            value = call.given(name)
            if value is not None:
                self._report_unsupported(call, f"its input {name} in its place")
                return value
        self._report_unsupported(call, "left out")
        return None

    def _report_unsupported(self, call: NodeCall, instead: str) -> None:
        known = "" if call.identifier.startswith(arnold.PREFIX) else "MaterialX "
        what = f"{known}node {call.identifier or '(no info:id)'} ({instead})"
        self.report.missing(what, call.inputs.path)

    def _constant(self, value: Any, attribute: Usd.Attribute | None, kind: str) -> Value | None:
        if isinstance(value, bool):
            return numbers(float(value))
        if isinstance(value, (str, Sdf.AssetPath)):
            return None
        if isinstance(value, (Gf.Matrix3d, Gf.Matrix4d)):
            return numbers(*(float(x) for row in value for x in row))
        try:
            found = [float(x) for x in value] if hasattr(value, "__len__") else [float(value)]
        except (TypeError, ValueError):
            return None
        if not 1 <= len(found) <= 4:
            return None
        of_colour = holds_colour(attribute) and len(found) >= 3
        if of_colour and kind != NORMAL:
            rgb = (found[0], found[1], found[2])
            rgb = read_colour(rgb, attribute, self.report, self.material.GetPath())
            found = [*rgb, *found[3:]]
        if self.converts and kind in COLOURS and of_colour:
            there = from_rec709(np.array(found[:3]), self.textures.working)
            found = [*(float(x) for x in there), *found[3:]]
        return numbers(*found)


def _graph_of(call: NodeCall) -> FlatGraph | None:
    """Returns the library's node graph that implements a node with a numeric output."""
    if not call.identifier.startswith("ND_"):
        return None
    definition = definition_of(call.identifier)
    if definition is None:
        return None
    name = call.output if call.output in definition.outputs else next(iter(definition.outputs), "")
    width = WIDTHS.get(definition.outputs.get(name, ""), 0)
    if not width:
        return None
    call.output, call.width = name, width
    is_wide = call.category in PER_COMPONENT and width > 1
    identifier = PER_COMPONENT[call.category] if is_wide else call.identifier
    return flat_graph(identifier, CATEGORIES)


class _StageInputs:
    """Inputs of a shader prim; implements ``node.Inputs``."""

    def __init__(self, networks: Networks, shader: UsdShade.Shader) -> None:
        self._networks = networks
        self._shader = shader

    @property
    def path(self) -> Sdf.Path:
        """Path of the shader."""
        return self._shader.GetPath()

    def find(self, name: str, kind: str) -> Value | None:
        """Returns the value of a shader input; None if it is not set."""
        return self._networks.input(self._shader, name, kind)

    def source(self, name: str) -> Source | None:
        """Returns the source of a shader input that holds text."""
        return self._networks.source(self._shader, name)

    def has(self, name: str) -> bool:
        """Returns whether an input is authored."""
        return self.source(name) is not None

    def names(self) -> list[str]:
        """Returns the names of the shader's inputs."""
        return [item.GetBaseName() for item in self._shader.GetInputs()]


Compile = Callable[[UsdShade.Shader, str, str], Value | None]
"""Callback that compiles an output of a shader for a given use of the value."""


class InstancedGraphs:
    """Compiles instanced node graphs of a material.

    A short document can nest graphs so deeply that there are far more prim paths than graphs.
    Instances of a prototype with equal sources of their inputs have equal values, which are
    compiled once.

    Attributes:
        are_there: Whether the material contains instanced node graphs.
    """

    def __init__(self, material: Usd.Prim, compile_node: Compile) -> None:
        top = material.GetPrimInPrototype() if material.IsInstanceProxy() else material
        self.are_there = any(prim.IsInstance() for prim in Usd.PrimRange(top))
        self._compile = compile_node
        self._ends: dict[Sdf.Path, Usd.Attribute] = {}
        self._values: dict[tuple[Any, ...], Value | None] = {}

    def source(self, shader_input: UsdShade.Input, time: Usd.TimeCode) -> Source | None:
        """Returns the source of an input as ``source_of`` does, but stops at instanced node graphs.

        The source's shader may be an instanced node graph.
        """
        if not shader_input:
            return None
        end = self._end(shader_input.GetAttr())
        if UsdShade.Output.IsOutput(end):
            return Source(UsdShade.Shader(end.GetPrim()), UsdShade.Output(end).GetBaseName())
        value = end.Get(time)
        return None if value is None else Source(value=value, attribute=end)

    def value(self, graph: Usd.Prim, output: str, kind: str) -> Value | None:
        """Returns the value of an output of an instanced node graph."""
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
        """Follows connections up to an output of a shader or of an instance, or to a value."""
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
        """Returns a key of an input's source; equal keys mean equal values."""
        end = self._end(graph_input.GetAttr())
        prim = end.GetPrim()
        if UsdShade.Output.IsOutput(end) or not prim.IsInstanceProxy():
            return str(end.GetPath())
        # Return the path inside the prototype, since all instances of a prototype have the same
        # value.
        return str(prim.GetPrimInPrototype().GetPath().AppendProperty(end.GetName()))
