# SPDX-License-Identifier: Apache-2.0
"""What filters of lights are, and their inputs, by who wrote them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import Usd

from wavecomb.usd.looks.colour_space import Colour
from wavecomb.usd.looks.network import colour, number, read_colour, word
from wavecomb.usd.stage.report import LoadReport

_PREFIXES = (
    "inputs:", "inputs:ri:light:", "inputs:ri:lightFilter:", "inputs:arnold:", "arnold:",
    "primvars:arnold:", "ri:light:", "ri:lightFilter:", "",
)  # fmt: skip
"""What inputs of filters begin with."""
OF_LIGHTS = ("inputs:", "")
"""What doors begin with that a light has itself."""


@dataclass(frozen=True)
class FilterInputs:
    """The inputs of a filter, or of a light that has doors of its own."""

    prim: Usd.Prim
    time: Usd.TimeCode
    prefixes: tuple[str, ...] = _PREFIXES

    def attribute(self, *names: str) -> Usd.Attribute | None:
        """The first of some names that says something."""
        for name in names:
            for prefix in self.prefixes:
                attribute = self.prim.GetAttribute(prefix + name)
                if attribute and (
                    attribute.HasAuthoredValue() or attribute.HasAuthoredConnections()
                ):
                    return attribute
        return None

    def value(self, *names: str) -> Any:
        """Of the first of some names that says something; None: none does."""
        attribute = self.attribute(*names)
        return None if attribute is None else attribute.Get(self.time)

    def number(self, name: str, default: float, *others: str) -> float:
        """A finite number."""
        value = self.value(name, *others)
        return default if value is None else number(value, default)

    def word(self, name: str, default: str, *others: str) -> str:
        """A token or string."""
        value = self.value(name, *others)
        return default if value is None else word(value, default)

    def colour(self, name: str, default: Colour, report: LoadReport) -> Colour:
        """A finite colour in linear Rec.709."""
        value = self.value(name)
        if value is None:
            return default
        rgb = colour(value, default)
        return read_colour(rgb, self.attribute(name), report, self.prim.GetPath())


def filter_prims(light: Usd.Prim) -> list[tuple[str, Usd.Prim | None]]:
    """What a light's ``light:filters`` names: path, prim or None."""
    relationship = light.GetRelationship("light:filters")
    targets = relationship.GetForwardedTargets() if relationship else []
    stage = light.GetStage()
    return [(str(target), stage.GetPrimAtPath(target) or None) for target in targets]


def kind_of(prim: Usd.Prim) -> str:
    """What a filter is: its prim's type, or what a LightFilter's ``shaderId`` says."""
    name = str(prim.GetTypeName())
    if name in ("LightFilter", "PluginLightFilter", ""):
        attribute = prim.GetAttribute("lightFilter:shaderId")
        name = word(attribute.Get(), "") if attribute else ""
    return name


def plain_kind(prim: Usd.Prim) -> str:
    """That in small letters, without what comes before a colon, and without underscores."""
    return kind_of(prim).lower().replace("_", "").rsplit(":", 1)[-1]
