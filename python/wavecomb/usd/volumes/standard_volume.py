# SPDX-License-Identifier: Apache-2.0
"""The volume shader ``standard_volume``: inputs and defaults as Arnold documents them.

Of density 1 light passes a length of ``transparent_depth`` with the colour ``transparent``, so the
extinction coefficient is density * -ln(transparent) / transparent_depth, per unit of the stage.
"""

from __future__ import annotations

import math

from pxr import UsdShade

from wavecomb.usd.volumes.inputs import Inputs
from wavecomb.usd.volumes.look import (
    BLACK,
    DENSITY,
    WHITE,
    Colour,
    Driven,
    VolumeLook,
    grey,
    product,
)

IDENTIFIERS = ("arnold:standard_volume", "standard_volume")

_HALF = (0.5, 0.5, 0.5)
_OPAQUE = 1e-4
"""Transparency below which the coefficient is that of it: 9.2 per ``transparent_depth``."""


def read(shader: UsdShade.Shader, inputs: Inputs) -> VolumeLook:
    """The look that the shader says."""
    dense = inputs.driven(shader, "density", WHITE)
    transparent = inputs.driven(shader, "transparent", grey(math.exp(-1.0)))
    depth = max(inputs.number(shader, "transparent_depth", 1.0), 1e-6)
    scatter = inputs.driven(shader, "scatter_color", _HALF)
    weight = inputs.number(shader, "scatter", 1.0)
    albedo = _clamped(product(scatter.colour, grey(max(weight, 0.0))))
    emission, glow, kelvin = _emission(shader, inputs)
    _say_others(shader, inputs)
    return VolumeLook(
        extinction=product(dense.colour, _coefficient(transparent.colour, depth)),
        albedo=albedo,
        anisotropy=inputs.number(shader, "scatter_anisotropy", 0.0),
        emission=emission,
        density=dense.field or inputs.text(shader, "density_channel", DENSITY),
        colour=scatter.field or inputs.text(shader, "scatter_color_channel"),
        glow=glow,
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
    """Colour, the field that it is times, and what 1 in that means in kelvin, unless 0."""
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
    return Driven(lit.colour).scaled(grey(intensity)).colour, field, kelvin


def _say_others(shader: UsdShade.Shader, inputs: Inputs) -> None:
    """What the shader asks for and does not get."""
    for name in ("transparent_channel",):
        if inputs.text(shader, name):
            inputs.report.missing(f"{name} of standard_volume (left out)", shader.GetPath())
    for name in ("scatter_secondary_anisotropy_mix", "scatter_diffusion"):
        if inputs.number(shader, name, 0.0) > 0.0:
            inputs.report.missing(f"{name} of standard_volume (left out)", shader.GetPath())
