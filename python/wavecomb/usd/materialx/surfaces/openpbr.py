# SPDX-License-Identifier: Apache-2.0
"""Converts MaterialX surface shaders to parameters of the program "openpbr".

Supports standard_surface, open_pbr_surface and gltf_pbr. A parameter is an input times a number;
the input is a constant, a plain texture, or driven by a value graph. ``layers_of`` computes the
other parameters. docs/decisions/materialx-graphs.md explains why Standard Surface is not converted
by MaterialX's graph ``standard_surface_to_open_pbr_surface``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.graphs.surface_parameters import Drivers, sampled
from wavecomb.usd.graphs.values import Value, fit, is_constant, numbers
from wavecomb.usd.materials.network import Colour, colour, holds_colour, number, source_of
from wavecomb.usd.materials.surface import Surface
from wavecomb.usd.materialx.nodes.network import Networks

if TYPE_CHECKING:
    from wavecomb.usd.materials.texture import TextureTable
    from wavecomb.usd.stage.report import LoadReport

WHITE, PALE, BLACK = (1.0, 1.0, 1.0), (0.8, 0.8, 0.8), (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Row:
    """Source of an OpenPBR parameter in a shader.

    Attributes:
        input: Name of the shader's input.
        default: Default of the input: a number, a colour, or a bool for a switch.
        factor: Number by which a numeric input is multiplied.
        divisor: Number by which a numeric input is divided.
        driven: Whether a node may drive the parameter. Otherwise the parameter is the mean of the
            node's value, unless ``drive_layers`` handles the input.
        weight: Name and default of the input by which the parameter is multiplied.
    """

    input: str
    default: float | bool | Colour
    factor: float = 1.0
    divisor: float = 1.0
    driven: bool = True
    weight: tuple[str, float] = ("", 1.0)


@dataclass(frozen=True)
class Model:
    """Description of a MaterialX shading model.

    Attributes:
        textured: Parameters that plain textures may drive, with their sources.
        normal: Input with the shading normal.
        layers: All other parameters, by the names of ``add_material(openpbr=...)``.
        ignored: Inputs without effect, which are reported if they are authored.
    """

    textured: dict[str, Row]
    normal: str
    layers: dict[str, Row]
    ignored: tuple[str, ...]


_MEDIUM = {
    "transmission_color": Row("transmission_color", WHITE, driven=False),
    "transmission_depth": Row("transmission_depth", 0.0, driven=False),
    "transmission_scatter": Row("transmission_scatter", BLACK, driven=False),
    "transmission_scatter_anisotropy": Row("transmission_scatter_anisotropy", 0.0, driven=False),
    "nested_priority": Row("dielectric_priority", 0.0, driven=False),
}
"""Inputs of the interior medium, which standard_surface and open_pbr_surface share."""

MODELS: dict[str, Model] = {
    "standard_surface": Model(
        textured={
            "base_color": Row("base_color", PALE, weight=("base", 1.0)),
            "specular_color": Row("specular_color", WHITE),
            "roughness": Row("specular_roughness", 0.2),
            "metallic": Row("metalness", 0.0),
            "ior": Row("specular_IOR", 1.5),
            "clearcoat": Row("coat", 0.0),
            "clearcoat_roughness": Row("coat_roughness", 0.1),
            "opacity": Row("opacity", 1.0),
            "emission": Row("emission_color", WHITE, weight=("emission", 0.0)),
        },
        normal="normal",
        layers={
            "diffuse_roughness": Row("diffuse_roughness", 0.0),
            "specular_weight": Row("specular", 1.0),
            "anisotropy": Row("specular_anisotropy", 0.0),
            "rotation": Row("specular_rotation", 0.0),
            "transmission_weight": Row("transmission", 0.0),
            **_MEDIUM,
            "subsurface_weight": Row("subsurface", 0.0),
            "subsurface_color": Row("subsurface_color", WHITE),
            "subsurface_anisotropy": Row("subsurface_anisotropy", 0.0),
            "fuzz_weight": Row("sheen", 0.0),
            "fuzz_color": Row("sheen_color", WHITE),
            "fuzz_roughness": Row("sheen_roughness", 0.3),
            "coat_color": Row("coat_color", WHITE),
            "coat_ior": Row("coat_IOR", 1.5),
            "coat_darkening": Row("coat_affect_color", 0.0),
            "film_thickness": Row("thin_film_thickness", 0.0),
            "film_ior": Row("thin_film_IOR", 1.5),
            "thin_walled": Row("thin_walled", False, driven=False),
        },
        ignored=(
            *("transmission_dispersion", "transmission_extra_roughness", "tangent"),
            *("coat_anisotropy", "coat_rotation", "coat_affect_roughness", "coat_normal"),
        ),
    ),
    "open_pbr_surface": Model(
        textured={
            "base_color": Row("base_color", PALE, weight=("base_weight", 1.0)),
            "specular_color": Row("specular_color", WHITE),
            "roughness": Row("specular_roughness", 0.3),
            "metallic": Row("base_metalness", 0.0),
            "ior": Row("specular_ior", 1.5),
            "clearcoat": Row("coat_weight", 0.0),
            "clearcoat_roughness": Row("coat_roughness", 0.0),
            "opacity": Row("geometry_opacity", 1.0),
            "emission": Row("emission_color", WHITE, weight=("emission_luminance", 0.0)),
        },
        normal="geometry_normal",
        layers={
            "diffuse_roughness": Row("base_diffuse_roughness", 0.0),
            "specular_weight": Row("specular_weight", 1.0),
            "anisotropy": Row("specular_roughness_anisotropy", 0.0),
            "transmission_weight": Row("transmission_weight", 0.0),
            **_MEDIUM,
            "subsurface_weight": Row("subsurface_weight", 0.0),
            "subsurface_color": Row("subsurface_color", PALE),
            "subsurface_anisotropy": Row("subsurface_scatter_anisotropy", 0.0),
            "fuzz_weight": Row("fuzz_weight", 0.0),
            "fuzz_color": Row("fuzz_color", WHITE),
            "fuzz_roughness": Row("fuzz_roughness", 0.5),
            "coat_color": Row("coat_color", WHITE),
            "coat_ior": Row("coat_ior", 1.6),
            "coat_darkening": Row("coat_darkening", 1.0),
            "film_weight": Row("thin_film_weight", 0.0),
            "film_thickness": Row("thin_film_thickness", 0.5, 1000.0),
            "film_ior": Row("thin_film_ior", 1.4),
            "thin_walled": Row("geometry_thin_walled", False, driven=False),
        },
        ignored=(
            "transmission_dispersion_scale",
            "coat_roughness_anisotropy",
            "geometry_tangent",
            "geometry_coat_normal",
            "geometry_coat_tangent",
        ),
    ),
    "gltf_pbr": Model(
        textured={
            "base_color": Row("base_color", WHITE),
            "specular_color": Row("specular_color", WHITE),
            "roughness": Row("roughness", 1.0),
            "metallic": Row("metallic", 1.0),
            "ior": Row("ior", 1.5),
            "clearcoat": Row("clearcoat", 0.0),
            "clearcoat_roughness": Row("clearcoat_roughness", 0.0),
            "opacity": Row("alpha", 1.0),
            "emission": Row("emissive", BLACK, weight=("emissive_strength", 1.0)),
        },
        normal="normal",
        layers={
            "specular_weight": Row("specular", 1.0),
            "anisotropy": Row("anisotropy_strength", 0.0),
            "rotation": Row("anisotropy_rotation", 0.0, divisor=2.0 * math.pi),
            "transmission_weight": Row("transmission", 0.0),
            "fuzz_roughness": Row("sheen_roughness", 0.0),
            "film_weight": Row("iridescence", 0.0),
            "film_thickness": Row("iridescence_thickness", 100.0),
            "film_ior": Row("iridescence_ior", 1.3),
        },
        ignored=("occlusion", "clearcoat_normal", "dispersion", "tangent"),
    ),
}
"""Shading models by the name in their shaders' ids."""


def layers_of(model: str, inputs: LayerInputs) -> dict[str, Any]:
    """Returns the parameters of a shading model that plain textures cannot drive."""
    known = MODELS[model]
    inputs.ignored(*known.ignored)
    found = {name: _read(row, inputs) for name, row in known.layers.items()}
    if model == "standard_surface":
        found |= _standard_surface(inputs, found)
    elif model == "gltf_pbr":
        found |= _gltf_pbr(inputs)
    if model != "gltf_pbr":
        found["subsurface_radius"] = _free_paths(model, inputs)
        if found["subsurface_weight"] > 0 and found["transmission_weight"] > 0:
            inputs.approximated("subsurface scattering beside transmission (diffuse in its colour)")
    return found


def _free_paths(model: str, i: LayerInputs) -> Colour:
    """Returns the mean free paths of subsurface scattering, by channel."""
    if model == "standard_surface":
        scale, by_channel = i.number("subsurface_scale", 1.0), i.colour("subsurface_radius", WHITE)
    else:
        scale = i.number("subsurface_radius", 1.0)
        by_channel = i.colour("subsurface_radius_scale", (1.0, 0.5, 0.25))
    return (scale * by_channel[0], scale * by_channel[1], scale * by_channel[2])


def _read(row: Row, inputs: LayerInputs) -> Any:
    if isinstance(row.default, tuple):
        return inputs.colour(row.input, row.default)
    value = inputs.number(row.input, float(row.default))
    return value != 0.0 if isinstance(row.default, bool) else value * row.factor / row.divisor


def _standard_surface(i: LayerInputs, found: dict[str, Any]) -> dict[str, Any]:
    specular = found["specular_weight"]
    if specular < 1.0 and i.number("metalness", 0.0) >= 1.0:
        # On metals, Standard Surface's specular weight dims only the edge tint, but OpenPBR's
        # weight dims the whole reflection, so use 1.
        specular = 1.0
    return {"specular_weight": specular, "film_weight": float(found["film_thickness"] > 0)}


def _gltf_pbr(i: LayerInputs) -> dict[str, Any]:
    sheen = i.colour("sheen_color", BLACK)
    fuzz = max(sheen)
    depth = i.number("attenuation_distance", 0.0)
    solid = i.number("thickness", 0.0) > 0
    base = i.colour("base_color", WHITE)
    if solid and depth > 0:
        if base != WHITE:
            i.approximated("base_color of glTF glass that absorbs (no tint at its surface)")
        base = i.colour("attenuation_color", WHITE)
    return {
        "fuzz_weight": min(fuzz, 1.0),
        "fuzz_color": (sheen[0] / fuzz, sheen[1] / fuzz, sheen[2] / fuzz) if fuzz > 0 else WHITE,
        "coat_ior": 1.5,
        "coat_darkening": 0.0,
        "thin_walled": i.number("transmission", 0.0) > 0 and not solid,
        "transmission_color": base,
        "transmission_depth": depth if solid else 0.0,
    }


def drive_layers(
    model: str, layers: dict[str, Any], driven: dict[str, Value], drivers: Drivers
) -> None:
    """Connects driven inputs to their parameters and removes them from ``driven``."""
    m = drivers.networks.make
    for parameter, row in MODELS[model].layers.items():
        if not row.driven or row.input not in driven:
            continue
        value = m.op("multiply", driven.pop(row.input), numbers(row.factor / row.divisor))
        if parameter == "rotation":
            value = m.op("subtract", value, m.op("floor", value))
        drivers.put(parameter, value)
    tint = "base_color" if model == "gltf_pbr" else "transmission_color"
    if tint in driven:
        value, depth = fit(driven.pop(tint), 3), layers["transmission_depth"]
        if depth > 0 and model != "gltf_pbr":
            layers["transmission_color"] = WHITE
            grey = m.op("clamp", value, numbers(1e-6), numbers(1.0))
            drivers.put("extinction", m.op("multiply", m.op("log", grey), numbers(-1.0 / depth)))
        elif depth <= 0:
            drivers.put("transmission_tint", value)
    if model == "gltf_pbr" and "sheen_color" in driven:
        sheen = fit(driven.pop("sheen_color"), 3)
        strongest = m.op("max", m.op("max", sheen[:1], sheen[1:2]), sheen[2:])
        drivers.put("fuzz_weight", strongest)
        drivers.put("fuzz_color", m.op("divide", sheen, strongest))


class SurfaceReader:
    """Base of readers of MaterialX surface shaders."""

    def __init__(
        self,
        material: Usd.Prim,
        time: Usd.TimeCode,
        textures: TextureTable,
        report: LoadReport,
        values: Mapping[str, Any] | None = None,
    ) -> None:
        """Creates a reader; ``values`` holds constants that replace inputs of the shader."""
        self.values = values or {}
        self.material = material
        self.time = time
        self.report = report
        self.drivers = Drivers(Networks(material, time, textures, report))
        self.parameters: dict[str, Any] = {}

    def put(self, name: str, value: Value) -> None:
        """Sets a parameter to a constant, or lets a texture or graph drive it."""
        constant = self.drivers.put(name, value)
        if constant is not None:
            self.parameters[name] = constant if len(constant) > 1 else constant[0]

    def missing(self, what: str) -> None:
        """Reports a feature of the shader that is not supported."""
        self.report.missing(what, self.material.GetPath())


class MaterialXReader(SurfaceReader):
    """Reader of standard_surface, open_pbr_surface and gltf_pbr shaders."""

    def read(self, shader: UsdShade.Shader, model_name: str) -> Surface:
        """Returns the surface of a shader whose shading model is ``model_name``."""
        model = MODELS[model_name]
        self.parameters["presence"] = True
        for parameter, row in model.textured.items():
            weight = self._value(shader, "", *row.weight)
            is_black = is_constant(weight) and weight[0] <= 0.0  # type: ignore[operator]
            if parameter != "emission" or not is_black:
                value = self._value(shader, parameter, row.input, row.default)
                value = fit(value, 3) if isinstance(row.default, tuple) else value[:1]
                self.put(parameter, self.drivers.scaled(value, weight))
        if self.parameters.get("ior", 1.5) <= 0.0:
            self.report.warn("ior of 0 or less: set to 1.5", self.material.GetPath())
            self.parameters["ior"] = 1.5
        normal = self.drivers.value(shader, model.normal, "normal")
        if normal is not None:
            self.drivers.put("normal", normal)
        inputs = LayerInputs(self, shader, model_name)
        layers = self.parameters["openpbr"] = layers_of(model_name, inputs)
        if layers["anisotropy"] or any("anisotropy" in name for name in inputs.driven):
            # Anisotropy needs UVs for the direction of the tangent.
            self.drivers.networks.uv_names.append("st")
        drive_layers(model_name, layers, inputs.driven, self.drivers)
        for name in inputs.driven:
            self.missing(f"MaterialX {model_name} input {name} by a node (one value for all)")
        return self.drivers.surface("openpbr", self.parameters)

    def _value(
        self, shader: UsdShade.Shader, parameter: str, name: str, default: float | Colour
    ) -> Value:
        """Returns the value of an input of the surface shader, or its default."""
        if name in self.values:
            value = self.values[name]
            return numbers(*value) if isinstance(value, tuple) else numbers(float(value))
        found = self.drivers.value(shader, name, parameter) if name else None
        if found is None:
            return default if isinstance(default, tuple) else (float(default),)
        return found


class LayerInputs:
    """Constants of a shader's inputs, and means of inputs that nodes drive.

    Attributes:
        driven: Varying values by input; values that drive a parameter are removed.
    """

    def __init__(self, reader: MaterialXReader, shader: UsdShade.Shader, model: str) -> None:
        self._reader = reader
        self._shader = shader
        self._model = model
        self.driven: dict[str, Value] = {}

    def number(self, name: str, default: float) -> float:
        """Returns a number, or the default if nothing is authored."""
        return number(self.constant(name, "number"), default)

    def colour(self, name: str, default: Colour) -> Colour:
        """Returns a colour, or the default if nothing is authored."""
        return colour(self.constant(name, "any_color"), default)

    def ignored(self, *names: str) -> None:
        """Reports authored inputs that have no effect in Wavecomb."""
        for name in names:
            # Do not report inputs that are connected to a material input without a value.
            if source_of(self._shader, name, self._reader.time) is not None:
                self._reader.missing(f"MaterialX {self._model} input {name} (ignored)")

    def approximated(self, what: str) -> None:
        """Reports that an input is only approximated."""
        self._reader.missing(f"{what}: approximated")

    def constant(self, name: str, parameter: str) -> Any:
        """Returns the value of an input, or its mean if a node drives it; None if unauthored."""
        if name in self._reader.values:
            return self._reader.values[name]
        source = source_of(self._shader, name, self._reader.time)
        if source is None:
            return None
        if source.is_value and not holds_colour(source.attribute):
            return source.value
        value = self._reader.drivers.value(self._shader, name, parameter)
        if value is None:
            return None
        if not is_constant(value):
            self.driven[name] = value
            value = tuple(float(x) for x in sampled(value).mean(axis=0))
        return value[0] if len(value) == 1 else value
