# SPDX-License-Identifier: Apache-2.0
"""Surfaces, the descriptions from which the loader adds materials to the core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavecomb.usd.graphs.values import Graph, Value

NUMBER, COLOUR, SWITCH = "number", "colour", "switch"


@dataclass(frozen=True)
class InputDefinition:
    """An input of a surface shader.

    Attributes:
        name: Authored name of the input without ``inputs:``.
        group: Heading of the input in the user interface, such as "Base" or "Coat".
        label: Label of the input under this heading.
        kind: "number", "colour" or "switch".
        type_name: MaterialX type: float, color3 or boolean. Wavecomb reads some color3 inputs as
        numbers.
        default: A number, three numbers or a bool.
        low: Smallest valid value.
        high: Largest valid value.
        soft_low: Value at the lower end of the slider in the user interface.
        soft_high: Value at the upper end of the slider in the user interface.
    """

    name: str
    group: str
    label: str
    kind: str
    type_name: str
    default: Any
    low: float = 0.0
    high: float = 1.0
    soft_low: float = 0.0
    soft_high: float = 1.0


@dataclass(frozen=True)
class SurfaceGraph:
    """The value graphs of a surface, compiled for the core.

    Attributes:
        whole: Graph of all parameters that are neither constants nor plain textures.
        opacity: Graph of the opacity only.
        emission: Graph of the emission only.
        brightest: Highest emission at sample points; textures count as white.
        primvars: Names of the primvars that the graph reads from each mesh.
        in_object_space: Whether the graph reads positions in object space.
        outputs: Values from which the graph was compiled, by parameter.
    """

    whole: Graph
    opacity: Graph | None = None
    emission: Graph | None = None
    brightest: float = field(default=0.0, compare=False)
    primvars: tuple[str, ...] = ()
    in_object_space: bool = False
    outputs: tuple[tuple[str, Value], ...] = field(default=(), compare=False, repr=False)

    @property
    def depends_on_mesh(self) -> bool:
        """Whether the graph reads data that differs between meshes."""
        return bool(self.primvars) or self.in_object_space


COLOUR_PARAMETERS = ("base_color", "specular_color", "emission")
OPENPBR_COLOURS = (
    "transmission_color",
    "transmission_scatter",
    "subsurface_color",
    "fuzz_color",
    "coat_color",
)
"""Colour parameters of OpenPBR surfaces."""

TEXTURED_PARAMETERS = (
    *COLOUR_PARAMETERS,
    "roughness",
    "metallic",
    "clearcoat",
    "clearcoat_roughness",
    "opacity",
    "normal",
)
"""Parameters that textures can drive directly."""

DEFAULTS: dict[str, Any] = {
    "base_color": (0.18, 0.18, 0.18),
    "specular_color": (0.0, 0.0, 0.0),
    "emission": (0.0, 0.0, 0.0),
    "roughness": 0.5,
    "metallic": 0.0,
    "clearcoat": 0.0,
    "clearcoat_roughness": 0.01,
    "opacity": 1.0,
    "normal": (0.0, 0.0, 1.0),
    "ior": 1.5,
}
"""Default values of parameters of ``SceneBuilder.add_material``."""


@dataclass(frozen=True)
class Surface:
    """A shading program with its parameters.

    Attributes:
        name: Name of the surface in messages.
        program: One of diffuse, metal, dielectric, plastic, emissive, principled, openpbr or hair.
        parameters: Keyword arguments of ``SceneBuilder.add_material``.
        textures: Texture uses for ``SceneBuilder.add_material``, by parameter.
        uv_names: Names of primvars that hold texture coordinates, in order of use.
        primvars: Name of the primvar that overrides a constant if a mesh has it, by parameter.
        displacement: Displacement along normals, as a length or a texture use; None for no
            displacement. The displacement changes the geometry of meshes.
        graph: Graph of parameters that are neither constants nor plain textures.
        texture_uvs: UV primvar of each textured parameter that does not use the first of
            ``uv_names``.
        object_reads: Names of primvars whose value on an object affects texture lookups.
            The material is read once for each set of values.
        stand_in: Whether this surface replaces a material that cannot be rendered. A display
            colour of the bound prim then takes precedence.
    """

    name: str
    program: str = "principled"
    parameters: dict[str, Any] = field(default_factory=dict)
    textures: dict[str, dict[str, Any]] = field(default_factory=dict)
    uv_names: tuple[str, ...] = ()
    primvars: dict[str, str] = field(default_factory=dict)
    displacement: float | dict[str, Any] | None = None
    graph: SurfaceGraph | None = None
    texture_uvs: dict[str, str] = field(default_factory=dict)
    object_reads: tuple[str, ...] = ()
    stand_in: bool = False

    def key(self) -> str:
        """Returns a key that is equal for surfaces with equal appearance."""
        parameters, textures = sorted(self.parameters.items()), sorted(self.textures.items())
        return repr((self.program, parameters, textures, self.graph))

    def texture_uses(self) -> list[dict[str, Any]]:
        """Returns all texture uses; the UV matrices of textures in graphs are approximate."""
        images = self.graph.whole.images if self.graph is not None else ()
        within = [{"texture": texture, "uv": (k, 0, 0, 0, k, 0)} for texture, k in images]
        return [*self.textures.values(), *within]

    def emission_attributes(self) -> tuple[str, ...]:
        """Returns names of the primvars that the emission graph reads at each hit."""
        emission = None if self.graph is None else self.graph.emission
        return () if emission is None else emission.names

    def brightest(self) -> float:
        """Returns the highest possible emission of the surface; textures count as white."""
        if self.graph is not None and self.graph.emission is not None:
            return self.graph.brightest
        use = self.textures.get("emission")
        if use is not None:
            return float(max(s + b for s, b in zip(use["scale"][:3], use["bias"][:3], strict=True)))
        return float(max(self.parameters.get("emission", (0.0,))))

    def with_value(self, parameter: str, value: Any) -> Surface:
        """Returns the surface with a constant for a parameter that read a primvar."""
        rest = {name: primvar for name, primvar in self.primvars.items() if name != parameter}
        return replace(self, parameters={**self.parameters, parameter: value}, primvars=rest)


def is_cloudy(surface: Surface) -> bool:
    """Returns whether a surface refracts light into a scattering medium."""
    layers = surface.parameters.get("openpbr") or {}
    scatters = max(layers.get("transmission_scatter", (0.0, 0.0, 0.0))) > 0
    fills = layers.get("transmission_weight", 0.0) > 0 and layers.get("transmission_depth", 0.0) > 0
    return scatters and fills and surface.parameters.get("ior", DEFAULTS["ior"]) != 1.0


def fallback_surface(
    colour: tuple[float, float, float],
    opacity: float = 1.0,
    name: str = "displayColor",
    varying: Sequence[str] = (),
) -> Surface:
    """Returns a surface with the display colour, for gprims without a material.

    ``varying`` lists the parameters, base_color or opacity, whose primvar varies over the gprim.
    """
    parameters: dict[str, Any] = {"base_color": colour}
    primvars = {parameter: _DISPLAY[parameter] for parameter in varying}
    if opacity >= 1.0 and "opacity" not in varying:
        return Surface(name, "diffuse", parameters, primvars=primvars)
    parameters |= {"opacity": max(opacity, 0.0), "roughness": 0.5, "presence": True}
    return Surface(name, "principled", parameters, primvars=primvars)


_DISPLAY = {"base_color": "displayColor", "opacity": "displayOpacity"}
