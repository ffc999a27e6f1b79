# SPDX-License-Identifier: Apache-2.0
"""Compiles networks of MaterialX nodes in a stage to expressions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Sdf, Usd, UsdShade

from wavecomb.picture.working_space import from_rec709
from wavecomb.usd.looks.graph_call import COLOURS, NodeCall
from wavecomb.usd.looks.graph_code import Expressions, Value, fit, numbers
from wavecomb.usd.looks.graph_images import IMAGES
from wavecomb.usd.looks.graph_nodes import HANDLERS
from wavecomb.usd.looks.network import shader_id, source_of
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.looks.texture import TextureTable

MAX_DEPTH = 100
"""Nodes in a row."""

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
