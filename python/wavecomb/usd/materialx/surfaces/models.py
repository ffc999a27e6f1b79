# SPDX-License-Identifier: Apache-2.0
"""MaterialX's surface shaders as parameters of program "openpbr": each is translated here, once.

A parameter is an input times a number, whether that is a constant, a texture or a graph. What is
no product of one input stands in ``openpbr``. Why Standard Surface does not go through MaterialX's
own graph, ``standard_surface_to_open_pbr_surface``, is told in docs/decisions/materialx-graphs.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from wavecomb.usd.graphs.node import Value, fit, numbers

if TYPE_CHECKING:
    from wavecomb.usd.graphs.surface import Drivers

Colour = tuple[float, float, float]

WHITE: Colour = (1.0, 1.0, 1.0)
PALE: Colour = (0.8, 0.8, 0.8)
BLACK: Colour = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Row:
    """Where a parameter comes from.

    Attributes:
        input: Of the shader; "" where there is none, and the default counts.
        default: Of that input: a number, a colour, or a bool for a switch.
        factor: That a number is multiplied by.
        divisor: That it is divided by.
        driven: Whether a node may give it; else that node's typical value is one value for all, or
            ``openpbr`` knows what to do with it.
        weight: Another input that it is multiplied by, with its default.
    """

    input: str
    default: float | bool | Colour
    factor: float = 1.0
    divisor: float = 1.0
    driven: bool = True
    weight: tuple[str, float] = ("", 1.0)


@dataclass(frozen=True)
class Model:
    """A shading model.

    Attributes:
        textured: Parameters that plain textures may drive.
        normal: The input that tilts the surface.
        layers: All other parameters; names are those of ``add_material(openpbr=...)``.
        ignored: Inputs without effect, said where they are authored.
    """

    textured: dict[str, Row]
    normal: str
    layers: dict[str, Row]
    ignored: tuple[str, ...]


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
            "transmission_color": Row("transmission_color", WHITE, driven=False),
            "transmission_depth": Row("transmission_depth", 0.0, driven=False),
            "transmission_scatter": Row("transmission_scatter", BLACK, driven=False),
            "transmission_scatter_anisotropy": Row(
                "transmission_scatter_anisotropy", 0.0, driven=False
            ),
            "nested_priority": Row("dielectric_priority", 0.0, driven=False),
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
            "transmission_dispersion",
            "transmission_extra_roughness",
            "coat_anisotropy",
            "coat_rotation",
            "coat_affect_roughness",
            "coat_normal",
            "tangent",
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
            "transmission_color": Row("transmission_color", WHITE, driven=False),
            "transmission_depth": Row("transmission_depth", 0.0, driven=False),
            "transmission_scatter": Row("transmission_scatter", BLACK, driven=False),
            "transmission_scatter_anisotropy": Row(
                "transmission_scatter_anisotropy", 0.0, driven=False
            ),
            "nested_priority": Row("dielectric_priority", 0.0, driven=False),
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
