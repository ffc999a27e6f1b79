# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that say where on the surface something is, how it is tilted, and when."""

from __future__ import annotations

from wavecomb.usd.graphs.surface import COLOURS, NORMAL, in_working_space
from wavecomb.usd.graphs.values import Value, fit, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder
from wavecomb.usd.materialx.nodes.spaces import tangent_of_object
from wavecomb.usd.stage.times import frame_number

NODES: dict[str, Handler] = {}
_node = adder(NODES)


@_node("position", "normal", "tangent", "bitangent")
def _geometric(n: NodeCall) -> Value:
    return n.at_place(n.category, n.text("space", "object"))


@_node("viewdirection")
def _view(n: NodeCall) -> Value:
    return n.at_place("viewdirection", n.text("space", "world"))


@_node("frame")
def _frame(n: NodeCall) -> Value:
    return numbers(frame_number(n.networks.time) or 0.0)


@_node("time")
def _time(n: NodeCall) -> Value:
    stage = n.networks.material.GetStage()
    frame = frame_number(n.networks.time) or 0.0
    return numbers(frame / (stage.GetFramesPerSecond() or 24.0))


@_node("texcoord")
def _texcoord(n: NodeCall) -> Value:
    index = int(n.number("index", 0.0))
    return _texture_coordinates(n, f"st{index}" if index else "st")


@_node("geomcolor")
def _geomcolor(n: NodeCall) -> Value:
    return _named(n, "geomprop", "default", "displayColor")


@_node("geompropvalue", "geompropvalueuniform")
def _geompropvalue(n: NodeCall) -> Value:
    return _named(n, "geomprop", "default", "")


@_node("UsdPrimvarReader")
def _primvar_reader(n: NodeCall) -> Value:
    return _named(n, "varname", "fallback", "")


def _named(n: NodeCall, named: str, fallback: str, usual: str) -> Value:
    name = n.text(named, usual)
    if n.width == 2:
        return _texture_coordinates(n, name or "st")
    if not name or n.width == 0:
        return n.value(fallback)
    return _primvar(n, name, fallback)


def _texture_coordinates(n: NodeCall, name: str) -> Value:
    """The first set that a material reads is the mesh's; others are read as primvars."""
    names = n.networks.uv_names
    if names and names[0] != name:
        return n.networks.primvar(name, numbers(0.0, 0.0))
    names.append(name)
    return n.make.input("uv")


def _primvar(n: NodeCall, name: str, fallback: str) -> Value:
    """A primvar of the mesh; alpha of its colours is displayOpacity."""
    networks = n.networks
    converts, networks.converts = networks.converts, False
    otherwise = n.value(fallback, width=n.width)
    networks.converts = converts
    if n.category == "geomcolor" and n.width == 4:
        opacity = networks.primvar("displayOpacity", numbers(1.0))
        value = networks.primvar(name, otherwise[:3]) + opacity
    else:
        value = networks.primvar(name, otherwise)
    if converts and n.kind in COLOURS and n.width >= 3:
        return in_working_space(n.make, value, networks.textures.working)
    return value


@_node("normalmap")
def _normal_map(n: NodeCall) -> Value:
    """A normal in tangent space; of a map that is flat, the surface's own."""
    m, n.width = n.make, 3
    texel = n.inputs.find("in", NORMAL)
    if texel is None:
        return numbers(0.0, 0.0, 1.0)
    tilted = m.op("subtract", m.op("multiply", fit(texel, 3), numbers(2.0)), numbers(1.0))
    if n.text("space", "tangent") != "tangent":
        return tangent_of_object(m, tilted)
    scale = n.value("scale", 1.0, 0)
    return m.op("multiply", tilted[:2], fit(scale, 2)) + tilted[2:]
