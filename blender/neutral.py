# SPDX-License-Identifier: GPL-3.0-or-later
"""Representation of surfaces as inputs of OpenPBR."""

from __future__ import annotations

from .graph import Value, colour, number

Surface = dict[str, Value]

BLACK, WHITE = colour((0, 0, 0)), colour((1, 1, 1))
NEUTRAL: Surface = {
    "base_weight": number(1.0),
    "base_color": WHITE,
    "base_metalness": number(0.0),
    "base_diffuse_roughness": number(0.0),
    "specular_weight": number(0.0),
    "specular_color": WHITE,
    "specular_roughness": number(0.5),
    "specular_ior": number(1.5),
    "specular_roughness_anisotropy": number(0.0),
    "transmission_weight": number(0.0),
    "transmission_color": WHITE,
    "subsurface_weight": number(0.0),
    "subsurface_color": WHITE,
    "subsurface_radius": number(0.0),
    "subsurface_radius_scale": WHITE,
    "subsurface_scatter_anisotropy": number(0.0),
    "coat_weight": number(0.0),
    "coat_roughness": number(0.03),
    "coat_ior": number(1.5),
    "coat_color": WHITE,
    "coat_darkening": number(0.0),
    "fuzz_weight": number(0.0),
    "fuzz_roughness": number(0.5),
    "fuzz_color": WHITE,
    "thin_film_weight": number(0.0),
    "thin_film_thickness": number(0.0),
    "thin_film_ior": number(1.33),
    "emission_color": BLACK,
    "geometry_opacity": number(1.0),
}
"""A white diffuse surface, whose values are the defaults of other surfaces."""


def is_zero(value: Value) -> bool:
    """Returns whether a value is the constant 0 or black."""
    constant = value.constant
    return constant is not None and not any(
        constant if isinstance(constant, tuple) else (constant,)
    )
