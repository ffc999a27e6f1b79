# SPDX-License-Identifier: Apache-2.0
"""Makes values of graphs, each node once.

Constants are folded by the core itself, one operation at a time, so that the formulas are those of
renders.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wavecomb.picture.working_space import from_rec709
from wavecomb.usd.graphs.node import (
    INPUTS,
    POINT_SIZE,
    PRIMVAR,
    Node,
    Part,
    Value,
    fit,
    is_constant,
    nodes_of,
    numbers,
)
from wavecomb.usd.graphs.program import assemble

_WHOLE = {"dot", "cross", "rgbtohsv", "hsvtorgb", "image", "input", "copy"}
_POINTS = {"noise2": 2, "noise3": 3, "fractal3": 3, "cell2": 2, "cell3": 3, "worley2": 2,
           "worley3": 3}  # fmt: skip


class Expressions:
    """Makes nodes, each once, and folds what is constant."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[Any, ...], Node] = {}

    def input(self, name: str) -> Value:
        """What the surface says: of ``GRAPH_INPUTS``."""
        width = 2 if name == "uv" else 3
        return self._all(self._node("input", width, (), INPUTS[name]))

    def image(self, texture: int, uv: Value, stretch: float) -> Value:
        """r, g, b and alpha of a texture."""
        return self._all(self._node("image", 4, (uv,), 0, (texture, stretch)))

    def primvar(self, number: int, otherwise: Value) -> Value:
        """A value that each mesh gives; ``otherwise`` where it does not. Replaced before use."""
        return self._all(self._node(PRIMVAR, len(otherwise), (otherwise,), number))

    def again(self, node: Node, operands: tuple[Value, ...]) -> Value:
        """A node with other operands."""
        if node.code == "input":
            return self.input(node.name)
        if node.code == "image" and node.image is not None:
            return self.image(node.image[0], operands[0], node.image[1])
        if node.attribute:
            return self.attribute(node.attribute, node.width, operands[0])
        return self.op(node.code, *operands, number=node.number, width=node.width)

    def attribute(self, name: str, width: int, fallback: Value) -> Value:
        """A primvar of the mesh at hits; ``fallback`` where it has none of so many components."""
        return self._all(self._node("attribute", width, (fit(fallback, width),), 0, None, name))

    def op(self, code: str, *operands: Value, number: int = 0, width: int = 0) -> Value:
        """An operation on values: component by component but for those on whole vectors.

        ``width``: components of the result where the operands do not say.
        """
        if code in _POINTS:
            point = fit(operands[0], _POINTS[code])
            rest = operands[1:]
            return self._whole(code, width, (point, *rest), number)
        widest = max(len(value) for value in operands)
        wide = tuple(fit(value, widest) for value in operands)
        if code in _WHOLE:
            return self._whole(code, widest, wide, number)
        return self._by_component(code, wide, widest)

    def _whole(self, code: str, width: int, operands: tuple[Value, ...], number: int) -> Value:
        node = self._node(code, width, operands, number)
        value = self._all(node)
        return self._folded(value) if all(is_constant(v) for v in operands) else value

    def _by_component(self, code: str, operands: tuple[Value, ...], width: int) -> Value:
        known: dict[int, Part] = {}
        for i in range(width):
            parts = tuple(value[i] for value in operands)
            simple = _simplified(code, parts)
            if simple is not None:
                known[i] = simple
            elif all(isinstance(part, float) for part in parts):
                one = self._node(code, 1, tuple((part,) for part in parts))
                known[i] = self._folded(self._all(one))[0]
        open_ones = {tuple(value[i] for value in operands) for i in range(width) if i not in known}
        if len(open_ones) == 1:
            (parts,) = open_ones
            node = self._node(code, 1, tuple((part,) for part in parts))
            return tuple(known.get(i, (node, 0)) for i in range(width))
        if not open_ones:
            return tuple(known[i] for i in range(width))
        node = self._node(code, width, operands)
        return tuple(known.get(i, (node, i)) for i in range(width))

    def _folded(self, value: Value) -> Value:
        graph = assemble(dict(enumerate(value)))
        row = graph.run(np.zeros((1, POINT_SIZE), np.float32))[0]
        return numbers(*(float(x) for x in row))

    def _all(self, node: Node) -> Value:
        return tuple((node, i) for i in range(node.results))

    def _node(
        self,
        code: str,
        width: int,
        operands: tuple[Value, ...],
        number: int = 0,
        image: tuple[int, float] | None = None,
        attribute: str = "",
    ) -> Node:
        key = (code, width, operands, number, image, attribute)
        node = self._nodes.get(key)
        if node is None:
            node = self._nodes[key] = Node(code, width, operands, number, image, attribute)
        return node


def _simplified(code: str, parts: tuple[Part, ...]) -> Part | None:
    """What an operation comes to without one; None where it is needed."""
    a = parts[0]
    b = parts[1] if len(parts) > 1 else None
    if code == "add":
        return b if a == 0.0 else a if b == 0.0 else None
    if code == "subtract":
        return a if b == 0.0 else None
    if code == "multiply":
        if a == 0.0 or b == 0.0:
            return 0.0
        return b if a == 1.0 else a if b == 1.0 else None
    if code in ("divide", "power"):
        return a if b == 1.0 else None
    if code == "mix":
        c = parts[2]
        return a if c == 0.0 or a == b else b if c == 1.0 else None
    if code == "select":
        if isinstance(a, float):
            return b if a != 0.0 else parts[2]
        return b if b == parts[2] else None
    return None


Replaced = Callable[[Node, tuple[Value, ...]], Value | None]
"""Called as replaced(node, its operands made anew); None: the node stays."""


def substituted(make: Expressions, value: Value, replaced: Replaced) -> Value:
    """A value made anew with other values in the place of some nodes; primvars give way always."""
    done: dict[Node, Value] = {}

    def part_of(part: Part) -> Part:
        return part if isinstance(part, float) else done[part[0]][part[1]]

    for node in nodes_of(value):
        operands = tuple(tuple(part_of(part) for part in one) for one in node.operands)
        new = replaced(node, operands)
        if new is None:
            new = operands[0] if node.code == PRIMVAR else make.again(node, operands)
        done[node] = fit(new, node.results)
    return tuple(part_of(part) for part in value)


def in_working_space(make: Expressions, value: Value, working: str) -> Value:
    """A colour of linear Rec.709 in the working space; what follows r, g and b stays."""
    if working == "rec709":
        return value
    matrix = from_rec709(np.eye(3), working)
    rgb = tuple(
        make.op("dot", value[:3], numbers(*(float(x) for x in matrix[:, i])))[0] for i in range(3)
    )
    return rgb + value[3:]
