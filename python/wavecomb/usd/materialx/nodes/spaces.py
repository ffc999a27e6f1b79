# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that lead from the object's space to the world's, and back.

With M the map of vectors from the object to the world, a hit gives the rows of the inverse of M
(``normal_x`` ...), its place in both spaces, and no more. M's own columns are the cross products of
those rows over their determinant.
"""

from __future__ import annotations

from wavecomb.usd.graphs.surface import NORMAL, NUMBER
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)


def _rows(m: Expressions) -> list[Value]:
    """Of the inverse of M, in the world."""
    return [m.input(f"normal_{axis}") for axis in "xyz"]


def _columns(m: Expressions) -> list[Value]:
    """Of M, in the world."""
    a, b, c = _rows(m)
    across = m.op("cross", b, c)
    size = m.op("dot", a, across)
    return [m.op("divide", v, size) for v in (across, m.op("cross", c, a), m.op("cross", a, b))]


def _sum(m: Expressions, vectors: list[Value], weights: Value) -> Value:
    parts = [m.op("multiply", v, (w,)) for v, w in zip(vectors, weights, strict=True)]
    return m.op("add", m.op("add", parts[0], parts[1]), parts[2])


def _dots(m: Expressions, vectors: list[Value], v: Value) -> Value:
    return tuple(m.op("dot", one, v)[0] for one in vectors)


def _unit(m: Expressions, v: Value) -> Value:
    return m.op("divide", v, m.op("sqrt", m.op("dot", v, v)))


def tangent_of_object(m: Expressions, normal: Value) -> Value:
    """A normal of the object's space in that of the tangents; turned to the side of the surface's.

    A surface that is seen from behind has its normal turned over; so is the map's.
    """
    there = _unit(m, _sum(m, _rows(m), fit(normal, 3)))
    frame = [m.input(name) for name in ("tangent", "bitangent", "normal")]
    tilted = _dots(m, frame, there)
    side = m.op("select", m.op("less", tilted[2:], numbers(0.0)), numbers(-1.0), numbers(1.0))
    return m.op("multiply", tilted, side)


def _spaces(n: NodeCall) -> tuple[bool, bool]:
    """Whether it leads from the object's space, and to it; what is not said is the object's."""
    start, end = (n.text(name, "") or "object" for name in ("fromspace", "tospace"))
    return start != "world", end != "world"


def _given(n: NodeCall, default: tuple[float, ...]) -> Value:
    """What is led, whatever the result is for: numbers of a space are no normals of tangents."""
    found = n.inputs.find("in", NUMBER)
    return fit(numbers(*default) if found is None else found, 3)


@_node("transformnormal", "transformvector")
def _transform(n: NodeCall) -> Value:
    m, is_normal = n.make, n.category == "transformnormal"
    starts, ends = _spaces(n)
    if n.kind == NORMAL and not (starts and not ends):
        return n.value("in", (0.0, 0.0, 1.0), 3)
    v = _given(n, (0.0, 0.0, 1.0 if is_normal else 0.0))
    if n.kind == NORMAL:
        if not is_normal:  # as a vector: what that is to normals
            v = _dots(m, _columns(m), _sum(m, _columns(m), v))
        return tangent_of_object(m, v)
    if starts == ends:
        return v
    rows = _rows(m) if is_normal == starts else _columns(m)
    led = _sum(m, rows, v) if starts else _dots(m, rows, v)
    return _unit(m, led) if is_normal else led


@_node("transformpoint")
def _transform_point(n: NodeCall) -> Value:
    """About where the surface is, which both spaces know."""
    m = n.make
    starts, ends = _spaces(n)
    p = _given(n, (0.0, 0.0, 0.0))
    if starts == ends:
        return p
    world, local = n.world_position(), m.input("local_position")
    if starts:
        return m.op("add", world, _sum(m, _columns(m), m.op("subtract", p, local)))
    return m.op("add", local, _dots(m, _rows(m), m.op("subtract", p, world)))
