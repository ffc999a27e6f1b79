# SPDX-License-Identifier: Apache-2.0
"""What a volume looks like: coefficients, and the fields that they are multiplied by."""

from __future__ import annotations

from dataclasses import dataclass, replace

Colour = tuple[float, float, float]

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)

DENSITY = "density"
"""The field that a volume without a material is as dense as, where it has that."""


@dataclass(frozen=True)
class Driven:
    """A colour times a field.

    Attributes:
        colour: Linear, in Rec.709.
        field: Name of a field; "": none.
    """

    colour: Colour = BLACK
    field: str = ""

    @property
    def is_black(self) -> bool:
        """Whether it is 0 whatever the field."""
        return not any(self.colour)

    def scaled(self, by: Colour) -> Driven:
        """Times a colour."""
        return replace(self, colour=product(self.colour, by))


@dataclass(frozen=True)
class VolumeLook:
    """How a volume absorbs, scatters and emits.

    Attributes:
        extinction: Per unit of length of the stage, times the field ``density``.
        albedo: Share of it that is scattered, times the field ``colour``.
        anisotropy: Mean cosine, in (-1, 1).
        emission: Radiance per unit of length of the stage, times the field ``glow``.
        density: Name of a field; "": the one named density, or the first of numbers.
        colour: Name of a field; "": none.
        glow: Name of a field; "": as the density.
        kelvin: Unless 0, ``glow`` holds temperatures, and this is what 1 in it means.
        name: For messages.
    """

    extinction: Colour = WHITE
    albedo: Colour = (0.8, 0.8, 0.8)
    anisotropy: float = 0.0
    emission: Colour = BLACK
    density: str = ""
    colour: str = ""
    glow: str = ""
    kelvin: float = 0.0
    name: str = ""


DEFAULT_LOOK = VolumeLook()
"""Without a material: white smoke, whose density 1 is an extinction of 1 per unit of the stage."""


def product(a: Colour, b: Colour) -> Colour:
    """Of two colours."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


def total(a: Colour, b: Colour) -> Colour:
    """Sum of two colours."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def share(part: Colour, whole: Colour) -> Colour:
    """A colour divided by another; 0 where that is."""
    r, g, b = (p / w if w > 0 else 0.0 for p, w in zip(part, whole, strict=True))
    return (r, g, b)


def grey(value: float) -> Colour:
    """A number as a colour."""
    return (value, value, value)
