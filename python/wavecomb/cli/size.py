# SPDX-License-Identifier: Apache-2.0
"""Image sizes on the command line, such as 640x360, 640 360 or 50%, and kinds of images."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import click

_EDGES = re.compile(r"(-?\d+)[xX](-?\d+)")


@dataclass(frozen=True)
class Percent:
    """Size relative to another one."""

    value: float

    def of(self, size: tuple[int, int]) -> tuple[int, int]:
        """Returns the size in pixels; each edge is at least one.

        >>> Percent(50.0).of((1920, 1081))
        (960, 540)
        """
        width, height = (max(1, round(edge * self.value / 100.0)) for edge in size)
        return width, height


ImageSize = tuple[int, int] | Percent


class SizeType(click.ParamType):
    """Type of --size. ``SettingCommand`` joins two words to one before."""

    name = "size"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> ImageSize:
        """Converts a word to a size."""
        if not isinstance(value, str):
            return value
        if found := _EDGES.fullmatch(value):
            return int(found[1]), int(found[2])
        if value.endswith("%"):
            try:
                percent = float(value[:-1])
            except ValueError:
                percent = math.nan
            if 0.0 < percent <= 10000.0:
                return Percent(percent)
        self.fail(
            f"{value!r} is no size: give width and height, such as 640x360, or a percentage, such "
            "as 50%",
            param,
            ctx,
        )


def is_png(name: str | None) -> bool:
    """Returns whether a file name ends in .png."""
    return name is not None and name.lower().endswith(".png")
