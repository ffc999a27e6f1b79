# SPDX-License-Identifier: Apache-2.0
"""Handlers for Arnold nodes: images, normal maps, arithmetic and user data.

Names and defaults follow Arnold's reference; node categories are Arnold's node ids with the prefix
``arnold_``.
"""

from __future__ import annotations

import math

from wavecomb.usd.graphs.surface_parameters import NORMAL, NUMBER
from wavecomb.usd.graphs.values import Value, fit, numbers
from wavecomb.usd.materialx.nodes.images import read_image
from wavecomb.usd.materialx.nodes.node import Handler, NodeCall, adder

PREFIX = "arnold:"

NODES: dict[str, Handler] = {}
_node = adder(NODES)

_WRAPS = {"periodic": "repeat", "black": "black", "clamp": "clamp", "mirror": "mirror"}
_SPACES = {"auto": "", "linear": "lin_rec709", "Raw": "raw"}
_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def category_of(identifier: str) -> str:
    """Returns the node category for an id such as ``arnold:image``; empty for other ids."""
    return f"arnold_{identifier.removeprefix(PREFIX)}" if identifier.startswith(PREFIX) else ""


@_node("arnold_image")
def _image(n: NodeCall) -> Value:
    m = n.make
    name = n.text("uvset", "")
    uv = n.inputs.find("uvcoords", NUMBER)
    if uv is None:
        uv = n.at_place("texcoord", "") if not name else n.networks.primvar(name, numbers(0, 0))
    u, v = fit(uv, 2)[:1], fit(uv, 2)[1:]
    if n.number("swap_st", 0.0):
        u, v = v, u
    placed: Value = ()
    for axis, part in (("s", u), ("t", v)):
        part = m.mul(part, numbers(n.number(f"{axis}scale", 1.0)))
        if n.number(f"{axis}flip", 0.0):
            part = m.sub(1.0, part)
        placed += m.add(part, numbers(n.number(f"{axis}offset", 0.0)))
    wraps = [_WRAPS.get(n.text(f"{axis}wrap", "periodic"), "repeat") for axis in "st"]
    said = n.text("color_space", "auto")
    texel = read_image(
        n, placed, wraps, "missing_texture_color", False,
        name="filename", space=_SPACES.get(said, said),
    )  # fmt: skip
    if n.kind != NORMAL:
        rgb = m.mul(texel[:3], fit(n.value("multiply", _WHITE), 3))
        texel = m.add(rgb, fit(n.value("offset", _BLACK), 3)) + texel[3:]
    return _of_output(n, texel)


def _of_output(n: NodeCall, texel: Value) -> Value:
    """Returns the component that the node's output names, or all components."""
    if n.output in ("r", "g", "b", "a"):
        n.width = 1
        return (texel["rgba".index(n.output)],)
    n.width = n.width or len(texel)
    return texel


@_node("arnold_normal_map")
def _normal_map(n: NodeCall) -> Value:
    m, n.width = n.make, 3
    texel = n.inputs.find("input", NORMAL)
    if texel is None or not n.number("tangent_space", 1.0):
        if texel is not None:
            n.networks.report.missing("arnold:normal_map of another space", n.inputs.path)
        return numbers(0.0, 0.0, 1.0)
    tilted = fit(texel, 3)
    if n.number("color_to_signed", 1.0):
        tilted = m.sub(m.mul(tilted, 2.0), 1.0)
    sides = (n.number("strength", 1.0), n.number("strength", 1.0))
    turned = [-1.0 if n.number(f"invert_{axis}", 0.0) else 1.0 for axis in "xy"]
    scale = tuple(side * sign for side, sign in zip(sides, turned, strict=True))
    return m.mul(tilted[:2], numbers(*scale)) + tilted[2:]


def _binary(code: str, first: float, second: float) -> Handler:
    return lambda n: n.make.op(code, n.value("input1", first), n.value("input2", second))


NODES |= {
    "arnold_add": _binary("add", 0.0, 0.0),
    "arnold_subtract": _binary("subtract", 0.0, 0.0),
    "arnold_multiply": _binary("multiply", 1.0, 1.0),
    "arnold_divide": _binary("divide", 1.0, 1.0),
    "arnold_min": _binary("min", 1.0, 1.0),
    "arnold_max": _binary("max", 1.0, 1.0),
}


@_node("arnold_mix_rgba", "arnold_mix_float", "arnold_mix_rgb")
def _mix(n: NodeCall) -> Value:
    first, second = n.value("input1", 0.0), n.value("input2", 1.0)
    width = max(len(first), len(second))
    first, second, m = fit(first, width), fit(second, width), n.make
    mixed = m.mul(m.sub(second, first), n.value("mix", 0.5, 1))
    return m.add(first, mixed)


@_node("arnold_flat")
def _flat(n: NodeCall) -> Value:
    return n.value("color", _WHITE)


@_node("arnold_color_correct")
def _color_correct(n: NodeCall) -> Value:
    """Applies gamma, exposure, multiply and add; reports hue, saturation and contrast."""
    m, x = n.make, n.value("input", _BLACK)
    rgb = fit(x, 3)
    neutral = (("hue_shift", 0.0), ("saturation", 1.0), ("contrast", 1.0), ("mask", 1.0))
    for name, nothing in neutral:
        if n.inputs.has(name) and n.number(name, nothing) != nothing:
            n.networks.report.missing(f"arnold:color_correct input {name}", n.inputs.path)
    gamma = n.number("gamma", 1.0)
    if gamma > 0 and gamma != 1.0:
        rgb = m.op("power", m.op("max", rgb, 0.0), numbers(1.0 / gamma))
    rgb = m.mul(rgb, numbers(math.pow(2.0, n.number("exposure", 0.0))))
    rgb = m.mul(rgb, fit(n.value("multiply", _WHITE), 3))
    return m.add(rgb, fit(n.value("add", _BLACK), 3)) + x[3:4]


@_node("arnold_user_data_rgb", "arnold_user_data_rgba", "arnold_user_data_float")
def _user_data(n: NodeCall) -> Value:
    width = 1 if n.category.endswith("float") else 4 if n.category.endswith("rgba") else 3
    default = n.value("default", 0.0, width)
    name = n.text("attribute", "")
    return n.networks.primvar(name, default) if name else default
