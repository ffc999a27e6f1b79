# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes for numbers, vectors and matrices, and conditional nodes.

Formulas and defaults follow the MaterialX Specification 1.39; names of version 1.38 also work.
A matrix is a value with 9 or 16 components in row-major order.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from wavecomb.usd.graphs.values import Expressions, Value, numbers
from wavecomb.usd.materialx.library import WIDTHS
from wavecomb.usd.materialx.nodes.node import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)


def _binary(code: str, second: float = 0.0) -> Handler:
    return lambda n: n.make.op(code, n.value("in1"), n.value("in2", second))


def _unary(code: str, default: float = 0.0) -> Handler:
    return lambda n: n.make.op(code, n.value("in", default))


def _of(formula: Callable[[Expressions, Value], Value]) -> Handler:
    return lambda n: formula(n.make, n.value("in"))


def fract(m: Expressions, x: Value) -> Value:
    """Returns x - floor(x)."""
    return m.sub(x, m.op("floor", x))


def unit(m: Expressions, x: Value) -> Value:
    """Returns x divided by its length."""
    return m.div(x, m.op("sqrt", m.op("dot", x, x)))


def weighted_sum(m: Expressions, vectors: list[Value], weights: Value) -> Value:
    """Returns the weighted sum of three vectors."""
    a, b, c = (m.mul(v, (w,)) for v, w in zip(vectors, weights, strict=True))
    return m.add(m.add(a, b), c)


NODES |= {
    "add": _binary("add"),
    "subtract": _binary("subtract"),
    "multiply": _binary("multiply", 1.0),
    "divide": _binary("divide", 1.0),
    "modulo": _binary("modulo", 1.0),
    "power": _binary("power", 1.0),
    "min": _binary("min"),
    "max": _binary("max"),
    "dotproduct": _binary("dot"),
    "crossproduct": _binary("cross"),
    "absval": _unary("abs"),
    "floor": _unary("floor"),
    "sign": _unary("sign"),
    "sqrt": _unary("sqrt"),
    "ln": _unary("log", 1.0),
    "exp": _unary("exp"),
    "sin": _unary("sin"),
    "cos": _unary("cos"),
    "acos": _unary("acos"),
    "tan": _of(lambda m, x: m.div(m.op("sin", x), m.op("cos", x))),
    "asin": _of(lambda m, x: m.sub(math.pi / 2, m.op("acos", x))),
    "ceil": _of(lambda m, x: m.sub(0.0, m.op("floor", m.sub(0.0, x)))),
    "round": _of(lambda m, x: m.op("floor", m.add(x, 0.5))),
    "fract": _of(fract),
    "magnitude": _of(lambda m, x: m.op("sqrt", m.op("dot", x, x))),
    "normalize": _of(unit),
    "invert": lambda n: n.make.sub(n.value("amount", 1.0), n.value("in")),
    "clamp": lambda n: n.make.op("clamp", n.value("in"), n.value("low"), n.value("high", 1.0)),
    "smoothstep": lambda n: n.make.op(
        "smoothstep", n.value("in"), n.value("low"), n.value("high", 1.0)
    ),
    "and": lambda n: n.make.mul(n.value("in1"), n.value("in2")),
    "or": lambda n: n.make.op("max", n.value("in1"), n.value("in2")),
    "not": lambda n: n.make.sub(1.0, n.value("in")),
}


@_node("atan2")
def _atan2(n: NodeCall) -> Value:
    # MaterialX 1.38 names the two inputs in1 and in2.
    y, x = n.given("iny") or n.given("in1"), n.given("inx") or n.given("in2")
    return n.make.op("atan2", y or 0.0, x or 1.0)


@_node("remap")
def _remap(n: NodeCall) -> Value:
    m = n.make
    low, high = n.value("outlow"), n.value("outhigh", 1.0)
    in_low, in_high = n.value("inlow"), n.value("inhigh", 1.0)
    x = m.div(m.sub(n.value("in"), in_low), m.sub(in_high, in_low))
    return m.add(low, m.mul(x, m.sub(high, low)))


@_node("rotate2d")
def _rotate2d(n: NodeCall) -> Value:
    """Rotates a vector clockwise, as MaterialX does."""
    m, x, degrees = n.make, n.value("in", width=2), n.value("amount", width=1)
    angle = m.mul(degrees, math.pi / 180)
    c, s = m.op("cos", angle), m.op("sin", angle)
    return m.add(m.mul(x[:1], c), m.mul(x[1:], s)) + m.sub(m.mul(x[1:], c), m.mul(x[:1], s))


@_node("rotate3d")
def _rotate3d(n: NodeCall) -> Value:
    m, x = n.make, n.value("in", width=3)
    axis = unit(m, n.value("axis", (0.0, 1.0, 0.0), 3))
    angle = m.mul(n.value("amount", width=1), math.pi / 180)
    c, s = m.op("cos", angle), m.op("sin", angle)
    along = m.mul(m.op("dot", axis, x), m.sub(1.0, c))
    turned = m.add(m.mul(x, c), m.mul(m.op("cross", axis, x), s))
    return m.add(turned, m.mul(axis, along))


# ---- conditions ----------------------------------------------------------------------------------


@_node("ifgreater", "ifgreatereq", "ifequal")
def _if(n: NodeCall) -> Value:
    m = n.make
    # The default of the compared value is 1 for integer variants and 0 for booleans.
    first = 0.0 if n.category == "ifequal" and n.identifier.endswith("B") else 1.0
    a, b = n.value("value1", (first,)), n.value("value2", (0.0,))
    if n.category == "ifequal":
        condition = m.op("equal", a, b)
    elif n.category == "ifgreater":
        condition = m.op("less", b, a)
    else:
        condition = m.sub(1.0, m.op("less", a, b))
    # The variant of the node with boolean output has no values to choose from. Its result is the
    # condition.
    if "_boolean" in n.identifier:
        return condition
    return m.op("select", condition, n.value("in1"), n.value("in2"))


# ---- components; none of these needs an operation ------------------------------------------------


@_node("dot", "constant")
def _same(n: NodeCall) -> Value:
    size = {9: 3, 16: 4}.get(n.width, 0)
    return n.value("value" if n.category == "constant" else "in", identity(size) if size else 0.0)


@_node("convert")
def _convert(n: NodeCall) -> Value:
    """Converts between types: new components are 0 (the fourth is 1), and a number is repeated."""
    words = n.identifier.split("_")  # an identifier is ND_convert_color3_color4, for example
    return n.value("in", 0.0, WIDTHS.get(words[2], 0) if len(words) > 3 else 0)


_PARTS = {"CF": (3, 1), "VF": (3, 1), "CC": (2, 2), "VV": (2, 2)}
"""Numbers of components of the vector inputs of "combine" nodes."""


@_node("combine2", "combine3", "combine4")
def _combine(n: NodeCall) -> Value:
    widths = _PARTS.get(n.identifier[-2:], (1,) * (n.width or int(n.category[-1])))
    parts: Value = ()
    for i, width in enumerate(widths):
        parts += n.value(f"in{i + 1}", 0.0, width)
    return parts


@_node("extract")
def _extract(n: NodeCall) -> Value:
    m, x, index = n.make, n.value("in"), n.value("index")
    if isinstance(index[0], float):
        return (x[min(max(int(index[0]), 0), len(x) - 1)],)
    result: Value = x[-1:]
    for i in reversed(range(len(x) - 1)):
        result = m.op("select", m.op("less", index, i + 0.5), x[i : i + 1], result)
    return result


@_node("swizzle")
def _swizzle(n: NodeCall) -> Value:
    x = n.value("in")
    result: Value = ()
    for letter in n.text("channels", ""):
        if letter in "01":
            result += numbers(float(letter))
        elif letter in "rgbaxyzw":
            result += (x[min("rgbaxyzw".index(letter) % 4, len(x) - 1)],)
    return result or x


# ---- matrices ------------------------------------------------------------------------------------


def identity(size: int) -> tuple[float, ...]:
    """Returns the identity matrix in row-major order."""
    return tuple(float(i % (size + 1) == 0) for i in range(size * size))


@_node("transformmatrix")
def _transform(n: NodeCall) -> Value:
    """Multiplies a row vector by a matrix; appends 1 to a vector that is short by one component.

    Additional components of the result are dropped without a perspective division.
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
        # The rows of a 4 x 4 matrix may have three components. The first three rows are then
        # directions, whose fourth component is 0, and the last row is a point, whose fourth
        # component is 1.
        result += row if len(row) == size else (*row[: size - 1], float(i == size - 1))
    return result
