# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of OpenPBR for subsurface scattering."""

from __future__ import annotations

import math
from typing import Any

from .graph import Value, colour, number, vector
from .neutral import Surface, is_zero
from .nodes import Nodes

Colour = tuple[float, ...]


def subsurface(n: Nodes, node: Any, found: Surface, base: Value) -> None:
    """Sets the subsurface inputs of a Principled BSDF."""
    weight = n.graph.clamped(n.read(node, "Subsurface Weight", "float"))
    found["subsurface_weight"] = weight
    if is_zero(weight):
        return
    found["subsurface_color"] = base
    # The name of this socket is only "IOR" in some versions.
    socket = next((one for one in node.inputs if one.identifier == "Subsurface IOR"), None)
    ior = 1.4 if socket is None else n.socket(socket, "float").constant
    _radius(n, node, found, "Subsurface ", node.subsurface_method, ior or 1.4)
    found["subsurface_scatter_anisotropy"] = n.read(node, "Subsurface Anisotropy", "float")


def scattering(n: Nodes, node: Any, found: Surface) -> None:
    """Sets the subsurface inputs of a Subsurface Scattering shader."""
    found["subsurface_weight"] = number(1.0)
    found["subsurface_color"] = n.read(node, "Color", "color3")
    ior = n.read(node, "IOR", "float").constant if "IOR" in node.inputs else None
    _radius(n, node, found, "", node.falloff, ior or 1.4)
    if "Anisotropy" in node.inputs:
        found["subsurface_scatter_anisotropy"] = n.read(node, "Anisotropy", "float")


def _radius(n: Nodes, node: Any, found: Surface, prefix: str, method: str, ior: float) -> None:
    """Sets the mean free path, which Cycles derives from the radius by a method."""
    radius = n.read(node, f"{prefix}Radius", "vector3")
    scale = n.read(node, f"{prefix}Scale", "float")
    if radius.constant is None or scale.constant is None:
        n.miss("subsurface radius by a node")
        radius, scale = vector((1.0, 0.2, 0.1)), number(0.05)
    if method == "BURLEY":
        n.approximate("subsurface method Christensen-Burley (a random walk instead)")
    factors: Colour = (0.25 / math.pi,) * 3
    if method == "RANDOM_WALK_SKIN":
        tint = found["subsurface_color"].constant
        if tint is None:
            n.approximate("free path of a skin whose colour is a node (that of grey)")
        factors = tuple(_path_of_albedo(albedo, ior) for albedo in tint or (0.5,) * 3)
    found["subsurface_radius"] = scale
    paths = [r * f for r, f in zip(radius.constant, factors, strict=True)]
    found["subsurface_radius_scale"] = colour(paths)


def _path_of_albedo(albedo: float, ior: float) -> float:
    """Returns mean free path over diffuse mean free path, by the dipole (Jensen et al. 2001)."""
    fresnel = (-1.44 / ior + 0.71) / ior + 0.668 + 0.0636 * ior
    a = (4.0 / 3.0) * (1.0 + fresnel) / (1.0 - fresnel)
    low, high = 0.0, 1.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        s = math.sqrt(3.0 * (1.0 - middle))
        reflectance = 0.5 * middle * (1.0 + math.exp(-a * s)) * math.exp(-s)
        low, high = (middle, high) if reflectance < albedo else (low, middle)
    return math.sqrt(3.0 * (1.0 - 0.5 * (low + high)))
