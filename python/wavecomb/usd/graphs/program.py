# SPDX-License-Identifier: Apache-2.0
"""Flat programs, as the core runs them, of values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavecomb import _core
from wavecomb.usd.graphs.node import CODES, GraphTooLarge, Node, Part, Value, is_constant, nodes_of

_OP = np.dtype(
    [("code", "u1"), ("width", "u1"), ("steps", "u1"), ("pad", "u1"), ("to", "u2"),
     ("operands", "u2", 4), ("number", "u2")]
)  # fmt: skip


@dataclass(frozen=True)
class Graph:
    """A flat program, as ``SceneBuilder.add_graph`` takes it.

    ``attributes``: primvars that it reads, with how many components.
    """

    ops: bytes
    constants: tuple[float, ...]
    images: tuple[tuple[int, float], ...]
    outputs: tuple[tuple[int, int], ...]
    attributes: tuple[tuple[str, int], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its attributes."""
        return tuple(name for name, _ in self.attributes)

    @property
    def count(self) -> int:
        """Operations."""
        return len(self.ops) // _OP.itemsize

    def run(self, points: Any, lanes: int = 1) -> Any:
        """Its outputs at points (n, ``POINT_SIZE``), textures taken for white, without a mesh."""
        array = np.ascontiguousarray(points, np.float32)
        return _core.run_graph(
            self.ops, self.constants, self.images, self.outputs, self.names, array, lanes=lanes
        )


def assemble(outputs: dict[int, Part]) -> Graph:
    """The program whose outputs are these parts, by component number.

    Raises:
        GraphTooLarge: It needs more registers or operations than there are.
    """
    return _Assembler(outputs).graph()


class _Assembler:
    """Gives nodes registers, in their order, and writes operations."""

    def __init__(self, outputs: dict[int, Part]) -> None:
        self._outputs = outputs
        self._order = nodes_of(list(outputs.values()))
        self._free = [True] * _core.GRAPH_REGISTERS
        self._place: dict[Node, int] = {}
        self._constants: list[float] = []
        self._images: list[tuple[int, float]] = []
        self._attributes: dict[str, int] = {}
        self._ops: list[tuple[Any, ...]] = []

    def graph(self) -> Graph:
        last: dict[Node, int] = {}
        for at, node in enumerate(self._order):
            for value in node.operands:
                last |= {part[0]: at for part in value if not isinstance(part, float)}
        for part in self._outputs.values():
            if not isinstance(part, float):
                last[part[0]] = len(self._order)
        for at, node in enumerate(self._order):
            self._write(node)
            for read in {
                p[0] for value in node.operands for p in value if not isinstance(p, float)
            }:
                if last[read] == at:
                    self._release(self._place[read], read.results)
        outputs = tuple(
            (number, self._operand((part,))[0]) for number, part in sorted(self._outputs.items())
        )
        if len(self._ops) > _core.GRAPH_OPS or len(self._constants) >= _core.GRAPH_CONSTANT:
            raise GraphTooLarge(f"{len(self._ops)} operations")
        ops = np.array(self._ops, _OP).tobytes() if self._ops else b""
        return Graph(
            ops, tuple(self._constants), tuple(self._images), outputs,
            tuple(self._attributes.items()),
        )  # fmt: skip

    def _write(self, node: Node) -> None:
        operands, steps, copies = [0] * 4, 0, []
        for k, value in enumerate(node.operands):
            place, step, copied = self._operand(value)
            operands[k] = place
            steps |= step << k
            if copied:
                copies.append((place, len(value)))
        to = self._place[node] = self._take(node.results)
        number = node.number
        if node.image is not None:
            number = self._image(node.image)
        if node.attribute:
            known = self._attributes
            known[node.attribute] = max(known.get(node.attribute, 0), node.width)
            number = list(known).index(node.attribute)
        self._emit(node.code, node.width, steps, to, operands, number)
        for place, width in copies:
            self._release(place, width)

    def _operand(self, value: Value) -> tuple[int, int, bool]:
        """Where a value is, whether it is a vector, and whether it was copied to be there."""
        if len(set(value)) == 1:
            return self._single(value[0]), 0, False
        if is_constant(value):
            return self._constant(value), 1, False
        first = value[0]
        if not isinstance(first, float):
            node, at = first
            if value == tuple((node, at + i) for i in range(len(value))):
                return self._place[node] + at, 1, False
        places = [self._single(part) for part in value] + [0] * (4 - len(value))
        to = self._take(len(value))
        self._emit("copy", len(value), 0, to, places, 0)
        return to, 1, True

    def _single(self, part: Part) -> int:
        if isinstance(part, float):
            return self._constant((part,))
        return self._place[part[0]] + part[1]

    def _constant(self, value: Value) -> int:
        wanted = [float(part) for part in value]  # type: ignore[arg-type]
        keys = [np.float32(x).tobytes() for x in wanted]
        have = [np.float32(x).tobytes() for x in self._constants]
        for at in range(len(have) - len(keys) + 1):
            if have[at : at + len(keys)] == keys:
                return int(_core.GRAPH_CONSTANT) + at
        self._constants += wanted
        return int(_core.GRAPH_CONSTANT) + len(self._constants) - len(wanted)

    def _image(self, image: tuple[int, float]) -> int:
        if image not in self._images:
            self._images.append(image)
        return self._images.index(image)

    def _take(self, width: int) -> int:
        for at in range(len(self._free) - width + 1):
            if all(self._free[at : at + width]):
                self._free[at : at + width] = [False] * width
                return at
        raise GraphTooLarge(f"more than {len(self._free)} values at once")

    def _release(self, at: int, width: int) -> None:
        self._free[at : at + width] = [True] * width

    def _emit(
        self, code: str, width: int, steps: int, to: int, operands: list[int], number: int
    ) -> None:
        self._ops.append((CODES[code], width, steps, 0, to, tuple(operands), number))
