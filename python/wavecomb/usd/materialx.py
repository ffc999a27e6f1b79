# SPDX-License-Identifier: Apache-2.0
"""MaterialX surface shaders, as the program "openpbr".

Constants, and images that are connected directly or through simple nodes, of standard_surface,
open_pbr_surface, gltf_pbr and MaterialX's UsdPreviewSurface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.colour_space import space_of
from wavecomb.usd.network import (
    MAX_DEPTH,
    colour,
    number,
    pair,
    shader_id,
    source_of,
    value_of,
)
from wavecomb.usd.openpbr import layers_of
from wavecomb.usd.surface import COLOUR_SLOTS, Surface
from wavecomb.usd.texture import asset_file

if TYPE_CHECKING:
    from wavecomb.usd.report import LoadReport
    from wavecomb.usd.texture import TextureTable

Colour = tuple[float, float, float]

_WHITE: Colour = (1.0, 1.0, 1.0)
_WRAPS = {"periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black"}


@dataclass(frozen=True)
class Model:
    """Names and defaults of the inputs of a shading model, each (name, default).

    A slot's value is its input, times its weight where one is named.
    """

    base_color: tuple[str, Colour]
    base_weight: tuple[str, float] = ("", 1.0)
    roughness: tuple[str, float] = ("specular_roughness", 0.2)
    metallic: tuple[str, float] = ("metalness", 0.0)
    ior: tuple[str, float] = ("specular_IOR", 1.5)
    transmission: tuple[str, float] = ("transmission", 0.0)
    transmission_color: tuple[str, Colour] = ("transmission_color", _WHITE)
    emission: tuple[str, Colour] = ("emission_color", _WHITE)
    emission_weight: tuple[str, float] = ("emission", 0.0)
    clearcoat: tuple[str, float] = ("coat", 0.0)
    clearcoat_roughness: tuple[str, float] = ("coat_roughness", 0.1)
    specular_color: tuple[str, Colour] = ("specular_color", _WHITE)
    opacity: tuple[str, float] = ("opacity", 1.0)
    normal: str = "normal"


MODELS: dict[str, Model] = {
    "standard_surface": Model(("base_color", (0.8, 0.8, 0.8)), ("base", 1.0)),
    "open_pbr_surface": Model(
        ("base_color", (0.8, 0.8, 0.8)),
        ("base_weight", 1.0),
        ("specular_roughness", 0.3),
        ("base_metalness", 0.0),
        ("specular_ior", 1.5),
        ("transmission_weight", 0.0),
        ("transmission_color", _WHITE),
        ("emission_color", _WHITE),
        ("emission_luminance", 0.0),
        ("coat_weight", 0.0),
        ("coat_roughness", 0.0),
        ("specular_color", _WHITE),
        ("geometry_opacity", 1.0),
        "geometry_normal",
    ),
    "gltf_pbr": Model(
        ("base_color", _WHITE),
        ("", 1.0),
        ("roughness", 1.0),
        ("metallic", 1.0),
        ("ior", 1.5),
        ("transmission", 0.0),
        ("", _WHITE),
        ("emissive", (0.0, 0.0, 0.0)),
        ("emissive_strength", 1.0),
        ("clearcoat", 0.0),
        ("clearcoat_roughness", 0.0),
        ("specular_color", _WHITE),
        ("alpha", 1.0),
    ),
}


def model_of(identifier: str) -> str:
    """The shading model of a shader id such as ``ND_standard_surface_surfaceshader``, or ''."""
    return next((name for name in MODELS if identifier.startswith(f"ND_{name}")), "")


class MaterialXReader:
    """Reads one MaterialX surface shader."""

    def __init__(
        self, material: Usd.Prim, time: Usd.TimeCode, textures: TextureTable, report: LoadReport
    ) -> None:
        self.material = material
        self.time = time
        self.textures = textures
        self.report = report
        self.slots: dict[str, dict[str, Any]] = {}
        self.uv_names: list[str] = []
        self._tried: set[tuple[str, str, str]] = set()

    def read(self, shader: UsdShade.Shader, model_name: str) -> Surface:
        """The surface: slots, and layers beside them."""
        model = MODELS[model_name]
        weight = self._number(shader, "", model.base_weight)
        ior = self._number(shader, "", model.ior)
        if ior <= 0.0:
            self.report.warn("ior of 0 or less: set to 1.5", self.material.GetPath())
            ior = 1.5
        parameters: dict[str, Any] = {
            "base_color": self._colour(shader, "base_color", model.base_color, weight),
            "specular_color": self._colour(shader, "specular_color", model.specular_color, 1.0),
            "roughness": self._number(shader, "roughness", model.roughness),
            "metallic": self._number(shader, "metallic", model.metallic),
            "ior": ior,
            "clearcoat": self._number(shader, "clearcoat", model.clearcoat),
            "clearcoat_roughness": self._number(
                shader, "clearcoat_roughness", model.clearcoat_roughness
            ),
            "opacity": self._number(shader, "opacity", model.opacity),
            "presence": True,
            "openpbr": layers_of(model_name, _Constants(self, shader, model_name)),
        }
        glow = self._number(shader, "", model.emission_weight)
        if model_name == "open_pbr_surface":
            # Luminance in nits; 1000 is open_pbr's own scale for a bright display.
            glow /= 1000.0
        if glow > 0:
            parameters["emission"] = self._colour(shader, "emission", model.emission, glow)
        self._normal(shader, model.normal)
        return self._surface("openpbr", parameters, self.slots)

    def _surface(self, program: str, parameters: dict[str, Any], slots: dict[str, Any]) -> Surface:
        names = tuple(dict.fromkeys(self.uv_names))
        return Surface(str(self.material.GetPath()), program, parameters, slots, names)

    def _number(self, shader: UsdShade.Shader, slot: str, spec: tuple[str, float]) -> float:
        name, default = spec
        value = self._value(shader, name, slot, 1.0) if name else None
        return number(value, default)

    def _colour(
        self, shader: UsdShade.Shader, slot: str, spec: tuple[str, Colour], weight: float
    ) -> Colour:
        name, default = spec
        value = self._value(shader, name, slot, weight) if name else None
        r, g, b = colour(value, default)
        return (r * weight, g * weight, b * weight)

    def constant(self, shader: UsdShade.Shader, name: str) -> Any:
        """What an input comes to as one value; None for its default."""
        return self._value(shader, name, "", 1.0)

    def _normal(self, shader: UsdShade.Shader, name: str) -> None:
        source = source_of(shader, name, self.time)
        if source is None or source.shader is None:
            return
        node = source.shader
        if not shader_id(node).startswith("ND_normalmap"):
            return
        strength = number(value_of(node, "scale", self.time), 1.0)
        self._value(node, "in", "normal", 1.0)
        if "normal" in self.slots:
            self.slots["normal"] |= {
                "scale": (2.0 * strength, 2.0 * strength, 2.0, 1.0),
                "bias": (-strength, -strength, -1.0, 0.0),
            }

    def _value(
        self, shader: UsdShade.Shader, name: str, slot: str, weight: float, depth: int = 0
    ) -> Any:
        """A constant; an image goes to ``slots`` where there is a slot, and gives None."""
        source = source_of(shader, name, self.time)
        if source is None or depth > MAX_DEPTH:
            return None
        if source.is_value:
            return source.value
        node = source.shader
        if node is None:
            return None
        identifier = shader_id(node)
        if identifier.startswith("ND_constant"):
            return self._value(node, "value", slot, weight, depth + 1)
        if identifier.startswith(
            ("ND_image", "ND_tiledimage", "ND_gltf_image", "ND_gltf_colorimage")
        ):
            return self._image(node, identifier, slot, weight)
        if identifier.startswith(("ND_convert", "ND_dot", "ND_swizzle", "ND_extract")):
            return self._value(node, "in", slot, weight, depth + 1)
        # Once for each slot: networks that fork and meet again have endless ways through them.
        key = (str(node.GetPath()), source.output, slot)
        if key in self._tried:
            return None
        self._tried.add(key)
        what = f"MaterialX node {identifier or '(no info:id)'} (inputs tried in its place)"
        self.report.missing(what, self.material.GetPath())
        for item in node.GetInputs():
            has_slot = slot in self.slots
            value = self._value(node, item.GetBaseName(), slot, weight, depth + 1)
            if slot in self.slots and not has_slot:
                return None
            if value is not None and _is_colour_like(value):
                return value
        return None

    def _image(self, node: UsdShade.Shader, identifier: str, slot: str, weight: float) -> Any:
        default = value_of(node, "default", self.time)
        file = source_of(node, "file", self.time)
        if not slot or file is None:
            return default
        path = asset_file(file.value, file.attribute)
        image = self.textures.image(path, node.GetPath())
        if image is None:
            if default is not None or slot != "base_color":
                return default
            texture, channel = self.textures.missing(), "rgb"
        else:
            is_colour = "color" in identifier and slot in COLOUR_SLOTS
            space = space_of(file.attribute) or ("auto" if is_colour else "raw")
            wraps = [
                _WRAPS.get(str(value_of(node, f"{axis}addressmode", self.time)), "repeat")
                for axis in "uv"
            ]
            texture = self.textures.add(path, image, space, *wraps, is_colour=is_colour)
            wide = slot in (*COLOUR_SLOTS, "normal") and image.channels >= 3
            channel = "rgb" if wide else "r"
        u, v = pair(value_of(node, "uvtiling", self.time), (1.0, 1.0))
        scale = weight if slot in COLOUR_SLOTS else 1.0
        self.slots[slot] = {
            "texture": texture,
            "channel": channel,
            "scale": (scale, scale, scale, 1.0),
            "bias": (0.0, 0.0, 0.0, 0.0),
            "uv": (u, 0.0, 0.0, 0.0, v, 0.0),
        }
        self.uv_names.append(self._uv_name(node))
        return None

    def _uv_name(self, node: UsdShade.Shader) -> str:
        """The primvar behind ``texcoord``: of a geompropvalue node; else st."""
        source = source_of(node, "texcoord", self.time)
        if source is not None and source.shader is not None:
            name = value_of(source.shader, "geomprop", self.time)
            if name:
                return str(name)
        return "st"


class _Constants:
    """Inputs that have no slot, as constants; what drives them otherwise is reported."""

    def __init__(self, reader: MaterialXReader, shader: UsdShade.Shader, model: str) -> None:
        self._reader = reader
        self._shader = shader
        self._model = model

    def number(self, name: str, default: float) -> float:
        return number(self._constant(name), default)

    def colour(self, name: str, default: Colour) -> Colour:
        return colour(self._constant(name), default)

    def ignored(self, *names: str) -> None:
        for name in names:
            given = self._shader.GetInput(name)
            if given and (given.HasConnectedSource() or given.Get(self._reader.time) is not None):
                self._missing(f"MaterialX {self._model} input {name} (ignored)")

    def approximated(self, what: str) -> None:
        self._missing(f"{what}: approximated")

    def _constant(self, name: str) -> Any:
        source = source_of(self._shader, name, self._reader.time)
        if source is None or source.is_value:
            return None if source is None else source.value
        node = source.shader
        if node is None or not shader_id(node).startswith("ND_constant"):
            self._missing(f"MaterialX {self._model} input {name} by a node (one value for all)")
        return self._reader.constant(self._shader, name)

    def _missing(self, what: str) -> None:
        self._reader.report.missing(what, self._reader.material.GetPath())


def _is_colour_like(value: Any) -> bool:
    return isinstance(value, float) or (hasattr(value, "__len__") and len(value) in (3, 4))
