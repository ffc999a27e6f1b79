# SPDX-License-Identifier: Apache-2.0
"""Converts UsdPreviewSurface networks to surfaces (UsdPreviewSurface specification 2.6)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Usd, UsdShade

from wavecomb.core_table import own_parameters, preview_programs, programs
from wavecomb.usd import mtlx
from wavecomb.usd.graphs.surface_parameters import Drivers
from wavecomb.usd.graphs.values import PARAMETERS
from wavecomb.usd.materials.colour_space import SRGB, canonical
from wavecomb.usd.materials.network import (
    MAX_DEPTH,
    InputValues,
    Source,
    asset_file,
    colour,
    number,
    pair,
    read_colour,
    shader_id,
    source_of,
    space_of,
    word,
)
from wavecomb.usd.materials.surface import COLOUR_PARAMETERS, Surface

if TYPE_CHECKING:
    from wavecomb.usd.materials.pixels import Image
    from wavecomb.usd.materials.texture import TextureTable, TiledImage
    from wavecomb.usd.stage.report import LoadReport

INPUTS: dict[str, tuple[str, Any]] = {
    "diffuseColor": ("base_color", (0.18, 0.18, 0.18)),
    "specularColor": ("specular_color", (0.0, 0.0, 0.0)),
    "emissiveColor": ("emission", (0.0, 0.0, 0.0)),
    "roughness": ("roughness", 0.5),
    "metallic": ("metallic", 0.0),
    "clearcoat": ("clearcoat", 0.0),
    "clearcoatRoughness": ("clearcoat_roughness", 0.01),
    "opacity": ("opacity", 1.0),
    "normal": ("normal", (0.0, 0.0, 1.0)),
    "ior": ("ior", 1.5),
    "opacityThreshold": ("opacity_threshold", 0.0),
}
"""Parameter and default value for each input of UsdPreviewSurface."""

_UNIT = frozenset(
    ("roughness", "metallic", "clearcoat", "clearcoat_roughness", "opacity", "opacity_threshold")
)

_WRAP_INPUTS = ("wrapS", "wrapT")
_ONES = (1.0, 1.0, 1.0, 1.0)
_ZEROS = (0.0, 0.0, 0.0, 0.0)
_IDENTITY_UV = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def program_of(material: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> str:
    """Returns the program in ``wavecomb:program`` of a material; "principled" if not authored."""
    name = material.GetAttribute("wavecomb:program").Get(time)
    if name is None:
        return "principled"
    if word(name) not in preview_programs():
        known = ", ".join(preview_programs())
        report.warn(f"wavecomb:program {name!r} is none of {known}: principled", material.GetPath())
        return "principled"
    return str(name)


def constant(parameter: str, value: Any, default: Any) -> Any:
    """Converts an authored value to a parameter value, finite and in range."""
    if isinstance(default, tuple):
        return colour(value, default)
    result = number(value, default)
    return min(max(result, 0.0), 1.0) if parameter in _UNIT else result


class PreviewReader:
    """Reader of one UsdPreviewSurface network."""

    def __init__(
        self,
        material: Usd.Prim,
        time: Usd.TimeCode,
        textures: TextureTable,
        report: LoadReport,
        primvars: Mapping[str, Any] | None = None,
    ) -> None:
        """``primvars`` has the object's values of the primvars that texture inputs read."""
        self.material = material
        self.time = time
        self.textures = textures
        self.report = report
        self.drivers = Drivers(mtlx.networks(material, time, textures, report))
        self.values = InputValues(time, report, self.drivers.networks.node, primvars)
        self._by_object = True
        self.uv_names = self.drivers.networks.uv_names
        self.textured = self.drivers.textured
        self.primvars: dict[str, str] = {}
        self.texture_uvs: dict[str, str] = {}

    def read(self, shader: UsdShade.Shader) -> Surface:
        """Returns the surface of a UsdPreviewSurface shader."""
        program = program_of(self.material, self.time, self.report)
        wanted = programs()[program].reads
        parameters: dict[str, Any] = {}
        for name, (parameter, default) in INPUTS.items():
            if parameter not in wanted:
                continue
            source = source_of(shader, name, self.time)
            if source is not None:
                value = self._input(parameter, source, default)
                if parameter == "normal":
                    self._flat_normal(value)
                elif value is not None:
                    parameters[parameter] = value
        if parameters.get("ior", 1.0) <= 0.0:
            self.report.warn("ior of 0 or less: set to 1.5", self.material.GetPath())
            parameters["ior"] = 1.5
        if program == "dielectric" and "base_color" not in parameters:
            parameters["base_color"] = (1.0, 1.0, 1.0)
        if program == "principled":
            workflow = self._value(shader, "useSpecularWorkflow", 0)
            parameters["specular_workflow"] = bool(number(workflow, 0))
            mode = self._value(shader, "opacityMode", "transparent")
            parameters["presence"] = word(mode) == "presence"
        for key, parameter in (("wavecomb:eta", "conductor_eta"), ("wavecomb:k", "conductor_k")):
            attribute = self.material.GetAttribute(key)
            if program == "metal" and attribute and attribute.HasAuthoredValue():
                parameters[parameter] = colour(attribute.Get(self.time), (0.0, 0.0, 0.0))
        for row in own_parameters(program):
            attribute = self.material.GetAttribute(row.attribute)
            if attribute.HasAuthoredValue():
                parameters[row.name] = row.in_range(number(attribute.Get(self.time), row.default))
        displacement = self._displacement(shader)
        return Surface(
            str(self.material.GetPath()),
            program,
            parameters,
            self.textured,
            self.drivers.uv_names,
            self.primvars,
            displacement,
            self.drivers.graph(),
            self.texture_uvs,
            tuple(self.values.reads),
        )

    def _value(self, shader: UsdShade.Shader, name: str, default: Any = None) -> Any:
        """Returns the value of an input that is constant over an object."""
        return self.values.of(shader, name, default, by_object=self._by_object)

    def _flat_normal(self, value: Any) -> None:
        """Adds a constant normal as a normal map of one texel."""
        if value is None or tuple(value) == INPUTS["normal"][1]:
            return
        texel = np.array(value, np.float32).reshape(1, 1, 3)
        texture = self.textures.add_pixels(f"normal {tuple(value)}", texel)
        self.textured["normal"] = _texture_use(texture, (0.0,) * 6)

    def _displacement(self, surface: UsdShade.Shader) -> float | dict[str, Any] | None:
        """Reads the material's displacement as a length or a texture use; None if there is none."""
        shader = UsdShade.Material(self.material).ComputeDisplacementSource()[0]
        connected = shader and "UsdPreviewSurface" in shader_id(shader)
        if shader and not connected:
            what = f"displacement shader {shader_id(shader) or '(none)'}"
            self.report.missing(what, self.material.GetPath())
        source = source_of(shader if connected else surface, "displacement", self.time)
        if source is None or (source.is_value and number(source.value, 0.0) == 0.0):
            return None
        if not connected:
            what = "displacement that the material's displacement output does not lead to: ignored"
            self.report.note(what, self.material.GetPath())
            return None
        # The displacement of a material is the same for all objects, so its inputs cannot be read
        # from primvars of objects.
        self._by_object = False
        value = self._input("displacement", source, 0.0)
        texture = self.textured.pop("displacement", None)
        if self.primvars.pop("displacement", None) is not None:
            self.report.missing("displacement by a primvar", self.material.GetPath())
            return None
        return texture if texture is not None else (float(value or 0.0) or None)

    def _input(self, parameter: str, source: Source, default: Any) -> Any:
        """Returns a constant for a parameter; None if the parameter has a texture or its default.

        The function adds textures to ``textured`` and primvars to ``primvars``.
        """
        if source.is_value:
            value = constant(parameter, source.value, default)
            return self._linear(value, source) if parameter in COLOUR_PARAMETERS else value
        shader = source.shader
        identifier = shader_id(shader) if shader else ""
        if shader is not None and identifier == "UsdUVTexture":
            if parameter in ("ior", "opacity_threshold"):
                self.report.missing(f"a texture for {parameter}", self.material.GetPath())
                return default
            return self._texture(parameter, shader, source.output, default)
        if shader is not None and identifier.startswith("UsdPrimvarReader_"):
            name = self._value(shader, "varname", "")
            fallback = self._value(shader, "fallback")
            if name and parameter == "normal":
                self.report.missing("normals by a primvar of a material", self.material.GetPath())
            elif name:
                self.primvars[parameter] = str(name)
            return constant(parameter, fallback, default)
        if shader is not None and identifier.startswith("ND_") and parameter in PARAMETERS:
            return self._network(parameter, shader, source.output, default)
        what = identifier or "a shader without info:id"
        self.report.missing(f"shading node {what}", self.material.GetPath())
        return default

    def _network(self, parameter: str, shader: UsdShade.Shader, output: str, default: Any) -> Any:
        """Evaluates a MaterialX node that drives a parameter.

        Returns a constant, or None if a texture or graph drives the parameter.
        """
        value = self.drivers.output(shader, output, parameter)
        if value is None:
            return default
        found = self.drivers.put(parameter, value)
        return None if found is None else constant(parameter, found, default)

    def _linear(self, value: Any, source: Source) -> Any:
        """Converts a colour from its attribute's colour space to linear Rec.709."""
        return read_colour(value, source.attribute, self.report, self.material.GetPath())

    def _texture(self, parameter: str, shader: UsdShade.Shader, output: str, default: Any) -> Any:
        """Adds a texture use; returns a constant if the texture has no image."""
        scale = _four(self._value(shader, "scale"), _ONES)
        bias = _four(self._value(shader, "bias"), _ZEROS)
        file = source_of(shader, "file", self.time)
        if file is not None and file.shader is not None:
            by = shader_id(file.shader)
            self.report.missing(f"UsdUVTexture input file by {by}", shader.GetPath())
            return default
        path = asset_file(file.value, file.attribute) if file is not None else ""
        image = self.textures.image(path, shader.GetPath())
        channel = output if output in ("rgb", "r", "g", "b", "a") else "rgb"
        if image is None:
            return self._fallback(parameter, shader, channel, scale, bias, default)
        if channel == "a" and image.channels in (1, 3):
            value = scale[3] + bias[3]
            return (value,) * 3 if isinstance(default, tuple) else value
        wide = parameter in COLOUR_PARAMETERS
        if channel == "rgb" and not wide and parameter != "normal":
            channel = "r"
        space = self._colour_space(shader, file)
        if parameter == "normal":
            space = self._linear_normals(space, image, shader)
            bare = scale[:3] == _ONES[:3] and bias[:3] == _ZEROS[:3]
            if bare and image.dtype.name in ("uint8", "float16"):
                scale, bias = (2.0, 2.0, 2.0, 1.0), (-1.0, -1.0, -1.0, 0.0)
                what = "normal map without scale and bias: read as 2 x - 1, linear"
                self.report.note(what, shader.GetPath())
        missing = _four(self._value(shader, "fallback"), (0.0, 0.0, 0.0, 1.0))
        wraps = [self._wrap(shader, name, image.wraps[i]) for i, name in enumerate(_WRAP_INPUTS)]
        matrix = self._coordinates(shader, parameter)
        if not any((*matrix[:2], *matrix[3:5])):
            # The texture coordinates are constant, so all lookups read a single texel, and the
            # border colour must not be blended into it.
            wraps = ["clamp", "clamp"]
        texture = self.textures.add(path, image, space, *wraps, is_colour=wide, missing=missing)
        self.textured[parameter] = _texture_use(texture, matrix, channel, scale, bias)
        return None

    def _wrap(self, shader: UsdShade.Shader, name: str, of_file: str) -> str:
        """Returns a wrap mode; "useMetadata" means the file's wrap mode, or black."""
        mode = word(self._value(shader, name), "useMetadata")
        if mode not in ("black", "clamp", "repeat", "mirror", "useMetadata"):
            self.report.warn(
                f"{name} {mode!r} is no wrap mode: read as useMetadata", shader.GetPath()
            )
            mode = "useMetadata"
        return of_file if mode == "useMetadata" else mode

    def _linear_normals(
        self, space: str, image: Image | TiledImage, shader: UsdShade.Shader
    ) -> str:
        """Returns raw, the colour space of all normal maps; reports other colour spaces."""
        if image.automatic_srgb if space == "auto" else canonical(space) == SRGB:
            if word(self._value(shader, "sourceColorSpace")) == "sRGB":
                what = "normal map whose sourceColorSpace is sRGB: read as raw"
                self.report.warn(what, shader.GetPath())
            else:
                what = "normal map whose sourceColorSpace is not raw: read as raw"
                self.report.note(what, shader.GetPath())
        return "raw"

    def _colour_space(self, shader: UsdShade.Shader, file: Source | None) -> str:
        """Returns sourceColorSpace, or the colour space of the file attribute, or "auto"."""
        space = word(self._value(shader, "sourceColorSpace"))
        if space in ("raw", "sRGB"):
            return str(space)
        # An authored sourceColorSpace of "auto" uses the file's metadata. Without an authored
        # value, the colour space of the stage applies if there is one.
        return "auto" if space == "auto" else space_of(file and file.attribute) or "auto"

    def _fallback(
        self,
        parameter: str,
        shader: UsdShade.Shader,
        channel: str,
        scale: tuple[float, ...],
        bias: tuple[float, ...],
        default: Any,
    ) -> Any:
        """Returns the value that replaces an image that cannot be read."""
        authored = self._value(shader, "fallback")
        if authored is not None:
            texel = _four(authored, (0.0, 0.0, 0.0, 1.0))
            value = [t * s + b for t, s, b in zip(texel, scale, bias, strict=True)]
            if isinstance(default, tuple):
                return tuple(value[:3]) if channel == "rgb" else (value["rgba".index(channel)],) * 3
            return constant(parameter, value["rgba".index(channel[0])], default)
        if parameter == "base_color":
            texture, uv = self.textures.missing(), self._coordinates(shader, parameter)
            self.textured[parameter] = _texture_use(texture, uv)
            return None
        return default

    def _coordinates(self, shader: UsdShade.Shader, parameter: str) -> tuple[float, ...]:
        """Returns the 2 x 3 matrix that transforms the mesh's texture coordinates.

        The name of the UV primvar is added to ``uv_names``, and to ``texture_uvs`` if the first
        texture uses another primvar. If the input ``st`` is not connected, the texture coordinates
        are constant: the authored value or (0, 0).
        """
        matrix: tuple[float, ...] = _IDENTITY_UV
        node, key = shader, "st"
        for _ in range(MAX_DEPTH):
            source = source_of(node, key, self.time)
            if source is None or source.shader is None:
                u, v = pair(source.value if source is not None else None, (0.0, 0.0))
                return _compose(matrix, (0.0, 0.0, u, 0.0, 0.0, v))
            node = source.shader
            identifier = shader_id(node)
            if identifier == "UsdTransform2d":
                matrix = _compose(matrix, self._transform_2d(node))
                key = "in"
            elif identifier.startswith("UsdPrimvarReader_float2"):
                name = str(self._value(node, "varname", "") or "st")
                self._note_uv(name, parameter)
                if any(pair(self._value(node, "fallback"), (0.0, 0.0))):
                    what = f"fallback of a reader of {name!r}: (0, 0) where a mesh has none"
                    self.report.missing(what, node.GetPath())
                return matrix
            else:
                self.report.missing(f"shading node {identifier} for st", self.material.GetPath())
                self._note_uv("st", parameter)
                return matrix
        self.report.warn("texture coordinates with a cyclic connection", self.material.GetPath())
        return (0.0,) * 6

    def _note_uv(self, name: str, parameter: str) -> None:
        self.uv_names.append(name)
        if name != self.uv_names[0]:
            self.texture_uvs[parameter] = name

    def _transform_2d(self, node: UsdShade.Shader) -> tuple[float, ...]:
        """Returns the matrix of a UsdTransform2d: scale, rotate counter-clockwise, translate."""
        angle = math.radians(number(self._value(node, "rotation"), 0.0))
        sx, sy = pair(self._value(node, "scale"), (1.0, 1.0))
        tx, ty = pair(self._value(node, "translation"), (0.0, 0.0))
        c, s = math.cos(angle), math.sin(angle)
        return (c * sx, -s * sy, tx, s * sx, c * sy, ty)


def _texture_use(
    texture: int,
    uv: tuple[float, ...],
    channel: str = "rgb",
    scale: tuple[float, ...] = _ONES,
    bias: tuple[float, ...] = _ZEROS,
) -> dict[str, Any]:
    return {"texture": texture, "channel": channel, "scale": scale, "bias": bias, "uv": uv}


def _four(value: Any, default: tuple[float, ...]) -> tuple[float, ...]:
    if not hasattr(value, "__len__") or len(value) < 4:
        return default
    return tuple(number(value[i], default[i]) for i in range(4))


def _compose(outer: tuple[float, ...], inner: tuple[float, ...]) -> tuple[float, ...]:
    """Multiplies two 2 x 3 matrices so that ``inner`` is applied first."""
    a, b, c, d, e, f = outer
    p, q, r, s, t, u = inner
    return (
        a * p + b * s, a * q + b * t, a * r + b * u + c,
        d * p + e * s, d * q + e * t, d * r + e * u + f,
    )  # fmt: skip
