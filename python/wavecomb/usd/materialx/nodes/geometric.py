# SPDX-License-Identifier: Apache-2.0
"""Handlers for MaterialX nodes for positions, primvars, normal maps, spaces, time and patterns.

Let M be the linear part of the object-to-world transform. Graphs can read the rows of M's inverse
(``normal_x``, ``normal_y``, ``normal_z``) and the position in object and world space. The columns
of M are computed as cross products of these rows, divided by the determinant of M's inverse.
"""

from __future__ import annotations

from wavecomb.usd.graphs.surface_parameters import COLOURS, NORMAL, NUMBER, in_working_space
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.materialx.nodes.arithmetic import unit, weighted_sum
from wavecomb.usd.materialx.nodes.node import Handler, NodeCall, adder
from wavecomb.usd.stage.time_codes import frame_number

NODES: dict[str, Handler] = {}
_node = adder(NODES)


@_node("position", "normal", "tangent", "bitangent")
def _geometric(n: NodeCall) -> Value:
    return n.at_place(n.category, n.text("space", "object"))


NODES["viewdirection"] = lambda n: n.at_place("viewdirection", n.text("space", "world"))
NODES["frame"] = lambda n: numbers(frame_number(n.networks.time) or 0.0)


@_node("time")
def _time(n: NodeCall) -> Value:
    stage = n.networks.material.GetStage()
    frame = frame_number(n.networks.time) or 0.0
    return numbers(frame / (stage.GetFramesPerSecond() or 24.0))


# ---- primvars ------------------------------------------------------------------------------------


@_node("texcoord")
def _texcoord(n: NodeCall) -> Value:
    index = int(n.number("index", 0.0))
    return _texture_coordinates(n, f"st{index}" if index else "st")


def _named(name_input: str, fallback: str, usual: str = "") -> Handler:
    """Returns a handler that reads the primvar named by an input; ``usual`` is the default name."""

    def compiled(n: NodeCall) -> Value:
        name = n.text(name_input, usual)
        if n.width == 2:
            return _texture_coordinates(n, name or "st")
        if not name or n.width == 0:
            return n.value(fallback)
        return _primvar(n, name, fallback)

    return compiled


NODES |= {
    "geomcolor": _named("geomprop", "default", "displayColor"),
    "geompropvalue": _named("geomprop", "default"),
    "geompropvalueuniform": _named("geomprop", "default"),
    "UsdPrimvarReader": _named("varname", "fallback"),
}


def _texture_coordinates(n: NodeCall, name: str) -> Value:
    """Returns the mesh's texture coordinates for a material's first UV set, else a primvar."""
    names = n.networks.uv_names
    if names and names[0] != name:
        return n.networks.primvar(name, numbers(0.0, 0.0))
    names.append(name)
    return n.make.input("uv")


def _primvar(n: NodeCall, name: str, fallback: str) -> Value:
    """Returns a primvar of the mesh; for ``geomcolor`` with alpha, alpha is displayOpacity."""
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


# ---- spaces --------------------------------------------------------------------------------------


@_node("normalmap")
def _normal_map(n: NodeCall) -> Value:
    """Returns a normal in tangent space, or the unperturbed normal if there is no normal map."""
    m, n.width = n.make, 3
    texel = n.inputs.find("in", NORMAL)
    if texel is None:
        return numbers(0.0, 0.0, 1.0)
    tilted = m.sub(m.mul(fit(texel, 3), 2.0), 1.0)
    if n.text("space", "tangent") != "tangent":
        return _tangent_of_object(m, tilted)
    return m.mul(tilted[:2], fit(n.value("scale", 1.0, 0), 2)) + tilted[2:]


def _rows(m: Expressions) -> list[Value]:
    """Returns the rows of the inverse of the object-to-world matrix."""
    return [m.input(f"normal_{axis}") for axis in "xyz"]


def _columns(m: Expressions) -> list[Value]:
    """Returns the columns of the object-to-world matrix."""
    a, b, c = _rows(m)
    across = m.op("cross", b, c)
    size = m.op("dot", a, across)
    return [m.div(v, size) for v in (across, m.op("cross", c, a), m.op("cross", a, b))]


def _dots(m: Expressions, vectors: list[Value], v: Value) -> Value:
    return tuple(m.op("dot", one, v)[0] for one in vectors)


def _tangent_of_object(m: Expressions, normal: Value) -> Value:
    """Converts an object-space normal to tangent space.

    The shading normal faces the viewer; if the normal was flipped for this, the map's normal is
    also flipped.
    """
    there = unit(m, weighted_sum(m, _rows(m), fit(normal, 3)))
    frame = [m.input(name) for name in ("tangent", "bitangent", "normal")]
    tilted = _dots(m, frame, there)
    return m.mul(tilted, m.op("select", m.op("less", tilted[2:], 0.0), -1.0, 1.0))


def _spaces(n: NodeCall) -> tuple[bool, bool]:
    """Returns whether the spaces before and after a transform are object space (the default)."""
    start, end = (n.text(name, "") or "object" for name in ("fromspace", "tospace"))
    return start != "world", end != "world"


def _transformed(n: NodeCall, default: tuple[float, ...]) -> Value:
    """Returns the input of a transform node as a number, even if the node drives a normal."""
    found = n.inputs.find("in", NUMBER)
    return fit(numbers(*default) if found is None else found, 3)


@_node("transformnormal", "transformvector")
def _transform(n: NodeCall) -> Value:
    m, is_normal = n.make, n.category == "transformnormal"
    starts, ends = _spaces(n)
    if n.kind == NORMAL and not (starts and not ends):
        return n.value("in", (0.0, 0.0, 1.0), 3)
    v = _transformed(n, (0.0, 0.0, 1.0 if is_normal else 0.0))
    if n.kind == NORMAL:
        # Compute the normal that the transform maps to the vector v.
        if not is_normal:
            v = _dots(m, _columns(m), weighted_sum(m, _columns(m), v))
        return _tangent_of_object(m, v)
    if starts == ends:
        return v
    rows = _rows(m) if is_normal == starts else _columns(m)
    out = weighted_sum(m, rows, v) if starts else _dots(m, rows, v)
    return unit(m, out) if is_normal else out


@_node("transformpoint")
def _transform_point(n: NodeCall) -> Value:
    """Transforms a point relative to the shading point, whose position is known in both spaces."""
    m = n.make
    starts, ends = _spaces(n)
    p = _transformed(n, (0.0, 0.0, 0.0))
    if starts == ends:
        return p
    world, local = n.world_position(), m.input("local_position")
    if starts:
        return m.add(world, weighted_sum(m, _columns(m), m.sub(p, local)))
    return m.add(local, _dots(m, _rows(m), m.sub(p, world)))


# ---- patterns ------------------------------------------------------------------------------------


def _point(n: NodeCall) -> Value:
    """Returns texture coordinates for nodes whose category ends in "2d", else the position."""
    if n.category.endswith("2d"):
        return n.coordinates()
    return n.place("position", "position", "object")


@_node("noise2d", "noise3d")
def _noise(n: NodeCall) -> Value:
    value = n.make.op(f"noise{n.category[-2]}", _point(n), width=n.width)
    return n.make.add(n.make.mul(value, n.value("amplitude", 1.0)), n.value("pivot"))


@_node("fractal2d", "fractal3d")
def _fractal(n: NodeCall) -> Value:
    m, place = n.make, _point(n)
    lacunarity, diminish = n.value("lacunarity", 2.0, 1), n.value("diminish", 0.5, 1)
    octaves = min(max(int(n.number("octaves", 3.0)), 0), 32)
    if n.category == "fractal3d":
        total = m.op("fractal3", place, lacunarity, diminish, number=octaves, width=n.width)
        return m.mul(total, n.value("amplitude", 1.0))
    total, amplitude = numbers(*[0.0] * (n.width or 1)), numbers(1.0)
    for _ in range(octaves):
        total = m.add(total, m.mul(m.op("noise2", place, width=n.width), amplitude))
        amplitude = m.mul(amplitude, diminish)
        place = m.mul(place, lacunarity)
    return m.mul(total, n.value("amplitude", 1.0))


@_node("cellnoise2d", "cellnoise3d")
def _cells(n: NodeCall) -> Value:
    return n.make.op(f"cell{n.category[-2]}", _point(n), width=n.width)


@_node("worleynoise2d", "worleynoise3d")
def _worley(n: NodeCall) -> Value:
    style, jitter = int(n.number("style", 0.0)), n.value("jitter", 1.0, 1)
    code = f"worley{n.category[-2]}"
    return n.make.op(code, _point(n), jitter, number=style, width=n.width)


@_node("ramplr", "ramptb", "splitlr", "splittb")
def _ramp(n: NodeCall) -> Value:
    """Interpolates or splits values along u, or along v with v = 1 at the top."""
    m, (u, v) = n.make, n.coordinates()
    names, at = (("valuel", "valuer"), (u,)) if n.category[-2:] == "lr" else (
        ("valueb", "valuet"), (v,)
    )  # fmt: skip
    if n.category.startswith("split"):
        low = m.op("less", at, n.value("center", 0.5))
        return m.op("select", low, n.value(names[0]), n.value(names[1]))
    return m.op("mix", n.value(names[0]), n.value(names[1]), m.op("clamp", at, 0.0, 1.0))
