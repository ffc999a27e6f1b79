# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolates two surfaces, as the Mix Shader node does."""

from __future__ import annotations

from .graph import Value, number
from .neutral import Surface, is_zero
from .nodes import Nodes


def mixed(n: Nodes, a: Surface, b: Surface, factor: Value) -> Surface:
    """Interpolates two surfaces: exactly if each has one lobe, else by averaging their inputs."""
    g = n.graph
    rest = g.op("subtract", number(1.0), factor) if factor.constant is None else None
    rest = rest or number(1.0 - factor.constant)
    for one, other, share in ((a, b, rest), (b, a, factor)):
        if is_zero(other["geometry_opacity"]):
            opacity = _product(n, one["geometry_opacity"], share)
            return {**one, "geometry_opacity": opacity}
    if _is_thin(a) != _is_thin(b):
        translucent = _translucency(n, a, b, factor, rest)
        if translucent is not None:
            return translucent
        n.approximate("mix of a thin and a solid surface")
    a, b = dict(a), dict(b)
    _separate_colours(a, b)
    found: Surface = {}
    for key in {**a, **b}:
        left, right = a.get(key), b.get(key)
        if left is None or right is None or key in ("geometry_normal", "geometry_thin_walled"):
            if left != right and left is not None and right is not None:
                n.approximate("mix of shaders with different normals (the first one's)")
            found[key] = left if left is not None else right  # type: ignore[assignment]
        else:
            found[key] = g.mix(left, right, factor)
    if _differs(a, b):
        n.approximate("mix of two layered shaders (their inputs are averaged)")
    return found


def _is_thin(one: Surface) -> bool:
    return "geometry_thin_walled" in one


def _translucency(n: Nodes, a: Surface, b: Surface, factor: Value, rest: Value) -> Surface | None:
    """Returns a mix of diffuse and translucent shaders as an anisotropic thin wall, or None."""
    thin, solid, share = (a, b, rest) if _is_thin(a) else (b, a, factor)
    if is_zero(thin["subsurface_weight"]) or not is_zero(solid["specular_weight"]):
        return None
    tint = n.graph.mix(solid["base_color"], thin["subsurface_color"], share)
    found = dict(thin, subsurface_color=tint)
    spread = n.graph.op("multiply", share, number(2.0)) if share.constant is None else None
    found["subsurface_scatter_anisotropy"] = (
        number(2.0 * share.constant - 1.0)
        if spread is None
        else n.graph.op("subtract", spread, number(1.0))
    )
    return found


def _separate_colours(a: Surface, b: Surface) -> None:
    """Moves the colour of a diffuse surface to the subsurface lobe, with radius 0.

    The base colour can then hold the colour of the metal that the surface is mixed with.
    """
    for one, other in ((a, b), (b, a)):
        is_metal = other["base_metalness"].constant == 1.0
        if is_metal and is_zero(one["base_metalness"]) and is_zero(one["subsurface_weight"]):
            one["subsurface_color"] = one["base_color"]
            one["subsurface_weight"] = number(1.0)
            one["base_color"] = other["base_color"]
            other["subsurface_weight"], other["subsurface_color"] = (
                number(1.0),
                one["subsurface_color"],
            )
            if is_zero(one["specular_weight"]):
                # An interface of index 1 reflects nothing, and the weight of the metal's
                # reflection, which OpenPBR shares with it, remains 1.
                one["specular_weight"] = other["specular_weight"]
                one["specular_ior"] = other["specular_ior"] = number(1.0)
                for key in ("specular_roughness", "specular_color"):
                    one[key] = other[key]
            return


def _differs(a: Surface, b: Surface) -> bool:
    """Returns whether two surfaces differ in more than the weights of lobes."""
    weights = {"base_weight", "emission_color", "base_metalness", "transmission_weight"}
    changed = {k for k in a if k in b and a[k] != b[k]} - weights - {"geometry_opacity"}
    if is_zero(a["base_weight"]) or is_zero(b["base_weight"]):
        changed -= {"base_color", "specular_weight"}
    return bool(changed - {"specular_weight", "subsurface_weight"})


def _product(n: Nodes, a: Value, b: Value) -> Value:
    if a.constant is not None and b.constant is not None:
        return number(a.constant * b.constant)
    if a.constant == 1.0:
        return b
    return n.graph.op("multiply", a, b)
