# SPDX-License-Identifier: Apache-2.0
"""The layers of program "openpbr", from inputs of MaterialX's surface shaders.

``models.MODELS`` says what comes from where; here is what depends on several inputs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from wavecomb.usd.graphs.node import Value, fit, numbers
from wavecomb.usd.materialx.surfaces.models import BLACK, MODELS, WHITE, Colour, Row

if TYPE_CHECKING:
    from wavecomb.usd.graphs.surface import Drivers


class Inputs(Protocol):
    """Constants of a shader's inputs."""

    def number(self, name: str, default: float) -> float:
        """A number; the default where nothing is authored."""

    def colour(self, name: str, default: Colour) -> Colour:
        """A colour; the default where nothing is authored."""

    def ignored(self, *names: str) -> None:
        """Says that inputs are authored which have no effect."""

    def approximated(self, what: str) -> None:
        """Says that something is not drawn as it is meant."""


def layers_of(model: str, inputs: Inputs) -> dict[str, Any]:
    """The layers of a shading model: its parameters that no plain texture drives."""
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
            what = "subsurface scattering beside transmission (diffuse in its colour)"
            inputs.approximated(what)
    return found


def _free_paths(model: str, i: Inputs) -> Colour:
    """Mean free paths below the surface, by channel."""
    if model == "standard_surface":
        scale, by_channel = i.number("subsurface_scale", 1.0), i.colour("subsurface_radius", WHITE)
    else:
        scale = i.number("subsurface_radius", 1.0)
        by_channel = i.colour("subsurface_radius_scale", (1.0, 0.5, 0.25))
    return (scale * by_channel[0], scale * by_channel[1], scale * by_channel[2])


def _read(row: Row, inputs: Inputs) -> Any:
    if isinstance(row.default, tuple):
        return inputs.colour(row.input, row.default)
    value = inputs.number(row.input, float(row.default))
    return value != 0.0 if isinstance(row.default, bool) else value * row.factor / row.divisor


def _standard_surface(i: Inputs, found: dict[str, Any]) -> dict[str, Any]:
    specular = found["specular_weight"]
    if specular < 1.0 and i.number("metalness", 0.0) >= 1.0:
        specular = 1.0  # dims the edge of a metal only; OpenPBR's weight would dim all of it
    film = 1.0 if found["film_thickness"] > 0 else 0.0
    return {"specular_weight": specular, "film_weight": film}


def _gltf_pbr(i: Inputs) -> dict[str, Any]:
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
    """Lets driven inputs drive their parameters, and takes them out of ``driven``."""
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
