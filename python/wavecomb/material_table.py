# SPDX-License-Identifier: Apache-2.0
"""What a material can be told: the rows of the core's table (scene/material_table.h).

Keywords of ``SceneBuilder.add_material`` and their stub, and the calls that a sandbox may make,
follow from them.
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
    """

    name: str
    kind: str
    default: Any

    @property
    def annotation(self) -> str:
        """Its type in a stub.

        >>> material_parameters()["emission"].annotation
        'tuple[float, float, float]'
        """
        types = {"number": "float", "colour": "tuple[float, float, float]", "flag": "bool"}
        return types[self.kind]


@cache
def material_parameters() -> Mapping[str, MaterialParameter]:
    """Every parameter by name, in the table's order.

    >>> material_parameters()["roughness"].default
    0.5
    """
    from wavecomb import _core

    return rows_by_name(MaterialParameter, _core.material_table())
