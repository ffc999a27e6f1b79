# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that take values apart and put them together: none costs an operation."""

from __future__ import annotations

from wavecomb.usd.graphs.values import Value, numbers
from wavecomb.usd.materialx.library import WIDTHS
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder
from wavecomb.usd.materialx.nodes.matrices import identity

NODES: dict[str, Handler] = {}
_node = adder(NODES)


@_node("dot", "constant")
def _same(n: NodeCall) -> Value:
    size = {9: 3, 16: 4}.get(n.width, 0)
    return n.value("value" if n.category == "constant" else "in", identity(size) if size else 0.0)


@_node("convert")
def _convert(n: NodeCall) -> Value:
    """More components are 0, but for a fourth, which is 1; one number is all components."""
    words = n.identifier.split("_")  # ND_convert_color3_color4
    return n.value("in", 0.0, WIDTHS.get(words[2], 0) if len(words) > 3 else 0)


_PARTS = {"CF": (3, 1), "VF": (3, 1), "CC": (2, 2), "VV": (2, 2)}
"""Components of the inputs of combine nodes whose inputs are no numbers."""


@_node("combine2", "combine3", "combine4")
def _combine(n: NodeCall) -> Value:
    widths = _PARTS.get(n.identifier[-2:], (1,) * (n.width or int(n.category[-1])))
    parts: Value = ()
    for i, width in enumerate(widths):
        parts += n.value(f"in{i + 1}", 0.0, width)
    return parts


@_node("extract")
def _extract(n: NodeCall) -> Value:
    x, index = n.value("in"), n.value("index")
    if isinstance(index[0], float):
        at = min(max(int(index[0]), 0), len(x) - 1)
        return (x[at],)
    result: Value = x[-1:]
    for i in reversed(range(len(x) - 1)):
        result = n.make.op(
            "select", n.make.op("less", index, numbers(i + 0.5)), x[i : i + 1], result
        )
    return result


@_node("swizzle")
def _swizzle(n: NodeCall) -> Value:
    x = n.value("in")
    channels = n.text("channels", "")
    letters = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}
    result: Value = ()
    for letter in channels:
        if letter in "01":
            result += numbers(float(letter))
        elif letter in letters:
            result += (x[min(letters[letter], len(x) - 1)],)
    return result or x
