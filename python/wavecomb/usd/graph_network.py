# SPDX-License-Identifier: Apache-2.0
"""Compiles networks of MaterialX nodes in a stage to expressions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.graph_code import Expressions, Value, fit, numbers
from wavecomb.usd.graph_colour import in_working_space
from wavecomb.usd.graph_images import IMAGES
from wavecomb.usd.graph_nodes import HANDLERS
from wavecomb.usd.network import shader_id, source_of, value_of, word
from wavecomb.usd.report import LoadReport
from wavecomb.usd.times import frame_number
from wavecomb.working_space import from_rec709

if TYPE_CHECKING:
    from wavecomb.usd.texture import TextureTable

MAX_DEPTH = 100
"""Nodes in a row."""

BASE, COLOUR, NUMBER, NORMAL = "base", "colour", "number", "normal"
"""What a value is for: the base colour, another colour, a number, or a normal in tangent space."""
COLOURS = (BASE, COLOUR)

_WIDTHS = {
    "float": 1, "integer": 1, "boolean": 1, "vector2": 2, "vector3": 3, "color3": 3, "vector4": 4,
    "color4": 4,
}  # fmt: skip
_WIDTH_OF_TYPE = {
    "float": 1, "half": 1, "double": 1, "int": 1, "bool": 1, "float2": 2, "texCoord2f": 2,
    "float3": 3, "color3f": 3, "vector3f": 3, "normal3f": 3, "point3f": 3, "float4": 4,
    "color4f": 4,
}  # fmt: skip
_FIRST_CHOICES = ("in", "in1", "bg", "base", "fg", "color1", "color", "value", "default")


def category_of(identifier: str) -> tuple[str, int]:
    """Category and output width of ``ND_mix_color3``: ("mix", 3); the width is 0 if not said."""
    words = identifier.removeprefix("ND_").split("_")
    known = HANDLERS.keys() | IMAGES.keys() | _PLACES
    at = next((n for n in range(len(words), 0, -1) if "_".join(words[:n]) in known), 1)
    widths = [
        width
        for w in words[at:]
        for name, width in _WIDTHS.items()
        # Variants end in FA, I, B, FC ...: of the same output.
        if w.startswith(name) and (w == name or w[len(name) :].isupper())
    ]
    return "_".join(words[:at]), widths[-1] if widths else 0


_PLACES = {
    "texcoord", "geompropvalue", "geompropvalueuniform", "geomcolor", "UsdPrimvarReader",
    "UsdTransform2d", "normalmap", "gltf_normalmap", "time", "frame",
}  # fmt: skip


class Networks:
    """Expressions of the networks of one material; each node once."""

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

    def in_working_space(self) -> Networks:
        """The same networks with constant colours of the working space; tells nothing."""
        other = Networks(self.material, self.time, self.textures, LoadReport())
        other.make, other.converts, other.uv_names = self.make, True, self.uv_names
        other.primvars = self.primvars
        return other

    def input(self, shader: UsdShade.Shader, name: str, kind: str) -> Value | None:
        """What feeds an input; None where nothing does, or nothing that can be read."""
        source = source_of(shader, name, self.time)
        if source is None:
            return None
        if source.is_value:
            return self._constant(source.value, source.attribute, kind)
        return None if source.shader is None else self.node(source.shader, source.output, kind)

    def node(self, shader: UsdShade.Shader, output: str, kind: str) -> Value | None:
        """What an output of a node gives."""
        key = (shader.GetPath(), output, kind)
        if key in self._done:
            return self._done[key]
        if key in self._path or len(self._path) > MAX_DEPTH:
            what = "shading network that runs in a circle or is too deep (cut there)"
            self.report.warn(what, shader.GetPath())
            return None
        self._path.append(key)
        try:
            value = self._compiled(shader, output, kind)
        finally:
            self._path.pop()
        self._done[key] = value
        return value

    def primvar(self, name: str, otherwise: Value) -> Value:
        """What each mesh gives for a primvar."""
        if name not in self.primvars:
            self.primvars.append(name)
        return self.make.primvar(self.primvars.index(name), otherwise)

    def _compiled(self, shader: UsdShade.Shader, output: str, kind: str) -> Value | None:
        identifier = shader_id(shader)
        category, width = category_of(identifier) if identifier else ("", 0)
        declared = shader.GetOutput(output)
        if declared:
            width = _WIDTH_OF_TYPE.get(str(declared.GetTypeName()), width)
        call = NodeCall(self, shader, category, identifier, output, width, kind)
        if not identifier.startswith("ND_"):
            value = self._nearest(call)
        elif category in _PLACES:
            value = call.of_surface()
        elif category in IMAGES:
            value = IMAGES[category](call)
        elif category in HANDLERS:
            value = HANDLERS[category](call)
        else:
            value = self._nearest(call)
        return None if value is None else fit(value, call.width or len(value))

    def _nearest(self, call: NodeCall) -> Value | None:
        """What stands for a node that is not known: the first of its inputs that gives a value."""
        given = [item.GetBaseName() for item in call.shader.GetInputs()]
        first = [name for name in _FIRST_CHOICES if name in given]
        for name in (*first, *(name for name in given if name not in first)):
            value = self.input(call.shader, name, call.kind)
            if value is not None:
                self._tell(call, f"its input {name} in its place")
                return value
        self._tell(call, "left out")
        return None

    def _tell(self, call: NodeCall, instead: str) -> None:
        what = f"MaterialX node {call.identifier or '(no info:id)'} ({instead})"
        self.report.missing(what, call.shader.GetPath())

    def _constant(self, value: Any, attribute: Usd.Attribute | None, kind: str) -> Value | None:
        if isinstance(value, bool):
            return numbers(float(value))
        if isinstance(value, (str, Sdf.AssetPath)):
            return None
        try:
            found = [float(x) for x in value] if hasattr(value, "__len__") else [float(value)]
        except (TypeError, ValueError):
            return None
        if not 1 <= len(found) <= 4:
            return None
        of_colour = attribute is not None and str(attribute.GetTypeName()).startswith("color")
        if self.converts and kind in COLOURS and of_colour and len(found) >= 3:
            there = from_rec709(np.array(found[:3]), self.textures.working)
            found = [*(float(x) for x in there), *found[3:]]
        return numbers(*found)


class NodeCall:
    """One node that is being compiled, as ``graph_nodes.Call``."""

    def __init__(
        self,
        networks: Networks,
        shader: UsdShade.Shader,
        category: str,
        identifier: str,
        output: str,
        width: int,
        kind: str,
    ) -> None:
        self.networks = networks
        self.shader = shader
        self.category = category
        self.identifier = identifier
        self.output = output
        self.width = width
        self.kind = kind

    @property
    def make(self) -> Expressions:
        """Makes operations."""
        return self.networks.make

    def has(self, name: str) -> bool:
        """Whether an input is authored."""
        return source_of(self.shader, name, self.networks.time) is not None

    def value(
        self, name: str, default: float | Sequence[float] | None = 0.0, width: int = 0
    ) -> Value:
        """An input; of its own width where none is given."""
        found = self.networks.input(self.shader, name, self.kind)
        if found is None:
            if isinstance(default, (int, float)):
                found = fit(numbers(float(default)), width or self.width or 1)
            else:
                found = numbers(*(default or (0.0,)))
        return fit(found, width) if width else found

    def number(self, name: str, default: float) -> float:
        """An input that must be one number for all; told where it is not."""
        found = self.networks.input(self.shader, name, NUMBER)
        if found is None:
            return default
        if not isinstance(found[0], float):
            what = f"MaterialX node {self.identifier} with {name} by a node (its default)"
            self.networks.report.missing(what, self.shader.GetPath())
            return default
        return found[0]

    def text(self, name: str, default: str) -> str:
        """A string or token."""
        return word(value_of(self.shader, name, self.networks.time), default)

    def coordinates(self, name: str = "texcoord") -> Value:
        """Texture coordinates: of an input, else of the mesh."""
        found = self.networks.input(self.shader, name, NUMBER)
        if found is not None:
            return fit(found, 2)
        self.networks.uv_names.append("st")
        return self.make.input("uv")

    def place(self, kind: str, name: str, space: str) -> Value:
        """position, normal ...: of an input where it is authored, else of the surface."""
        if name and (found := self.networks.input(self.shader, name, NUMBER)) is not None:
            return fit(found, 3)
        if kind == "normal" and self.kind == NORMAL:
            return numbers(0.0, 0.0, 1.0)
        local = f"local_{kind}"
        if space != "world" and kind in ("position", "normal"):
            return self.make.input(local)
        return self.make.input(kind)

    def of_surface(self) -> Value | None:
        """Nodes that only say where on the surface something is, or how it is tilted."""
        time = self.networks.time
        if self.category in ("normalmap", "gltf_normalmap"):
            return self._normal_map()
        if self.category == "UsdTransform2d":
            return self._transform_2d()
        if self.category in ("time", "frame"):
            frame = frame_number(time) or 0.0
            if self.category == "frame":
                return numbers(frame)
            stage = self.shader.GetPrim().GetStage()
            return numbers(frame / (stage.GetFramesPerSecond() or 24.0))
        if self.category == "texcoord":
            index = int(self.number("index", 0.0))
            return self._texture_coordinates(f"st{index}" if index else "st")
        named = "varname" if self.category == "UsdPrimvarReader" else "geomprop"
        name = self.text(named, "displayColor" if self.category == "geomcolor" else "")
        if self.width == 2:
            return self._texture_coordinates(name or "st")
        fallback = "fallback" if self.category == "UsdPrimvarReader" else "default"
        if not name or self.width == 0:
            return self.value(fallback)
        return self._primvar(name, fallback)

    def _texture_coordinates(self, name: str) -> Value:
        """The first set that a material reads is the mesh's; others are read as primvars."""
        names = self.networks.uv_names
        if names and names[0] != name:
            return self.networks.primvar(name, numbers(0.0, 0.0))
        names.append(name)
        return self.make.input("uv")

    def _primvar(self, name: str, fallback: str) -> Value:
        """A primvar of the mesh; alpha of its colours is displayOpacity."""
        networks = self.networks
        converts, networks.converts = networks.converts, False
        otherwise = self.value(fallback, width=self.width)
        networks.converts = converts
        if self.category == "geomcolor" and self.width == 4:
            opacity = networks.primvar("displayOpacity", numbers(1.0))
            value = networks.primvar(name, otherwise[:3]) + opacity
        else:
            value = networks.primvar(name, otherwise)
        if converts and self.kind in COLOURS and self.width >= 3:
            return in_working_space(self.make, value, networks.textures.working)
        return value

    def _normal_map(self) -> Value | None:
        """A normal in tangent space; of a map that is flat, the surface's own."""
        m, self.width = self.make, 3
        texel = self.networks.input(self.shader, "in", NORMAL)
        if texel is None or self.text("space", "tangent") != "tangent":
            if texel is not None:
                what = f"MaterialX node {self.identifier} in object space (left out)"
                self.networks.report.missing(what, self.shader.GetPath())
            return numbers(0.0, 0.0, 1.0)
        n = m.op("subtract", m.op("multiply", fit(texel, 3), numbers(2.0)), numbers(1.0))
        scale = self.value("scale", 1.0, 0)
        return m.op("multiply", n[:2], fit(scale, 2)) + n[2:]

    def _transform_2d(self) -> Value:
        """Scaled, turned counter-clockwise and moved."""
        m, x = self.make, self.coordinates("in")
        scale, move = self.value("scale", 1.0, 2), self.value("translation", 0.0, 2)
        turn = m.op("multiply", self.value("rotation", 0.0, 1), numbers(3.14159265358979 / 180))
        c, s = m.op("cos", turn), m.op("sin", turn)
        x = m.op("multiply", x, scale)
        u = m.op("subtract", m.op("multiply", x[:1], c), m.op("multiply", x[1:], s))
        v = m.op("add", m.op("multiply", x[:1], s), m.op("multiply", x[1:], c))
        return m.op("add", u + v, move)
