# SPDX-License-Identifier: Apache-2.0
"""Gels: filters that multiply all the light of a lamp, whatever its kind.

Karma's ``kma_lfilter_gel`` and what its barn doors and gobos say beside, RenderMan's PxrIntMult.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pxr import Usd

from wavecomb.picture.working_space import LUMINANCE
from wavecomb.usd.lights.filter_inputs import FilterInputs, filter_prims, plain_kind
from wavecomb.usd.stage.report import LoadReport

GELS = frozenset({"kmalfiltergel", "pxrintmultlightfilter", "pxrintmult"})
"""Kinds of filters that are nothing but gels."""

_WITH_GEL = GELS | {"kmalfilterbarndoor", "kmalfiltergobo"}

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Gel:
    """What a light's gels do together.

    Attributes:
        tint: Factor of the light's colour, linear Rec. 709.
        saturation: Of what comes of that: 0 is grey of its luminance.
        diffuse, specular: Factors of the light's own multipliers.
    """

    tint: Colour = (1.0, 1.0, 1.0)
    saturation: float = 1.0
    diffuse: float = 1.0
    specular: float = 1.0

    def over(self, rgb: Colour) -> Colour:
        """A light's colour through it."""
        r, g, b = (c * t for c, t in zip(rgb, self.tint, strict=True))
        if self.saturation == 1:
            return (r, g, b)
        grey = sum(w * c for w, c in zip(LUMINANCE, (r, g, b), strict=True))
        r, g, b = (max(grey + self.saturation * (c - grey), 0.0) for c in (r, g, b))
        return (r, g, b)

    def multiplied(self, options: Mapping[str, Any]) -> dict[str, float]:
        """The multipliers of a light whose other options are known, where they change."""
        return {
            name: factor * float(options.get(name, 1.0))
            for name, factor in (("diffuse", self.diffuse), ("specular", self.specular))
            if factor != 1
        }


def gel_of(light: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> Gel:
    """The gels among a light's filters, together; also of what is listed as not supported."""
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
