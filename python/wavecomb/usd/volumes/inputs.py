# SPDX-License-Identifier: Apache-2.0
"""Inputs of volume shaders: constants, fields that nodes read, and products of these."""

from __future__ import annotations

from pxr import Usd, UsdShade

from wavecomb.usd.looks.network import (
    MAX_DEPTH,
    colour,
    holds_colour,
    number,
    read_colour,
    shader_id,
    source_of,
    value_of,
    word,
)
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.look import BLACK, WHITE, Colour, Driven, product

_READERS = {
    "ND_geompropvalue": "geomprop",
    "UsdPrimvarReader": "varname",
    "arnold:volume_sample": "channel",
    "volume_sample": "channel",
}
"""What ids of nodes that read a field begin with, and the input that names it."""


class Inputs:
    """Reads inputs of the shaders of one material."""

    def __init__(self, material: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> None:
        self.material = material
        self.time = time
        self.report = report

    def number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        """A constant number; what drives it otherwise is said, and the default taken."""
        source = source_of(shader, name, self.time)
        if source is not None and source.shader is not None:
            self._left_out(source.shader, name)
            return default
        return default if source is None else number(source.value, default)

    def text(self, shader: UsdShade.Shader, name: str, default: str = "") -> str:
        """A constant text."""
        return word(value_of(shader, name, self.time), default)

    def driven(
        self, shader: UsdShade.Shader, name: str, default: Colour = BLACK, depth: int = 0
    ) -> Driven:
        """A colour, a number as grey, a field, or a product of them; never below 0."""
        source = source_of(shader, name, self.time)
        if source is None:
            return Driven(default)
        if source.shader is None:
            rgb = colour(source.value, default)
            if holds_colour(source.attribute):
                rgb = read_colour(rgb, source.attribute, self.report, self.material.GetPath())
            r, g, b = (max(c, 0.0) for c in rgb)
            return Driven((r, g, b))
        return self._node(source.shader, name, default, depth + 1)

    def _node(self, node: UsdShade.Shader, name: str, default: Colour, depth: int) -> Driven:
        kind = shader_id(node)
        for start, named in _READERS.items():
            if kind.startswith(start):
                field = self.text(node, named)
                scale = self.driven(node, "multiply", WHITE, depth) if depth < MAX_DEPTH else None
                if field and scale is not None:
                    return Driven(scale.colour, field)
        if kind.startswith("ND_multiply_") and depth < MAX_DEPTH:
            one = self.driven(node, "in1", BLACK, depth)
            two = self.driven(node, "in2", WHITE, depth)
            if not (one.field and two.field):
                return Driven(product(one.colour, two.colour), one.field or two.field)
        if kind.startswith("ND_constant_") and depth < MAX_DEPTH:
            return self.driven(node, "value", BLACK, depth)
        if kind.startswith("ND_convert_") and depth < MAX_DEPTH:
            return self.driven(node, "in", BLACK, depth)
        self._left_out(node, name)
        return Driven(default)

    def _left_out(self, node: UsdShade.Shader, name: str) -> None:
        kind = shader_id(node) or "a node without an id"
        self.report.missing(f"{kind} in {name} of a volume shader (default taken)", node.GetPath())
