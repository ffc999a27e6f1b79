# SPDX-License-Identifier: Apache-2.0
"""Parameters of lights: the rows of the core's table (light/description/light_table.h).

Keywords of ``SceneBuilder.add_light`` and their stub, the calls that a sandbox may make, what the
loader reads of a prim and the window's fields follow from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from wavecomb.core_table import rows_by_name

MESH = "triangle"
"""The kind of lights of meshes: ``SceneBuilder.add_mesh_light``."""

EDITABLE = ("number", "colour", "flag")
"""Kinds of values that an edit can change."""


@dataclass(frozen=True)
class LightParameter:
    """A parameter of lights.

    Attributes:
        name: Keyword of ``add_light``.
        label: In a form.
        help: What it is, with its unit, a sentence.
        input: UsdLux's name without "inputs:"; "" where there is none of that meaning.
        group: "emission", "shape", "shaping" or "response".
        kind: "number", "colour", "flag", "choice", "id" or "transforms".
        refers: What an id is of: "texture", "profile", "set" or "group", which is a name.
        default: None of an id: none.
        least: Smallest number; None: any.
        most: Largest number; None: any.
        usual: Upper end of a slider where there is no largest number.
        choices: Of a choice.
        kinds: Kinds of light that have it.
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
        """Its type in a stub.

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
    """Every parameter by name, in the table's order.

    >>> light_parameters()["radius"].kinds
    ('disk', 'sphere', 'cylinder')
    """
    from wavecomb import _core

    return rows_by_name(LightParameter, _core.light_table())


def of_kind(kind: str) -> tuple[LightParameter, ...]:
    """The parameters of a kind of light, in the table's order.

    >>> [row.name for row in of_kind("distant")][:2]
    ['color', 'angle']
    """
    return tuple(row for row in light_parameters().values() if kind in row.kinds)


@cache
def kind_of_prims() -> Mapping[str, str]:
    """The kind of light that prims of a type are drawn as.

    >>> kind_of_prims()["DomeLight_1"]
    'dome'
    """
    from wavecomb import _core

    return MappingProxyType({prim: kind for kind, prims in _core.light_kinds() for prim in prims})
