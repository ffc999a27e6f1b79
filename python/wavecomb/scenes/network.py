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
"""USD's types by MaterialX's names."""


class Network:
    """One material of MaterialX nodes."""

    def __init__(self, stage: Usd.Stage, path: str) -> None:
        """Defines the material ``path``."""
        self._stage = stage
        self._path = path
        self._count = 0
        self.material = UsdShade.Material.Define(stage, path)

    def node(self, kind: str, output: str, **inputs: Any) -> UsdShade.Output:
        """Adds node ``ND_<kind>_<output>`` and returns its output.

        Args:
            kind: Category of the node, such as "mix".
            output: Its type, such as "color3", or "color3FA" where one operand is a number.
            **inputs: Outputs to connect, or (type, value) pairs; "in" is spelt ``in_``.
        """
        self._count += 1
        shader = UsdShade.Shader.Define(self._stage, f"{self._path}/{kind}_{self._count:02d}")
        self._fill(shader, f"ND_{kind}_{output}", inputs)
        return shader.CreateOutput("out", _TYPES[output.removesuffix("FA")])

    def surface(self, definition: str, **inputs: Any) -> None:
        """Ends the network in a surface shader, such as ``ND_open_pbr_surface_surfaceshader``."""
        shader = UsdShade.Shader.Define(self._stage, f"{self._path}/Surface")
        self._fill(shader, definition, inputs)
        out = shader.CreateOutput("out", Sdf.ValueTypeNames.Token)
        self.material.CreateSurfaceOutput("mtlx").ConnectToSource(out)

    def hair(self, absorption: str, roughness: dict[str, Any], **inputs: Any) -> None:
        """Ends the network in hair.

        Args:
            absorption: The node that gives it, without types: ``chiang_hair_absorption_from_color``
                or ``deon_hair_absorption_from_melanin``.
            roughness: Inputs of ``chiang_hair_roughness``, as ``node`` takes them.
            **inputs: Those of the absorption's node.
        """
        nodes = {}
        for name, kind, given in (
            ("Absorption", absorption, inputs),
            ("Roughness", "chiang_hair_roughness", roughness),
            ("Hair", "chiang_hair_bsdf", {}),
            ("Surface", "surface", {}),
        ):
            nodes[name] = UsdShade.Shader.Define(self._stage, f"{self._path}/{name}")
            self._fill(nodes[name], f"ND_{kind}", given)
        colour = nodes["Absorption"].CreateOutput("absorption", _TYPES["vector3"])
        hair = nodes["Hair"]
        hair.CreateInput("absorption_coefficient", _TYPES["vector3"]).ConnectToSource(colour)
        for lobe in ("R", "TT", "TRT"):
            width = nodes["Roughness"].CreateOutput(f"roughness_{lobe}", _TYPES["vector2"])
            hair.CreateInput(f"roughness_{lobe}", _TYPES["vector2"]).ConnectToSource(width)
        bsdf = hair.CreateOutput("out", Sdf.ValueTypeNames.Token)
        nodes["Surface"].CreateInput("bsdf", Sdf.ValueTypeNames.Token).ConnectToSource(bsdf)
        out = nodes["Surface"].CreateOutput("out", Sdf.ValueTypeNames.Token)
        self.material.CreateSurfaceOutput("mtlx").ConnectToSource(out)

    def _fill(self, shader: UsdShade.Shader, definition: str, inputs: dict[str, Any]) -> None:
        shader.CreateIdAttr(definition)
        for name, value in inputs.items():
            if isinstance(value, UsdShade.Output):
                made = shader.CreateInput(name.rstrip("_"), value.GetTypeName())
                made.ConnectToSource(value)
                continue
            kind, plain = value
            made = shader.CreateInput(name.rstrip("_"), _TYPES[kind])
            made.Set(Gf.Vec3f(*plain) if kind in ("color3", "vector3") else plain)
