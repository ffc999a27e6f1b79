# SPDX-License-Identifier: Apache-2.0
"""Shader networks: what feeds an input, through node graphs and interface inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd, UsdShade

MAX_DEPTH = 32
"""Shaders in a row before a network is taken for a cycle."""


@dataclass(frozen=True)
class Source:
    """Where the value of an input comes from: a shader's output, or an attribute with a value.

    Attributes:
        shader: The shader, where the input is connected to one.
        output: Its output's name.
        value: The value, where there is one.
        attribute: Which holds that value.
    """

    shader: UsdShade.Shader | None = None
    output: str = ""
    value: Any = None
    attribute: Usd.Attribute | None = None

    @property
    def is_value(self) -> bool:
        """Whether this is a plain value."""
        return self.value is not None


def source_of(shader: UsdShade.Shader, name: str, time: Usd.TimeCode) -> Source | None:
    """What feeds an input; None where it is not authored, dangles or runs in a circle.

    An input that is connected to an input of another shader has the source of that input, though
    UsdShade resolves such connections for containers only.
    """
    shader_input = shader.GetInput(name)
    return _source_of(shader_input, time, MAX_DEPTH) if shader_input else None


def _source_of(shader_input: UsdShade.Input, time: Usd.TimeCode, depth: int) -> Source | None:
    for attribute in UsdShade.Utils.GetValueProducingAttributes(shader_input):
        if UsdShade.Output.IsOutput(attribute):
            node = UsdShade.Shader(attribute.GetPrim())
            if node:
                return Source(shader=node, output=UsdShade.Output(attribute).GetBaseName())
            continue
        value = attribute.Get(time)
        if value is not None:
            return Source(value=value, attribute=attribute)
    for path in shader_input.GetAttr().GetConnections() if depth else ():
        attribute = shader_input.GetAttr().GetStage().GetAttributeAtPath(path)
        if UsdShade.Input.IsInput(attribute):
            source = _source_of(UsdShade.Input(attribute), time, depth - 1)
            if source is not None:
                return source
    value = shader_input.Get(time)
    return None if value is None else Source(value=value, attribute=shader_input.GetAttr())


def value_of(shader: UsdShade.Shader, name: str, time: Usd.TimeCode, default: Any = None) -> Any:
    """The constant value of an input, or the default."""
    source = source_of(shader, name, time)
    return source.value if source is not None and source.is_value else default


def layer_of_value(attribute: Usd.Attribute | None) -> Sdf.Layer | None:
    """The layer of the strongest opinion that has a value: relative paths start there.

    Stronger opinions may hold metadata or a connection alone.
    """
    for spec in attribute.GetPropertyStack() if attribute else []:
        has_default = spec.HasDefaultValue() and not isinstance(spec.default, Sdf.ValueBlock)
        if has_default or spec.layer.GetNumTimeSamplesForPath(spec.path):
            return spec.layer
    return None


def shader_id(shader: UsdShade.Shader) -> str:
    """info:id of a shader, or the empty string."""
    return str(shader.GetIdAttr().Get() or "") if shader else ""


def number(value: Any, default: float) -> float:
    """A finite float of a value; of a vector its first component."""
    try:
        result = float(value[0]) if hasattr(value, "__getitem__") else float(value)
    except (TypeError, ValueError, IndexError, OverflowError):
        return default
    return result if result - result == 0 else default


def word(value: Any, default: str = "") -> str:
    """A token or string; the default for a value of any other type."""
    return value if isinstance(value, str) else default


def pair(value: Any, default: tuple[float, float]) -> tuple[float, float]:
    """The first two components of a value, finite; the default where it has fewer."""
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) < 2:
        return default
    return number(value[0], default[0]), number(value[1], default[1])


def colour(value: Any, default: tuple[float, float, float]) -> tuple[float, float, float]:
    """Three finite floats of a value; a number is taken for grey."""
    try:
        if hasattr(value, "__len__"):
            r, g, b = (float(value[i]) for i in range(3))
        else:
            r = g = b = float(value)
    except (TypeError, ValueError, IndexError):
        return default
    return (r, g, b) if (r - r) + (g - g) + (b - b) == 0 else default
