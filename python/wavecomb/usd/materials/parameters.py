# SPDX-License-Identifier: Apache-2.0
"""Editable parameters of materials and lights, with the attributes that hold them.

The module ``wavecomb.usd.materials.material`` reads surfaces. This module finds the attribute that
holds each constant, so that programs such as the viewer can write changes to the stage. This module
also reads the constants of a MaterialX material without reading images.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from wavecomb.core_table import EDITABLE, of_kind, own_parameters, programs
from wavecomb.usd import mtlx
from wavecomb.usd.geometry.mesh_arrays import IDENTITY
from wavecomb.usd.lights.light import KINDS as LIGHT_KINDS
from wavecomb.usd.lights.light import Light, LightReader
from wavecomb.usd.materials.colour_space import LINEAR, RAW, canonical
from wavecomb.usd.materials.material import PREVIEW, surface_source
from wavecomb.usd.materials.network import (
    Source,
    colour,
    linear_colour,
    number,
    shader_id,
    source_of,
    space_of,
    value_of,
)
from wavecomb.usd.materials.preview_surface import INPUTS, constant, program_of
from wavecomb.usd.materials.surface import (
    COLOUR,
    COLOUR_PARAMETERS,
    DEFAULTS,
    SWITCH,
    InputDefinition,
    Surface,
)
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.collections import LightGroups
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport

IN_INSTANCE = "it is inside an instance, where USD does not accept opinions"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a material.

    Attributes:
        name: Keyword argument of ``SceneBuilder.add_material``, or input of the MaterialX shader.
        value: Value that the loader reads: a number, a colour or a bool; None if a texture or
            primvar drives the parameter.
        attribute: Path of the attribute to author, which may not exist yet; None if there is no
            such attribute.
        type_name: Type of the attribute.
        driven_by: Source of a value that is not constant, such as "texture marble.png" or "primvar
            displayColor"; empty for a constant.
        reason: Reason why the parameter cannot be edited; empty if it can be edited.
        definition: MaterialX definition of the input; None for UsdPreviewSurface.
    """

    name: str
    value: Any = None
    attribute: Sdf.Path | None = None
    type_name: Sdf.ValueTypeName = Sdf.ValueTypeNames.Float
    driven_by: str = ""
    reason: str = ""
    definition: InputDefinition | None = None

    def authored(self, value: Any) -> Any:
        """Converts a parameter value to the value of the attribute."""
        if isinstance(value, bool):
            return value if self.type_name == Sdf.ValueTypeNames.Bool else int(value)
        if isinstance(value, (tuple, list)):
            return self.type_name.type.pythonClass(*(float(v) for v in value))
        if _is_triple(self.type_name):
            return self.type_name.type.pythonClass(*[float(value)] * 3)
        return as_stored(float(value))


def material_parameters(prim: Usd.Prim, time: Usd.TimeCode) -> dict[str, Parameter]:
    """Returns a material's parameters by name, in display order; empty without a surface."""
    material = UsdShade.Material(prim)
    kind, shader = surface_source(material) if material else ("", UsdShade.Shader())
    if not kind:
        return {}
    tracer = _Tracer(prim, shader, time)
    if kind != PREVIEW:
        return tracer.materialx(kind)
    return tracer.preview(program_of(prim, time, LoadReport()))


class _Tracer:
    """Finds the attributes that hold the inputs of one surface shader."""

    def __init__(self, prim: Usd.Prim, shader: UsdShade.Shader, time: Usd.TimeCode) -> None:
        self._prim = prim
        self._shader = shader
        self._time = time

    def preview(self, program: str) -> dict[str, Parameter]:
        """Returns the parameters of a UsdPreviewSurface."""
        wanted = programs()[program].reads
        out: dict[str, Parameter] = {}
        for name, (parameter, default) in INPUTS.items():
            if parameter == "normal" or parameter not in wanted:
                continue
            if parameter == "base_color" and program == "dielectric":
                default = (1.0, 1.0, 1.0)
            out[parameter] = self._input(parameter, name, default)
        for key, parameter in (("wavecomb:eta", "conductor_eta"), ("wavecomb:k", "conductor_k")):
            attribute = self._prim.GetAttribute(key)
            if program == "metal" and attribute and attribute.HasAuthoredValue():
                black = (0.0, 0.0, 0.0)
                value = colour(attribute.Get(self._time), black)
                path, usual = attribute.GetPath(), Sdf.ValueTypeNames.Color3f
                out[parameter] = self._constant(parameter, value, path, attribute, usual)
        for row in own_parameters(program):
            attribute = self._prim.GetAttribute(row.attribute) or None
            given = None if attribute is None else attribute.Get(self._time)
            now = row.in_range(number(given, row.default))
            path = self._prim.GetPath().AppendProperty(row.attribute)
            usual = Sdf.ValueTypeNames.Float
            out[row.name] = self._constant(row.name, now, path, attribute, usual)
        return out

    def materialx(self, model_name: str) -> dict[str, Parameter]:
        """Returns the inputs of a MaterialX surface that Wavecomb reads."""
        known = mtlx.definitions(model_name, shader_id(self._shader))
        return {name: self._own_input(one) for name, one in known.items()}

    def _own_input(self, definition: InputDefinition) -> Parameter:
        name, default = definition.name, definition.default
        source = source_of(self._shader, name, self._time)
        if source is not None and not source.is_value:
            return Parameter(name, driven_by=self._driver(source), definition=definition)
        attribute = None if source is None else source.attribute
        value = default if source is None else source.value
        if definition.kind == SWITCH:
            value = bool(number(value, default))
        elif definition.kind == COLOUR:
            value = colour(value, default)
            if (space := _other_space(attribute)) is not None:
                return replace(self._encoded(name, value, attribute, space), definition=definition)
        else:
            value = number(value, default)
        types = Sdf.ValueTypeNames
        usual = {"color3": types.Color3f, "boolean": types.Bool}.get(
            definition.type_name, types.Float
        )
        return replace(
            self._constant(name, value, self._path_of(name, attribute), attribute, usual),
            definition=definition,
        )

    def _path_of(self, name: str, attribute: Usd.Attribute | None) -> Sdf.Path:
        """Returns the path of the attribute that holds, or would hold, an input's value."""
        own = self._shader.GetPath().AppendProperty(f"inputs:{name}")
        return own if attribute is None else attribute.GetPath()

    def _input(self, parameter: str, name: str, default: Any) -> Parameter:
        source = source_of(self._shader, name, self._time)
        if source is not None and not source.is_value:
            return Parameter(parameter, driven_by=self._driver(source))
        attribute = None if source is None else source.attribute
        value = constant(parameter, default if source is None else source.value, default)
        space = _other_space(attribute) if parameter in COLOUR_PARAMETERS else None
        if space is not None:
            return self._encoded(parameter, value, attribute, space)
        wide = parameter in COLOUR_PARAMETERS
        usual = Sdf.ValueTypeNames.Color3f if wide else Sdf.ValueTypeNames.Float
        return self._constant(parameter, value, self._path_of(name, attribute), attribute, usual)

    def _encoded(
        self, parameter: str, value: Any, attribute: Usd.Attribute | None, space: str
    ) -> Parameter:
        """Returns a colour parameter that is not editable because of its colour space."""
        # Ignore unknown colour spaces here, since the material reader reports them.
        with contextlib.suppress(ValueError):
            value = linear_colour(value, attribute)
        return Parameter(parameter, value, reason=f"it is in the colour space {space}")

    def _constant(
        self,
        parameter: str,
        value: Any,
        path: Sdf.Path,
        attribute: Usd.Attribute | None,
        usual: Sdf.ValueTypeName,
    ) -> Parameter:
        """Returns a parameter held by ``attribute``, or by a new attribute of the usual type."""
        if self._prim.IsInstanceProxy() or self._prim.IsInPrototype():
            return Parameter(parameter, value, reason=IN_INSTANCE)
        if not path.HasPrefix(self._prim.GetPath()):
            reason = f"it comes from {path}, outside of the material"
            return Parameter(parameter, value, reason=reason)
        if attribute is None:
            return Parameter(parameter, value, path, usual)
        type_name = attribute.GetTypeName()
        if _is_triple(usual) != _is_triple(type_name):
            return Parameter(parameter, value, reason=f"{path} is a {type_name}")
        return Parameter(parameter, value, path, type_name)

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


class _AnyProfile:
    """Table of IES profiles that accepts every profile without reading it."""

    def add(self, path: str, prim: Sdf.Path) -> int:
        """Returns a dummy profile id."""
        return 0


def light_values(prim: Usd.Prim, time: Usd.TimeCode) -> dict[str, Any] | None:
    """Returns the parameters that the loader passes to ``SceneBuilder.add_light``.

    The light must be outside of instances. The result has all numbers, colours and switches of this
    kind of light except its visibility, by their names in ``wavecomb.core_table``. Returns None if
    the prim is not a supported light.
    """
    if not prim or str(prim.GetTypeName()) not in LIGHT_KINDS:
        return None
    light, _ = _read_light(prim, time)
    return {
        row.name: light.options.get(row.name, row.default)
        for row in of_kind(light.kind)
        if row.kind in EDITABLE and row.name not in ("visible", "visible_to_camera")
    }


def light_transform(prim: Usd.Prim, time: Usd.TimeCode) -> NDArray[np.float64]:
    """Returns the transform (4, 4) to the world that the loader uses for a supported light."""
    light, matrix = _read_light(prim, time)
    return np.asarray(light.local @ np.array(matrix))


def _read_light(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[Light, Gf.Matrix4d]:
    """Reads a light and its transform to the world."""
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
    context = LoadContext(prim.GetStage(), time, None)  # type: ignore[arg-type]
    reader = LightReader(context, None, LightGroups(context.report), _AnyProfile())
    return reader.read(prim, scale), matrix


def as_stored(value: Any) -> Any:
    """Rounds a number or colour to float32, as the core stores it; returns a bool unchanged."""
    if isinstance(value, bool):
        return value
    if isinstance(value, (tuple, list)):
        return tuple(float(np.float32(v)) for v in value)
    return float(np.float32(value))


def _other_space(attribute: Usd.Attribute | None) -> str | None:
    """Returns the colour space of an attribute, or None for linear Rec.709 or no space."""
    space = space_of(attribute)
    return space if space and canonical(space) not in (LINEAR, RAW) else None


class _NoTextures:
    """Texture table that accepts every file name and opens no file."""

    working = "rec709"

    def __init__(self) -> None:
        self._numbers: dict[Any, int] = {}

    def image(self, path: str, prim: object) -> Any:
        """Returns a dummy image with four channels."""
        return SimpleNamespace(channels=4)

    def add(self, *key: Any, **more: Any) -> int:
        """Returns an id for a texture use, which differs between texture uses."""
        use = (key[0], *key[2:], *sorted(more.items()))
        return self._numbers.setdefault(use, len(self._numbers))

    def missing(self) -> int:
        """Returns a dummy id for the checker texture."""
        return -1


@dataclass(frozen=True)
class SurfaceValues:
    """The values of a material in the core.

    Attributes:
        constants: Keyword arguments of ``Renderer.edit``, except those that textures or graphs
            drive.
        structure: Text that differs if textures or graphs differ, which ``Renderer.edit`` cannot
            change.
    """

    constants: Mapping[str, Any]
    structure: str


def surface_values(
    prim: Usd.Prim, time: Usd.TimeCode, values: Mapping[str, Any] | None = None
) -> SurfaceValues | None:
    """Returns the values that the loader passes to the core; None unless the material is MaterialX.

    Args:
        prim: A material.
        time: Time code at which attributes are evaluated.
        values: Constants that replace authored inputs of the surface shader.
    """
    material = UsdShade.Material(prim)
    kind, shader = surface_source(material) if material else ("", UsdShade.Shader())
    if not kind or kind == PREVIEW:
        return None
    textures = cast(TextureTable, _NoTextures())
    try:
        surface = mtlx.surface(prim, time, textures, LoadReport(), shader, kind, values)
    # A material that cannot be read is rendered in grey.
    except (Tf.ErrorException, RecursionError):
        return None
    if surface is None:
        return None
    return SurfaceValues(_constants(surface), _structure(surface))


def _constants(surface: Surface) -> dict[str, Any]:
    parameters = dict(surface.parameters)
    layers = parameters.pop("openpbr", {})
    driven = set(surface.textures)
    if surface.graph is not None:
        driven |= {name for name, _ in surface.graph.outputs}
    if "extinction" in driven or "transmission_tint" in driven:
        driven |= {"transmission_color", "transmission_depth"}
    every = {name: value for name, value in DEFAULTS.items() if name != "normal"}
    every |= parameters | layers
    return {name: value for name, value in every.items() if name not in driven}


def _structure(surface: Surface) -> str:
    return repr((sorted(surface.textures.items()), surface.uv_names, surface.graph))
