# SPDX-License-Identifier: Apache-2.0
"""Writes MaterialX networks into generated stages."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Sdf, Usd, UsdShade

_TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "integer": Sdf.ValueTypeNames.Int,
    "boolean": Sdf.ValueTypeNames.Bool,
    "string": Sdf.ValueTypeNames.String,
    "filename": Sdf.ValueTypeNames.Asset,
    "color3": Sdf.ValueTypeNames.Color3f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
}
"""Value types of USD by the names of MaterialX types."""
_TOKEN = Sdf.ValueTypeNames.Token


class Network:
    """A material of MaterialX nodes."""

    def __init__(self, stage: Usd.Stage, path: str) -> None:
        """Defines the material at ``path``."""
        self._stage = stage
        self._path = path
        self._count = 0
        self.material = UsdShade.Material.Define(stage, path)

    def node(self, kind: str, output: str, **inputs: Any) -> UsdShade.Output:
        """Adds node ``ND_<kind>_<output>`` and returns its output.

        Args:
            kind: Category of the node, such as "mix".
            output: Type of its output, such as "color3", or "color3FA" if one operand is a float.
            **inputs: Outputs to connect, or (type, value) pairs; "in" is spelt ``in_``.
        """
        self._count += 1
        shader = self._shader(f"{kind}_{self._count:02d}", f"ND_{kind}_{output}", inputs)
        return shader.CreateOutput("out", _TYPES[output.removesuffix("FA")])

    def closure(self, name: str, definition: str, **inputs: Any) -> UsdShade.Output:
        """Adds a shader that outputs a closure, such as a surface, a BSDF or a volume."""
        return self._shader(name, definition, inputs).CreateOutput("out", _TOKEN)

    def surface(self, definition: str, **inputs: Any) -> None:
        """Adds the final surface shader, such as ``ND_open_pbr_surface_surfaceshader``."""
        out = self.closure("Surface", definition, **inputs)
        self.material.CreateSurfaceOutput("mtlx").ConnectToSource(out)

    def openpbr(self, **inputs: Any) -> None:
        """Adds an OpenPBR surface as the final shader."""
        self.surface("ND_open_pbr_surface_surfaceshader", **inputs)

    def hair(self, absorption: str, roughness: dict[str, Any], **inputs: Any) -> None:
        """Adds a hair BSDF as the final shader.

        Args:
            absorption: Node that computes absorption, without types:
                ``chiang_hair_absorption_from_color`` or ``deon_hair_absorption_from_melanin``.
            roughness: Inputs of ``chiang_hair_roughness``, as ``node`` takes them.
            **inputs: Inputs of the absorption node.
        """
        colour = self._shader("Absorption", f"ND_{absorption}", inputs)
        rough = self._shader("Roughness", "ND_chiang_hair_roughness", roughness)
        lobes = [f"roughness_{lobe}" for lobe in ("R", "TT", "TRT")]
        bsdf = self.closure(
            "Hair",
            "ND_chiang_hair_bsdf",
            absorption_coefficient=colour.CreateOutput("absorption", _TYPES["vector3"]),
            **{lobe: rough.CreateOutput(lobe, _TYPES["vector2"]) for lobe in lobes},
        )
        self.surface("ND_surface", bsdf=bsdf)

    def _shader(self, name: str, definition: str, inputs: dict[str, Any]) -> UsdShade.Shader:
        shader = UsdShade.Shader.Define(self._stage, f"{self._path}/{name}")
        shader.CreateIdAttr(definition)
        for key, value in inputs.items():
            if isinstance(value, UsdShade.Output):
                made = shader.CreateInput(key.rstrip("_"), value.GetTypeName())
                made.ConnectToSource(value)
                continue
            kind, plain = value
            made = shader.CreateInput(key.rstrip("_"), _TYPES[kind])
            made.Set(Gf.Vec3f(*plain) if kind in ("color3", "vector3") else plain)
        return shader
