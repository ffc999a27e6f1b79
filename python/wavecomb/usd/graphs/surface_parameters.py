# SPDX-License-Identifier: Apache-2.0
"""Maps value graphs to surface parameters as constants, plain textures or compiled graphs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from pxr import Usd, UsdShade

from wavecomb.image.working_space import from_rec709
from wavecomb.usd.graphs.values import (
    OF_SPACE,
    PARAMETERS,
    POINT_SIZE,
    PRIMVAR,
    Expressions,
    Graph,
    GraphTooLarge,
    Node,
    Part,
    Value,
    assemble,
    fit,
    is_constant,
    nodes_of,
    numbers,
)
from wavecomb.usd.materials.surface import (
    COLOUR_PARAMETERS,
    TEXTURED_PARAMETERS,
    Surface,
    SurfaceGraph,
)
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.report import LoadReport

BASE, COLOUR, NUMBER, NORMAL = "base", "colour", "number", "normal"
"""Uses of a value, as base colour, another colour, a number or a tangent-space normal."""
COLOURS = (BASE, COLOUR)

_SAMPLES = 8
"""Number of sample points along u and v at which graphs are evaluated for estimates."""


class Networks(Protocol):
    """Interface that evaluates the shader networks of one material."""

    make: Expressions
    material: Usd.Prim
    primvars: list[str]
    report: LoadReport
    textures: TextureTable
    uv_names: list[str]

    def input(self, shader: UsdShade.Shader, name: str, kind: str) -> Value | None:
        """Returns the value of an input; None if the input has no valid connection or value."""

    def node(self, shader: UsdShade.Shader, output: str, kind: str) -> Value | None:
        """Returns the value of a node's output."""

    def in_working_space(self) -> Networks:
        """Returns a copy with constants in the working space, which reports no problems."""


Replaced = Callable[[Node, tuple[Value, ...]], Value | None]
"""Callback that gets a node and its rebuilt operands, and returns a new value or None to keep the
node."""


def substituted(make: Expressions, value: Value, replaced: Replaced) -> Value:
    """Rebuilds a value with some nodes replaced.

    Placeholders of primvars are replaced by their default, unless the callback replaces them.
    """
    done: dict[Node, Value] = {}

    def part_of(part: Part) -> Part:
        return part if isinstance(part, float) else done[part[0]][part[1]]

    for node in nodes_of(value):
        operands = tuple(tuple(part_of(part) for part in one) for one in node.operands)
        new = replaced(node, operands)
        if new is None:
            new = operands[0] if node.code == PRIMVAR else make.with_operands(node, operands)
        done[node] = fit(new, node.results)
    return tuple(part_of(part) for part in value)


def in_working_space(make: Expressions, value: Value, working: str) -> Value:
    """Converts a colour from linear Rec.709 to the working space.

    Components after r, g and b are unchanged.
    """
    if working == "rec709":
        return value
    matrix = from_rec709(np.eye(3), working)
    rgb = tuple(
        make.op("dot", value[:3], numbers(*(float(x) for x in matrix[:, i])))[0] for i in range(3)
    )
    return rgb + value[3:]


def uv_matrix(uv: Value) -> tuple[float, ...] | None:
    """Returns m with u' = m[0] u + m[1] v + m[2], v' = m[3] u + ...; None if not affine."""
    rows: list[float] = []
    for part in uv:
        found: Linear | None = linear(part, _is_uv)
        if found is None:
            return None
        terms, constant = found
        weights = [0.0, 0.0]
        for (_, component), k in terms.items():
            weights[component] = k
        rows += [*weights, constant]
    return tuple(rows)


def _is_uv(node: Node) -> bool:
    return node.code == "input" and node.number == 0


def sampled(value: Value) -> Any:
    """Evaluates a value at sample points, (n, components); textures count as white."""
    points = np.zeros((_SAMPLES * _SAMPLES, POINT_SIZE), np.float32)
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    points[:, 0], points[:, 1] = (axis.ravel() for axis in np.meshgrid(steps, steps))
    points[:, [3, 4, 6, 7]] = np.tile(points[:, :2], 2)
    points[:, [11, 14, 15, 20]] = points[:, 21::4] = 1.0
    ready = substituted(Expressions(), value, _as_it_is)
    return assemble(dict(enumerate(ready))).run(points)


def plain_use(value: Value, wide: bool) -> dict[str, Any] | None:
    """Returns the texture use that equals a value (texel * scale + bias, affine UVs), or None."""
    found = [linear(part, lambda node: node.code == "image") for part in value]
    if any(one is None or len(one[0]) != 1 for one in found):
        return None
    leaves: list[tuple[Node, int]] = []
    scale, bias = [], []
    for one in found:
        assert one is not None
        ((leaf, k),) = one[0].items()
        leaves.append(leaf)
        scale.append(k)
        bias.append(one[1])
    node, first = leaves[0]
    channels = [component for _, component in leaves]
    if any(other is not node for other, _ in leaves):
        return None
    matrix = uv_matrix(node.operands[0])
    if matrix is None or node.image is None:
        return None
    alike = len(set(zip(channels, scale, bias, strict=True))) == 1
    if alike:
        scale, bias = [scale[0]] * 3, [bias[0]] * 3
    elif channels != [0, 1, 2] or not wide:
        return None
    alpha = (scale[0], bias[0]) if alike and first == 3 else (1.0, 0.0)
    return {
        "texture": node.image[0],
        "channel": "rgba"[first] if alike else "rgb",
        "scale": (*scale, alpha[0]),
        "bias": (*bias, alpha[1]),
        "uv": matrix,
    }


class Drivers:
    """The values that drive the parameters of one surface shader."""

    def __init__(self, networks: Networks) -> None:
        self.networks = networks
        self.textured: dict[str, dict[str, Any]] = {}
        self._outputs: dict[str, Value] = {}
        self._converted: Networks | None = None

    @property
    def uv_names(self) -> tuple[str, ...]:
        """Names of the UV primvars that are read, in order of first use."""
        return tuple(dict.fromkeys(self.networks.uv_names))

    def value(self, shader: UsdShade.Shader, name: str, parameter: str) -> Value | None:
        """Returns the value of an input that drives a parameter; None if the input is not set.

        Constant colours are in linear Rec.709; varying colours are in the working space.
        """
        return self._read(parameter, lambda networks, kind: networks.input(shader, name, kind))

    def output(self, shader: UsdShade.Shader, output: str, parameter: str) -> Value | None:
        """Returns the value of a node's output, in the same colour spaces as ``value``."""
        return self._read(parameter, lambda networks, kind: networks.node(shader, output, kind))

    def _read(self, parameter: str, read: Callable[[Networks, str], Value | None]) -> Value | None:
        kind = kind_of(parameter)
        value = read(self.networks, kind)
        if value is None or is_constant(value) or kind not in COLOURS:
            return value
        if self.networks.textures.working == "rec709":
            return value
        if self._converted is None:
            self._converted = self.networks.in_working_space()
        return read(self._converted, kind)

    def scaled(self, value: Value, by: Value) -> Value:
        """Multiplies two values; multiplies constants in double precision."""
        if is_constant(value) and is_constant(by):
            factors = by * len(value) if len(by) == 1 else by
            return tuple(
                float(a) * float(b)  # type: ignore[arg-type]
                for a, b in zip(value, factors, strict=True)
            )
        return self.networks.make.op("multiply", value, by)

    def put(self, parameter: str, value: Value) -> tuple[float, ...] | None:
        """Stores a parameter's value as texture or graph; returns a constant value instead."""
        width = PARAMETERS[parameter][1]
        value = fit(value, width)
        if is_constant(value):
            return tuple(float(part) for part in value)  # type: ignore[arg-type]
        use = plain_use(value, width == 3) if parameter in TEXTURED_PARAMETERS else None
        if use is not None:
            self.textured[parameter] = use
        else:
            self._outputs[parameter] = value
        return None

    def surface(self, program: str, parameters: dict[str, Any]) -> Surface:
        """Returns the surface with these constants and the stored textures and graph."""
        return Surface(
            str(self.networks.material.GetPath()),
            program,
            parameters,
            self.textured,
            self.uv_names,
            graph=self.graph(),
        )

    def graph(self) -> SurfaceGraph | None:
        """Returns the graph of all parameters that neither constants nor plain textures drive.

        Returns None if there are no such parameters. If the graph is too large, the last parameters
        are left out with a message.
        """
        left = dict(self._outputs)
        while left:
            try:
                return graphs_of(left, tuple(self.networks.primvars))
            except GraphTooLarge as error:
                name, _ = left.popitem()
                what = f"shading network too large for {name} ({error}): left out"
                self.networks.report.missing(what, self.networks.material.GetPath())
        return None


def graphs_of(outputs: Mapping[str, Value], primvars: tuple[str, ...]) -> SurfaceGraph | None:
    """Compiles the graphs of parameters with default primvars; None if there are no parameters.

    Raises:
        GraphTooLarge: The graph exceeds the size limit.
    """
    if not outputs:
        return None
    make = Expressions()
    ready = {name: substituted(make, v, _as_it_is) for name, v in outputs.items()}
    whole = _of(ready)
    opacity = _of({"opacity": ready["opacity"]}) if "opacity" in ready else None
    emission = _of({"emission": ready["emission"]}) if "emission" in ready else None
    seen = float(sampled(ready["emission"]).max()) if emission else 0.0
    nodes = nodes_of([part for value in outputs.values() for part in value])
    wanted = {node.number for node in nodes if node.code == PRIMVAR}
    local = any(node.name in OF_SPACE for node in nodes)
    names = primvars if wanted else ()
    return SurfaceGraph(
        whole, opacity, emission, seen, names, local, tuple(sorted(outputs.items()))
    )


def _as_it_is(_node: Node, _operands: tuple[Value, ...]) -> Value | None:
    return None


def kind_of(parameter: str) -> str:
    """Returns ``BASE``, ``COLOUR``, ``NUMBER`` or ``NORMAL`` for a surface parameter."""
    if parameter == "base_color":
        return BASE
    if parameter == "normal":
        return NORMAL
    return COLOUR if parameter in COLOUR_PARAMETERS or parameter.endswith("_color") else NUMBER


def _of(outputs: Mapping[str, Value]) -> Graph:
    parts: dict[int, Part] = {}
    for parameter, value in outputs.items():
        first, _ = PARAMETERS[parameter]
        parts |= {first + i: part for i, part in enumerate(value)}
    return assemble(parts)


Linear = tuple[dict[tuple[Node, int], float], float]


def linear(part: Part, is_leaf: Callable[[Node], bool]) -> Linear | None:
    """Returns a component as a linear combination of components of other nodes plus a constant.

    Returns None if the component is not linear.
    """
    known: dict[tuple[Node, int], Linear | None] = {}

    def of(one: Part) -> Linear | None:
        return ({}, one) if isinstance(one, float) else known[one]

    for node in nodes_of([part]):
        for i in range(node.results):
            if is_leaf(node):
                known[node, i] = {(node, i): 1.0}, 0.0
            elif node.code in _LINEAR:
                known[node, i] = _combined(node.code, *(of(value[i]) for value in node.operands))
            else:
                known[node, i] = None
    return of(part)


def _combined(code: str, a: Linear | None, b: Linear | None) -> Linear | None:
    if a is None or b is None:
        return None
    if code == "multiply" and not a[0]:
        return _scaled(b, a[1])
    if code == "multiply":
        return None if b[0] else _scaled(a, b[1])
    if code == "divide":
        return None if b[0] or b[1] == 0.0 else _scaled(a, 1.0 / b[1])
    return _sum(a, b, 1.0 if code == "add" else -1.0)


_LINEAR = ("add", "subtract", "multiply", "divide")


def _scaled(a: Linear, scale: float) -> Linear:
    return {leaf: k * scale for leaf, k in a[0].items()}, a[1] * scale


def _sum(a: Linear, b: Linear, sign: float) -> Linear:
    terms = dict(a[0])
    for leaf, k in b[0].items():
        terms[leaf] = terms.get(leaf, 0.0) + sign * k
    return terms, a[1] + sign * b[1]
