# SPDX-License-Identifier: Apache-2.0
"""One MaterialX node while it is compiled: what its inputs come to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from pxr import Usd, UsdShade

from wavecomb.usd.looks.graph_code import Expressions, Value, fit, numbers
from wavecomb.usd.looks.graph_colour import in_working_space
from wavecomb.usd.looks.network import source_of, value_of, word
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.times import frame_number

BASE, COLOUR, NUMBER, NORMAL = "base", "colour", "number", "normal"
"""What a value is for: the base colour, another colour, a number, or a normal in tangent space."""
COLOURS = (BASE, COLOUR)


class NodeHost(Protocol):
    """What compiles the network that a node is in: ``graph_network.Networks``."""

    make: Expressions
    report: LoadReport
    time: Usd.TimeCode
    uv_names: list[str]
    converts: bool
    textures: Any

    def input(self, shader: UsdShade.Shader, name: str, kind: str) -> Value | None:
        """What feeds an input; None where nothing does."""

    def primvar(self, name: str, otherwise: Value) -> Value:
        """What each mesh gives for a primvar."""


class NodeCall:
    """One node that is being compiled, as ``graph_nodes.Call``."""

    def __init__(
        self,
        networks: NodeHost,
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
