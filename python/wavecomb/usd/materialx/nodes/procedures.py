# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that make patterns: noise, ramps, splits."""

from __future__ import annotations

from wavecomb.usd.graphs.values import Value, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)


def _scaled(n: NodeCall, value: Value, pivot: bool = True) -> Value:
    result = n.make.op("multiply", value, n.value("amplitude", 1.0))
    return n.make.op("add", result, n.value("pivot")) if pivot else result


@_node("noise2d")
def _noise2d(n: NodeCall) -> Value:
    return _scaled(n, n.make.op("noise2", n.coordinates(), width=n.width))


@_node("noise3d")
def _noise3d(n: NodeCall) -> Value:
    place = n.place("position", "position", "object")
    return _scaled(n, n.make.op("noise3", place, width=n.width))


@_node("fractal3d")
def _fractal3d(n: NodeCall) -> Value:
    place = n.place("position", "position", "object")
    value = n.make.op(
        "fractal3", place, n.value("lacunarity", 2.0, 1), n.value("diminish", 0.5, 1),
        number=_octaves(n), width=n.width,
    )  # fmt: skip
    return _scaled(n, value, pivot=False)


@_node("fractal2d")
def _fractal2d(n: NodeCall) -> Value:
    m, place = n.make, n.coordinates()
    lacunarity, diminish = n.value("lacunarity", 2.0, 1), n.value("diminish", 0.5, 1)
    total, amplitude = numbers(*[0.0] * (n.width or 1)), numbers(1.0)
    for _ in range(_octaves(n)):
        noise = m.op("noise2", place, width=n.width)
        total = m.op("add", total, m.op("multiply", noise, amplitude))
        amplitude = m.op("multiply", amplitude, diminish)
        place = m.op("multiply", place, lacunarity)
    return _scaled(n, total, pivot=False)


def _octaves(n: NodeCall) -> int:
    return min(max(int(n.number("octaves", 3.0)), 0), 32)


@_node("cellnoise2d", "cellnoise3d")
def _cells(n: NodeCall) -> Value:
    if n.category == "cellnoise2d":
        return n.make.op("cell2", n.coordinates(), width=n.width)
    return n.make.op("cell3", n.place("position", "position", "object"), width=n.width)


@_node("worleynoise2d", "worleynoise3d")
def _worley(n: NodeCall) -> Value:
    style = int(n.number("style", 0.0))
    jitter = n.value("jitter", 1.0, 1)
    if n.category == "worleynoise2d":
        return n.make.op("worley2", n.coordinates(), jitter, number=style, width=n.width)
    place = n.place("position", "position", "object")
    return n.make.op("worley3", place, jitter, number=style, width=n.width)


@_node("ramplr", "ramptb")
def _ramp(n: NodeCall) -> Value:
    u, v = n.coordinates()
    if n.category == "ramplr":
        ends, at = (n.value("valuel"), n.value("valuer")), (u,)
    else:
        # The specification has the top at v = 1.
        ends, at = (n.value("valueb"), n.value("valuet")), (v,)
    return n.make.op("mix", *ends, n.make.op("clamp", at, numbers(0.0), numbers(1.0)))


@_node("splitlr", "splittb")
def _split(n: NodeCall) -> Value:
    u, v = n.coordinates()
    centre = n.value("center", 0.5)
    if n.category == "splitlr":
        return n.make.op(
            "select", n.make.op("less", (u,), centre), n.value("valuel"), n.value("valuer")
        )
    return n.make.op(
        "select", n.make.op("less", (v,), centre), n.value("valueb"), n.value("valuet")
    )
