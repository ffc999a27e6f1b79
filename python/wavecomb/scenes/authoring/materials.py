# SPDX-License-Identifier: Apache-2.0
"""Materials of the generated stages, which are UsdPreviewSurface with a Wavecomb program.

``wavecomb:program`` on the Material selects the shading program. The program reads its parameters
from the UsdPreviewSurface inputs below, so that other renderers show a similar material:

- diffuse: ``diffuseColor``.
- metal: ``roughness``; ``diffuseColor`` is the reflectance at normal incidence; the optional
``specularColor`` is the F82 tint.
- dielectric: ``ior``, ``roughness``, ``diffuseColor`` tints transmission.
- plastic: ``diffuseColor`` of the base, ``ior`` and ``roughness`` of the coat.
- emissive: ``emissiveColor``, radiance.
- principled: all inputs.

``plain`` converts a material to the form that third-party exporters write: the metallic workflow
without a Wavecomb program.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdShade

Colour = tuple[float, float, float]
"""Linear RGB colour with Rec. 709 primaries."""

PROGRAMS = ("diffuse", "metal", "dielectric", "plastic", "emissive", "principled")


@dataclass(frozen=True)
class MaterialInfo:
    """A material.

    Attributes:
        program: One of ``PROGRAMS``, or None for a UsdPreviewSurface without a program.
        inputs: Values of UsdPreviewSurface inputs by name.
        textures: Names of textures in ``textures.TEXTURES``, by the input that they drive.
        repeat: Number of texture repeats per unit of texture coordinates.
    """

    program: str | None
    inputs: dict[str, float | int | Colour] = field(default_factory=dict)
    textures: dict[str, str] = field(default_factory=dict)
    repeat: float = 1.0


def diffuse(colour: Colour, texture: str | None = None, repeat: float = 1.0) -> MaterialInfo:
    """Makes a matt surface, with as little specular reflection as UsdPreviewSurface allows."""
    inputs: dict[str, float | int | Colour] = {
        "diffuseColor": colour,
        "useSpecularWorkflow": 1,
        "specularColor": (0.0, 0.0, 0.0),
        "roughness": 1.0,
    }
    return MaterialInfo(
        "diffuse", inputs, {} if texture is None else {"diffuseColor": texture}, repeat
    )


def metal(
    colour: Colour,
    roughness: float,
    edge: Colour | None = None,
    textures: dict[str, str] | None = None,
) -> MaterialInfo:
    """Makes a conductor from its reflectance at normal incidence."""
    inputs: dict[str, float | int | Colour] = {
        "diffuseColor": colour,
        "metallic": 1.0,
        "roughness": roughness,
    }
    if edge is not None:
        inputs["specularColor"] = edge
    return MaterialInfo("metal", inputs, textures or {})


def dielectric(colour: Colour, roughness: float, ior: float = 1.5) -> MaterialInfo:
    """Makes glass. The opacity is low, so that other renderers show the material as glass."""
    return MaterialInfo(
        "dielectric",
        {"diffuseColor": colour, "roughness": roughness, "ior": ior, "opacity": 0.1},
    )


def plastic(
    colour: Colour, roughness: float, texture: str | None = None, repeat: float = 1.0
) -> MaterialInfo:
    """Makes a diffuse base under a clear coat of index 1.5."""
    return MaterialInfo(
        "plastic",
        {"diffuseColor": colour, "roughness": roughness, "ior": 1.5, "metallic": 0.0},
        {} if texture is None else {"diffuseColor": texture},
        repeat,
    )


def emissive(radiance: Colour) -> MaterialInfo:
    """Makes a surface that emits light and reflects nothing."""
    return MaterialInfo(
        "emissive",
        {
            "emissiveColor": radiance,
            "diffuseColor": (0.0, 0.0, 0.0),
            "useSpecularWorkflow": 1,
            "specularColor": (0.0, 0.0, 0.0),
            "roughness": 1.0,
        },
    )


def principled(
    inputs: dict[str, float | int | Colour],
    textures: dict[str, str] | None = None,
    repeat: float = 1.0,
) -> MaterialInfo:
    """Makes a material with all inputs of UsdPreviewSurface."""
    return MaterialInfo("principled", inputs, textures or {}, repeat)


def preview(
    inputs: dict[str, float | int | Colour],
    textures: dict[str, str] | None = None,
    repeat: float = 1.0,
) -> MaterialInfo:
    """Makes a UsdPreviewSurface without a Wavecomb program."""
    return MaterialInfo(None, inputs, textures or {}, repeat)


_SPECULAR_WORKFLOW = ("useSpecularWorkflow", "specularColor")
_TINT_OPACITY = 0.4
"""Opacity that ``plain`` gives to glass with a fully saturated colour."""


def plain(info: MaterialInfo) -> MaterialInfo:
    """Converts a material to the metallic workflow without a Wavecomb program.

    Matt surfaces get the specular reflection that UsdPreviewSurface gives all dielectrics. Metals
    lose their reflectance at grazing angles (``specularColor``). Glass becomes a specular reflector
    that transmits light without refraction, which UsdPreviewSurface does not have. Coloured glass
    becomes partly opaque, since UsdPreviewSurface cannot tint transmitted light.
    """
    inputs = {key: value for key, value in info.inputs.items() if key not in _SPECULAR_WORKFLOW}
    if info.program == "dielectric":
        colour = np.asarray(inputs["diffuseColor"], float)
        purity = 1.0 - colour.min() / max(colour.max(), 1e-6)
        inputs["opacity"] = float(_TINT_OPACITY * purity)
    return replace(info, program=None, inputs=inputs)


GOLD = metal((1.00, 0.71, 0.29), 0.16, (1.0, 0.94, 0.78))
COPPER = metal((0.93, 0.48, 0.32), 0.24, (1.0, 0.86, 0.78))
STEEL = metal((0.62, 0.61, 0.60), 0.25, None, {"roughness": "brushed"})
BRONZE = metal((0.60, 0.39, 0.19), 0.34)
SILVER = metal((0.95, 0.93, 0.88), 0.08)
MIRROR = metal((0.94, 0.95, 0.95), 0.0)
CLEAR_GLASS = dielectric((1.0, 1.0, 1.0), 0.0)
AMBER_GLASS = dielectric((1.0, 0.66, 0.22), 0.0, 1.54)
FROSTED_GLASS = dielectric((0.82, 0.95, 0.92), 0.22)
JADE = principled(
    {
        "diffuseColor": (0.09, 0.36, 0.20),
        "roughness": 0.22,
        "ior": 1.62,
        "clearcoat": 0.6,
        "clearcoatRoughness": 0.05,
    }
)
LACQUER = principled(
    {
        "diffuseColor": (0.42, 0.015, 0.02),
        "roughness": 0.38,
        "clearcoat": 1.0,
        "clearcoatRoughness": 0.03,
        "metallic": 0.15,
    }
)
MARBLE = principled(
    {"diffuseColor": (0.8, 0.8, 0.8), "roughness": 0.18, "ior": 1.5}, {"diffuseColor": "marble"}
)
HAMMERED = principled(
    {"diffuseColor": (0.88, 0.58, 0.36), "metallic": 1.0, "roughness": 0.22},
    {"normal": "hammered"},
    2.0,
)
FLOOR = principled(
    {"diffuseColor": (0.2, 0.2, 0.2), "roughness": 0.4, "ior": 1.5},
    {"diffuseColor": "tiles", "roughness": "tiles_roughness"},
)
TERRACOTTA = diffuse((0.55, 0.20, 0.11))
CHECKER = diffuse((0.5, 0.5, 0.5), "checker")
CLOTH = diffuse((0.4, 0.2, 0.1), "weave", 2.0)
CHALK = diffuse((0.76, 0.74, 0.70))
BLUE_PLASTIC = plastic((0.02, 0.12, 0.42), 0.08)
TEAL_PLASTIC = plastic((0.01, 0.30, 0.30), 0.16)
YELLOW_PLASTIC = plastic((0.83, 0.44, 0.02), 0.12)
WALNUT = plastic((0.25, 0.12, 0.06), 0.15, "wood")
PORCELAIN = plastic((0.8, 0.8, 0.78), 0.04, "glaze")
EMBER = emissive((2.4, 0.62, 0.09))


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
"""USD value types of the MaterialX types, by MaterialX name."""
_TOKEN = Sdf.ValueTypeNames.Token


class Network:
    """Builder of a material from MaterialX nodes."""

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
            output: Output type of the node, such as "color3", or "color3FA" if one operand is a
                float.
            **inputs: Outputs of nodes to connect, or (type, value) pairs; the input "in" is written
                ``in_``.
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
            absorption: Node that computes absorption, without the type suffix:
                ``chiang_hair_absorption_from_color`` or ``deon_hair_absorption_from_melanin``.
            roughness: Inputs of ``chiang_hair_roughness``, given like the inputs of ``node``.
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
