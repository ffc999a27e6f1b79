# SPDX-License-Identifier: Apache-2.0
"""Specialises value graphs for one mesh by inserting the mesh's primvars and transform."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.graphs.surface_parameters import graphs_of, plain_use, substituted
from wavecomb.usd.graphs.values import (
    OF_SPACE,
    PARAMETERS,
    PRIMVAR,
    Expressions,
    Node,
    Value,
    fit,
    is_constant,
    numbers,
)
from wavecomb.usd.materials.surface import TEXTURED_PARAMETERS

if TYPE_CHECKING:
    from wavecomb.usd.materials.surface import Surface

_LOCAL, _AXES = OF_SPACE[:2], OF_SPACE[2:]

_CONSTANTS = {*TEXTURED_PARAMETERS, "ior"} - {"normal"}
"""Parameters of surfaces, besides the parameters of OpenPBR layers, that may become constants."""


def bound(
    surface: Surface,
    matrix: NDArray[np.float64],
    primvars: Mapping[str, Sequence[float]],
    attributes: Mapping[str, int] = MappingProxyType({}),
) -> Surface:
    """Returns the surface specialised for one mesh.

    Args:
        surface: A surface whose graph reads object space or primvars.
        matrix: (4, 4) transform from the mesh to its group (the world or a prototype), for row
            vectors.
        primvars: Values of the mesh's constant primvars, by name.
        attributes: Numbers of components of the mesh's varying primvars, by name.
    """
    graph = surface.graph
    if graph is None:
        return surface
    make = Expressions()
    turned: dict[str, Value] = {}
    if not np.array_equal(matrix, np.eye(4)):
        turned = _in_object_space(make, matrix)

    def replaced(node: Node, operands: tuple[Value, ...]) -> Value | None:
        if node.code == PRIMVAR:
            name = graph.primvars[node.number]
            if name in attributes:
                width = attributes[name]
                return make.attribute(name, width, operands[0])[: node.width]
            value = primvars.get(name)
            return None if value is None else numbers(*value)[: node.width]
        return turned.get(node.name) if node.code == "input" else None

    parameters: dict[str, Any] = dict(surface.parameters)
    layers = dict(parameters.get("openpbr", {}))
    textures, left = dict(surface.textures), {}
    for parameter, open_value in graph.outputs:
        value = substituted(make, open_value, replaced)
        use = plain_use(value, len(value) == 3) if parameter in TEXTURED_PARAMETERS else None
        plain = value if len(value) > 1 else value[0]
        if use is not None:
            textures[parameter] = use
        elif is_constant(value) and parameter in layers:
            layers[parameter] = plain
        elif is_constant(value) and parameter in _CONSTANTS:
            parameters[parameter] = plain
        else:
            left[parameter] = value
    if layers:
        parameters["openpbr"] = layers
    return replace(
        surface, parameters=parameters, textures=textures, graph=graphs_of(left, graph.primvars)
    )


def with_uv_sets(surface: Surface, sets: Mapping[str, str], own: str) -> Surface:
    """Returns a surface that reads UV primvars instead of the mesh's default texture coordinates.

    Args:
        surface: The surface, which must be a result of ``bound`` if its graph reads primvars.
        sets: UV primvar of each textured parameter, by parameter.
        own: UV primvar of the surface's graph; an empty string means the mesh's default texture
            coordinates.
    """
    make = Expressions()
    mesh = make.input("uv")
    textures, outputs = dict(surface.textures), {}
    for parameter, name in sets.items():
        uv = make.attribute(name, 2, mesh)
        outputs[parameter] = _texel(make, textures.pop(parameter), uv, PARAMETERS[parameter][1])

    def replaced(node: Node, _operands: tuple[Value, ...]) -> Value | None:
        return make.attribute(own, 2, mesh) if own and node.name == "uv" else None

    for parameter, value in surface.graph.outputs if surface.graph is not None else ():
        outputs[parameter] = substituted(make, value, replaced)
    return replace(
        surface,
        textures=textures,
        texture_uvs={},
        graph=graphs_of(dict(sorted(outputs.items())), ()),
    )


def _texel(make: Expressions, use: Mapping[str, Any], uv: Value, width: int) -> Value:
    """Returns the value that a texture use has at the texture coordinates ``uv``."""
    m = use["uv"]
    at = tuple(
        make.op("add", make.op("dot", uv, numbers(*row[:2])), numbers(row[2]))[0]
        for row in (m[:3], m[3:])
    )
    stretch = math.sqrt(max(m[0] ** 2 + m[1] ** 2, m[3] ** 2 + m[4] ** 2))
    texel = make.image(use["texture"], at, stretch)
    channels = range(3) if use["channel"] == "rgb" else ["rgba".index(use["channel"])]
    value, scale, bias = (
        tuple(values[i] for i in channels)
        for values in (texel, numbers(*use["scale"]), numbers(*use["bias"]))
    )
    return fit(make.op("add", make.op("multiply", value, scale), bias), width)


def _in_object_space(make: Expressions, matrix: NDArray[np.float64]) -> dict[str, Value]:
    """Expresses object-space inputs by the inputs in the space of the mesh's group."""
    inverse = np.linalg.pinv(matrix)

    def mapped(vector: Value, rows: NDArray[Any]) -> Value:
        total: Value = numbers(0.0, 0.0, 0.0)
        for part, row in zip(vector, rows, strict=True):
            total = make.op("add", total, make.op("multiply", (part,) * 3, numbers(*row)))
        return total

    def mapped_sum(vectors: Sequence[Value], weights: NDArray[Any]) -> Value:
        total: Value = numbers(0.0, 0.0, 0.0)
        for vector, weight in zip(vectors, weights, strict=True):
            total = make.op("add", total, make.op("multiply", vector, numbers(float(weight))))
        return total

    position = make.op(
        "add", mapped(make.input(_LOCAL[0]), inverse[:3, :3]), numbers(*inverse[3, :3])
    )
    normal = mapped(make.input(_LOCAL[1]), matrix[:3, :3].T)
    length = make.op("sqrt", make.op("dot", normal, normal))
    axes = [make.input(name) for name in _AXES]
    turned = {name: mapped_sum(axes, inverse[:3, i]) for i, name in enumerate(_AXES)}
    return {_LOCAL[0]: position, _LOCAL[1]: make.op("divide", normal, length), **turned}
