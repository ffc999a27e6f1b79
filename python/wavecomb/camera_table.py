# SPDX-License-Identifier: Apache-2.0
"""Parameters of cameras, from the core's table (scene/camera/camera_table.h).

They determine the keywords of ``SceneBuilder.set_camera`` and its stub, the calls that a sandboxed
process may make, the parameters that frames of a sequence share, and camera poses in the window.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from wavecomb.core_table import rows_by_name


@dataclass(frozen=True)
class CameraParameter:
    """A parameter of cameras.

    Attributes:
        name: Keyword of ``set_camera``.
        help: Description with unit, one sentence.
        kind: "number", "choice", "four" (numbers) or "planes".
        default: Default value; None if ``set_camera`` requires the parameter.
        least: Smallest number; None means no limit.
        choices: Values of a choice.
    """

    name: str
    help: str
    kind: str
    default: Any
    least: float | None
    choices: tuple[str, ...]

    @property
    def annotation(self) -> str:
        """Python type for the stub.

        >>> camera_parameters()["window"].annotation
        'tuple[float, float, float, float]'
        """
        return {
            "number": "float",
            "choice": "Literal[" + ", ".join(f'"{name}"' for name in self.choices) + "]",
            "four": "tuple[float, float, float, float]",
            "planes": "Sequence[Sequence[float]]",
        }[self.kind]


@cache
def camera_parameters() -> Mapping[str, CameraParameter]:
    """Returns every parameter by name, in the table's order.

    >>> camera_parameters()["projection"].choices
    ('perspective', 'orthographic', 'latlong')
    """
    from wavecomb import _core

    return rows_by_name(CameraParameter, _core.camera_table())


def camera_defaults() -> dict[str, Any]:
    """Returns the defaults of ``set_camera`` for all optional parameters.

    >>> camera_defaults()["pixel_aspect"]
    1.0
    """
    return {
        name: row.default for name, row in camera_parameters().items() if row.default is not None
    }
