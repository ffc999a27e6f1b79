# SPDX-License-Identifier: Apache-2.0
"""Table of Blender scenes that are compared with Cycles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Expected:
    """Bounds of a comparison.

    Attributes:
        low: Lowest ratio of the means, Wavecomb to Cycles.
        high: Highest ratio of the means.
        outside: Largest fraction of blocks that differ by more than 2 % and four standard errors.
        why: Reason for a difference; empty if both renderers have the same model.
    """

    low: float = 0.99
    high: float = 1.01
    outside: float = 0.05
    why: str = ""


@dataclass(frozen=True)
class ParityScene:
    """A scene that a script creates.

    Attributes:
        name: Name of the scene and of its images.
        group: Heading under which the documentation lists the scene.
        make: Function that fills the empty scene.
        expected: Bounds of the comparison.
        spp: Samples per pixel of each of two renders.
        messages: Words that the report of the export must contain.
    """

    name: str
    group: str
    make: Callable[[], None]
    expected: Expected
    spp: int
    messages: tuple[str, ...] = ()


SCENES: dict[str, ParityScene] = {}


def scene(
    group: str,
    low: float = 0.99,
    high: float = 1.01,
    outside: float = 0.05,
    why: str = "",
    spp: int = 128,
    messages: tuple[str, ...] = (),
) -> Callable[[Callable[[], None]], Callable[[], None]]:
    """Adds a scene to the table, under the name of its function."""

    def added(make: Callable[[], None]) -> Callable[[], None]:
        expected = Expected(low, high, outside, why)
        SCENES[make.__name__] = ParityScene(make.__name__, group, make, expected, spp, messages)
        return make

    return added
