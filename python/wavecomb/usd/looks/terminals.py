# SPDX-License-Identifier: Apache-2.0
"""Surface outputs of materials, those for other renderers among them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Sdf, UsdShade

from wavecomb.usd.looks.network import shader_id, word


@dataclass(frozen=True)
class Terminal:
    """A surface output of a material and the shader that it leads to.

    Attributes:
        output: Its name, such as outputs:ri:surface.
        shader: The shader.
    """

    output: str
    shader: UsdShade.Shader

    def __str__(self) -> str:
        return f"{_name_of(self.shader)} of {self.output}"


def terminals(material: UsdShade.Material) -> Iterator[Terminal]:
    """The surface outputs that lead to a shader, in the stage's order."""
    for output in material.GetSurfaceOutputs():
        for attribute in UsdShade.Utils.GetValueProducingAttributes(output):
            shader = UsdShade.Shader(attribute.GetPrim())
            if shader:
                yield Terminal(str(output.GetFullName()), shader)


def _name_of(shader: UsdShade.Shader) -> str:
    """info:id of a shader, else the name of its source."""
    if name := shader_id(shader):
        return name
    for attribute in shader.GetPrim().GetAuthoredAttributes():
        if attribute.GetName().endswith(":sourceAsset:subIdentifier"):
            return word(attribute.Get()) or "a shader without info:id"
    for attribute in shader.GetPrim().GetAuthoredAttributes():
        value = attribute.Get() if attribute.GetName().endswith(":sourceAsset") else None
        if isinstance(value, Sdf.AssetPath):
            return str(value.path)
    return "a shader without info:id"
