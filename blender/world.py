# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the world as a dome light: a colour, an environment image, or a bake of its nodes."""

from __future__ import annotations

from typing import Any

from mathutils import Matrix

from . import bake
from .context import OWN, Translation
from .images import file_of, space_of
from .usda import Asset

DOME = f"{OWN}/World"

AXES = Matrix(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))).to_4x4()
"""Turns a dome of UsdLux (pole +Y, middle of the image +Z) to Blender's (pole +Z, middle +X)."""


def write_world(into: Translation) -> None:
    """Writes the world of the scene; a scene without a world is black."""
    world = into.scene.world
    prim = into.layer.define(DOME, "DomeLight")
    if world is None:
        # A light of intensity 0 prevents Wavecomb's default dome.
        prim.set("float inputs:intensity", 0.0)
        return
    if world.lightgroup:
        prim.set("string wavecomb:lightGroup", world.lightgroup)
    tree = world.node_tree if world.use_nodes else None
    if tree is None:
        prim.set("color3f inputs:color", tuple(world.color))
        return
    output = tree.get_output_node("CYCLES")
    if output is None or not output.inputs["Surface"].links:
        prim.set("float inputs:intensity", 0.0)
    else:
        _surface(into, world, prim, output.inputs["Surface"].links[0].from_node)
    if output is not None and output.inputs["Volume"].links:
        into.report.miss("volume of the world", world.name)
    _visibility(into, world)


def _visibility(into: Translation, world: Any) -> None:
    rays = getattr(world, "cycles_visibility", None)
    kinds = ("camera", "diffuse", "glossy", "transmission", "scatter")
    hidden = [kind for kind in kinds if not getattr(rays, kind, True)]
    if hidden:
        into.report.miss(f"world hidden from {', '.join(hidden)} rays", world.name)


def _surface(into: Translation, world: Any, prim: Any, node: Any) -> None:
    plain = node.type == "BACKGROUND" and not node.inputs["Strength"].links
    if plain and not node.inputs["Color"].links:
        prim.set("color3f inputs:color", tuple(node.inputs["Color"].default_value)[:3])
        prim.set("float inputs:intensity", float(node.inputs["Strength"].default_value))
        return
    if plain:
        source = node.inputs["Color"].links[0].from_node
        if source.type == "TEX_ENVIRONMENT" and _image(into, prim, source):
            prim.set("float inputs:intensity", float(node.inputs["Strength"].default_value))
            return
    file = bake.world(into, world)
    if file is None:
        into.report.miss(f"world node {node.bl_label} (black)", world.name)
        prim.set("float inputs:intensity", 0.0)
        return
    prim.set("asset inputs:texture:file", Asset(file))
    prim.transform({into.time: AXES})


def _image(into: Translation, prim: Any, node: Any) -> bool:
    """Writes an environment image; returns whether a dome light can represent the node."""
    if node.projection != "EQUIRECTANGULAR" or node.image is None:
        return False
    turn = _turn(node.inputs["Vector"])
    if turn is None:
        return False
    file = file_of(into, node.image)
    if file is None:
        return False
    space = space_of(into, node.image)
    prim.lines.append(f'asset inputs:texture:file = @{file}@ (colorSpace = "{space}")')
    prim.set("token inputs:texture:format", "latlong")
    prim.transform({into.time: turn.inverted().to_4x4() @ AXES})
    return True


def _turn(socket: Any) -> Any:
    """Returns the rotation of the texture coordinates; None if the mapping is not a rotation."""
    if not socket.links:
        return Matrix.Identity(3)
    source = socket.links[0].from_node
    if source.type == "TEX_COORD":
        return Matrix.Identity(3) if socket.links[0].from_socket.name == "Generated" else None
    if source.type != "MAPPING" or source.vector_type not in ("POINT", "VECTOR", "TEXTURE"):
        return None
    if any(source.inputs[name].links for name in ("Rotation", "Scale")):
        return None
    scale = source.inputs["Scale"].default_value
    place = source.inputs["Location"] if source.vector_type != "VECTOR" else None
    moved = place is not None and any(abs(value) > 1e-6 for value in place.default_value)
    if moved or any(abs(value - 1.0) > 1e-6 for value in scale):
        return None
    before = _turn(source.inputs["Vector"])
    if before is None:
        return None
    own = source.inputs["Rotation"].default_value.to_matrix()
    if source.vector_type == "TEXTURE":
        own = own.inverted()
    return own @ before
