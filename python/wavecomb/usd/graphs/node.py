# SPDX-License-Identifier: Apache-2.0
"""What a value of a graph is: a tuple of parts, one for each component.

A part is a number, or a component of a node. So what swizzles, extracts and combines needs no
operation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavecomb import _core

CODES = {name: number for number, name in enumerate(_core.GRAPH_CODES)}
INPUTS = {name: number for number, name in enumerate(_core.GRAPH_INPUTS)}
PARAMETERS: dict[str, tuple[int, int]] = dict(_core.GRAPH_PARAMETERS)
"""Parameter -> (its first component, how many it has)."""

POINT_SIZE = 3 * len(INPUTS) - 3
"""Numbers of a point: uv, its width, then position, local position, normal, local normal, tangent,
view and the three axes of normals, of three each."""

OF_SPACE = ("local_position", "local_normal", "normal_x", "normal_y", "normal_z")
"""Inputs that depend on the object's own space."""

PRIMVAR = "primvar"
"""A node that stands for what a mesh gives."""


class GraphTooLarge(Exception):
    """A graph needs more registers or operations than there are."""


class Node:
    """One operation; equal ones are one node."""

    __slots__ = ("attribute", "code", "image", "number", "operands", "width")

    def __init__(
        self,
        code: str,
        width: int,
        operands: tuple[Value, ...],
        number: int,
        image: tuple[int, float] | None,
        attribute: str = "",
    ) -> None:
        self.attribute = attribute
        self.code = code
        self.width = width
        self.operands = operands
        self.number = number
        self.image = image

    @property
    def name(self) -> str:
        """Which input it is; "" of other operations."""
        return str(_core.GRAPH_INPUTS[self.number]) if self.code == "input" else ""

    @property
    def results(self) -> int:
        """Registers that it writes."""
        return 1 if self.code == "dot" else self.width


Part = float | tuple[Node, int]
Value = tuple[Part, ...]


def is_constant(value: Value) -> bool:
    """Whether all components are numbers."""
    return all(isinstance(part, float) for part in value)


def numbers(*values: float) -> Value:
    """A constant, in 32 bits; what is not finite is 0."""
    return tuple(float(np.float32(v)) if np.isfinite(v) else 0.0 for v in values)


def fit(value: Value, width: int) -> Value:
    """Another number of components: numbers spread, vectors lose or gain some."""
    if len(value) == width:
        return value
    if len(value) == 1:
        return value * width
    if len(value) > width:
        return value[:width]
    return (*value, 0.0)[: min(width, 3)] + ((1.0,) if width == 4 else ())


def nodes_of(parts: Sequence[Part]) -> list[Node]:
    """All nodes that parts need, operands before what reads them."""
    order: list[Node] = []
    done: set[Node] = set()
    stack: list[tuple[Node, bool]] = [
        (part[0], False) for part in reversed(parts) if not isinstance(part, float)
    ]
    while stack:
        node, ready = stack.pop()
        if node in done:
            continue
        if ready:
            done.add(node)
            order.append(node)
            continue
        stack.append((node, True))
        for value in reversed(node.operands):
            stack += [(p[0], False) for p in reversed(value) if not isinstance(p, float)]
    return order
