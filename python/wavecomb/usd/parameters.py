# SPDX-License-Identifier: Apache-2.0
"""Where the parameters of materials and lights come from: for programs that let people change them.

``wavecomb.usd.material`` reads surfaces; here each constant of one is traced to the attribute that
holds it, so that a change can be written back.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from wavecomb.usd.colour_space import space_of
from wavecomb.usd.identity import LightGroups
from wavecomb.usd.light import KINDS as LIGHT_KINDS
from wavecomb.usd.light import LightReader
from wavecomb.usd.material import PREVIEW, surface_source
from wavecomb.usd.materialx import MODELS
from wavecomb.usd.mesh import IDENTITY
from wavecomb.usd.network import Source, colour, number, shader_id, source_of, value_of
from wavecomb.usd.preview import INPUTS, USES, constant, program_of
from wavecomb.usd.report import LoadReport
from wavecomb.usd.surface import COLOUR_SLOTS

IN_INSTANCE = "it is inside an instance, where USD takes no opinions"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a material.

    Attributes:
        slot: Keyword argument of ``SceneBuilder.add_material``.
        value: As the loader reads it; None where it is driven.
        attribute: To author for another value, there already or not; None: there is none.
        type_name: Of that attribute.
        factor: The value is the attribute's times this.
        driven_by: What else gives the value: "texture marble.png", "primvar displayColor"; "" of a
            constant.
        reason: Why there is no attribute to author; "" where there is.
    """

    slot: str
    value: Any = None
    attribute: Sdf.Path | None = None
    type_name: Sdf.ValueTypeName = Sdf.ValueTypeNames.Float
    factor: float = 1.0
    driven_by: str = ""
    reason: str = ""

    def authored(self, value: Any) -> Any:
        """What the attribute must hold for the parameter to be so."""
        if isinstance(value, (tuple, list)):
            make = self.type_name.type.pythonClass
            return make(*(float(v) / self.factor for v in value))
        return as_stored(float(value) / self.factor)


def material_parameters(prim: Usd.Prim, time: Usd.TimeCode) -> dict[str, Parameter]:
    """Parameters of a material by slot, in the order of a panel; empty where it has no surface."""
    material = UsdShade.Material(prim)
    kind, shader = surface_source(material) if material else ("", UsdShade.Shader())
    if not kind:
        return {}
    tracer = _Tracer(prim, shader, time)
    if kind != PREVIEW:
        return tracer.materialx(kind)
    return tracer.preview(program_of(prim, time, LoadReport()))


class _Tracer:
    """Traces the inputs of one surface shader."""

    def __init__(self, prim: Usd.Prim, shader: UsdShade.Shader, time: Usd.TimeCode) -> None:
        self._prim = prim
        self._shader = shader
        self._time = time

    def preview(self, program: str) -> dict[str, Parameter]:
        """Of a UsdPreviewSurface."""
        wanted = USES.get(program)
        out: dict[str, Parameter] = {}
        for name, (slot, default) in INPUTS.items():
            if slot == "normal" or (wanted is not None and slot not in wanted):
                continue
            if slot == "base_color" and program == "dielectric":
                default = (1.0, 1.0, 1.0)
            out[slot] = self._input(slot, name, default)
        for key, slot in (("wavecomb:eta", "conductor_eta"), ("wavecomb:k", "conductor_k")):
            attribute = self._prim.GetAttribute(key)
            if program == "metal" and attribute and attribute.HasAuthoredValue():
                black = (0.0, 0.0, 0.0)
                value = colour(attribute.Get(self._time), black)
                out[slot] = self._constant(slot, value, attribute.GetPath(), attribute)
        return out

    def materialx(self, model_name: str) -> dict[str, Parameter]:
        """Of a MaterialX surface: of the inputs that Wavecomb reads."""
        model = MODELS[model_name]
        weight = self._weight(model.base_weight)
        glow = self._weight(model.emission_weight)
        if model_name == "open_pbr_surface":
            glow /= 1000.0
        specs = [
            ("base_color", model.base_color, weight),
            ("roughness", model.roughness, 1.0),
            ("ior", model.ior, 1.0),
            ("metallic", model.metallic, 1.0),
            ("specular_color", model.specular_color, 1.0),
            ("clearcoat", model.clearcoat, 1.0),
            ("clearcoat_roughness", model.clearcoat_roughness, 1.0),
            ("opacity", model.opacity, 1.0),
            ("emission", model.emission, glow),
        ]
        out: dict[str, Parameter] = {}
        for slot, (name, default), factor in specs:
            if name:
                out[slot] = self._input(slot, name, default, factor, clamped=False)
        return out

    def _weight(self, spec: tuple[str, Any]) -> float:
        name, default = spec
        value = value_of(self._shader, name, self._time) if name else None
        return number(value, default)

    def _input(
        self, slot: str, name: str, default: Any, factor: float = 1.0, *, clamped: bool = True
    ) -> Parameter:
        source = source_of(self._shader, name, self._time)
        if source is not None and not source.is_value:
            return Parameter(slot, driven_by=self._driver(source))
        if factor <= 0:
            return Parameter(slot, reason="its weight in the stage is 0")
        attribute = None if source is None else source.attribute
        own = self._shader.GetPath().AppendProperty(f"inputs:{name}")
        path = own if attribute is None else attribute.GetPath()
        value = default if source is None else source.value
        if slot in COLOUR_SLOTS and (space := space_of(attribute)):
            return Parameter(slot, reason=f"it is in the colour space {space}")
        if clamped:
            value = constant(slot, value, default)
        elif isinstance(default, tuple):
            value = colour(value, default)
        else:
            value = number(value, default)
        if factor != 1.0:
            value = tuple(v * factor for v in value)
        return self._constant(slot, value, path, attribute, factor)

    def _constant(
        self,
        slot: str,
        value: Any,
        path: Sdf.Path,
        attribute: Usd.Attribute | None,
        factor: float = 1.0,
    ) -> Parameter:
        """A parameter whose value is that of an attribute, or would be."""
        wide = slot in (*COLOUR_SLOTS, "conductor_eta", "conductor_k")
        types = Sdf.ValueTypeNames
        type_name = types.Color3f if wide else types.Float
        if self._prim.IsInstanceProxy() or self._prim.IsInPrototype():
            return Parameter(slot, value, reason=IN_INSTANCE)
        if not path.HasPrefix(self._prim.GetPath()):
            return Parameter(slot, value, reason=f"it comes from {path}, outside of the material")
        if attribute is not None:
            type_name = attribute.GetTypeName()
            if wide != (type_name.defaultValue is not None and _is_triple(type_name)):
                return Parameter(slot, value, reason=f"{path} is a {type_name}")
        return Parameter(slot, value, path, type_name, factor)

    def _driver(self, source: Source) -> str:
        shader = source.shader
        identifier = shader_id(shader) if shader is not None else ""
        if shader is None or not identifier:
            return "a shader without info:id"
        if identifier.startswith("UsdPrimvarReader_"):
            return f"primvar {value_of(shader, 'varname', self._time, '')}"
        file = value_of(shader, "file", self._time)
        if isinstance(file, Sdf.AssetPath):
            return f"texture {os.path.basename(file.path)}"
        return f"node {identifier} ({shader.GetPath().name})"


def _is_triple(type_name: Sdf.ValueTypeName) -> bool:
    value = type_name.defaultValue
    return hasattr(value, "__len__") and not isinstance(value, str) and len(value) == 3


def light_radiance(
    prim: Usd.Prim, time: Usd.TimeCode, up_axis: str
) -> tuple[float, float, float] | None:
    """The colour that the loader gives ``SceneBuilder.add_light`` for a light outside of instances.

    None where the prim is no light that Wavecomb knows.
    """
    if not prim or str(prim.GetTypeName()) not in LIGHT_KINDS:
        return None
    matrix = IDENTITY
    xforms = UsdGeom.XformCache(time)
    for path in prim.GetPath().GetPrefixes():
        step = prim.GetStage().GetPrimAtPath(path)
        if not step.IsA(UsdGeom.Xformable):
            continue
        own, resets = xforms.GetLocalTransformation(step)
        if resets:
            matrix = own
        elif own != IDENTITY:
            matrix = own * matrix
    scale = abs(matrix.GetDeterminant3()) ** (1.0 / 3.0)
    report = LoadReport()
    reader = LightReader(time, up_axis, None, LightGroups(report), report)
    light = reader.read(prim, scale)
    r, g, b = light.options["color"]
    return (r, g, b)


def as_stored(value: Any) -> Any:
    """A number or colour as the core keeps it, in 32 bits."""
    if isinstance(value, (tuple, list)):
        return tuple(float(np.float32(v)) for v in value)
    return float(np.float32(value))
