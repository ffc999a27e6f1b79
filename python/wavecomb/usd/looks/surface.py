# SPDX-License-Identifier: Apache-2.0
"""A material as the core takes it, before it has an id."""

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
        name: As authored, without ``inputs:``.
        group: Heading that it stands under: "Base", "Coat" ...
        label: What it is called there.
        kind: "number", "colour" or "switch".
        type_name: Of MaterialX: float, color3 or boolean; a number may be read of a color3.
        default: A number, three of them, or a bool.
        low: Least value.
        high: Greatest value.
        soft_low: From here ...
        soft_high: ... to here it is set with a slider.
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
    """The graphs of a surface.

    Attributes:
        whole: Drives all parameters that constants and plain textures do not.
        opacity: The part that drives opacity.
        emission: The part that drives emission.
        brightest: Highest emission seen at some points, textures taken for white.
        primvars: That it reads of each mesh.
        in_object_space: Whether it reads places in the space of the mesh.
        outputs: What it was compiled from.
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
        """Whether the graph differs from mesh to mesh."""
        return bool(self.primvars) or self.in_object_space


COLOUR_PARAMETERS = ("base_color", "specular_color", "emission")
OPENPBR_COLOURS = (
    "transmission_color",
    "transmission_scatter",
    "subsurface_color",
    "fuzz_color",
    "coat_color",
)
"""Which of the further parameters of program openpbr are colours."""

TEXTURED_PARAMETERS = (
    *COLOUR_PARAMETERS,
    "roughness",
    "metallic",
    "clearcoat",
    "clearcoat_roughness",
    "opacity",
    "normal",
)
"""Parameters that a texture can drive."""

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
"""What ``SceneBuilder.add_material`` takes for parameters that are not given."""


@dataclass(frozen=True)
class Surface:
    """A program with its parameters.

    Attributes:
        name: For messages.
        program: diffuse, metal, dielectric, plastic, emissive, principled, openpbr or hair.
        parameters: Keyword arguments of ``SceneBuilder.add_material``.
        textures: By parameter, as ``SceneBuilder.add_material`` takes them.
        uv_names: Primvars that hold texture coordinates, first use first.
        texture_uvs: By textured parameter, the primvar that its texture is read at, where that is
            not the first of ``uv_names``.
        primvars: By parameter, the primvar of the mesh that it is read from, where there is that.
        displacement: How far points move along their normals: a length, or a texture use; None: not
            at all. Part of the mesh's shape, not of the material's look.
        graph: Computes parameters that neither constants nor plain textures give.
        stand_in: Whether it stands for a material that cannot be drawn: the display colour of what
            it is bound to goes before it.
        object_reads: Primvars whose one value on an object changes how textures are read: the
            material is read again for each value.
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
        """Equal for surfaces that look alike."""
        parameters, textures = sorted(self.parameters.items()), sorted(self.textures.items())
        return repr((self.program, parameters, textures, self.graph))

    def texture_uses(self) -> list[dict[str, Any]]:
        """All that reads a texture; of graphs about how."""
        images = self.graph.whole.images if self.graph is not None else ()
        within = [{"texture": texture, "uv": (k, 0, 0, 0, k, 0)} for texture, k in images]
        return [*self.textures.values(), *within]

    def emission_attributes(self) -> tuple[str, ...]:
        """Primvars that what it emits depends on at hits."""
        emission = None if self.graph is None else self.graph.emission
        return () if emission is None else emission.names

    def brightest(self) -> float:
        """Highest emission that it can reach, textures taken for white."""
        if self.graph is not None and self.graph.emission is not None:
            return self.graph.brightest
        use = self.textures.get("emission")
        if use is not None:
            return float(max(s + b for s, b in zip(use["scale"][:3], use["bias"][:3], strict=True)))
        return float(max(self.parameters.get("emission", (0.0,))))

    def with_value(self, parameter: str, value: Any) -> Surface:
        """The surface with a constant for a parameter, in place of its primvar."""
        rest = {name: primvar for name, primvar in self.primvars.items() if name != parameter}
        return replace(self, parameters={**self.parameters, parameter: value}, primvars=rest)


def is_cloudy(surface: Surface) -> bool:
    """Whether a surface bends light into something that scatters it."""
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
    """What is drawn where no material is bound: matt, in the display colour.

    ``varying``: which of base_color and opacity have a primvar that differs from place to place.
    """
    parameters: dict[str, Any] = {"base_color": colour}
    primvars = {parameter: _DISPLAY[parameter] for parameter in varying}
    if opacity >= 1.0 and "opacity" not in varying:
        return Surface(name, "diffuse", parameters, primvars=primvars)
    parameters |= {"opacity": max(opacity, 0.0), "roughness": 0.5, "presence": True}
    return Surface(name, "principled", parameters, primvars=primvars)


_DISPLAY = {"base_color": "displayColor", "opacity": "displayOpacity"}
