# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that choose."""

from __future__ import annotations

from wavecomb.usd.graphs.values import Value, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)


def _compare(n: NodeCall) -> tuple[Value, Value]:
    # Of variants that take whole numbers these are whole, of others not: the same here.
    first = 0.0 if n.category == "ifequal" and n.identifier.endswith("B") else 1.0
    return n.value("value1", (first,)), n.value("value2", (0.0,))


def _choice(n: NodeCall, condition: Value) -> Value:
    if "_boolean" in n.identifier:  # the variant whose result is true or false
        return condition
    return n.make.op("select", condition, n.value("in1"), n.value("in2"))


@_node("ifgreater")
def _if_greater(n: NodeCall) -> Value:
    a, b = _compare(n)
    return _choice(n, n.make.op("less", b, a))


@_node("ifgreatereq")
def _if_greater_or_equal(n: NodeCall) -> Value:
    a, b = _compare(n)
    return _choice(n, n.make.op("subtract", numbers(1.0), n.make.op("less", a, b)))


@_node("ifequal")
def _if_equal(n: NodeCall) -> Value:
    a, b = _compare(n)
    return _choice(n, n.make.op("equal", a, b))


NODES |= {
    "and": lambda n: n.make.op("multiply", n.value("in1"), n.value("in2")),
    "or": lambda n: n.make.op("max", n.value("in1"), n.value("in2")),
    "not": lambda n: n.make.op("subtract", numbers(1.0), n.value("in")),
}
