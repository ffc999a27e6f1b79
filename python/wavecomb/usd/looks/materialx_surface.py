# SPDX-License-Identifier: Apache-2.0
"""MaterialX surface shaders, as the program "openpbr".

These are standard_surface, open_pbr_surface and gltf_pbr. An input is a constant, a plain texture,
or driven by a value graph.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.looks.graph_code import Value, is_constant, numbers
from wavecomb.usd.looks.graph_network import Networks
from wavecomb.usd.looks.graph_surface import Drivers, sampled
from wavecomb.usd.looks.network import colour, number, source_of
from wavecomb.usd.looks.openpbr import drive_layers, layers_of
from wavecomb.usd.looks.surface import Surface

if TYPE_CHECKING:
    from wavecomb.usd.looks.texture import TextureTable
    from wavecomb.usd.stage.report import LoadReport

Colour = tuple[float, float, float]

_WHITE: Colour = (1.0, 1.0, 1.0)


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
        self,
        material: Usd.Prim,
        time: Usd.TimeCode,
        textures: TextureTable,
        report: LoadReport,
        values: Mapping[str, Any] | None = None,
    ) -> None:
        """``values``: constants of the surface shader in place of what the stage says."""
        self.values = values or {}
        self.material = material
        self.time = time
        self.report = report
        self.drivers = Drivers(Networks(material, time, textures, report))

    def read(self, shader: UsdShade.Shader, model_name: str) -> Surface:
        """The surface: slots, and layers beside them."""
        model = MODELS[model_name]
        parameters: dict[str, Any] = {"presence": True}
        whole = self._value(shader, "", model.base_weight)
        for parameter, spec, weight in (
            ("base_color", model.base_color, whole),
            ("specular_color", model.specular_color, (1.0,)),
            ("roughness", model.roughness, (1.0,)),
            ("metallic", model.metallic, (1.0,)),
            ("ior", model.ior, (1.0,)),
            ("clearcoat", model.clearcoat, (1.0,)),
            ("clearcoat_roughness", model.clearcoat_roughness, (1.0,)),
            ("opacity", model.opacity, (1.0,)),
        ):
            self._put(parameters, shader, parameter, spec, weight)
        if parameters.get("ior", 1.5) <= 0.0:
            self.report.warn("ior of 0 or less: set to 1.5", self.material.GetPath())
            parameters["ior"] = 1.5
        glow = self._value(shader, "", model.emission_weight)
        if model_name == "open_pbr_surface":
            # Luminance in nits; 1000 is open_pbr's own scale for a bright display.
            nits = 1000.0
            constant = is_constant(glow)
            glow = (glow[0] / nits,) if constant else self.drivers.scaled(glow, (1 / nits,))  # type: ignore[operator]
        if not (is_constant(glow) and glow[0] <= 0.0):  # type: ignore[operator]
            self._put(parameters, shader, "emission", model.emission, glow)
        normal = self.drivers.value(shader, model.normal, "normal")
        if normal is not None:
            self.drivers.put("normal", normal)
        inputs = _Layers(self, shader, model_name)
        parameters["openpbr"] = layers_of(model_name, inputs)
        layers = parameters["openpbr"]
        if layers["anisotropy"] or any("anisotropy" in name for name in inputs.driven):
            self.drivers.networks.uv_names.append("st")  # which way it is brushed
        drive_layers(model_name, layers, inputs.driven, self.drivers)
        inputs.tell_rest()
        return Surface(
            str(self.material.GetPath()),
            "openpbr",
            parameters,
            self.drivers.slots,
            self.drivers.uv_names,
            graph=self.drivers.graph(),
        )

    def input(self, shader: UsdShade.Shader, name: str, parameter: str) -> Value | None:
        """What feeds an input of the surface shader; None where nothing does."""
        if name in self.values:
            value = self.values[name]
            return numbers(*value) if isinstance(value, tuple) else numbers(float(value))
        return self.drivers.value(shader, name, parameter)

    def _value(self, shader: UsdShade.Shader, parameter: str, spec: tuple[str, Any]) -> Value:
        """An input, or its default."""
        name, default = spec
        value = self.input(shader, name, parameter) if name else None
        if value is None:
            return tuple(default) if isinstance(default, tuple) else (default,)
        return value

    def _put(
        self,
        parameters: dict[str, Any],
        shader: UsdShade.Shader,
        parameter: str,
        spec: tuple[str, Any],
        weight: Value,
    ) -> None:
        value = self._value(shader, parameter, spec)
        if isinstance(spec[1], tuple) and len(value) == 1:
            value = value * 3
        value = value[: 3 if isinstance(spec[1], tuple) else 1]
        constant = self.drivers.put(parameter, self.drivers.scaled(value, weight))
        if constant is not None:
            parameters[parameter] = constant if len(constant) > 1 else constant[0]


class _Layers:
    """Inputs of layers: constants, and a typical value of what is driven."""

    def __init__(self, reader: MaterialXReader, shader: UsdShade.Shader, model: str) -> None:
        self._reader = reader
        self._shader = shader
        self._model = model
        self.driven: dict[str, Value] = {}
        """What varies, by input; what is used of it is taken out."""

    def number(self, name: str, default: float) -> float:
        return number(self._constant(name, "number"), default)

    def colour(self, name: str, default: Colour) -> Colour:
        return colour(self._constant(name, "any_color"), default)

    def ignored(self, *names: str) -> None:
        for name in names:
            # Interfaces of materials connect all inputs, also to what nobody gives a value.
            if source_of(self._shader, name, self._reader.time) is not None:
                self._missing(f"MaterialX {self._model} input {name} (ignored)")

    def approximated(self, what: str) -> None:
        self._missing(f"{what}: approximated")

    def tell_rest(self) -> None:
        """Says what is driven in the stage and not here."""
        for name in self.driven:
            self._missing(f"MaterialX {self._model} input {name} by a node (one value for all)")

    def _constant(self, name: str, parameter: str) -> Any:
        if name in self._reader.values:
            return self._reader.values[name]
        source = source_of(self._shader, name, self._reader.time)
        if source is None or source.is_value:
            return None if source is None else source.value
        value = self._reader.drivers.value(self._shader, name, parameter)
        if value is None:
            return None
        if not is_constant(value):
            self.driven[name] = value
            value = tuple(float(x) for x in sampled(value).mean(axis=0))
        return value[0] if len(value) == 1 else value

    def _missing(self, what: str) -> None:
        self._reader.report.missing(what, self._reader.material.GetPath())
