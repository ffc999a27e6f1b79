# SPDX-License-Identifier: GPL-3.0-or-later
"""Translations of arithmetic nodes and of procedural textures with a simple formula."""

from __future__ import annotations

import math
from typing import Any

from .graph import Value, colour, number, vector
from .nodes import Nodes

_TWO = {
    "ADD": "add", "SUBTRACT": "subtract", "MULTIPLY": "multiply", "DIVIDE": "divide",
    "POWER": "power", "MINIMUM": "min", "MAXIMUM": "max", "MODULO": "modulo",
}  # fmt: skip
_ONE = {
    "ABSOLUTE": "absval", "SIGN": "sign", "SQRT": "sqrt", "FLOOR": "floor", "CEIL": "ceil",
    "EXPONENT": "exp", "SINE": "sin", "COSINE": "cos", "TANGENT": "tan", "ARCSINE": "asin",
    "ARCCOSINE": "acos", "ROUND": "round", "FRACT": "fract",
}  # fmt: skip


def _math(n: Nodes, node: Any, socket: Any) -> Value | None:
    g, kind = n.graph, node.operation
    a, b, c = (n.read(node, min(i, len(node.inputs) - 1), "float") for i in range(3))
    if kind in _TWO:
        made = g.node(f"{_TWO[kind]}_float", "float", in1=a, in2=b)
    elif kind in _ONE:
        made = g.node(f"{_ONE[kind]}_float", "float", in_=a)
    elif kind == "MULTIPLY_ADD":
        made = g.op("add", g.op("multiply", a, b), c)
    elif kind in ("LESS_THAN", "GREATER_THAN"):
        low, high = (a, b) if kind == "LESS_THAN" else (b, a)
        made = g.node(
            "ifgreater_float", "float", value1=high, value2=low, in1=number(1), in2=number(0)
        )
    elif kind in ("RADIANS", "DEGREES"):
        factor = math.pi / 180.0 if kind == "RADIANS" else 180.0 / math.pi
        made = g.op("multiply", a, number(factor))
    elif kind == "LOGARITHM":
        logs = [g.node("ln_float", "float", in_=one) for one in (a, b)]
        made = g.node("divide_float", "float", in1=logs[0], in2=logs[1])
    elif kind == "ARCTAN2":
        made = g.node("atan2_float", "float", iny=a, inx=b)
    else:
        return None
    return g.clamped(made) if node.use_clamp else made


def _vector_math(n: Nodes, node: Any, socket: Any) -> Value | None:
    g, kind = n.graph, node.operation
    a, b = n.read(node, 0, "vector3"), n.read(node, 1, "vector3")
    two = {k: _TWO[k] for k in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MINIMUM", "MAXIMUM")}
    if kind in two:
        return g.node(f"{two[kind]}_vector3", "vector3", in1=a, in2=b)
    if kind == "SCALE":
        return g.op("multiply", a, g.to("vector3", n.read(node, "Scale", "float")))
    if kind == "DOT_PRODUCT":
        return g.node("dotproduct_vector3", "float", in1=a, in2=b)
    if kind == "CROSS_PRODUCT":
        return g.node("crossproduct_vector3", "vector3", in1=a, in2=b)
    if kind == "NORMALIZE":
        return g.node("normalize_vector3", "vector3", in_=a)
    if kind in ("LENGTH", "DISTANCE"):
        made = a if kind == "LENGTH" else g.op("subtract", a, b)
        return g.node("magnitude_vector3", "float", in_=made)
    if kind in ("FLOOR", "CEIL", "ABSOLUTE", "FRACTION"):
        name = {"FRACTION": "fract"}.get(kind, _ONE.get(kind, kind.lower()))
        return g.node(f"{name}_vector3", "vector3", in_=a)
    return None


def _map_range(n: Nodes, node: Any, socket: Any) -> Value | None:
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        return None
    g = n.graph
    at, low, high, out_low, out_high = (n.read(node, i, "float") for i in range(5))
    part = g.op("divide", g.op("subtract", at, low), g.op("subtract", high, low))
    if node.clamp:
        part = g.clamped(part)
    return g.op("add", out_low, g.op("multiply", part, g.op("subtract", out_high, out_low)))


def _clamp(n: Nodes, node: Any, socket: Any) -> Value:
    low, high = n.read(node, "Min", "float"), n.read(node, "Max", "float")
    return n.graph.node(
        "clamp_float", "float", in_=n.read(node, "Value", "float"), low=low, high=high
    )


def _where(n: Nodes, node: Any) -> Value | None:
    """Returns the coordinates of a procedural texture."""
    from .node_types import _generated

    return n.read(node, "Vector") if node.inputs["Vector"].links else _generated(n)


def _checker(n: Nodes, node: Any, socket: Any) -> Value | None:
    where = _where(n, node)
    if where is None:
        return None
    g = n.graph
    scaled = g.op("multiply", where, g.to("vector3", n.read(node, "Scale", "float")))
    # The lookup is shifted away from the borders of cells, on which surfaces often lie.
    cells = g.node("floor_vector3", "vector3", in_=g.op("add", scaled, vector((1e-6,) * 3)))
    total = g.node("dotproduct_vector3", "float", in1=cells, in2=vector((1, 1, 1)))
    odd = g.node("modulo_float", "float", in1=total, in2=number(2.0))
    odd = g.node("absval_float", "float", in_=odd)
    if socket.name in ("Fac", "Factor"):
        return odd
    return g.mix(n.read(node, "Color2", "color3"), n.read(node, "Color1", "color3"), odd)


def _gradient(n: Nodes, node: Any, socket: Any) -> Value | None:
    where = _where(n, node)
    g = n.graph
    if where is None:
        return None
    x, y = g.component(where, 0), g.component(where, 1)
    if node.gradient_type == "LINEAR":
        made = x
    elif node.gradient_type == "QUADRATIC":
        positive = g.op("max", x, number(0.0))
        made = g.op("multiply", positive, positive)
    elif node.gradient_type == "DIAGONAL":
        made = g.op("multiply", g.op("add", x, y), number(0.5))
    elif node.gradient_type in ("SPHERICAL", "QUADRATIC_SPHERE"):
        radius = g.node("magnitude_vector3", "float", in_=where)
        made = g.op("max", g.op("subtract", number(0.999999), radius), number(0.0))
        if node.gradient_type == "QUADRATIC_SPHERE":
            made = g.op("multiply", made, made)
    elif node.gradient_type == "RADIAL":
        angle = g.node("atan2_float", "float", iny=y, inx=x)
        made = g.op("add", g.op("multiply", angle, number(0.5 / math.pi)), number(0.5))
    else:
        return None
    made = g.clamped(made)
    return g.to("color3", made) if socket.name == "Color" else made


def _facing(n: Nodes) -> Value:
    g = n.graph
    normal = g.node("normal_vector3", "vector3", space="world")
    view = g.node("viewdirection_vector3", "vector3", space="world")
    cosine = g.node("dotproduct_vector3", "float", in1=normal, in2=view)
    return g.clamped(g.node("absval_float", "float", in_=cosine))


def _fresnel_of(n: Nodes, ior: Value) -> Value:
    """Returns the exact Fresnel reflectance towards the viewer, from outside."""
    g = n.graph
    cosine = _facing(n)
    ior = g.op("max", ior, number(1.00001))
    squares = [g.op("multiply", one, one) for one in (ior, cosine)]
    inner = g.op("add", g.op("subtract", squares[0], number(1.0)), squares[1])
    root = g.node("sqrt_float", "float", in_=g.op("max", inner, number(0.0)))
    a = g.op("divide", g.op("subtract", root, cosine), g.op("add", root, cosine))
    product = g.op("multiply", root, cosine)
    sine = g.op("subtract", number(1.0), squares[1])
    b = g.op("divide", g.op("subtract", product, sine), g.op("add", product, sine))
    one = g.op("add", g.op("multiply", b, b), number(1.0))
    return g.op("multiply", g.op("multiply", g.op("multiply", a, a), number(0.5)), one)


def _fresnel(n: Nodes, node: Any, socket: Any) -> Value:
    return _fresnel_of(n, n.read(node, "IOR", "float"))


def _layer_weight(n: Nodes, node: Any, socket: Any) -> Value | None:
    g = n.graph
    blend = n.read(node, "Blend", "float")
    if socket.name == "Fresnel":
        rest = g.op("max", g.op("subtract", number(1.0), blend), number(1e-5))
        return _fresnel_of(n, g.node("divide_float", "float", in1=number(1.0), in2=rest))
    if blend.constant is None:
        return None
    amount = min(max(float(blend.constant), 0.0), 1.0 - 1e-5)
    power = 2.0 * amount if amount < 0.5 else 0.5 / (1.0 - amount)
    raised = g.node("power_float", "float", in1=_facing(n), in2=number(power))
    return g.op("subtract", number(1.0), raised)


def _wave(n: Nodes, node: Any, socket: Any) -> Value | None:
    if node.inputs["Distortion"].links or node.inputs["Distortion"].default_value != 0.0:
        return None
    where = _where(n, node)
    axes = {"X": (20, 0, 0), "Y": (0, 20, 0), "Z": (0, 0, 20), "DIAGONAL": (10, 10, 10)}
    if where is None or node.wave_type != "BANDS":
        return None
    g = n.graph
    axis = vector(axes[node.bands_direction])
    scaled = g.op("multiply", where, g.to("vector3", n.read(node, "Scale", "float")))
    phase = g.node("dotproduct_vector3", "float", in1=scaled, in2=axis)
    phase = g.op("add", phase, n.read(node, "Phase Offset", "float"))
    if node.wave_profile == "SIN":
        sine = g.node("sin_float", "float", in_=g.op("subtract", phase, number(0.5 * math.pi)))
        made = g.op("add", g.op("multiply", sine, number(0.5)), number(0.5))
    else:
        turns = g.op("multiply", phase, number(0.5 / math.pi))
        part = g.op("subtract", turns, g.node("floor_float", "float", in_=turns))
        if node.wave_profile == "TRI":
            centre = g.op("add", turns, number(0.5))
            near = g.node("floor_float", "float", in_=centre)
            away = g.node("absval_float", "float", in_=g.op("subtract", turns, near))
            part = g.op("multiply", away, number(2.0))
        made = part
    return g.to("color3", made) if socket.name == "Color" else made


TYPES = {
    "MATH": _math,
    "VECT_MATH": _vector_math,
    "MAP_RANGE": _map_range,
    "CLAMP": _clamp,
    "TEX_CHECKER": _checker,
    "TEX_GRADIENT": _gradient,
    "TEX_WAVE": _wave,
    "FRESNEL": _fresnel,
    "LAYER_WEIGHT": _layer_weight,
}
__all__ = ["TYPES", "colour"]
