# SPDX-License-Identifier: Apache-2.0
"""Handlers for MaterialX nodes for colours, compositing and hair absorption."""

from __future__ import annotations

from collections.abc import Callable

from wavecomb.usd.graphs.surface_parameters import COLOURS, in_working_space
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.materialx.nodes.node import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)

LUMA = (0.2722287, 0.6740818, 0.0536895)
"""Default of MaterialX's input ``lumacoeffs``, which are the luminance weights of ACEScg (AP1)."""


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
"""Temperature range in which the black-body fits are valid, in kelvin."""

_CHROMATICITY = ((2222.0, (-1.1063814, -1.34811020, 2.18555832, -0.20219683)),
        (4000.0, (-0.9549476, -1.37418593, 2.09137015, -0.16748867)),
        (0.0, (3.0817580, -5.87338670, 3.75112997, -0.37001483)))  # fmt: skip
"""Cubic fits of y(x) for the chromaticity of a black body, each up to a temperature limit."""

_TO_REC709 = ((3.2406, -0.9689, 0.0557), (-1.5372, 1.8758, -0.2040), (-0.4986, 0.0415, 1.0570))
"""Columns of the matrix from XYZ to linear Rec.709, for X, Y and Z."""


def _cubic(m: Expressions, x: Value, factors: tuple[float, ...]) -> Value:
    total = numbers(factors[0])
    for factor in factors[1:]:
        total = m.add(m.mul(total, x), factor)
    return total


@_node("blackbody")
def _blackbody(n: NodeCall) -> Value:
    """Returns the colour of a black body with luminance 1.

    Source: Kang et al. 2002, "Design of Advanced Color Temperature Control System".
    """
    m = n.make
    kelvin = m.op("clamp", n.value("temperature", 5000.0, 1), *_KELVIN)
    t = m.div(1000.0, kelvin)
    warm = _cubic(m, t, (-0.2661239, -0.2343580, 0.8776956, 0.179910))
    cold = _cubic(m, t, (-3.0258469, 2.1070379, 0.2226347, 0.240390))
    x = m.op("select", m.op("less", kelvin, 4000.0), warm, cold)
    y = _cubic(m, x, _CHROMATICITY[-1][1])
    for limit, factors in reversed(_CHROMATICITY[:-1]):
        y = m.op("select", m.op("less", kelvin, limit), _cubic(m, x, factors), y)
    z = m.sub(m.sub(1.0, x), y)
    xyz = m.div(x, y) + numbers(1.0) + m.div(z, y)
    rgb = tuple(
        m.op("dot", xyz, numbers(*(row[i] for row in _TO_REC709)))[0] for i in range(3)
    )  # fmt: skip
    value = m.op("max", rgb, 0.0)
    if n.networks.converts and n.kind in COLOURS:
        return in_working_space(m, value, n.networks.textures.working)
    return value


# ---- compositing ---------------------------------------------------------------------------------

Formula = Callable[[Expressions, Value, Value], Value]
"""Function that combines a foreground colour and a background colour."""


def _blend(formula: Formula, width: int = 0) -> Handler:
    def compiled(n: NodeCall) -> Value:
        fg, bg = n.value("fg", width=width), n.value("bg", width=width)
        return n.make.op("mix", bg, formula(n.make, fg, bg), n.value("mix", 1.0, 1))

    return compiled


def _layered(formula: Formula) -> Handler:
    """Returns a handler that composites premultiplied colours (Porter and Duff 1984)."""
    return _blend(formula, 4)


def _screen(m: Expressions, f: Value, b: Value) -> Value:
    return m.sub(1.0, m.mul(m.sub(1.0, f), m.sub(1.0, b)))


def _matte(m: Expressions, f: Value, b: Value) -> Value:
    alpha, rest = f[3:], m.sub(1.0, f[3:])
    over = m.add(m.mul(f[:3], alpha), m.mul(b[:3], rest))
    return over + m.add(alpha, m.mul(b[3:], rest))


def _disjoint_over(m: Expressions, f: Value, b: Value) -> Value:
    total = m.add(f[3:], b[3:])
    scale = m.div(m.sub(1.0, f[3:]), b[3:])
    under = m.op("select", m.op("less", 1.0, total), m.mul(b[:3], scale), b[:3])
    return m.add(f[:3], under) + m.op("min", total, 1.0)


def _by_alpha(code: str) -> Handler:
    def compiled(n: NodeCall) -> Value:
        x = n.value("in", (0.0, 0.0, 0.0, 1.0), 4)
        return n.make.op(code, x[:3], x[3:]) + x[3:]

    return compiled


NODES |= {
    "mix": lambda n: n.make.op("mix", n.value("bg"), n.value("fg"), n.value("mix")),
    "plus": _blend(lambda m, f, b: m.add(b, f)),
    "minus": _blend(lambda m, f, b: m.sub(b, f)),
    "difference": _blend(lambda m, f, b: m.op("abs", m.sub(b, f))),
    "screen": _blend(_screen),
    "burn": _blend(lambda m, f, b: m.sub(1.0, m.div(m.sub(1.0, b), f))),
    "dodge": _blend(lambda m, f, b: m.div(b, m.sub(1.0, f))),
    "inside": lambda n: n.make.mul(n.value("in"), n.value("mask", 1.0, 1)),
    "outside": lambda n: n.make.mul(n.value("in"), n.make.sub(1.0, n.value("mask", 0.0, 1))),
    "premult": _by_alpha("multiply"),
    "unpremult": _by_alpha("divide"),
    "over": _layered(lambda m, f, b: m.add(f, m.mul(b, m.sub(1.0, f[3:])))),
    "in": _layered(lambda m, f, b: m.mul(f, b[3:])),
    "out": _layered(lambda m, f, b: m.mul(f, m.sub(1.0, b[3:]))),
    "mask": _layered(lambda m, f, b: m.mul(b, f[3:])),
    "matte": _layered(_matte),
    "disjointover": _layered(_disjoint_over),
}


# ---- hair, as in MaterialX's shader code ---------------------------------------------------------

_EUMELANIN = (0.657704, 0.498077, 0.254106)
_PHEOMELANIN = (0.829443, 0.670320, 0.349937)


def color_divisor(azimuthal: float) -> float:
    """Returns the divisor of a colour's logarithm in the square root of the absorption coefficient.

    Source: Chiang et al. 2016, eq. 9. The core has the same formula in ``fibre_color_divisor``.
    """
    p = azimuthal
    return 5.969 + p * (-0.215 + p * (2.532 + p * (-10.73 + p * (5.574 + p * 0.245))))


@_node("chiang_hair_absorption_from_color")
def _from_color(n: NodeCall) -> Value:
    m = n.make
    color = m.op("clamp", n.value("color", (1.0,) * 3, 3), 0.001, 1.0)
    divisor = color_divisor(n.number("azimuthal_roughness", 0.2))
    root = m.mul(m.op("log", color), 1.0 / divisor)
    return m.mul(root, root)


@_node("deon_hair_absorption_from_melanin")
def _from_melanin(n: NodeCall) -> Value:
    """Computes hair absorption from melanin.

    Source: E. d'Eon et al., "An Energy-Conserving Hair Reflectance Model", 2011.
    """
    m = n.make
    left = m.sub(1.0, n.value("melanin_concentration", 0.25, 1))
    amount = m.mul(m.op("log", m.op("max", left, 1e-4)), -1.0)
    red = n.value("melanin_redness", 0.5, 1)

    def of(share: Value, name: str, default: tuple[float, ...]) -> Value:
        log = m.op("log", m.op("max", n.value(name, default, 3), 1e-6))
        return m.mul(fit(m.mul(amount, share), 3), m.mul(log, -1.0))

    brown = of(m.sub(1.0, red), "eumelanin_color", _EUMELANIN)
    return m.op("max", m.add(brown, of(red, "pheomelanin_color", _PHEOMELANIN)), 0.0)
