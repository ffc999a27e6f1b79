# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes materials as OpenPBR, hair and volume shaders of MaterialX."""

from __future__ import annotations

from typing import Any

import bpy

from .context import OWN, ROOT, Translation, material_path
from .graph import Graph, Value, colour, number
from .hair import write_hair
from .neutral import BLACK, NEUTRAL, Surface, is_zero
from .nodes import Nodes
from .normals import write_displacement
from .surfaces import surface_of
from .volumes import write_volume

DEFAULT = f"{OWN}/Default"


def write_materials(into: Translation) -> None:
    """Writes the materials of all visible objects, and a default for objects without material."""
    # Objects without material are Principled in Blender 5.0 and diffuse in 4.2.
    shine = 1.0 if bpy.app.version >= (5, 0, 0) else 0.0
    default = dict(NEUTRAL, base_color=colour((0.8, 0.8, 0.8)), specular_weight=number(shine))
    _write(into, DEFAULT, default, None)
    into.layer.over(ROOT).apply("MaterialBindingAPI")
    into.layer.over(ROOT).relate("material:binding", DEFAULT)
    names: dict[str, str] = {}
    for material in _used(into):
        path = material_path(material)
        other = names.setdefault(path, material.name)
        if other != material.name:
            into.report.miss(f"two materials with one name on the stage, {other}", material.name)
        write_material(into, material, path)


def _used(into: Translation) -> list[Any]:
    found: dict[str, Any] = {}
    for instance in into.depsgraph.object_instances:
        for slot in instance.object.material_slots:
            if slot.material is not None:
                found[slot.material.name] = slot.material
                if instance.is_instance:
                    into.instanced.add(slot.material.name)
        data = instance.object.data
        for material in getattr(data, "materials", None) or ():
            if material is not None:
                found.setdefault(material.name, material)
    return [found[name] for name in sorted(found)]


def write_material(into: Translation, material: Any, path: str) -> None:
    """Writes a material to the correction layer, which overrides the exporter's material."""
    tree = material.node_tree if material.use_nodes else None
    if tree is None:
        base = colour(material.diffuse_color)
        _write(into, path, dict(NEUTRAL, base_color=base), None)
        return
    output = tree.get_output_node("CYCLES")
    if output is None:
        _write(into, path, dict(NEUTRAL, base_weight=number(0.0)), None)
        return
    graph = Graph(into.layer, path)
    nodes = Nodes(into, graph, material.name)
    found = nodes.shader(output.inputs["Surface"])
    if found is not None and found[0].type in ("BSDF_HAIR_PRINCIPLED", "BSDF_HAIR"):
        write_hair(nodes, found[0], into.layer.define(path, "Material"), path)
        return
    surface = surface_of(nodes, output.inputs["Surface"])
    has_volume = bool(output.inputs["Volume"].links)
    if has_volume:
        write_volume(nodes, output.inputs["Volume"], path, surface)
    if surface is None and not has_volume:
        surface = dict(NEUTRAL, base_weight=number(0.0))
    if surface is not None:
        write_displacement(nodes, material, output.inputs["Displacement"], surface)
        _write(into, path, surface, graph)


def _write(into: Translation, path: str, surface: Surface, graph: Graph | None) -> None:
    """Writes an OpenPBR shader; inputs with OpenPBR's own default are written too."""
    material = into.layer.define(path, "Material")
    shader_path = f"{path}/WavecombSurface"
    shader = into.layer.define(shader_path, "Shader")
    shader.set("uniform token info:id", "ND_open_pbr_surface_surfaceshader")
    graph = graph or Graph(into.layer, path)
    emits = not is_zero(surface["emission_color"])
    for key, value in sorted(surface.items()):
        if key == "geometry_thin_walled":
            shader.set("bool inputs:geometry_thin_walled", True)
        elif value != BLACK or key != "emission_color":
            graph.put(shader, key, _typed(value))
    shader.set("float inputs:emission_luminance", 1.0 if emits else 0.0)
    shader.lines.append("token outputs:out")
    material.connect("token outputs:mtlx:surface", f"{shader_path}.outputs:out")


def _typed(value: Value) -> Value:
    return value
