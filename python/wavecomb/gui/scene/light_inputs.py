# SPDX-License-Identifier: Apache-2.0
"""Editable inputs of lights: those of the core's table of lights, and the brightness inputs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pxr import Gf, Sdf, Usd

from wavecomb.core_table import EDITABLE, LightParameter, light_parameters, of_kind
from wavecomb.gui.scene.form_model import COLOUR, NUMBER, SWITCH, Range
from wavecomb.usd.lights.light import KINDS
from wavecomb.usd.materials.parameters import as_stored

_TYPES = {
    NUMBER: Sdf.ValueTypeNames.Float,
    COLOUR: Sdf.ValueTypeNames.Color3f,
    SWITCH: Sdf.ValueTypeNames.Bool,
}
_KINDS = {"number": NUMBER, "colour": COLOUR, "flag": SWITCH}


@dataclass(frozen=True)
class LightInput:
    """An input of a light.

    Attributes:
        name: Name of the input in the window.
        input: UsdLux name of the input, without "inputs:".
        label: Label in the form.
        kind: Kind of the form field, one of those in ``form_model``.
        default: Value if nothing is authored.
        bounds: Range of the number, or of each component of the colour.
        tip: Tooltip that describes the effect of the input.
        group: Heading above the field, or "" for none.
    """

    name: str
    input: str
    label: str
    kind: str
    default: Any
    bounds: Range
    tip: str
    group: str = ""

    @property
    def attribute(self) -> str:
        """Name of the attribute on the light prim."""
        return f"inputs:{self.input}"

    @property
    def type_name(self) -> Sdf.ValueTypeName:
        """Type of the attribute."""
        return _TYPES[self.kind]

    def read(self, prim: Usd.Prim, time: Usd.TimeCode) -> Any:
        """Returns the input's value on a prim: a number, a colour of three numbers, or a bool."""
        attribute = prim.GetAttribute(self.attribute)
        value = attribute.Get(time) if attribute else None
        if value is None:
            return self.default
        if self.kind == COLOUR:
            return tuple(value)
        return bool(value) if self.kind == SWITCH else float(value)

    def stored(self, value: Any) -> Any:
        """Converts a value to the type of the attribute."""
        return Gf.Vec3f(*value) if self.kind == COLOUR else as_stored(value)


BRIGHTNESS = (
    LightInput("intensity", "intensity", "intensity", NUMBER, 1.0,
               Range(0.0, 1e9, 1e-3, 1e5, 4, logarithmic=True), "Factor on the colour"),
    LightInput("exposure", "exposure", "exposure", NUMBER, 0.0,
               Range(-30.0, 30.0, -10.0, 10.0, 2), "Stops; each doubles the brightness"),
    LightInput("color", "color", "colour", COLOUR, (1.0, 1.0, 1.0), Range(0.0, 1e4, 0.0, 1.0),
               "Linear Rec.709, multiplied by the colour temperature of the stage"),
)  # fmt: skip
"""Inputs that the core combines into one colour."""


def light_inputs() -> dict[str, LightInput]:
    """Returns all light inputs by name."""
    return {one.name: one for one in (*map(_of, _edited(light_parameters().values())), *BRIGHTNESS)}


def inputs_of(prim: Usd.Prim) -> list[LightInput]:
    """Returns the inputs of a prim in the order of a form.

    Brightness comes first, then the light type's inputs without a heading, then its inputs with
    headings.
    """
    kind = KINDS.get(str(prim.GetTypeName()), "")
    brightness = {one.name for one in BRIGHTNESS}
    own = [_of(row) for row in _edited(of_kind(kind)) if row.name not in brightness]
    there = [one for one in own if prim.HasAttribute(one.attribute)]
    return [*BRIGHTNESS, *sorted(there, key=lambda one: one.group)]


def _edited(rows: Iterable[LightParameter]) -> list[LightParameter]:
    return [row for row in rows if row.input and row.kind in EDITABLE]


def _of(row: LightParameter) -> LightInput:
    """Converts a light parameter of the core to an input."""
    low = -1e9 if row.least is None else row.least
    high = 1e9 if row.most is None else row.most
    usual = row.usual if row.most is None else row.most
    bounds = Range(low, high, max(low, 0.0), usual)
    group = row.group if row.group in ("shaping", "response") else ""
    return LightInput(
        row.name, row.input, row.label, _KINDS[row.kind], row.default, bounds, row.help[:-1], group
    )
