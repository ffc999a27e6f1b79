# SPDX-License-Identifier: Apache-2.0
"""Volume shaders: MaterialX's ``volume``, with coefficients per metre, and Arnold's.

Inputs may be constants, fields that nodes read, and products of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pxr import Usd, UsdShade

from wavecomb.usd.materials.network import (
    MAX_DEPTH,
    colour,
    holds_colour,
    number,
    read_colour,
    shader_id,
    source_of,
    value_of,
    word,
)
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.optical_properties import (
    BLACK,
    DENSITY,
    WHITE,
    Colour,
    FieldColour,
    OpticalProperties,
    grey,
    product,
    share,
    total,
)

CLOSURES = ("ND_volume", "ND_volume_volumeshader")
"""Identifiers of shaders that combine volume distribution functions (VDFs)."""

_NOTHING = FieldColour()


@dataclass(frozen=True)
class Medium:
    """Parameters of a volume distribution function.

    Attributes:
        absorption: Absorption coefficient per metre.
        scattering: Scattering coefficient per metre.
        anisotropy: Mean cosine of the phase function.
    """

    absorption: FieldColour = _NOTHING
    scattering: FieldColour = _NOTHING
    anisotropy: float = 0.0


class ClosureReader:
    """Reader of the MaterialX volume shader of one material."""

    def __init__(self, inputs: Inputs, metres_per_unit: float) -> None:
        self._inputs = inputs
        self._metres = metres_per_unit

    def read(self, shader: UsdShade.Shader) -> OpticalProperties:
        """Returns the properties of a ``volume`` shader."""
        medium = self._medium(shader, "vdf", 0)
        emission_field = self._edf(shader, "edf", 0)
        absorption = medium.absorption.scaled(grey(self._metres))
        scattering = medium.scattering.scaled(grey(self._metres))
        both = self._sum(absorption, scattering)
        return OpticalProperties(
            extinction=both.colour,
            albedo=share(scattering.colour, both.colour),
            anisotropy=medium.anisotropy,
            emission=emission_field.scaled(grey(self._metres)).colour,
            density=both.field,
            emission_field=emission_field.field,
            name=str(self._inputs.material.GetPath()),
        )

    def _sum(self, one: FieldColour, two: FieldColour) -> FieldColour:
        """Adds two values that are multiplied by the same field.

        If the fields differ, reports this and uses the second value.
        """
        if one.is_black:
            return two
        if two.is_black:
            return one
        if one.field != two.field:
            what = "volume coefficients that read several fields (one is used for all)"
            self._inputs.report.missing(what, self._inputs.material.GetPath())
        return FieldColour(total(one.colour, two.colour), two.field or one.field)

    def _closure(self, shader: UsdShade.Shader, name: str) -> UsdShade.Shader | None:
        source = source_of(shader, name, self._inputs.time)
        return None if source is None else source.shader

    def _medium(self, shader: UsdShade.Shader, name: str, depth: int) -> Medium:
        """Reads the distribution function that is connected to an input; empty if there is none."""
        node = self._closure(shader, name)
        if node is None:
            return Medium()
        kind, inputs = shader_id(node), self._inputs
        if kind.startswith("ND_anisotropic_vdf"):
            return Medium(
                inputs.driven(node, "absorption"),
                inputs.driven(node, "scattering"),
                inputs.number(node, "anisotropy", 0.0),
            )
        if kind.startswith("ND_absorption_vdf"):
            return Medium(inputs.driven(node, "absorption"))
        if depth < MAX_DEPTH:
            if kind.startswith("ND_multiply_vdf"):
                return self._times(self._medium(node, "in1", depth + 1), node)
            if kind.startswith("ND_add_vdf"):
                one, two = (self._medium(node, each, depth + 1) for each in ("in1", "in2"))
                return self._added(one, two)
            if kind.startswith("ND_mix_vdf"):
                mix = min(max(inputs.number(node, "mix", 0.0), 0.0), 1.0)
                front = _scaled(self._medium(node, "fg", depth + 1), mix)
                back = _scaled(self._medium(node, "bg", depth + 1), 1.0 - mix)
                return self._added(front, back)
        self._left_out(node)
        return Medium()

    def _times(self, medium: Medium, node: UsdShade.Shader) -> Medium:
        by = self._inputs.driven(node, "in2", WHITE)
        return Medium(
            self._driven_by(medium.absorption, by),
            self._driven_by(medium.scattering, by),
            medium.anisotropy,
        )

    def _driven_by(self, one: FieldColour, by: FieldColour) -> FieldColour:
        if one.field and by.field and not one.is_black:
            what = "products of fields in a volume (the first is used)"
            self._inputs.report.missing(what, self._inputs.material.GetPath())
        return FieldColour(one.scaled(by.colour).colour, one.field or by.field)

    def _added(self, one: Medium, two: Medium) -> Medium:
        scattering = self._sum(one.scattering, two.scattering)
        weight = sum(one.scattering.colour), sum(two.scattering.colour)
        mean = one.anisotropy * weight[0] + two.anisotropy * weight[1]
        return Medium(
            self._sum(one.absorption, two.absorption),
            scattering,
            mean / sum(weight) if sum(weight) > 0 else 0.0,
        )

    def _edf(self, shader: UsdShade.Shader, name: str, depth: int) -> FieldColour:
        """Returns the emitted radiance of the EDF that is connected to an input."""
        node = self._closure(shader, name)
        if node is None:
            return FieldColour(BLACK)
        kind = shader_id(node)
        if kind.startswith("ND_uniform_edf"):
            return self._inputs.driven(node, "color", WHITE)
        if kind.startswith("ND_multiply_edf") and depth < MAX_DEPTH:
            by = self._inputs.driven(node, "in2", WHITE)
            return self._driven_by(self._edf(node, "in1", depth + 1), by)
        if kind.startswith("ND_add_edf") and depth < MAX_DEPTH:
            one, two = (self._edf(node, each, depth + 1) for each in ("in1", "in2"))
            return self._sum(one, two)
        self._left_out(node)
        return FieldColour(BLACK)

    def _left_out(self, node: UsdShade.Shader) -> None:
        kind = shader_id(node) or "node without an id"
        self._inputs.report.missing(f"{kind} in a volume (left out)", node.GetPath())


def _scaled(medium: Medium, by: float) -> Medium:
    weight = grey(by)
    return Medium(
        medium.absorption.scaled(weight), medium.scattering.scaled(weight), medium.anisotropy
    )


STANDARD = ("arnold:standard_volume", "standard_volume")
"""Identifiers of Arnold's volume shader."""

_HALF = (0.5, 0.5, 0.5)
_OPAQUE = 1e-4
"""Smallest transparency, which gives an extinction coefficient of 9.2 / ``transparent_depth``."""


def read_standard(shader: UsdShade.Shader, inputs: Inputs) -> OpticalProperties:
    """Returns the properties of a ``standard_volume`` shader.

    At density 1, the transmittance over the length ``transparent_depth`` is ``transparent``. The
    extinction coefficient is therefore density * -ln(transparent) / transparent_depth per stage
    unit. Inputs and defaults follow Arnold's documentation.
    """
    dense = inputs.driven(shader, "density", WHITE)
    transparent = inputs.driven(shader, "transparent", grey(math.exp(-1.0)))
    depth = max(inputs.number(shader, "transparent_depth", 1.0), 1e-6)
    scatter = inputs.driven(shader, "scatter_color", _HALF)
    weight = inputs.number(shader, "scatter", 1.0)
    albedo = _clamped(product(scatter.colour, grey(max(weight, 0.0))))
    emission, emission_field, kelvin = _emission(shader, inputs)
    _report_unsupported(shader, inputs)
    return OpticalProperties(
        extinction=product(dense.colour, _coefficient(transparent.colour, depth)),
        albedo=albedo,
        anisotropy=inputs.number(shader, "scatter_anisotropy", 0.0),
        emission=emission,
        density=dense.field or inputs.text(shader, "density_channel", DENSITY),
        colour=scatter.field or inputs.text(shader, "scatter_color_channel"),
        emission_field=emission_field,
        kelvin=kelvin,
        name=str(inputs.material.GetPath()),
    )


def _coefficient(transparent: Colour, depth: float) -> Colour:
    r, g, b = (-math.log(min(max(c, _OPAQUE), 1.0)) / depth for c in transparent)
    return (r, g, b)


def _clamped(colour: Colour) -> Colour:
    r, g, b = (min(max(c, 0.0), 1.0) for c in colour)
    return (r, g, b)


def _emission(shader: UsdShade.Shader, inputs: Inputs) -> tuple[Colour, str, float]:
    """Returns the emission colour, the field that multiplies it, and its kelvin scale (or 0)."""
    mode = inputs.text(shader, "emission_mode", "blackbody")
    tint = inputs.driven(shader, "emission_color", WHITE)
    strength = max(inputs.number(shader, "emission", 1.0), 0.0)
    lit = tint.scaled(grey(strength))
    if mode == "none" or lit.is_black:
        return BLACK, "", 0.0
    if mode == "density":
        return lit.colour, tint.field, 0.0
    if mode == "channel":
        return lit.colour, tint.field or inputs.text(shader, "emission_channel", "heat"), 0.0
    hot = inputs.driven(shader, "temperature", WHITE)
    field = hot.field or inputs.text(shader, "temperature_channel", "temperature")
    intensity = max(inputs.number(shader, "blackbody_intensity", 1.0), 0.0)
    kelvin = max(hot.colour[0] * inputs.number(shader, "blackbody_kelvin", 5000.0), 0.0)
    if not field or kelvin == 0.0:
        return BLACK, "", 0.0
    return FieldColour(lit.colour).scaled(grey(intensity)).colour, field, kelvin


def _report_unsupported(shader: UsdShade.Shader, inputs: Inputs) -> None:
    """Reports authored inputs that are not supported."""
    for name in ("transparent_channel",):
        if inputs.text(shader, name):
            inputs.report.missing(f"{name} of standard_volume (left out)", shader.GetPath())
    for name in ("scatter_secondary_anisotropy_mix", "scatter_diffusion"):
        if inputs.number(shader, name, 0.0) > 0.0:
            inputs.report.missing(f"{name} of standard_volume (left out)", shader.GetPath())


_READERS = {
    "ND_geompropvalue": "geomprop",
    "UsdPrimvarReader": "varname",
    "arnold:volume_sample": "channel",
    "volume_sample": "channel",
}
"""Maps id prefixes of nodes that read a field to the name of the input that names the field."""


class Inputs:
    """Reader of the inputs of one material's shaders."""

    def __init__(self, material: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> None:
        self.material = material
        self.time = time
        self.report = report

    def number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        """Returns a constant number; reports connected nodes and returns the default for them."""
        source = source_of(shader, name, self.time)
        if source is not None and source.shader is not None:
            self._left_out(source.shader, name)
            return default
        return default if source is None else number(source.value, default)

    def text(self, shader: UsdShade.Shader, name: str, default: str = "") -> str:
        """Returns a constant string."""
        return word(value_of(shader, name, self.time), default)

    def driven(
        self, shader: UsdShade.Shader, name: str, default: Colour = BLACK, depth: int = 0
    ) -> FieldColour:
        """Returns a non-negative colour, grey number or field, or a product of these."""
        source = source_of(shader, name, self.time)
        if source is None:
            return FieldColour(default)
        if source.shader is None:
            rgb = colour(source.value, default)
            if holds_colour(source.attribute):
                rgb = read_colour(rgb, source.attribute, self.report, self.material.GetPath())
            r, g, b = (max(c, 0.0) for c in rgb)
            return FieldColour((r, g, b))
        return self._node(source.shader, name, default, depth + 1)

    def _node(self, node: UsdShade.Shader, name: str, default: Colour, depth: int) -> FieldColour:
        kind = shader_id(node)
        for start, named in _READERS.items():
            if kind.startswith(start):
                field = self.text(node, named)
                scale = self.driven(node, "multiply", WHITE, depth) if depth < MAX_DEPTH else None
                if field and scale is not None:
                    return FieldColour(scale.colour, field)
        if kind.startswith("ND_multiply_") and depth < MAX_DEPTH:
            one = self.driven(node, "in1", BLACK, depth)
            two = self.driven(node, "in2", WHITE, depth)
            if not (one.field and two.field):
                return FieldColour(product(one.colour, two.colour), one.field or two.field)
        if kind.startswith("ND_constant_") and depth < MAX_DEPTH:
            return self.driven(node, "value", BLACK, depth)
        if kind.startswith("ND_convert_") and depth < MAX_DEPTH:
            return self.driven(node, "in", BLACK, depth)
        self._left_out(node, name)
        return FieldColour(default)

    def _left_out(self, node: UsdShade.Shader, name: str) -> None:
        kind = shader_id(node) or "a node without an id"
        self.report.missing(f"{kind} in {name} of a volume shader (default used)", node.GetPath())
