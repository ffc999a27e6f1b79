# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes of numbers and vectors.

Formulas and defaults are those of the MaterialX Specification 1.39; names that 1.38 had are kept.
"""

from __future__ import annotations

import math

from wavecomb.usd.graphs.values import Expressions, Value, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)


def _binary(code: str, first: float = 0.0, second: float = 0.0) -> Handler:
    return lambda n: n.make.op(code, n.value("in1", first), n.value("in2", second))


NODES |= {
    "add": _binary("add"),
    "subtract": _binary("subtract"),
    "multiply": _binary("multiply", 0.0, 1.0),
    "divide": _binary("divide", 0.0, 1.0),
    "modulo": _binary("modulo", 0.0, 1.0),
    "power": _binary("power", 0.0, 1.0),
    "min": _binary("min"),
    "max": _binary("max"),
    "dotproduct": _binary("dot"),
    "crossproduct": _binary("cross"),
}


def _unary(code: str, default: float = 0.0) -> Handler:
    return lambda n: n.make.op(code, n.value("in", default))


NODES |= {
    "absval": _unary("abs"),
    "floor": _unary("floor"),
    "sign": _unary("sign"),
    "sqrt": _unary("sqrt"),
    "ln": _unary("log", 1.0),
    "exp": _unary("exp"),
    "sin": _unary("sin"),
    "cos": _unary("cos"),
    "acos": _unary("acos"),
}


@_node("tan")
def _tan(n: NodeCall) -> Value:
    x = n.value("in")
    return n.make.op("divide", n.make.op("sin", x), n.make.op("cos", x))


@_node("asin")
def _asin(n: NodeCall) -> Value:
    return n.make.op("subtract", numbers(math.pi / 2), n.make.op("acos", n.value("in")))


@_node("atan2")
def _atan2(n: NodeCall) -> Value:
    # 1.38 called them in1 and in2.
    y, x = n.given("iny") or n.given("in1"), n.given("inx") or n.given("in2")
    return n.make.op("atan2", y or numbers(0.0), x or numbers(1.0))


@_node("ceil")
def _ceil(n: NodeCall) -> Value:
    negated = n.make.op("subtract", numbers(0.0), n.value("in"))
    return n.make.op("subtract", numbers(0.0), n.make.op("floor", negated))


@_node("round")
def _round(n: NodeCall) -> Value:
    return n.make.op("floor", n.make.op("add", n.value("in"), numbers(0.5)))


@_node("fract")
def _fract(n: NodeCall) -> Value:
    x = n.value("in")
    return n.make.op("subtract", x, n.make.op("floor", x))


@_node("invert")
def _invert(n: NodeCall) -> Value:
    return n.make.op("subtract", n.value("amount", 1.0), n.value("in"))


@_node("clamp")
def _clamp(n: NodeCall) -> Value:
    return n.make.op("clamp", n.value("in"), n.value("low"), n.value("high", 1.0))


@_node("smoothstep")
def _smoothstep(n: NodeCall) -> Value:
    return n.make.op("smoothstep", n.value("in"), n.value("low"), n.value("high", 1.0))


@_node("magnitude")
def _magnitude(n: NodeCall) -> Value:
    x = n.value("in")
    return n.make.op("sqrt", n.make.op("dot", x, x))


@_node("normalize")
def _normalize(n: NodeCall) -> Value:
    return _unit(n.make, n.value("in"))


def _unit(m: Expressions, x: Value) -> Value:
    return m.op("divide", x, m.op("sqrt", m.op("dot", x, x)))


@_node("remap")
def _remap(n: NodeCall) -> Value:
    m = n.make
    low, high = n.value("outlow"), n.value("outhigh", 1.0)
    in_low, in_high = n.value("inlow"), n.value("inhigh", 1.0)
    x = m.op("divide", m.op("subtract", n.value("in"), in_low), m.op("subtract", in_high, in_low))
    return m.op("add", low, m.op("multiply", x, m.op("subtract", high, low)))


@_node("rotate2d")
def _rotate2d_node(n: NodeCall) -> Value:
    return _rotated(n.make, n.value("in", width=2), n.value("amount", width=1))


def _rotated(m: Expressions, x: Value, degrees: Value) -> Value:
    """Clockwise, as MaterialX has it."""
    angle = m.op("multiply", degrees, numbers(math.pi / 180))
    c, s = m.op("cos", angle), m.op("sin", angle)
    u = m.op("add", m.op("multiply", x[:1], c), m.op("multiply", x[1:2], s))
    v = m.op("subtract", m.op("multiply", x[1:2], c), m.op("multiply", x[:1], s))
    return u + v


@_node("rotate3d")
def _rotate3d(n: NodeCall) -> Value:
    m, x = n.make, n.value("in", width=3)
    axis = _unit(m, n.value("axis", (0.0, 1.0, 0.0), 3))
    angle = m.op("multiply", n.value("amount", width=1), numbers(math.pi / 180))
    c, s = m.op("cos", angle), m.op("sin", angle)
    along = m.op("multiply", m.op("dot", axis, x), m.op("subtract", numbers(1.0), c))
    turned = m.op("add", m.op("multiply", x, c), m.op("multiply", m.op("cross", axis, x), s))
    return m.op("add", turned, m.op("multiply", axis, along))
