# SPDX-License-Identifier: Apache-2.0
"""Parameters of materials and programs, from the core's tables.

The tables are in material/description/material_table.h.

They determine the keywords of ``SceneBuilder.add_material`` and its stub, the calls that a
sandboxed process may make, and the material attributes that the loader reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from wavecomb.core_table import rows_by_name


@dataclass(frozen=True)
class MaterialParameter:
    """A parameter of materials.

    Attributes:
        name: Keyword of ``add_material``.
        kind: "number", "colour" or "flag".
        default: Default, as in UsdPreviewSurface.
        program: The only program with this parameter; "" if all materials accept it.
        least: Smallest number of such a parameter; None means no limit.
        most: Largest number; None means no limit.
    """

    name: str
    kind: str
    default: Any
    program: str = ""
    least: float | None = None
    most: float | None = None

    @property
    def annotation(self) -> str:
        """Python type for the stub.

        >>> material_parameters()["emission"].annotation
        'tuple[float, float, float]'
        """
        types = {"number": "float", "colour": "tuple[float, float, float]", "flag": "bool"}
        return types[self.kind]

    @property
    def attribute(self) -> str:
        """Attribute of the material prim, for parameters of a single program."""
        return f"wavecomb:{self.name}"

    def in_range(self, value: float) -> float:
        """Clamps a number to the valid range."""
        least = value if self.least is None else max(value, self.least)
        return least if self.most is None else min(least, self.most)


@dataclass(frozen=True)
class Program:
    """A shading program and the parameters that it reads.

    Attributes:
        name: Name for ``add_material``.
        inputs: Parameters that textures can drive, by their names in ``add_material``.
        reads_ior: Whether it uses the index of refraction.
        has_more: Whether it has further parameters, as openpbr has.
    """

    name: str
    inputs: tuple[str, ...]
    reads_ior: bool
    has_more: bool

    @property
    def reads(self) -> frozenset[str]:
        """Parameters that it shares with UsdPreviewSurface.

        >>> sorted(programs()["plastic"].reads)
        ['base_color', 'ior', 'normal', 'roughness']
        """
        more = {"ior"} if self.reads_ior else set()
        if "opacity" in self.inputs:
            more.add("opacity_threshold")
        return frozenset({*self.inputs, *more})


@cache
def material_parameters() -> Mapping[str, MaterialParameter]:
    """Returns every parameter by name, in the table's order.

    >>> material_parameters()["roughness"].default
    0.5
    """
    from wavecomb import _core

    return rows_by_name(MaterialParameter, _core.material_table())


def own_parameters(program: str) -> tuple[MaterialParameter, ...]:
    """Returns the parameters that only this program has, in the table's order."""
    return tuple(row for row in material_parameters().values() if row.program == program)


@cache
def programs() -> Mapping[str, Program]:
    """Returns every program by name.

    >>> programs()["emissive"].inputs
    ('emission',)
    """
    from wavecomb import _core

    return rows_by_name(Program, _core.program_table())


@cache
def preview_programs() -> tuple[str, ...]:
    """Returns the programs that a UsdPreviewSurface can select.

    >>> "principled" in preview_programs(), "openpbr" in preview_programs()
    (True, False)
    """
    return tuple(name for name, program in programs().items() if not program.has_more)
