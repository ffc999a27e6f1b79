# SPDX-License-Identifier: Apache-2.0
"""What program "openpbr" takes beside its slots, from inputs of MaterialX's surface shaders.

Names on the left are those of ``SceneBuilder.add_material(openpbr=...)``. Standard Surface goes to
OpenPBR as Autodesk's published graph, ``standard_surface_to_open_pbr_surface``, does it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from wavecomb.usd.looks.graph_code import Value, fit, numbers

if TYPE_CHECKING:
    from wavecomb.usd.looks.graph_surface import Drivers

Colour = tuple[float, float, float]

WHITE: Colour = (1.0, 1.0, 1.0)
PALE: Colour = (0.8, 0.8, 0.8)

OPENPBR_COLOURS = ("transmission_color", "subsurface_color", "fuzz_color", "coat_color")
"""Which of the parameters are colours."""


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


def _open_pbr(i: Inputs) -> dict[str, Any]:
    i.ignored(
        "transmission_scatter",
        "transmission_scatter_anisotropy",
        "transmission_dispersion_scale",
        "coat_roughness_anisotropy",
        "geometry_tangent",
        "geometry_coat_normal",
        "geometry_coat_tangent",
    )
    return {
        "diffuse_roughness": i.number("base_diffuse_roughness", 0.0),
        "specular_weight": i.number("specular_weight", 1.0),
        "anisotropy": i.number("specular_roughness_anisotropy", 0.0),
        "transmission_weight": i.number("transmission_weight", 0.0),
        "transmission_color": i.colour("transmission_color", WHITE),
        "transmission_depth": i.number("transmission_depth", 0.0),
        "subsurface_weight": i.number("subsurface_weight", 0.0),
        "subsurface_color": i.colour("subsurface_color", PALE),
        "subsurface_anisotropy": i.number("subsurface_scatter_anisotropy", 0.0),
        "fuzz_weight": i.number("fuzz_weight", 0.0),
        "fuzz_color": i.colour("fuzz_color", WHITE),
        "fuzz_roughness": i.number("fuzz_roughness", 0.5),
        "coat_color": i.colour("coat_color", WHITE),
        "coat_ior": i.number("coat_ior", 1.6),
        "coat_darkening": i.number("coat_darkening", 1.0),
        "film_weight": i.number("thin_film_weight", 0.0),
        "film_thickness": 1000.0 * i.number("thin_film_thickness", 0.5),
        "film_ior": i.number("thin_film_ior", 1.4),
        "thin_walled": i.number("geometry_thin_walled", 0.0) != 0.0,
    }


def _standard_surface(i: Inputs) -> dict[str, Any]:
    i.ignored(
        "transmission_scatter",
        "transmission_scatter_anisotropy",
        "transmission_dispersion",
        "transmission_extra_roughness",
        "coat_anisotropy",
        "coat_rotation",
        "coat_affect_roughness",
        "coat_normal",
        "tangent",
    )
    film = i.number("thin_film_thickness", 0.0)
    specular = i.number("specular", 1.0)
    if specular < 1.0 and i.number("metalness", 0.0) >= 1.0:
        specular = 1.0  # dims the edge of a metal only; OpenPBR's weight would dim all of it
    return {
        "diffuse_roughness": i.number("diffuse_roughness", 0.0),
        "specular_weight": specular,
        "anisotropy": i.number("specular_anisotropy", 0.0),
        "rotation": i.number("specular_rotation", 0.0),
        "transmission_weight": i.number("transmission", 0.0),
        "transmission_color": i.colour("transmission_color", WHITE),
        "transmission_depth": i.number("transmission_depth", 0.0),
        "subsurface_weight": i.number("subsurface", 0.0),
        "subsurface_color": i.colour("subsurface_color", WHITE),
        "subsurface_anisotropy": i.number("subsurface_anisotropy", 0.0),
        "fuzz_weight": i.number("sheen", 0.0),
        "fuzz_color": i.colour("sheen_color", WHITE),
        "fuzz_roughness": i.number("sheen_roughness", 0.3),
        "coat_color": i.colour("coat_color", WHITE),
        "coat_ior": i.number("coat_IOR", 1.5),
        "coat_darkening": i.number("coat_affect_color", 0.0),
        "film_weight": 1.0 if film > 0 else 0.0,
        "film_thickness": film,
        "film_ior": i.number("thin_film_IOR", 1.5),
        "thin_walled": i.number("thin_walled", 0.0) != 0.0,
    }


def _gltf_pbr(i: Inputs) -> dict[str, Any]:
    i.ignored("occlusion", "clearcoat_normal", "dispersion", "tangent")
    sheen = i.colour("sheen_color", (0.0, 0.0, 0.0))
    fuzz = max(sheen)
    depth = i.number("attenuation_distance", 0.0)
    solid = i.number("thickness", 0.0) > 0
    base = i.colour("base_color", WHITE)
    if solid and depth > 0:
        if base != WHITE:
            i.approximated("base_color of glTF glass that absorbs (no tint at its surface)")
        base = i.colour("attenuation_color", WHITE)
    return {
        "specular_weight": i.number("specular", 1.0),
        "anisotropy": i.number("anisotropy_strength", 0.0),
        "rotation": i.number("anisotropy_rotation", 0.0) / 6.283185307179586,
        "transmission_weight": i.number("transmission", 0.0),
        "transmission_color": base,
        "transmission_depth": depth if solid else 0.0,
        "fuzz_weight": min(fuzz, 1.0),
        "fuzz_color": (sheen[0] / fuzz, sheen[1] / fuzz, sheen[2] / fuzz) if fuzz > 0 else WHITE,
        "fuzz_roughness": i.number("sheen_roughness", 0.0),
        "coat_ior": 1.5,
        "coat_darkening": 0.0,
        "film_weight": i.number("iridescence", 0.0),
        "film_thickness": i.number("iridescence_thickness", 100.0),
        "film_ior": i.number("iridescence_ior", 1.3),
        "thin_walled": i.number("transmission", 0.0) > 0 and not solid,
    }


_READERS: dict[str, Callable[[Inputs], dict[str, Any]]] = {
    "open_pbr_surface": _open_pbr,
    "standard_surface": _standard_surface,
    "gltf_pbr": _gltf_pbr,
}


def layers_of(model: str, inputs: Inputs) -> dict[str, Any]:
    """The parameters of a shading model beside slots."""
    found = _READERS[model](inputs)
    if found.get("subsurface_weight", 0.0) > 0:
        inputs.approximated("subsurface scattering (diffuse in its colour)")
    return found


_DRIVEN: dict[str, dict[str, tuple[str, float]]] = {
    "open_pbr_surface": {
        "diffuse_roughness": ("base_diffuse_roughness", 1.0),
        "specular_weight": ("specular_weight", 1.0),
        "anisotropy": ("specular_roughness_anisotropy", 1.0),
        "transmission_weight": ("transmission_weight", 1.0),
        "subsurface_weight": ("subsurface_weight", 1.0),
        "subsurface_color": ("subsurface_color", 1.0),
        "subsurface_anisotropy": ("subsurface_scatter_anisotropy", 1.0),
        "fuzz_weight": ("fuzz_weight", 1.0),
        "fuzz_color": ("fuzz_color", 1.0),
        "fuzz_roughness": ("fuzz_roughness", 1.0),
        "coat_color": ("coat_color", 1.0),
        "coat_ior": ("coat_ior", 1.0),
        "coat_darkening": ("coat_darkening", 1.0),
        "film_weight": ("thin_film_weight", 1.0),
        "film_thickness": ("thin_film_thickness", 1000.0),
        "film_ior": ("thin_film_ior", 1.0),
    },
    "standard_surface": {
        "diffuse_roughness": ("diffuse_roughness", 1.0),
        "specular_weight": ("specular", 1.0),
        "anisotropy": ("specular_anisotropy", 1.0),
        "rotation": ("specular_rotation", 1.0),
        "transmission_weight": ("transmission", 1.0),
        "subsurface_weight": ("subsurface", 1.0),
        "subsurface_color": ("subsurface_color", 1.0),
        "subsurface_anisotropy": ("subsurface_anisotropy", 1.0),
        "fuzz_weight": ("sheen", 1.0),
        "fuzz_color": ("sheen_color", 1.0),
        "fuzz_roughness": ("sheen_roughness", 1.0),
        "coat_color": ("coat_color", 1.0),
        "coat_ior": ("coat_IOR", 1.0),
        "coat_darkening": ("coat_affect_color", 1.0),
        "film_thickness": ("thin_film_thickness", 1.0),
        "film_ior": ("thin_film_IOR", 1.0),
    },
    "gltf_pbr": {
        "specular_weight": ("specular", 1.0),
        "anisotropy": ("anisotropy_strength", 1.0),
        "rotation": ("anisotropy_rotation", 1.0 / 6.283185307179586),
        "transmission_weight": ("transmission", 1.0),
        "fuzz_roughness": ("sheen_roughness", 1.0),
        "film_weight": ("iridescence", 1.0),
        "film_thickness": ("iridescence_thickness", 1.0),
        "film_ior": ("iridescence_ior", 1.0),
    },
}
"""Parameter -> the input that gives it, times a number."""


def drive_layers(
    model: str, layers: dict[str, Any], driven: dict[str, Value], drivers: Drivers
) -> None:
    """Lets driven inputs drive their parameters, and takes them out of ``driven``."""
    m = drivers.networks.make
    for parameter, (name, factor) in _DRIVEN[model].items():
        if name not in driven:
            continue
        value = m.op("multiply", driven.pop(name), numbers(factor))
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
