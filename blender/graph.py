# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds MaterialX nodes below a material of the correction layer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .usda import Asset, Layer, Prim

USD_TYPES = {
    "float": "float",
    "color3": "color3f",
    "vector2": "float2",
    "vector3": "float3",
    "vector4": "float4",
    "filename": "asset",
    "string": "string",
    "integer": "int",
}
WIDTHS = {"float": 1, "vector2": 2, "color3": 3, "vector3": 3, "vector4": 4}


@dataclass(frozen=True)
class Value:
    """Value of a shader or node input: a constant, or the output of a MaterialX node.

    Attributes:
        kind: MaterialX type.
        constant: Number or tuple; None if a node computes the value.
        path: Path of the output.
    """

    kind: str
    constant: Any = None
    path: str = ""


def number(value: float) -> Value:
    """Returns a constant number."""
    return Value("float", float(value))


def colour(values: Any) -> Value:
    """Returns a constant colour from the first three components."""
    return Value("color3", tuple(float(v) for v in tuple(values)[:3]))


def vector(values: Any) -> Value:
    """Returns a constant vector of three components."""
    return Value("vector3", tuple(float(v) for v in tuple(values)[:3]))


class Graph:
    """Nodes of one material."""

    def __init__(self, layer: Layer, material: str) -> None:
        self.layer, self.material = layer, material
        self._count = 0

    def node(self, name: str, kind: str, **inputs: Value | str | int | Asset) -> Value:
        """Adds a node.

        Args:
            name: Name of its definition without "ND_".
            kind: Type of its output.
            inputs: Values by name; None leaves the default.
        """
        self._count += 1
        path = f"{self.material}/n{self._count}"
        prim = self.layer.define(path, "Shader")
        prim.set("uniform token info:id", f"ND_{name}")
        for key, value in inputs.items():
            if value is not None:
                self.put(prim, key, value)
        prim.lines.append(f"{USD_TYPES[kind]} outputs:out")
        return Value(kind, None, f"{path}.outputs:out")

    def put(self, prim: Prim, key: str, value: Value | str | int | Asset) -> None:
        """Sets or connects an input of a shader."""
        key = key.rstrip("_")
        if isinstance(value, Asset):
            prim.set(f"asset inputs:{key}", value)
        elif isinstance(value, str):
            prim.set(f"string inputs:{key}", value)
        elif isinstance(value, int):
            prim.set(f"int inputs:{key}", value)
        elif value.constant is not None:
            prim.set(f"{USD_TYPES[value.kind]} inputs:{key}", value.constant)
        else:
            prim.connect(f"{USD_TYPES[value.kind]} inputs:{key}", value.path)

    def image(self, kind: str, file: str, space: str, where: Value, wrap: str) -> Value:
        """Adds an image of a colour space, looked up at texture coordinates."""
        made = self.node(
            f"image_{kind}", kind, file=Asset(file), texcoord=where, uaddressmode=wrap,
            vaddressmode=wrap,
        )  # fmt: skip
        prim = self.layer.over(made.path.rpartition(".")[0])
        line = next(i for i, text in enumerate(prim.lines) if text.startswith("asset inputs:file"))
        prim.lines[line] += f' (colorSpace = "{space}")'
        return made

    def op(self, name: str, a: Value, b: Value | None = None) -> Value:
        """Applies an operation of one or two operands of the same type, such as "multiply"."""
        if b is None:
            return self.node(f"{name}_{a.kind}", a.kind, in_=a)
        if a.kind != b.kind:
            a, b = (self.to(b.kind, a), b) if a.kind == "float" else (a, self.to(a.kind, b))
        return self.node(f"{name}_{a.kind}", a.kind, in1=a, in2=b)

    def mix(self, background: Value, foreground: Value, factor: Value) -> Value:
        """Interpolates between two values of one type."""
        if factor.constant in (0.0, 1.0):
            return foreground if factor.constant else background
        if background == foreground:
            return background
        kind = background.kind
        foreground = self.to(kind, foreground)
        constants = (background.constant, foreground.constant, factor.constant)
        if all(value is not None for value in constants):
            return Value(kind, _lerp(*constants))
        factor = self.to("float", factor)
        return self.node(f"mix_{kind}", kind, bg=background, fg=foreground, mix=factor)

    def to(self, kind: str, value: Value) -> Value:
        """Converts a value as Blender's sockets do."""
        if value.kind == kind:
            return value
        if value.constant is not None:
            return Value(kind, _converted(value.constant, kind, value.kind))
        if kind == "float":
            if value.kind == "color3":
                grey = self.node("luminance_color3", "color3", in_=value)
                return self.component(grey, 0)
            if value.kind == "vector2":
                return self.component(value, 0)
            total = self.node("dotproduct_vector3", "float", in1=value, in2=vector((1, 1, 1)))
            return self.op("multiply", total, number(1.0 / 3.0))
        if {kind, value.kind} == {"vector2", "vector3"}:
            parts = [self.component(value, i) for i in range(2)]
            if kind == "vector2":
                return self.node("combine2_vector2", kind, in1=parts[0], in2=parts[1])
            return self.combine(kind, parts[0], parts[1], number(0.0))
        return self.node(f"convert_{value.kind}_{kind}", kind, in_=value)

    def component(self, value: Value, index: int) -> Value:
        """Returns a component of a colour or vector."""
        if value.kind == "float":
            return value
        if value.constant is not None:
            return number(value.constant[index])
        return self.node(f"extract_{value.kind}", "float", in_=value, index=index)

    def combine(self, kind: str, x: Value, y: Value, z: Value) -> Value:
        """Makes a colour or vector of three numbers."""
        return self.node(f"combine3_{kind}", kind, in1=x, in2=y, in3=z)

    def clamped(self, value: Value) -> Value:
        """Clamps a value to the range [0, 1]."""
        if value.constant is not None:
            parts = value.constant if isinstance(value.constant, tuple) else (value.constant,)
            low = tuple(min(max(part, 0.0), 1.0) for part in parts)
            return Value(value.kind, low if isinstance(value.constant, tuple) else low[0])
        return self.node(f"clamp_{value.kind}", value.kind, in_=value)


def _lerp(a: Any, b: Any, t: float) -> Any:
    if isinstance(a, tuple):
        return tuple(x + (y - x) * t for x, y in zip(a, b, strict=True))
    return a + (b - a) * t


def _converted(value: Any, kind: str, source: str) -> Any:
    if kind == "float":
        if source == "color3":
            return 0.2126729 * value[0] + 0.7151522 * value[1] + 0.0721750 * value[2]
        return sum(value) / len(value)
    width = WIDTHS[kind]
    if isinstance(value, tuple):
        return (*value, 0.0, 0.0)[:width]
    return (float(value),) * width
