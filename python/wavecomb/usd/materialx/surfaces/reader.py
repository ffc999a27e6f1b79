# SPDX-License-Identifier: Apache-2.0
"""MaterialX surface shaders, as the program "openpbr".

These are standard_surface, open_pbr_surface and gltf_pbr. An input is a constant, a plain texture,
or driven by a value graph.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.graphs.node import Value, is_constant, numbers
from wavecomb.usd.graphs.surface import Drivers, sampled
from wavecomb.usd.looks.colour_space import holds_colour
from wavecomb.usd.looks.network import colour, number, source_of
from wavecomb.usd.looks.surface import Surface
from wavecomb.usd.materialx.nodes.network import Networks
from wavecomb.usd.materialx.surfaces.models import MODELS, Colour, Row, drive_layers, layers_of

if TYPE_CHECKING:
    from wavecomb.usd.looks.texture import TextureTable
    from wavecomb.usd.stage.report import LoadReport


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
        """The surface: parameters that textures may drive, and layers beside them."""
        model = MODELS[model_name]
        parameters: dict[str, Any] = {"presence": True}
        for parameter, row in model.textured.items():
            weight = self._value(shader, "", *row.weight)
            is_black = is_constant(weight) and weight[0] <= 0.0  # type: ignore[operator]
            if parameter == "emission" and is_black:
                continue
            self._put(parameters, shader, parameter, row, weight)
        if parameters.get("ior", 1.5) <= 0.0:
            self.report.warn("ior of 0 or less: set to 1.5", self.material.GetPath())
            parameters["ior"] = 1.5
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
        return self.drivers.surface("openpbr", parameters)

    def input(self, shader: UsdShade.Shader, name: str, parameter: str) -> Value | None:
        """What feeds an input of the surface shader; None where nothing does."""
        if name in self.values:
            value = self.values[name]
            return numbers(*value) if isinstance(value, tuple) else numbers(float(value))
        return self.drivers.value(shader, name, parameter)

    def _value(
        self, shader: UsdShade.Shader, parameter: str, name: str, default: float | Colour
    ) -> Value:
        """An input, or its default."""
        value = self.input(shader, name, parameter) if name else None
        if value is None:
            return default if isinstance(default, tuple) else (float(default),)
        return value

    def _put(
        self,
        parameters: dict[str, Any],
        shader: UsdShade.Shader,
        parameter: str,
        row: Row,
        weight: Value,
    ) -> None:
        width = 3 if isinstance(row.default, tuple) else 1
        value = self._value(shader, parameter, row.input, row.default)
        if width == 3 and len(value) == 1:
            value = value * 3
        constant = self.drivers.put(parameter, self.drivers.scaled(value[:width], weight))
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

    def _missing(self, what: str) -> None:
        self._reader.report.missing(what, self._reader.material.GetPath())
