# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that lay one picture over another."""

from __future__ import annotations

from collections.abc import Callable

from wavecomb.usd.graphs.values import Expressions, Value, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

ONE = numbers(1.0)

NODES: dict[str, Handler] = {}
_node = adder(NODES)


@_node("mix")
def _mix(n: NodeCall) -> Value:
    return n.make.op("mix", n.value("bg"), n.value("fg"), n.value("mix"))


def _blend(formula: Callable[[Expressions, Value, Value], Value]) -> Handler:
    def compiled(n: NodeCall) -> Value:
        fg, bg = n.value("fg"), n.value("bg")
        return n.make.op("mix", bg, formula(n.make, fg, bg), n.value("mix", 1.0, 1))

    return compiled


def _screen(m: Expressions, f: Value, b: Value) -> Value:
    dark = m.op("multiply", m.op("subtract", ONE, f), m.op("subtract", ONE, b))
    return m.op("subtract", ONE, dark)


def _burn(m: Expressions, f: Value, b: Value) -> Value:
    return m.op("subtract", ONE, m.op("divide", m.op("subtract", ONE, b), f))


NODES |= {
    "plus": _blend(lambda m, f, b: m.op("add", b, f)),
    "minus": _blend(lambda m, f, b: m.op("subtract", b, f)),
    "difference": _blend(lambda m, f, b: m.op("abs", m.op("subtract", b, f))),
    "screen": _blend(_screen),
    "burn": _blend(_burn),
    "dodge": _blend(lambda m, f, b: m.op("divide", b, m.op("subtract", ONE, f))),
    "inside": lambda n: n.make.op("multiply", n.value("in"), n.value("mask", 1.0, 1)),
    "outside": lambda n: n.make.op(
        "multiply", n.value("in"), n.make.op("subtract", ONE, n.value("mask", 0.0, 1))
    ),
}

_BLACK = (0.0, 0.0, 0.0, 1.0)


@_node("premult")
def _premult(n: NodeCall) -> Value:
    x = n.value("in", _BLACK, 4)
    return n.make.op("multiply", x[:3], x[3:]) + x[3:]


@_node("unpremult")
def _unpremult(n: NodeCall) -> Value:
    x = n.value("in", _BLACK, 4)
    return n.make.op("divide", x[:3], x[3:]) + x[3:]


def _layered(formula: Callable[[Expressions, Value, Value], Value]) -> Handler:
    """Porter and Duff 1984, of colours with their alpha in them."""

    def compiled(n: NodeCall) -> Value:
        f, b = n.value("fg", width=4), n.value("bg", width=4)
        return n.make.op("mix", b, formula(n.make, f, b), n.value("mix", 1.0, 1))

    return compiled


def _less(m: Expressions, x: Value) -> Value:
    return m.op("subtract", ONE, x)


def _matte(m: Expressions, f: Value, b: Value) -> Value:
    alpha = f[3:]
    over = m.op("add", m.op("multiply", f[:3], alpha), m.op("multiply", b[:3], _less(m, alpha)))
    return over + m.op("add", alpha, m.op("multiply", b[3:], _less(m, alpha)))


def _disjoint_over(m: Expressions, f: Value, b: Value) -> Value:
    total = m.op("add", f[3:], b[3:])
    scale = m.op("divide", _less(m, f[3:]), b[3:])
    fits = m.op("less", numbers(1.0), total)
    under = m.op("select", fits, m.op("multiply", b[:3], scale), b[:3])
    return m.op("add", f[:3], under) + m.op("min", total, ONE)


NODES |= {
    "over": _layered(lambda m, f, b: m.op("add", f, m.op("multiply", b, _less(m, f[3:])))),
    "in": _layered(lambda m, f, b: m.op("multiply", f, b[3:])),
    "out": _layered(lambda m, f, b: m.op("multiply", f, _less(m, b[3:]))),
    "mask": _layered(lambda m, f, b: m.op("multiply", b, f[3:])),
    "matte": _layered(_matte),
    "disjointover": _layered(_disjoint_over),
}
