# SPDX-License-Identifier: GPL-3.0-or-later
"""Translates Blender's shader nodes to inputs of OpenPBR."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .graph import Value, colour, number
from .mixtures import mixed
from .neutral import BLACK, NEUTRAL, Surface, is_zero
from .nodes import Nodes
from .normals import normal_of
from .subsurface import scattering, subsurface


def surface_of(n: Nodes, socket: Any) -> Surface | None:
    """Returns the surface that drives a shader socket; None if nothing drives the socket."""
    found = n.shader(socket)
    if found is None:
        return None
    node, groups = found
    before = list(n._groups)
    n.within(groups)
    try:
        if node.mute:
            link = next((k for k in node.internal_links if k.to_socket.type == "SHADER"), None)
            return None if link is None else surface_of(n, link.from_socket)
        made = SHADERS.get(node.type)
        if made is None:
            n.miss(f"shader {node.bl_label} (a white diffuse surface instead)")
            return dict(NEUTRAL)
        return made(n, node)
    finally:
        n.within(before)


def _normal(n: Nodes, node: Any, found: Surface) -> None:
    socket = node.inputs.get("Normal")
    if socket is not None and socket.links:
        value = normal_of(n, socket)
        if value is not None:
            found["geometry_normal"] = value


# ---- the Principled BSDF -------------------------------------------------------------------------


def _principled(n: Nodes, node: Any) -> Surface:
    found = dict(NEUTRAL)
    base = n.read(node, "Base Color", "color3")
    found["base_color"] = n.graph.op("max", base, BLACK) if base.constant is None else base
    found["base_metalness"] = n.graph.clamped(n.read(node, "Metallic", "float"))
    found["specular_roughness"] = n.graph.clamped(n.read(node, "Roughness", "float"))
    if "Diffuse Roughness" in node.inputs:
        found["base_diffuse_roughness"] = n.read(node, "Diffuse Roughness", "float")
    found["specular_color"] = n.read(node, "Specular Tint", "color3")
    _specular(n, node, found)
    _anisotropy(n, node, found)
    _transmission(n, node, found, base)
    subsurface(n, node, found, base)
    _coat(n, node, found)
    _sheen(n, node, found)
    _film(n, node, found)
    _emission_of(n, node, found)
    found["geometry_opacity"] = n.graph.clamped(n.read(node, "Alpha", "float"))
    _normal(n, node, found)
    return found


def _specular(n: Nodes, node: Any, found: Surface) -> None:
    """Translates Specular IOR Level, which scales reflectance at normal incidence (0.5: by 1)."""
    ior = n.read(node, "IOR", "float")
    level = n.read(node, "Specular IOR Level", "float")
    found["specular_weight"] = number(1.0)
    found["specular_ior"] = ior
    if level.constant == 0.5:
        return
    if ior.constant is None or level.constant is None:
        found["specular_weight"] = n.graph.op("multiply", level, number(2.0))
        return
    f0 = ((ior.constant - 1.0) / (ior.constant + 1.0)) ** 2 * 2.0 * max(level.constant, 0.0)
    root = min(f0, 0.999) ** 0.5
    scaled = (1.0 + root) / (1.0 - root)
    if is_zero(n.read(node, "Transmission Weight", "float")):
        found["specular_ior"] = number(scaled)
        return
    found["specular_weight"] = number(2.0 * level.constant)
    if level.constant > 0.5:
        n.approximate("Specular IOR Level above 0.5 with transmission")


def _anisotropy(n: Nodes, node: Any, found: Surface) -> None:
    amount = n.read(node, "Anisotropic", "float")
    if is_zero(amount):
        return
    if amount.constant is None:
        n.miss("anisotropy by a node")
        return
    # Blender has alpha_x = alpha / aspect and alpha_y = alpha * aspect, with aspect = sqrt(1 - 0.9
    # a). OpenPBR has alpha_y / alpha_x = 1 - anisotropy and (alpha_x^2 + alpha_y^2) / 2 = alpha^2.
    aspect = (1.0 - 0.9 * min(max(amount.constant, 0.0), 1.0)) ** 0.5
    ratio = aspect * aspect
    found["specular_roughness_anisotropy"] = number(1.0 - ratio)
    scale = ((1.0 / ratio + ratio) / 2.0) ** 0.25
    rough = found["specular_roughness"]
    found["specular_roughness"] = n.graph.clamped(n.graph.op("multiply", rough, number(scale)))
    if rough.constant is not None:
        found["specular_roughness"] = number(min(rough.constant * scale, 1.0))
    rotation = n.read(node, "Anisotropic Rotation", "float")
    if not is_zero(rotation) or node.inputs["Tangent"].links:
        n.miss("anisotropic rotation and tangent")


def _transmission(n: Nodes, node: Any, found: Surface, base: Value) -> None:
    weight = n.graph.clamped(n.read(node, "Transmission Weight", "float"))
    found["transmission_weight"] = weight
    if not is_zero(weight):
        found["transmission_color"] = _root(n, base)


def _root(n: Nodes, value: Value) -> Value:
    """Returns the square root of a colour, since light crosses two surfaces of glass."""
    if value.constant is not None:
        return colour([max(v, 0.0) ** 0.5 for v in value.constant])
    return n.graph.node("power_color3FA", "color3", in1=value, in2=number(0.5))


def _coat(n: Nodes, node: Any, found: Surface) -> None:
    found["coat_weight"] = n.read(node, "Coat Weight", "float")
    if is_zero(found["coat_weight"]):
        return
    found["coat_roughness"] = n.read(node, "Coat Roughness", "float")
    found["coat_ior"] = n.read(node, "Coat IOR", "float")
    found["coat_color"] = n.read(node, "Coat Tint", "color3")
    _keep_base(n, node, found)
    if node.inputs["Coat Normal"].links:
        n.miss("normal of the coat")


def _keep_base(n: Nodes, node: Any, found: Surface) -> None:
    """Compensates for the coat's effect on the base in OpenPBR, which Cycles does not have.

    OpenPBR refracts from the coat into the base, by the ratio of their indices, and a rough coat
    broadens the highlight of the base.
    """
    keys = ("coat_weight", "coat_ior", "coat_roughness", "specular_ior", "specular_roughness")
    values = [found[key].constant for key in keys]
    weight, ior, rough = (n.graph.clamped(found["coat_weight"]), found["coat_ior"], values[2])
    if not is_zero(found["transmission_weight"]):
        n.approximate("coat over a transmissive base (its index is relative to the coat)")
    elif values[0] is not None and values[1] is not None and values[3] is not None:
        relative = 1.0 + min(values[0], 1.0) * (values[1] - 1.0)
        found["specular_ior"] = number(values[3] * relative)
    else:
        one = number(1.0)
        excess = n.graph.op("subtract", ior, one)
        relative = n.graph.op("add", one, n.graph.op("multiply", weight, excess))
        found["specular_ior"] = n.graph.op("multiply", found["specular_ior"], relative)
    if values[0] == 1.0 and rough is not None and values[4] is not None:
        sharp = max(values[4] ** 4 - 2.0 * rough**4, 0.0) ** 0.25
        found["specular_roughness"] = number(sharp)


def _sheen(n: Nodes, node: Any, found: Surface) -> None:
    found["fuzz_weight"] = n.graph.clamped(n.read(node, "Sheen Weight", "float"))
    found["fuzz_roughness"] = n.graph.clamped(n.read(node, "Sheen Roughness", "float"))
    found["fuzz_color"] = n.read(node, "Sheen Tint", "color3")


def _film(n: Nodes, node: Any, found: Surface) -> None:
    if "Thin Film Thickness" not in node.inputs:
        return
    thickness = n.read(node, "Thin Film Thickness", "float")
    if is_zero(thickness):
        return
    found["thin_film_weight"] = number(1.0)
    # Blender's thickness is in nanometres, and OpenPBR's is in micrometres.
    found["thin_film_thickness"] = n.graph.op("multiply", thickness, number(1e-3))
    if thickness.constant is not None:
        found["thin_film_thickness"] = number(thickness.constant * 1e-3)
    found["thin_film_ior"] = n.read(node, "Thin Film IOR", "float")


def _emission_of(n: Nodes, node: Any, found: Surface) -> None:
    strength = n.read(node, "Emission Strength", "float")
    found["emission_color"] = _scaled(n, n.read(node, "Emission Color", "color3"), strength)


def _scaled(n: Nodes, value: Value, factor: Value) -> Value:
    if is_zero(value) or is_zero(factor):
        return BLACK
    if value.constant is not None and factor.constant is not None:
        return colour([v * factor.constant for v in value.constant])
    return n.graph.op("multiply", value, n.graph.to("color3", factor))


# ---- other shaders -------------------------------------------------------------------------------


def _diffuse(n: Nodes, node: Any) -> Surface:
    found = dict(NEUTRAL, base_color=n.read(node, "Color", "color3"))
    rough = n.read(node, "Roughness", "float")
    found["base_diffuse_roughness"] = rough
    _normal(n, node, found)
    return found


def _glossy(n: Nodes, node: Any) -> Surface:
    tint = n.read(node, "Color", "color3")
    found = dict(NEUTRAL, base_color=tint, base_metalness=number(1.0), specular_weight=number(1.0))
    found["specular_roughness"] = n.read(node, "Roughness", "float")
    if "Anisotropy" in node.inputs and not is_zero(n.read(node, "Anisotropy", "float")):
        n.miss("anisotropy of a glossy shader")
    _normal(n, node, found)
    return found


def _metallic(n: Nodes, node: Any) -> Surface:
    found = _glossy_like(n, node, "Base Color")
    if node.fresnel_type == "F82":
        found["specular_color"] = n.read(node, "Edge Tint", "color3")
    else:
        n.approximate("physical conductor (its index at normal incidence)")
    return found


def _glossy_like(n: Nodes, node: Any, name: str) -> Surface:
    found = dict(NEUTRAL, base_metalness=number(1.0), specular_weight=number(1.0))
    found["base_color"] = n.read(node, name, "color3")
    found["specular_roughness"] = n.read(node, "Roughness", "float")
    _normal(n, node, found)
    return found


def _glass(n: Nodes, node: Any) -> Surface:
    found = dict(NEUTRAL, specular_weight=number(1.0), transmission_weight=number(1.0))
    found["transmission_color"] = found["specular_color"] = n.read(node, "Color", "color3")
    found["specular_roughness"] = n.read(node, "Roughness", "float")
    found["specular_ior"] = n.read(node, "IOR", "float")
    _normal(n, node, found)
    return found


def _refraction(n: Nodes, node: Any) -> Surface:
    n.approximate("Refraction BSDF (glass, with reflection)")
    return _glass(n, node)


def _transparent(n: Nodes, node: Any) -> Surface:
    tint = n.read(node, "Color", "color3")
    found = dict(NEUTRAL, base_weight=number(0.0))
    if tint.constant == (1.0, 1.0, 1.0):
        found["geometry_opacity"] = number(0.0)
        return found
    if tint.constant is not None and max(tint.constant) == min(tint.constant):
        found["base_color"], found["base_weight"] = BLACK, number(1.0)
        found["geometry_opacity"] = number(1.0 - tint.constant[0])
        return found
    n.approximate("coloured Transparent BSDF (its shadow has the tint's smallest component)")
    # A thin wall without an interface transmits what exceeds the smallest component.
    least = min(max(min(tint.constant), 0.0), 1.0) if tint.constant is not None else 0.0
    if tint.constant is not None and least < 1.0:
        tint = colour([(c - least) / (1.0 - least) for c in tint.constant])
        found["geometry_opacity"] = number(1.0 - least)
    found |= {"transmission_weight": number(1.0), "transmission_color": tint}
    found |= {"specular_weight": number(0.0), "specular_roughness": number(0.0)}
    found["geometry_thin_walled"] = number(1.0)
    return found


def _translucent(n: Nodes, node: Any) -> Surface:
    tint = n.read(node, "Color", "color3")
    found = dict(NEUTRAL, subsurface_weight=number(1.0), subsurface_color=tint)
    found["subsurface_scatter_anisotropy"] = number(1.0)
    found["geometry_thin_walled"] = number(1.0)
    return found


def _emission(n: Nodes, node: Any) -> Surface:
    light = _scaled(n, n.read(node, "Color", "color3"), n.read(node, "Strength", "float"))
    return dict(NEUTRAL, base_weight=number(0.0), emission_color=light)


def _scattering(n: Nodes, node: Any) -> Surface:
    found = dict(NEUTRAL, base_color=n.read(node, "Color", "color3"))
    scattering(n, node, found)
    _normal(n, node, found)
    return found


def _velvet(n: Nodes, node: Any) -> Surface:
    found = dict(NEUTRAL, base_weight=number(0.0), fuzz_weight=number(1.0))
    found["fuzz_color"] = n.read(node, "Color", "color3")
    found["fuzz_roughness"] = n.read(node, "Roughness", "float")
    return found


def _holdout(n: Nodes, node: Any) -> Surface:
    n.miss("Holdout shader (use the object's holdout; black instead)")
    return dict(NEUTRAL, base_weight=number(0.0))


# ---- mixtures ------------------------------------------------------------------------------------


def _mix_shader(n: Nodes, node: Any) -> Surface:
    sockets = [one for one in node.inputs if one.type == "SHADER"]
    factor = n.graph.clamped(n.read(node, 0, "float"))
    if factor.constant in (0.0, 1.0):
        chosen = surface_of(n, sockets[int(factor.constant)])
        return dict(NEUTRAL, base_weight=number(0.0)) if chosen is None else chosen
    a, b = (surface_of(n, one) for one in sockets)
    black = dict(NEUTRAL, base_weight=number(0.0))
    return mixed(n, a or black, b or dict(black), factor)


def _add_shader(n: Nodes, node: Any) -> Surface:
    parts = [surface_of(n, one) for one in node.inputs]
    found = [one for one in parts if one is not None]
    if len(found) < 2:
        return found[0] if found else dict(NEUTRAL, base_weight=number(0.0))
    a, b = found
    light = _sum(n, a["emission_color"], b["emission_color"])
    for one, other in ((a, b), (b, a)):
        if is_zero(other["base_weight"]) and is_zero(other["specular_weight"]):
            return {**one, "emission_color": light}
    n.approximate("sum of two shaders that scatter light (weights above 1 are lost)")
    total = {**a, "emission_color": light, "base_color": _sum(n, a["base_color"], b["base_color"])}
    if a["base_metalness"] != b["base_metalness"]:
        total = mixed(n, a, b, number(0.5))
    return total


def _sum(n: Nodes, a: Value, b: Value) -> Value:
    if is_zero(a) or is_zero(b):
        return b if is_zero(a) else a
    if a.constant is not None and b.constant is not None:
        return colour([x + y for x, y in zip(a.constant, b.constant, strict=True)])
    return n.graph.op("add", a, b)


SHADERS: dict[str, Callable[[Nodes, Any], Surface]] = {
    "BSDF_PRINCIPLED": _principled,
    "BSDF_DIFFUSE": _diffuse,
    "BSDF_GLOSSY": _glossy,
    "BSDF_METALLIC": _metallic,
    "BSDF_GLASS": _glass,
    "BSDF_REFRACTION": _refraction,
    "BSDF_TRANSPARENT": _transparent,
    "BSDF_TRANSLUCENT": _translucent,
    "BSDF_SHEEN": _velvet,
    "SUBSURFACE_SCATTERING": _scattering,
    "EMISSION": _emission,
    "HOLDOUT": _holdout,
    "MIX_SHADER": _mix_shader,
    "ADD_SHADER": _add_shader,
}
