# SPDX-License-Identifier: Apache-2.0
"""What a camera can be told: the rows of the core's table of cameras (scene/camera/camera_table.h).

Keywords of ``SceneBuilder.set_camera`` and their stub, the call that a sandbox may make, what a
sequence takes over from frame to frame and poses of the window follow from them.
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
        help: What it is, with its unit, a sentence.
        kind: "number", "choice", "four" (numbers) or "planes".
        default: None where ``set_camera`` must be told.
        least: Smallest number; None: any.
        choices: Of a choice.
    """

    name: str
    help: str
    kind: str
    default: Any
    least: float | None
    choices: tuple[str, ...]

    @property
    def annotation(self) -> str:
        """Its type in a stub.

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
    """Every parameter by name, in the table's order.

    >>> camera_parameters()["projection"].choices
    ('perspective', 'orthographic', 'latlong')
    """
    from wavecomb import _core

    return rows_by_name(CameraParameter, _core.camera_table())


def camera_defaults() -> dict[str, Any]:
    """What ``set_camera`` takes where nothing is said, of all that it need not be told.

    >>> camera_defaults()["pixel_aspect"]
    1.0
    """
    return {
        name: row.default for name, row in camera_parameters().items() if row.default is not None
    }
