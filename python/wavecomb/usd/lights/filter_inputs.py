# SPDX-License-Identifier: Apache-2.0
"""Reads inputs of light filters by the names that several renderers use, and colour gels.

A gel is a filter that multiplies all light of a light source. Supported gels are Karma's
``kma_lfilter_gel``, the gel inputs of Karma's barn doors and gobos, and RenderMan's PxrIntMult.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pxr import Usd

from wavecomb.image.working_space import LUMINANCE
from wavecomb.usd.materials.colour_space import Colour
from wavecomb.usd.materials.network import colour, number, read_colour, word
from wavecomb.usd.stage.report import LoadReport

_PREFIXES = (
    "inputs:", "inputs:ri:light:", "inputs:ri:lightFilter:", "inputs:arnold:", "arnold:",
    "primvars:arnold:", "ri:light:", "ri:lightFilter:", "",
)  # fmt: skip
"""Prefixes of filter input names in different renderers."""
OF_LIGHTS = ("inputs:", "")
"""Prefixes of barn door inputs that are authored on the light itself."""


@dataclass(frozen=True)
class FilterInputs:
    """The inputs of a light filter, or of a light with built-in barn doors."""

    prim: Usd.Prim
    time: Usd.TimeCode
    prefixes: tuple[str, ...] = _PREFIXES

    def attribute(self, *names: str) -> Usd.Attribute | None:
        """Returns the first of the named attributes that is authored or connected."""
        for name in names:
            for prefix in self.prefixes:
                attribute = self.prim.GetAttribute(prefix + name)
                if attribute.HasAuthoredValue() or attribute.HasAuthoredConnections():
                    return attribute
        return None

    def value(self, *names: str) -> Any:
        """Returns the value of the first authored input with one of the names, or None."""
        attribute = self.attribute(*names)
        return None if attribute is None else attribute.Get(self.time)

    def number(self, name: str, default: float, *others: str) -> float:
        """Returns a finite number."""
        value = self.value(name, *others)
        return default if value is None else number(value, default)

    def word(self, name: str, default: str, *others: str) -> str:
        """Returns the value of an input that is a token or string."""
        value = self.value(name, *others)
        return default if value is None else word(value, default)

    def colour(self, name: str, default: Colour, report: LoadReport) -> Colour:
        """Returns the value of a colour input, finite and in linear Rec.709."""
        value = self.value(name)
        if value is None:
            return default
        rgb = colour(value, default)
        return read_colour(rgb, self.attribute(name), report, self.prim.GetPath())


def filter_prims(light: Usd.Prim) -> list[tuple[str, Usd.Prim | None]]:
    """Returns the path and the prim (or None) of each light filter of a light."""
    relationship = light.GetRelationship("light:filters")
    targets = relationship.GetForwardedTargets() if relationship else []
    stage = light.GetStage()
    return [(str(target), stage.GetPrimAtPath(target) or None) for target in targets]


def kind_of(prim: Usd.Prim) -> str:
    """Returns the type of a filter prim, or the ``shaderId`` of a generic LightFilter."""
    name = str(prim.GetTypeName())
    if name in ("LightFilter", "PluginLightFilter", ""):
        name = word(prim.GetAttribute("lightFilter:shaderId").Get())
    return name


def plain_kind(prim: Usd.Prim) -> str:
    """Returns the filter type in lower case, without namespace and underscores."""
    return kind_of(prim).lower().replace("_", "").rsplit(":", 1)[-1]


GELS = frozenset({"kmalfiltergel", "pxrintmultlightfilter", "pxrintmult"})
"""Types of light filters that have no effect besides a gel."""

_WITH_GEL = GELS | {"kmalfilterbarndoor", "kmalfiltergobo"}


@dataclass(frozen=True)
class Gel:
    """The combined effect of a light's gels.

    Attributes:
        tint: Factor on the light's colour, in linear Rec. 709.
        saturation: Saturation of the tinted colour; 0 makes it grey with the same luminance.
        diffuse, specular: Factors on the light's diffuse and specular multipliers.
    """

    tint: Colour = (1.0, 1.0, 1.0)
    saturation: float = 1.0
    diffuse: float = 1.0
    specular: float = 1.0

    def apply(self, rgb: Colour) -> Colour:
        """Applies the gel to a light's colour."""
        r, g, b = (c * t for c, t in zip(rgb, self.tint, strict=True))
        if self.saturation == 1:
            return (r, g, b)
        grey = sum(w * c for w, c in zip(LUMINANCE, (r, g, b), strict=True))
        r, g, b = (max(grey + self.saturation * (c - grey), 0.0) for c in (r, g, b))
        return (r, g, b)

    def multiplied(self, options: Mapping[str, Any]) -> dict[str, float]:
        """Returns those of the light's diffuse and specular multipliers that the gel changes."""
        return {
            name: factor * float(options.get(name, 1.0))
            for name, factor in (("diffuse", self.diffuse), ("specular", self.specular))
            if factor != 1
        }


def gel_of(light: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> Gel:
    """Combines the gels of all filters of a light, including otherwise unsupported filters."""
    gel = Gel()
    for _, prim in filter_prims(light):
        if prim is not None and plain_kind(prim) in _WITH_GEL:
            gel = _together(gel, _read(FilterInputs(prim, time), report))
    return gel


def _read(inputs: FilterInputs, report: LoadReport) -> Gel:
    exposure = min(inputs.number("exposure", 0.0), 200.0)
    power = max(inputs.number("intensity", 1.0), 0.0) * 2.0**exposure
    tint = inputs.colour("tint", (1.0, 1.0, 1.0), report)
    r, g, b = (power * max(c, 0.0) for c in tint)
    return Gel(
        (r, g, b),
        max(inputs.number("saturation", 1.0), 0.0),
        max(inputs.number("diffuse", 1.0, "diffusescale", "diffuse_scale"), 0.0),
        max(inputs.number("specular", 1.0, "specularscale", "specular_scale"), 0.0),
    )


def _together(a: Gel, b: Gel) -> Gel:
    r, g, c = (x * y for x, y in zip(a.tint, b.tint, strict=True))
    return Gel(
        (r, g, c), a.saturation * b.saturation, a.diffuse * b.diffuse, a.specular * b.specular
    )
