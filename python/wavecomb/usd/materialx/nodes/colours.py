# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes of colours."""

from __future__ import annotations

from wavecomb.usd.graphs.surface import COLOURS, in_working_space
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

LUMA = (0.2722287, 0.6740818, 0.0536895)
"""Default of ``lumacoeffs``: AP1, as MaterialX has it."""

NODES: dict[str, Handler] = {}
_node = adder(NODES)


@_node("rgbtohsv", "hsvtorgb")
def _hsv(n: NodeCall) -> Value:
    x = n.value("in")
    return n.make.op(n.category, fit(x, 3)) + x[3:4]


@_node("luminance")
def _luminance(n: NodeCall) -> Value:
    x = n.value("in")
    grey = n.make.op("dot", fit(x, 3), n.value("lumacoeffs", LUMA, 3))
    return fit(grey, 3) + x[3:4]


_KELVIN = (800.0, 25000.0)
"""Range of the fits below."""

_CHROMATICITY = ((2222.0, (-1.1063814, -1.34811020, 2.18555832, -0.20219683)),
        (4000.0, (-0.9549476, -1.37418593, 2.09137015, -0.16748867)),
        (0.0, (3.0817580, -5.87338670, 3.75112997, -0.37001483)))  # fmt: skip
"""Up to a temperature, y of a black body's chromaticity as a cubic of x; the last for the rest."""

_TO_REC709 = ((3.2406, -0.9689, 0.0557), (-1.5372, 1.8758, -0.2040), (-0.4986, 0.0415, 1.0570))
"""What X, Y and Z give red, green and blue."""


def _cubic(m: Expressions, x: Value, factors: tuple[float, ...]) -> Value:
    total = numbers(factors[0])
    for factor in factors[1:]:
        total = m.op("add", m.op("multiply", total, x), numbers(factor))
    return total


@_node("blackbody")
def _blackbody(n: NodeCall) -> Value:
    """Kang et al. 2002, "Design of Advanced Color Temperature Control System", at luminance 1."""
    m = n.make
    kelvin = m.op("clamp", n.value("temperature", 5000.0, 1), *(numbers(x) for x in _KELVIN))
    t = m.op("divide", numbers(1000.0), kelvin)
    warm = _cubic(m, t, (-0.2661239, -0.2343580, 0.8776956, 0.179910))
    cold = _cubic(m, t, (-3.0258469, 2.1070379, 0.2226347, 0.240390))
    x = m.op("select", m.op("less", kelvin, numbers(4000.0)), warm, cold)
    y = _cubic(m, x, _CHROMATICITY[-1][1])
    for limit, factors in reversed(_CHROMATICITY[:-1]):
        below = m.op("less", kelvin, numbers(limit))
        y = m.op("select", below, _cubic(m, x, factors), y)
    z = m.op("subtract", m.op("subtract", numbers(1.0), x), y)
    xyz = m.op("divide", x, y) + numbers(1.0) + m.op("divide", z, y)
    rgb = tuple(
        m.op("dot", xyz, numbers(*(row[i] for row in _TO_REC709)))[0] for i in range(3)
    )  # fmt: skip
    value = m.op("max", rgb, numbers(0.0))
    if n.networks.converts and n.kind in COLOURS:
        return in_working_space(m, value, n.networks.textures.working)
    return value
