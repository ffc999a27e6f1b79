# SPDX-License-Identifier: Apache-2.0
"""Creates values of shader graphs, folds constants, and compiles values to programs of the core.

A value is a tuple of parts, one per component. Each part is a number or a component of a node.
Swizzling, extracting and combining components therefore needs no operation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavecomb import _core

CODES = {name: number for number, name in enumerate(_core.GRAPH_CODES)}
INPUTS = {name: number for number, name in enumerate(_core.GRAPH_INPUTS)}
PARAMETERS: dict[str, tuple[int, int]] = dict(_core.GRAPH_PARAMETERS)
"""Index of the first component and number of components of each surface parameter."""

POINT_SIZE = 3 * len(INPUTS) - 3
"""Number of floats that describe an evaluation point: uv and its filter width, then three each for
position, local position, normal, local normal, tangent, view direction and the three normal
axes."""

OF_SPACE = ("local_position", "local_normal", "normal_x", "normal_y", "normal_z")
"""Graph inputs whose values are in object space."""

PRIMVAR = "primvar"
"""Code of a node that stands for a primvar until the graph is bound to a mesh."""


class GraphTooLarge(Exception):
    """Raised if a graph needs more registers or operations than the core has."""


@dataclass(eq=False, slots=True)
class Node:
    """Operation of a graph; ``Expressions`` creates equal nodes only once."""

    code: str
    width: int
    operands: tuple[Value, ...]
    number: int
    image: tuple[int, float] | None
    attribute: str = ""

    @property
    def name(self) -> str:
        """Name of the graph input that the node reads; empty for other operations."""
        return str(_core.GRAPH_INPUTS[self.number]) if self.code == "input" else ""

    @property
    def reads(self) -> list[Node]:
        """Nodes of the operands, in operand order."""
        return [node for value in self.operands for node in _nodes(value)]

    @property
    def results(self) -> int:
        """Number of registers that the operation writes."""
        return 1 if self.code == "dot" else self.width


Part = float | tuple[Node, int]
Value = tuple[Part, ...]
Operand = Value | float


def is_constant(value: Value) -> bool:
    """Returns whether all components of a value are numbers."""
    return all(isinstance(part, float) for part in value)


def numbers(*values: float) -> Value:
    """Creates a constant rounded to float32; values that are not finite become 0."""
    return tuple(float(np.float32(v)) if np.isfinite(v) else 0.0 for v in values)


def fit(value: Value, width: int) -> Value:
    """Changes the number of components by repeating a number, or cutting or extending a vector."""
    if len(value) == width:
        return value
    if len(value) == 1:
        return value * width
    if len(value) > width:
        return value[:width]
    return (*value, 0.0)[: min(width, 3)] + ((1.0,) if width == 4 else ())


def _nodes(parts: Iterable[Part]) -> list[Node]:
    return [part[0] for part in parts if not isinstance(part, float)]


def nodes_of(parts: Sequence[Part]) -> list[Node]:
    """Returns all nodes that the parts depend on, in evaluation order."""
    order: list[Node] = []
    done: set[Node] = set()
    stack = [(node, False) for node in reversed(_nodes(parts))]
    while stack:
        node, ready = stack.pop()
        if node in done:
            continue
        if ready:
            done.add(node)
            order.append(node)
            continue
        stack.append((node, True))
        stack += [(one, False) for one in reversed(node.reads)]
    return order


_OP = np.dtype(
    [("code", "u1"), ("width", "u1"), ("steps", "u1"), ("pad", "u1"), ("to", "u2"),
     ("operands", "u2", 4), ("number", "u2")]
)  # fmt: skip


@dataclass(frozen=True)
class Graph:
    """A compiled program for ``SceneBuilder.add_graph``.

    ``attributes`` has the name and the number of components of each primvar that the program reads.
    """

    ops: bytes
    constants: tuple[float, ...]
    images: tuple[tuple[int, float], ...]
    outputs: tuple[tuple[int, int], ...]
    attributes: tuple[tuple[str, int], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the program's attributes."""
        return tuple(name for name, _ in self.attributes)

    @property
    def count(self) -> int:
        """Number of operations of the program."""
        return len(self.ops) // _OP.itemsize

    def run(self, points: Any, lanes: int = 1) -> Any:
        """Evaluates the program at points (n, ``POINT_SIZE``) without a mesh.

        Textures count as white.
        """
        array = np.ascontiguousarray(points, np.float32)
        return _core.run_graph(
            self.ops, self.constants, self.images, self.outputs, self.names, array, lanes=lanes
        )


def assemble(outputs: dict[int, Part]) -> Graph:
    """Compiles parts to a program; ``outputs`` has the part of each component of a parameter.

    Raises:
        GraphTooLarge: The program needs more registers or operations than available.
    """
    return _Assembler(outputs).graph()


class _Assembler:
    """State of the compiler: registers assigned to nodes, and operations written so far."""

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
            last |= dict.fromkeys(node.reads, at)
        last |= dict.fromkeys(_nodes(self._outputs.values()), len(self._order))
        for at, node in enumerate(self._order):
            self._write(node)
            for read in set(node.reads):
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
            operands[k], step, copied = self._operand(value)
            steps |= step << k
            if copied:
                copies.append((operands[k], len(value)))
        to = self._place[node] = self._take(node.results)
        number = node.number if node.image is None else self._image(node.image)
        if node.attribute:
            known = self._attributes
            known[node.attribute] = max(known.get(node.attribute, 0), node.width)
            number = list(known).index(node.attribute)
        self._emit(node.code, node.width, steps, to, operands, number)
        for place, width in copies:
            self._release(place, width)

    def _operand(self, value: Value) -> tuple[int, int, bool]:
        """Returns the register of a value, whether it is a vector, and whether it was copied."""
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

    def _emit(self, code: str, width: int, steps: int, to: int, reads: list[int], n: int) -> None:
        self._ops.append((CODES[code], width, steps, 0, to, tuple(reads), n))


_WHOLE = {"dot", "cross", "rgbtohsv", "hsvtorgb", "image", "input", "copy"}
_POINTS = {"noise2": 2, "noise3": 3, "fractal3": 3, "cell2": 2, "cell3": 3, "worley2": 2,
           "worley3": 3}  # fmt: skip


def simplified(code: str, parts: tuple[Any, ...]) -> Any | None:
    """Simplifies an operation algebraically; returns None if the operation is needed."""
    a, b, c = (*parts, None, None)[:3]
    if code == "add":
        return b if a == 0.0 else a if b == 0.0 else None
    if code == "multiply":
        return 0.0 if a == 0.0 or b == 0.0 else b if a == 1.0 else a if b == 1.0 else None
    if code in ("subtract", "divide", "power"):
        return a if b == (0.0 if code == "subtract" else 1.0) else None
    if code == "mix":
        return a if c == 0.0 or a == b else b if c == 1.0 else None
    if code == "select" and isinstance(a, float):
        return b if a != 0.0 else c
    return b if code == "select" and b == c else None


class Expressions:
    """Factory of nodes that creates equal nodes only once and folds constants."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[Any, ...], Node] = {}

    def input(self, name: str) -> Value:
        """Returns an input of the shading point, one of ``GRAPH_INPUTS``."""
        width = 2 if name == "uv" else 3
        return self._all(self._node("input", width, (), INPUTS[name]))

    def image(self, texture: int, uv: Value, stretch: float) -> Value:
        """Returns r, g, b and alpha of a texture."""
        return self._all(self._node("image", 4, (uv,), 0, (texture, stretch)))

    def primvar(self, number: int, otherwise: Value) -> Value:
        """Returns a placeholder for a primvar of each mesh; ``otherwise`` is the default."""
        return self._all(self._node(PRIMVAR, len(otherwise), (otherwise,), number))

    def with_operands(self, node: Node, operands: tuple[Value, ...]) -> Value:
        """Returns a copy of a node with different operands."""
        if node.code == "input":
            return self.input(node.name)
        if node.code == "image" and node.image is not None:
            return self.image(node.image[0], operands[0], node.image[1])
        if node.attribute:
            return self.attribute(node.attribute, node.width, operands[0])
        return self.op(node.code, *operands, number=node.number, width=node.width)

    def attribute(self, name: str, width: int, fallback: Value) -> Value:
        """Returns the value of a primvar that varies over the mesh.

        On meshes without this primvar, or with too few components, the value is ``fallback``.
        """
        return self._all(self._node("attribute", width, (fit(fallback, width),), 0, None, name))

    def add(self, a: Operand, b: Operand) -> Value:
        """Returns the sum a + b."""
        return self.op("add", a, b)

    def sub(self, a: Operand, b: Operand) -> Value:
        """Returns the difference a - b."""
        return self.op("subtract", a, b)

    def mul(self, a: Operand, b: Operand) -> Value:
        """Returns the product a b."""
        return self.op("multiply", a, b)

    def div(self, a: Operand, b: Operand) -> Value:
        """Returns the quotient a / b."""
        return self.op("divide", a, b)

    def op(self, code: str, *given: Operand, number: int = 0, width: int = 0) -> Value:
        """Applies an operation to values per component, or for some codes to whole vectors.

        ``width`` is the number of components of the result if the operands do not determine the
        number.
        """
        operands = tuple(numbers(one) if isinstance(one, float) else one for one in given)
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
            simple = simplified(code, parts)
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
