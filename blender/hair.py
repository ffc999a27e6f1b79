# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes hair shaders as MaterialX's chiang_hair_bsdf."""

from __future__ import annotations

import math
from typing import Any

from .graph import Value, number
from .nodes import Nodes
from .usda import Prim


def write_hair(n: Nodes, node: Any, material: Prim, path: str) -> None:
    """Writes the material of a Principled Hair BSDF."""
    inputs: dict[str, Any] = {}
    if node.type == "BSDF_HAIR":
        n.approximate("Hair BSDF (a Principled Hair BSDF of its colour)")
        inputs["absorption_coefficient"] = _of_colour(n, n.read(node, "Color", "color3"), 0.3)
        inputs |= _lobes(n, 0.3, 0.3)
    else:
        if getattr(node, "model", "CHIANG") != "CHIANG":
            n.approximate("hair model Huang (Chiang's instead)")
        rough, radial = (_constant(n, node, k, 0.3) for k in ("Roughness", "Radial Roughness"))
        inputs["absorption_coefficient"] = _absorption(n, node, radial)
        inputs |= _lobes(n, rough, radial)
        inputs["ior"] = number(_constant(n, node, "IOR", 1.55))
        # A cuticle_angle of 0.5 means no tilt; 0 and 1 mean a tilt of 90 degrees.
        tilt = _constant(n, node, "Offset", math.radians(2.0))
        inputs["cuticle_angle"] = number(0.5 - tilt / math.pi)
        for name in ("Random Color", "Random Roughness", "Coat"):
            if name in node.inputs and node.inputs[name].default_value:
                n.miss(f"hair input {name}")
    bsdf = n.graph.node("chiang_hair_bsdf", "color3", **inputs)
    prim = n.into.layer.over(bsdf.path.rpartition(".")[0])
    prim.lines[-1] = "token outputs:out"
    surface = n.into.layer.define(f"{path}/WavecombSurface", "Shader")
    surface.set("uniform token info:id", "ND_surface")
    surface.connect("token inputs:bsdf", bsdf.path)
    surface.lines.append("token outputs:out")
    material.connect("token outputs:mtlx:surface", f"{path}/WavecombSurface.outputs:out")


def _constant(n: Nodes, node: Any, name: str, default: float) -> float:
    if name not in node.inputs:
        return default
    value = n.read(node, name, "float")
    if value.constant is None:
        n.miss(f"hair input {name} by a node")
        return default
    return float(value.constant)


def _lobes(n: Nodes, longitudinal: float, azimuthal: float) -> dict[str, Any]:
    """Converts perceptual roughness to the roughness inputs of the BSDF, which are variances."""
    found: dict[str, Any] = {}
    v = (0.726 * longitudinal + 0.812 * longitudinal**2 + 3.7 * longitudinal**20) ** 2
    s = 0.265 * azimuthal + 1.194 * azimuthal**2 + 5.372 * azimuthal**22
    for lobe, factor in (("R", 1.0), ("TT", 0.25), ("TRT", 4.0)):
        found[f"roughness_{lobe}"] = Value("vector2", (v * factor, s))
    return found


def _absorption(n: Nodes, node: Any, radial: float) -> Value:
    kind = node.parametrization
    if kind == "ABSORPTION":
        return n.read(node, "Absorption Coefficient", "vector3")
    if kind == "COLOR":
        return _of_colour(n, n.read(node, "Color", "color3"), radial)
    amount = _constant(n, node, "Melanin", 0.8)
    red = _constant(n, node, "Melanin Redness", 1.0)
    total = -math.log(max(1.0 - amount, 1e-4))
    eumelanin, pheomelanin = total * (1.0 - red), total * red
    sigma = (
        0.506 * eumelanin + 0.343 * pheomelanin,
        0.841 * eumelanin + 0.733 * pheomelanin,
        1.653 * eumelanin + 1.924 * pheomelanin,
    )
    return Value("vector3", sigma)


def _of_colour(n: Nodes, tint: Value, radial: float) -> Value:
    """Absorption of a colour, by the fit of Chiang and others 2016."""
    if tint.constant is None:
        n.miss("hair colour by a node (grey instead)")
    r = radial
    fit = 5.969 - 0.215 * r + 2.532 * r**2 - 10.73 * r**3 + 5.574 * r**4 + 0.245 * r**5
    values = tint.constant or (0.3, 0.3, 0.3)
    return Value("vector3", tuple((math.log(max(v, 1e-5)) / fit) ** 2 for v in values))
