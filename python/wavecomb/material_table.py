# SPDX-License-Identifier: Apache-2.0
"""Parameters of materials: the core's table (material/description/material_table.h).

Keywords of ``SceneBuilder.add_material`` and their stub, the calls that a sandbox may make, and
what the loader reads of attributes of materials follow from them. Beside them, what programs read.
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
        default: That of UsdPreviewSurface.
        program: The one that has it to itself; "" where materials of all can be told it.
        least: Smallest number of a program's own; None: any.
        most: Largest one.
    """

    name: str
    kind: str
    default: Any
    program: str = ""
    least: float | None = None
    most: float | None = None

    @property
    def annotation(self) -> str:
        """Its type in a stub.

        >>> material_parameters()["emission"].annotation
        'tuple[float, float, float]'
        """
        types = {"number": "float", "colour": "tuple[float, float, float]", "flag": "bool"}
        return types[self.kind]

    @property
    def attribute(self) -> str:
        """Of a program's own: the attribute of a material's prim that gives it."""
        return f"wavecomb:{self.name}"

    def in_range(self, value: float) -> float:
        """The nearest number that it can be."""
        least = value if self.least is None else max(value, self.least)
        return least if self.most is None else min(least, self.most)


@dataclass(frozen=True)
class Program:
    """What a program reads of its materials.

    Attributes:
        name: As ``add_material`` takes it.
        inputs: What textures can drive, as ``add_material`` calls it.
        reads_ior: The index of refraction says something.
        has_more: It has a whole set of parameters beside them, as openpbr.
    """

    name: str
    inputs: tuple[str, ...]
    reads_ior: bool
    has_more: bool

    @property
    def reads(self) -> frozenset[str]:
        """Its parameters that UsdPreviewSurface has, too.

        >>> sorted(programs()["plastic"].reads)
        ['base_color', 'ior', 'normal', 'roughness']
        """
        more = {"ior"} if self.reads_ior else set()
        if "opacity" in self.inputs:
            more.add("opacity_threshold")
        return frozenset({*self.inputs, *more})


@cache
def material_parameters() -> Mapping[str, MaterialParameter]:
    """Every parameter by name, in the table's order.

    >>> material_parameters()["roughness"].default
    0.5
    """
    from wavecomb import _core

    return rows_by_name(MaterialParameter, _core.material_table())


def own_parameters(program: str) -> tuple[MaterialParameter, ...]:
    """What a program has to itself, in the table's order."""
    return tuple(row for row in material_parameters().values() if row.program == program)


@cache
def programs() -> Mapping[str, Program]:
    """Every program by name.

    >>> programs()["emissive"].inputs
    ('emission',)
    """
    from wavecomb import _core

    return rows_by_name(Program, _core.program_table())


@cache
def preview_programs() -> tuple[str, ...]:
    """The programs that a UsdPreviewSurface can ask for.

    >>> "principled" in preview_programs(), "openpbr" in preview_programs()
    (True, False)
    """
    return tuple(name for name, program in programs().items() if not program.has_more)
