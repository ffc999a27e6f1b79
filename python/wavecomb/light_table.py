# SPDX-License-Identifier: Apache-2.0
"""Parameters of lights, from the core's table (light/description/light_table.h).

They determine the keywords of ``SceneBuilder.add_light`` and its stub, the calls that a sandboxed
process may make, the inputs that the loader reads, and the window's fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from wavecomb.core_table import rows_by_name

MESH = "triangle"
"""Kind of mesh lights, for ``SceneBuilder.add_mesh_light``."""

EDITABLE = ("number", "colour", "flag")
"""Kinds of values that an edit can change."""


@dataclass(frozen=True)
class LightParameter:
    """A parameter of lights.

    Attributes:
        name: Keyword of ``add_light``.
        label: Label in a form.
        help: Description with unit, one sentence.
        input: UsdLux name without "inputs:"; "" if UsdLux has no equivalent.
        group: "emission", "shape", "shaping" or "response".
        kind: "number", "colour", "flag", "choice", "id" or "transforms".
        refers: Kind of object that an id refers to: "texture", "profile", "set", or "group", which
            is a name.
        default: Default value; None for ids.
        least: Smallest number; None means no limit.
        most: Largest number; None means no limit.
        usual: Upper end of a slider if there is no largest number.
        choices: Values of a choice.
        kinds: Kinds of light that have the parameter.
    """

    name: str
    label: str
    help: str
    input: str
    group: str
    kind: str
    refers: str
    default: Any
    least: float | None
    most: float | None
    usual: float
    choices: tuple[str, ...]
    kinds: tuple[str, ...]

    @property
    def annotation(self) -> str:
        """Python type for the stub.

        >>> light_parameters()["color"].annotation, light_parameters()["ies"].annotation
        ('tuple[float, float, float]', 'int | None')
        """
        if self.refers == "group":
            return "str"
        types = {
            "number": "float", "colour": "tuple[float, float, float]", "flag": "bool",
            "choice": "str", "id": "int | None", "transforms": "NDArray[np.float64] | None",
        }  # fmt: skip
        return types[self.kind]


@cache
def light_parameters() -> Mapping[str, LightParameter]:
    """Returns every parameter by name, in the table's order.

    >>> light_parameters()["radius"].kinds
    ('disk', 'sphere', 'cylinder')
    """
    from wavecomb import _core

    return rows_by_name(LightParameter, _core.light_table())


def of_kind(kind: str) -> tuple[LightParameter, ...]:
    """Returns the parameters of a kind of light, in the table's order.

    >>> [row.name for row in of_kind("distant")][:2]
    ['color', 'angle']
    """
    return tuple(row for row in light_parameters().values() if kind in row.kinds)


@cache
def kind_of_prims() -> Mapping[str, str]:
    """Returns the kind of light by USD prim type.

    >>> kind_of_prims()["DomeLight_1"]
    'dome'
    """
    from wavecomb import _core

    return MappingProxyType({prim: kind for kind, prims in _core.light_kinds() for prim in prims})
