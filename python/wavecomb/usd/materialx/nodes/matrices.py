# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes of matrices: made, transposed, and applied; values of 9 or 16 parts, by rows."""

from __future__ import annotations

from wavecomb.usd.graphs.values import Value, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)


def identity(size: int) -> tuple[float, ...]:
    """The matrix that changes nothing, by rows."""
    return tuple(float(i % (size + 1) == 0) for i in range(size * size))


@_node("transformmatrix")
def _transform(n: NodeCall) -> Value:
    """Rows times matrix, as MaterialX has it; with 1 beside coordinates where the matrix is wider.

    What comes out wider than it went in is cut, not divided by its last.
    """
    size = 4 if n.identifier.endswith(("M4", "vector4")) else 3
    matrix = n.value("mat", identity(size), size * size)
    x = n.value("in", 0.0, n.width or size)
    row = (x + numbers(1.0))[:size] if len(x) < size else x
    result: Value = ()
    for column in range(min(size, n.width or size)):
        result += n.make.op("dot", row, matrix[column::size])
    return result


@_node("transpose")
def _transpose(n: NodeCall) -> Value:
    size = 4 if n.identifier.endswith("44") else 3
    x = n.value("in", identity(size), size * size)
    return tuple(x[(i % size) * size + i // size] for i in range(size * size))


@_node("creatematrix")
def _create(n: NodeCall) -> Value:
    size = 4 if n.identifier.endswith("44") else 3
    rows = identity(size)
    result: Value = ()
    for i in range(size):
        row = n.value(f"in{i + 1}", rows[i * size : (i + 1) * size])
        # Of three coordinates for four the last is that of a direction, in the last row a point's.
        result += row if len(row) == size else (*row[: size - 1], float(i == size - 1))
    return result
