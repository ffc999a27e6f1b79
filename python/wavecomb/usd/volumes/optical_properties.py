# SPDX-License-Identifier: Apache-2.0
"""Optical properties of a volume: coefficients and the fields that multiply them."""

from __future__ import annotations

from dataclasses import dataclass, replace

Colour = tuple[float, float, float]

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)

DENSITY = "density"
"""Field that is the density of a volume without a material."""


@dataclass(frozen=True)
class FieldColour:
    """A colour that is multiplied by a field.

    Attributes:
        colour: The colour in linear Rec.709.
        field: Name of the field that multiplies the colour, or "".
    """

    colour: Colour = BLACK
    field: str = ""

    @property
    def is_black(self) -> bool:
        """Whether the colour is 0, so that the field has no effect."""
        return not any(self.colour)

    def scaled(self, by: Colour) -> FieldColour:
        """Returns a copy whose colour is multiplied by ``by``; the field is unchanged."""
        return replace(self, colour=product(self.colour, by))


@dataclass(frozen=True)
class OpticalProperties:
    """Absorption, scattering and emission of a volume.

    Attributes:
        extinction: Extinction coefficient per stage unit, multiplied by the field ``density``.
        albedo: Single-scattering albedo, multiplied by the field ``colour``.
        anisotropy: Mean cosine of the phase function, in (-1, 1).
        emission: Emitted radiance per stage unit, multiplied by the field ``emission_field``.
        density: Name of a field; "" means the field named density, or the first scalar field.
        colour: Name of the field that multiplies the albedo, or "".
        emission_field: Name of a field; "" means the density field.
        kelvin: Temperature of value 1 in ``emission_field``; 0 if the field holds no temperatures.
        name: Name of the material for messages.
    """

    extinction: Colour = WHITE
    albedo: Colour = (0.8, 0.8, 0.8)
    anisotropy: float = 0.0
    emission: Colour = BLACK
    density: str = ""
    colour: str = ""
    emission_field: str = ""
    kelvin: float = 0.0
    name: str = ""


DEFAULT_PROPERTIES = OpticalProperties()
"""Properties of a volume without material: white smoke, extinction 1 per stage unit."""


def product(a: Colour, b: Colour) -> Colour:
    """Returns the product of two colours."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


def total(a: Colour, b: Colour) -> Colour:
    """Returns the sum of two colours."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def share(part: Colour, whole: Colour) -> Colour:
    """Divides two colours; division by 0 gives 0."""
    r, g, b = (p / w if w > 0 else 0.0 for p, w in zip(part, whole, strict=True))
    return (r, g, b)


def grey(value: float) -> Colour:
    """Returns a number as a grey colour."""
    return (value, value, value)
