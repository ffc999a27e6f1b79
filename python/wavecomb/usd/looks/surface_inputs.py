# SPDX-License-Identifier: Apache-2.0
"""What an input of a surface shader is for people: its group, label, default and range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

NUMBER, COLOUR, SWITCH = "number", "colour", "switch"


@dataclass(frozen=True)
class InputDefinition:
    """An input of a surface shader.

    Attributes:
        name: As authored, without ``inputs:``.
        group: Heading that it stands under: "Base", "Coat" ...
        label: What it is called there.
        kind: "number", "colour" or "switch".
        type_name: Of MaterialX: float, color3 or boolean; a number may be read of a color3.
        default: A number, three of them, or a bool.
        low: Least value.
        high: Greatest value.
        soft_low: From here ...
        soft_high: ... to here it is set with a slider.
    """

    name: str
    group: str
    label: str
    kind: str
    type_name: str
    default: Any
    low: float = 0.0
    high: float = 1.0
    soft_low: float = 0.0
    soft_high: float = 1.0
