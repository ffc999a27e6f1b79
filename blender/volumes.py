# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes volume shaders of meshes and of OpenVDB volumes."""

from __future__ import annotations

from typing import Any

from .graph import Value
from .neutral import Surface
from .nodes import Nodes

Colour = tuple[float, float, float]


def write_volume(n: Nodes, socket: Any, path: str, surface: Surface | None) -> None:
    """Writes a volume shader, or the medium of glass if the material has a surface."""
    found = n.shader(socket)
    if found is None:
        return
    medium = _medium(n, found[0])
    if medium is None:
        n.miss(f"volume shader {found[0].bl_label}")
        return
    absorption, scattering, anisotropy, emission = medium
    if surface is not None:
        if surface["transmission_weight"].constant == 1.0 and any(absorption + scattering):
            n.approximate("volume inside of glass (not translated)")
        else:
            n.miss("volume below an opaque surface")
        return
    _define(n, path, found[0], absorption, scattering, anisotropy, emission)


def _number(n: Nodes, node: Any, name: str) -> float:
    value = n.read(node, name, "float")
    if value.constant is None:
        n.approximate(f"volume input {name} by a node (1)")
        return 1.0
    return float(value.constant)


def _tint(n: Nodes, node: Any, name: str) -> Colour:
    value = n.read(node, name, "color3")
    if value.constant is None:
        n.approximate(f"volume input {name} by a node (grey)")
        return (0.5, 0.5, 0.5)
    r, g, b = value.constant
    return (r, g, b)


def _medium(n: Nodes, node: Any) -> tuple[Colour, Colour, float, Colour] | None:
    """Returns absorption, scattering, anisotropy and emission per unit of density."""
    black = (0.0, 0.0, 0.0)
    if node.type == "VOLUME_SCATTER":
        density, tint = _number(n, node, "Density"), _tint(n, node, "Color")
        scattering = tuple(density * c for c in tint)
        return black, scattering, _number(n, node, "Anisotropy"), black  # type: ignore[return-value]
    if node.type == "VOLUME_ABSORPTION":
        density, tint = _number(n, node, "Density"), _tint(n, node, "Color")
        return tuple(density * max(1.0 - c, 0.0) for c in tint), black, 0.0, black  # type: ignore[return-value]
    if node.type == "EMISSION":
        tint, strength = _tint(n, node, "Color"), _number(n, node, "Strength")
        return black, black, 0.0, tuple(strength * c for c in tint)  # type: ignore[return-value]
    if node.type != "PRINCIPLED_VOLUME":
        return None
    density, tint = _number(n, node, "Density"), _tint(n, node, "Color")
    absorbed = _tint(n, node, "Absorption Color")
    scattering = tuple(density * max(c, 0.0) for c in tint)
    absorption = tuple(
        density * max(1.0 - c, 0.0) * max(1.0 - max(a, 0.0) ** 0.5, 0.0)
        for c, a in zip(tint, absorbed, strict=True)
    )
    strength = _number(n, node, "Emission Strength")
    emission = tuple(strength * c for c in _tint(n, node, "Emission Color"))
    if node.inputs["Blackbody Intensity"].default_value > 0.0:
        n.miss("black-body emission of a volume")
    return absorption, scattering, _number(n, node, "Anisotropy"), emission  # type: ignore[return-value]


def _define(
    n: Nodes, path: str, node: Any, absorption: Colour, scattering: Colour, g: float, light: Colour
) -> None:
    layer = n.into.layer
    material = layer.define(path, "Material")
    vdf = layer.define(f"{path}/WavecombVdf", "Shader")
    vdf.set("uniform token info:id", "ND_anisotropic_vdf")
    if _is_field(n):
        field = n.graph.node("geompropvalue_float", "float", geomprop="density")
        for name, values in (("absorption", absorption), ("scattering", scattering)):
            tint = Value("vector3", values)
            made = n.graph.op("multiply", n.graph.to("vector3", field), tint)
            vdf.connect(f"float3 inputs:{name}", made.path)
    else:
        vdf.set("float3 inputs:absorption", absorption)
        vdf.set("float3 inputs:scattering", scattering)
    vdf.set("float inputs:anisotropy", g)
    vdf.lines.append("token outputs:out")
    volume = layer.define(f"{path}/WavecombVolume", "Shader")
    volume.set("uniform token info:id", "ND_volume")
    volume.connect("token inputs:vdf", f"{path}/WavecombVdf.outputs:out")
    if any(light) and not _is_field(n):
        n.miss("emission of a volume in a mesh")
    elif any(light):
        edf = layer.define(f"{path}/WavecombEdf", "Shader")
        edf.set("uniform token info:id", "ND_uniform_edf")
        edf.set("color3f inputs:color", light)
        edf.lines.append("token outputs:out")
        volume.connect("token inputs:edf", f"{path}/WavecombEdf.outputs:out")
    volume.lines.append("token outputs:out")
    material.connect("token outputs:mtlx:volume", f"{path}/WavecombVolume.outputs:out")
    # The surface that the exporter wrote would hide the medium, so it is disconnected.
    material.lines.append("token outputs:surface.connect = None")


def _is_field(n: Nodes) -> bool:
    return any(
        thing.type == "VOLUME"
        and any(s.material and s.material.name == n.owner for s in thing.material_slots)
        for thing in n.into.scene.objects
    )
