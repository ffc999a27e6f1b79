# SPDX-License-Identifier: Apache-2.0
"""MaterialX's nodes as expressions: what each category of the standard library computes.

Formulas and defaults are those of the MaterialX Specification 1.39 and of the node graphs of its
standard library; names that 1.38 had are kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

from wavecomb.usd.looks.graph_code import Expressions, Value, fit, numbers

LUMA = (0.2722287, 0.6740818, 0.0536895)
"""Default of ``lumacoeffs``: AP1, as MaterialX has it."""


class Call(Protocol):
    """A node that is being compiled."""

    @property
    def width(self) -> int:
        """Components of its output."""

    @property
    def category(self) -> str:
        """Of the node, without types."""

    @property
    def output(self) -> str:
        """Name of the output that is asked for."""

    @property
    def make(self) -> Expressions:
        """Makes operations."""

    def value(
        self, name: str, default: float | Sequence[float] | None = 0.0, width: int = 0
    ) -> Value:
        """An input; of its own width where none is given."""

    def has(self, name: str) -> bool:
        """Whether an input is authored."""

    def number(self, name: str, default: float) -> float:
        """An input that must be one number for all; told where it is not."""

    def text(self, name: str, default: str) -> str:
        """A string or token."""

    def coordinates(self, name: str = "texcoord") -> Value:
        """Texture coordinates: of an input, else of the mesh."""

    def place(self, kind: str, name: str, space: str) -> Value:
        """position, normal ...: of an input where it is authored, else of the surface."""


Handler = Callable[[Call], Value]
HANDLERS: dict[str, Handler] = {}
"""What compiles a category. One that names no input of its own gives what the surface says."""


def _node(*categories: str) -> Callable[[Handler], Handler]:
    def add(handler: Handler) -> Handler:
        HANDLERS.update(dict.fromkeys(categories, handler))
        return handler

    return add


def _binary(code: str, first: float = 0.0, second: float = 0.0) -> Handler:
    return lambda n: n.make.op(code, n.value("in1", first), n.value("in2", second))


HANDLERS |= {
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


HANDLERS |= {
    "absval": _unary("abs"),
    "floor": _unary("floor"),
    "sign": _unary("sign"),
    "sqrt": _unary("sqrt"),
    "ln": _unary("log", 1.0),
    "exp": _unary("exp"),
    "sin": _unary("sin"),
    "cos": _unary("cos"),
    "acos": _unary("acos"),
    "rgbtohsv": _unary("rgbtohsv"),
    "hsvtorgb": _unary("hsvtorgb"),
    "dot": lambda n: n.value("in"),
    "constant": lambda n: n.value("value"),
    "convert": lambda n: n.value("in"),
}


@_node("tan")
def _tan(n: Call) -> Value:
    x = n.value("in")
    return n.make.op("divide", n.make.op("sin", x), n.make.op("cos", x))


@_node("asin")
def _asin(n: Call) -> Value:
    return n.make.op("subtract", numbers(math.pi / 2), n.make.op("acos", n.value("in")))


@_node("atan2")
def _atan2(n: Call) -> Value:
    y = n.value("iny") if n.has("iny") else n.value("in1")
    return n.make.op("atan2", y, n.value("inx", 1.0) if n.has("inx") else n.value("in2", 1.0))


@_node("ceil")
def _ceil(n: Call) -> Value:
    negated = n.make.op("subtract", numbers(0.0), n.value("in"))
    return n.make.op("subtract", numbers(0.0), n.make.op("floor", negated))


@_node("round")
def _round(n: Call) -> Value:
    return n.make.op("floor", n.make.op("add", n.value("in"), numbers(0.5)))


@_node("fract")
def _fract(n: Call) -> Value:
    x = n.value("in")
    return n.make.op("subtract", x, n.make.op("floor", x))


@_node("safepower")
def _safe_power(n: Call) -> Value:
    x, m = n.value("in1"), n.make
    return m.op("multiply", m.op("sign", x), m.op("power", m.op("abs", x), n.value("in2", 1.0)))


@_node("invert")
def _invert(n: Call) -> Value:
    return n.make.op("subtract", n.value("amount", 1.0), n.value("in"))


@_node("clamp")
def _clamp(n: Call) -> Value:
    return n.make.op("clamp", n.value("in"), n.value("low"), n.value("high", 1.0))


@_node("smoothstep")
def _smoothstep(n: Call) -> Value:
    return n.make.op("smoothstep", n.value("in"), n.value("low"), n.value("high", 1.0))


@_node("magnitude")
def _magnitude(n: Call) -> Value:
    x = n.value("in")
    return n.make.op("sqrt", n.make.op("dot", x, x))


@_node("distance")
def _distance(n: Call) -> Value:
    x = n.make.op("subtract", n.value("in1"), n.value("in2"))
    return n.make.op("sqrt", n.make.op("dot", x, x))


@_node("normalize")
def _normalize(n: Call) -> Value:
    return _unit(n.make, n.value("in"))


def _unit(m: Expressions, x: Value) -> Value:
    return m.op("divide", x, m.op("sqrt", m.op("dot", x, x)))


# ---- adjustment


@_node("remap", "range")
def _remap(n: Call) -> Value:
    m = n.make
    low, high = n.value("outlow"), n.value("outhigh", 1.0)
    x = _ratio(m, n.value("in"), n.value("inlow"), n.value("inhigh", 1.0))
    if n.category == "range":
        inverse = m.op("divide", numbers(1.0), n.value("gamma", 1.0))
        x = m.op("multiply", m.op("sign", x), m.op("power", m.op("abs", x), inverse))
    result = m.op("add", low, m.op("multiply", x, m.op("subtract", high, low)))
    if n.category == "range" and n.has("doclamp"):
        return m.op("select", n.value("doclamp"), m.op("clamp", result, low, high), result)
    return result


def _ratio(m: Expressions, x: Value, low: Value, high: Value) -> Value:
    return m.op("divide", m.op("subtract", x, low), m.op("subtract", high, low))


@_node("luminance")
def _luminance(n: Call) -> Value:
    x = n.value("in")
    grey = n.make.op("dot", fit(x, 3), n.value("lumacoeffs", LUMA, 3))
    return fit(grey, 3) + x[3:4]


@_node("saturate")
def _saturate(n: Call) -> Value:
    x = n.value("in")
    grey = n.make.op("dot", fit(x, 3), n.value("lumacoeffs", LUMA, 3))
    return n.make.op("mix", fit(grey, 3), fit(x, 3), n.value("amount", 1.0)) + x[3:4]


@_node("hsvadjust")
def _hsv_adjust(n: Call) -> Value:
    m, x = n.make, n.value("in")
    amount = n.value("amount", (0.0, 1.0, 1.0), 3)
    h, s, v = m.op("rgbtohsv", fit(x, 3))
    hue = m.op("add", (h,), amount[:1])
    rest = m.op("multiply", (s, v), amount[1:])
    return m.op("hsvtorgb", hue + rest) + x[3:4]


@_node("contrast")
def _contrast(n: Call) -> Value:
    return _contrasted(n.make, n.value("in"), n.value("amount", 1.0), n.value("pivot", 0.5))


def _contrasted(m: Expressions, x: Value, amount: Value, pivot: Value) -> Value:
    return m.op("add", m.op("multiply", m.op("subtract", x, pivot), amount), pivot)


@_node("colorcorrect")
def _color_correct(n: Call) -> Value:
    m, x = n.make, n.value("in", 1.0)
    h, s, v = m.op("rgbtohsv", fit(x, 3))
    hue = m.op("add", (h,), n.value("hue"))
    grey = m.op("hsvtorgb", (*hue, s, v))
    luma = m.op("dot", grey, numbers(*LUMA))
    c = m.op("mix", fit(luma, 3), grey, n.value("saturation", 1.0))
    inverse = m.op("divide", numbers(1.0), n.value("gamma", 1.0))
    c = m.op("multiply", m.op("sign", c), m.op("power", m.op("abs", c), inverse))
    lift = n.value("lift")
    c = m.op("add", m.op("multiply", c, m.op("subtract", numbers(1.0), lift)), lift)
    c = m.op("multiply", c, n.value("gain", 1.0))
    c = _contrasted(m, c, n.value("contrast", 1.0), n.value("contrastpivot", 0.5))
    stops = m.op("power", numbers(2.0), n.value("exposure"))
    return m.op("multiply", c, stops) + x[3:4]


# ---- compositing


@_node("mix")
def _mix(n: Call) -> Value:
    return n.make.op("mix", n.value("bg"), n.value("fg"), n.value("mix"))


def _blend(formula: Callable[[Expressions, Value, Value], Value]) -> Handler:
    def compiled(n: Call) -> Value:
        fg, bg = n.value("fg"), n.value("bg")
        return n.make.op("mix", bg, formula(n.make, fg, bg), n.value("mix", 1.0))

    return compiled


def _screen(m: Expressions, f: Value, b: Value) -> Value:
    one = numbers(1.0)
    return m.op(
        "subtract", one, m.op("multiply", m.op("subtract", one, f), m.op("subtract", one, b))
    )


def _overlay(m: Expressions, f: Value, b: Value) -> Value:
    low = m.op("multiply", numbers(2.0), m.op("multiply", f, b))
    one = numbers(1.0)
    rest = m.op("multiply", m.op("subtract", one, f), m.op("subtract", one, b))
    high = m.op("subtract", one, m.op("multiply", numbers(2.0), rest))
    return m.op("select", m.op("less", f, numbers(0.5)), low, high)


def _burn(m: Expressions, f: Value, b: Value) -> Value:
    one = numbers(1.0)
    return m.op("subtract", one, m.op("divide", m.op("subtract", one, b), f))


HANDLERS |= {
    "plus": _blend(lambda m, f, b: m.op("add", b, f)),
    "minus": _blend(lambda m, f, b: m.op("subtract", b, f)),
    "difference": _blend(lambda m, f, b: m.op("abs", m.op("subtract", b, f))),
    "screen": _blend(_screen),
    "overlay": _blend(_overlay),
    "burn": _blend(_burn),
    "dodge": _blend(lambda m, f, b: m.op("divide", b, m.op("subtract", numbers(1.0), f))),
    "inside": lambda n: n.make.op("multiply", n.value("in"), n.value("mask", 1.0)),
    "outside": lambda n: n.make.op(
        "multiply", n.value("in"), n.make.op("subtract", numbers(1.0), n.value("mask"))
    ),
}


@_node("premult")
def _premult(n: Call) -> Value:
    x = n.value("in", (0.0, 0.0, 0.0, 1.0), 4)
    return n.make.op("multiply", x[:3], x[3:]) + x[3:]


@_node("unpremult")
def _unpremult(n: Call) -> Value:
    x = n.value("in", (0.0, 0.0, 0.0, 1.0), 4)
    return n.make.op("divide", x[:3], x[3:]) + x[3:]


@_node("over")
def _over(n: Call) -> Value:
    f, b, m = n.value("fg", width=4), n.value("bg", width=4), n.make
    under = m.op("multiply", b, m.op("subtract", numbers(1.0), f[3:]))
    return m.op("mix", b, m.op("add", f, under), n.value("mix", 1.0))


# ---- conditions


def _compare(n: Call) -> tuple[Value, Value]:
    return n.value("value1", 1.0), n.value("value2")


def _choice(n: Call, condition: Value) -> Value:
    first, second = n.value("in1"), n.value("in2")
    if not n.has("in1") and not n.has("in2"):  # the variant whose result is true or false
        return condition
    return n.make.op("select", condition, first, second)


@_node("ifgreater")
def _if_greater(n: Call) -> Value:
    a, b = _compare(n)
    return _choice(n, n.make.op("less", b, a))


@_node("ifgreatereq")
def _if_greater_or_equal(n: Call) -> Value:
    a, b = _compare(n)
    return _choice(n, n.make.op("subtract", numbers(1.0), n.make.op("less", a, b)))


@_node("ifequal")
def _if_equal(n: Call) -> Value:
    a, b = _compare(n)
    return _choice(n, n.make.op("equal", a, b))


@_node("switch")
def _switch(n: Call) -> Value:
    which = n.value("which")
    result = fit(numbers(0.0), n.width)
    for i in reversed(range(10)):
        if n.has(f"in{i + 1}"):
            before = n.make.op("less", which, numbers(float(i + 1)))
            result = n.make.op("select", before, n.value(f"in{i + 1}"), result)
        else:
            before = n.make.op("less", which, numbers(float(i + 1)))
            result = n.make.op("select", before, fit(numbers(0.0), n.width), result)
    return result


HANDLERS |= {
    "and": lambda n: n.make.op("multiply", n.value("in1"), n.value("in2")),
    "or": lambda n: n.make.op("max", n.value("in1"), n.value("in2")),
    "xor": lambda n: n.make.op("abs", n.make.op("subtract", n.value("in1"), n.value("in2"))),
    "not": lambda n: n.make.op("subtract", numbers(1.0), n.value("in")),
}


# ---- channels


@_node("combine2", "combine3", "combine4")
def _combine(n: Call) -> Value:
    parts: Value = ()
    for i in range(4):
        if n.has(f"in{i + 1}") or len(parts) < n.width:
            parts += n.value(f"in{i + 1}", (0.0,))
    return parts


@_node("extract")
def _extract(n: Call) -> Value:
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


@_node("separate2", "separate3", "separate4")
def _separate(n: Call) -> Value:
    x = n.value("in")
    names = {"outr": 0, "outx": 0, "outg": 1, "outy": 1, "outb": 2, "outz": 2, "outa": 3, "outw": 3}
    at = names.get(n.output, 0)
    return (x[min(at, len(x) - 1)],)


@_node("swizzle")
def _swizzle(n: Call) -> Value:
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


# ---- places


@_node("rotate2d")
def _rotate2d_node(n: Call) -> Value:
    return _rotated(n.make, n.value("in", width=2), n.value("amount"))


def _rotated(m: Expressions, x: Value, degrees: Value) -> Value:
    """Clockwise, as MaterialX has it."""
    angle = m.op("multiply", degrees, numbers(math.pi / 180))
    c, s = m.op("cos", angle), m.op("sin", angle)
    u = m.op("add", m.op("multiply", x[:1], c), m.op("multiply", x[1:2], s))
    v = m.op("subtract", m.op("multiply", x[1:2], c), m.op("multiply", x[:1], s))
    return u + v


@_node("rotate3d")
def _rotate3d(n: Call) -> Value:
    m, x = n.make, n.value("in", width=3)
    axis = _unit(m, n.value("axis", (0.0, 1.0, 0.0), 3))
    angle = m.op("multiply", n.value("amount"), numbers(math.pi / 180))
    c, s = m.op("cos", angle), m.op("sin", angle)
    along = m.op("multiply", m.op("dot", axis, x), m.op("subtract", numbers(1.0), c))
    turned = m.op("add", m.op("multiply", x, c), m.op("multiply", m.op("cross", axis, x), s))
    return m.op("add", turned, m.op("multiply", axis, along))


@_node("place2d")
def _place2d(n: Call) -> Value:
    return placed(
        n,
        n.coordinates(),
        n.value("pivot", width=2),
        n.number("operationorder", 0.0) != 0,
        n.value("rotate"),
    )


def placed(n: Call, uv: Value, pivot: Value, translate_first: bool, degrees: Value) -> Value:
    """Coordinates about a pivot: divided by scale, turned, less offset; or the other way round."""
    m = n.make
    scale, offset = n.value("scale", 1.0, 2), n.value("offset", width=2)
    x = m.op("subtract", uv, pivot)
    if translate_first:
        x = m.op("divide", _rotated(m, m.op("subtract", x, offset), degrees), scale)
    else:
        x = m.op("subtract", _rotated(m, m.op("divide", x, scale), degrees), offset)
    return m.op("add", x, pivot)


@_node("position", "normal", "tangent", "bitangent")
def _geometric(n: Call) -> Value:
    return n.place(n.category, "", n.text("space", "object"))


@_node("viewdirection")
def _view(n: Call) -> Value:
    m = n.make
    return m.op("subtract", numbers(0.0), n.place("view", "", n.text("space", "world")))


@_node("facingratio")
def _facing(n: Call) -> Value:
    m = n.make
    ratio = m.op("dot", n.place("view", "", "world"), n.place("normal", "normal", "world"))
    if n.number("faceforward", 1.0) != 0:
        ratio = m.op("abs", ratio)
    return m.op("subtract", numbers(1.0), ratio) if n.number("invert", 0.0) != 0 else ratio


# ---- procedures


def _scaled(n: Call, value: Value, pivot: bool = True) -> Value:
    result = n.make.op("multiply", value, n.value("amplitude", 1.0))
    return n.make.op("add", result, n.value("pivot")) if pivot else result


@_node("noise2d")
def _noise2d(n: Call) -> Value:
    return _scaled(n, n.make.op("noise2", n.coordinates(), width=n.width))


@_node("noise3d")
def _noise3d(n: Call) -> Value:
    place = n.place("position", "position", "object")
    return _scaled(n, n.make.op("noise3", place, width=n.width))


@_node("fractal3d", "fractal2d")
def _fractal(n: Call) -> Value:
    if n.category == "fractal2d":
        place = n.coordinates() + numbers(0.0)
    else:
        place = n.place("position", "position", "object")
    octaves = min(max(int(n.number("octaves", 3.0)), 0), 32)
    value = n.make.op(
        "fractal3", place, n.value("lacunarity", 2.0, 1), n.value("diminish", 0.5, 1),
        number=octaves, width=n.width,
    )  # fmt: skip
    return _scaled(n, value, pivot=False)


@_node("cellnoise2d", "cellnoise3d")
def _cells(n: Call) -> Value:
    if n.category == "cellnoise2d":
        return n.make.op("cell2", n.coordinates(), width=n.width)
    return n.make.op("cell3", n.place("position", "position", "object"), width=n.width)


@_node("worleynoise2d", "worleynoise3d")
def _worley(n: Call) -> Value:
    style = int(n.number("style", 0.0))
    jitter = n.value("jitter", 1.0, 1)
    if n.category == "worleynoise2d":
        return n.make.op("worley2", n.coordinates(), jitter, number=style, width=n.width)
    place = n.place("position", "position", "object")
    return n.make.op("worley3", place, jitter, number=style, width=n.width)


@_node("ramplr", "ramptb")
def _ramp(n: Call) -> Value:
    u, v = n.coordinates()
    if n.category == "ramplr":
        ends, at = (n.value("valuel"), n.value("valuer")), (u,)
    else:
        # The specification has the top at v = 1.
        ends, at = (n.value("valueb"), n.value("valuet")), (v,)
    return n.make.op("mix", *ends, n.make.op("clamp", at, numbers(0.0), numbers(1.0)))


@_node("ramp4")
def _ramp4(n: Call) -> Value:
    m, (u, v) = n.make, n.coordinates()
    s, t = (m.op("clamp", (x,), numbers(0.0), numbers(1.0)) for x in (u, v))
    top = m.op("mix", n.value("valuetl"), n.value("valuetr"), s)
    low = m.op("mix", n.value("valuebl"), n.value("valuebr"), s)
    return m.op("mix", low, top, t)


@_node("splitlr", "splittb")
def _split(n: Call) -> Value:
    u, v = n.coordinates()
    centre = n.value("center", 0.5)
    if n.category == "splitlr":
        return n.make.op(
            "select", n.make.op("less", (u,), centre), n.value("valuel"), n.value("valuer")
        )
    return n.make.op(
        "select", n.make.op("less", (v,), centre), n.value("valueb"), n.value("valuet")
    )


@_node("checkerboard")
def _checkerboard(n: Call) -> Value:
    m = n.make
    uv = m.op("multiply", n.coordinates(), n.value("uvtiling", 8.0, 2))
    cell = m.op("floor", m.op("subtract", uv, n.value("uvoffset", width=2)))
    odd = m.op("modulo", m.op("dot", cell, numbers(1.0, 1.0)), numbers(2.0))
    return m.op("mix", n.value("color1", 1.0, n.width), n.value("color2", 0.0, n.width), odd)
