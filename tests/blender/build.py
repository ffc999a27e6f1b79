# SPDX-License-Identifier: Apache-2.0
"""Makes objects, lights and materials for scenes that compare Wavecomb with Cycles."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

Colour = tuple[float, float, float]


def link(name: str, data: Any, at: Any = (0, 0, 0), turn: Any = (0, 0, 0)) -> Any:
    """Adds an object to the scene."""
    made = bpy.data.objects.new(name, data)
    made.location, made.rotation_euler = at, turn
    bpy.context.scene.collection.objects.link(made)
    return made


def aim(thing: Any, target: Any) -> Any:
    """Turns an object so that it looks at a point."""
    away = Vector(target) - thing.location
    thing.rotation_euler = away.to_track_quat("-Z", "Y").to_euler()
    return thing


def camera(at: Any = (0, -7, 3), target: Any = (0, 0, 0.8), **options: Any) -> Any:
    """Adds the camera."""
    data = bpy.data.cameras.new("camera")
    for name, value in options.items():
        setattr(data, name, value)
    thing = aim(link("camera", data, at), target)
    bpy.context.scene.camera = thing
    return thing


def light(
    kind: str, energy: float, at: Any = (2, -2, 4), target: Any = (0, 0, 0), **options: Any
) -> Any:
    """Adds a light that shines at a point."""
    data = bpy.data.lights.new("light", kind)
    data.energy = energy
    for name, value in options.items():
        setattr(data, name, value)
    return aim(link("light", data, at), target)


def world(colour: Colour = (0.5, 0.5, 0.5), strength: float = 1.0) -> Any:
    """Sets a world of one colour; returns its background node."""
    made = bpy.data.worlds.new("world")
    bpy.context.scene.world = made
    made.use_nodes = True
    node = next(n for n in made.node_tree.nodes if n.type == "BACKGROUND")
    node.inputs["Color"].default_value = (*colour, 1.0)
    node.inputs["Strength"].default_value = strength
    return node


def principled(name: str = "material", **inputs: Any) -> Any:
    """Makes a material of one Principled BSDF; inputs are named with underscores."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    node = shader_of(made)
    for key, value in inputs.items():
        key = key.replace("_", " ")
        names = {one.name.lower(): one for one in node.inputs}
        socket = names[key.lower()]
        if hasattr(socket.default_value, "__len__") and len(socket.default_value) == 4:
            value = (*value, 1.0)
        socket.default_value = value
    return made


def shader_of(material: Any) -> Any:
    """Returns the Principled BSDF of a material."""
    return next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")


def shader(material: Any, kind: str, to: str = "Surface", **inputs: Any) -> Any:
    """Replaces the surface of a material by one shader node; returns the node."""
    tree = material.node_tree
    node = tree.nodes.new(kind)
    put(node, **inputs)
    output = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
    if to == "Volume":
        for one in list(output.inputs["Surface"].links):
            tree.links.remove(one)
    tree.links.new(node.outputs[0], output.inputs[to])
    return node


def put(node: Any, **inputs: Any) -> Any:
    """Sets inputs of a node."""
    for key, value in inputs.items():
        socket = node.inputs[key.replace("_", " ")]
        if hasattr(socket.default_value, "__len__") and len(socket.default_value) == 4:
            value = (*value, 1.0)
        socket.default_value = value
    return node


def add(material: Any, kind: str, **properties: Any) -> Any:
    """Adds a node with properties."""
    node = material.node_tree.nodes.new(kind)
    for name, value in properties.items():
        setattr(node, name, value)
    return node


def wire(material: Any, source: Any, target: Any) -> None:
    """Connects two sockets."""
    material.node_tree.links.new(source, target)


def floor(colour: Colour = (0.8, 0.8, 0.8), size: float = 12.0) -> Any:
    """Adds a diffuse floor."""
    bpy.ops.mesh.primitive_plane_add(size=size)
    thing = bpy.context.object
    material = bpy.data.materials.new("floor")
    material.use_nodes = True
    shader(material, "ShaderNodeBsdfDiffuse", Color=colour)
    thing.data.materials.append(material)
    return thing


def sphere(
    material: Any = None, at: Any = (0, 0, 1), radius: float = 1.0, segments: int = 96
) -> Any:
    """Adds a smooth sphere."""
    bpy.ops.mesh.primitive_uv_sphere_add(
        location=at, radius=radius, segments=segments, ring_count=segments // 2
    )
    bpy.ops.object.shade_smooth()
    thing = bpy.context.object
    if material is not None:
        thing.data.materials.append(material)
    return thing


def cube(
    material: Any = None, at: Any = (0, 0, 1), size: float = 2.0, turn: Any = (0, 0, 0.4)
) -> Any:
    """Adds a cube."""
    bpy.ops.mesh.primitive_cube_add(location=at, size=size, rotation=turn)
    thing = bpy.context.object
    if material is not None:
        thing.data.materials.append(material)
    return thing


def wall(material: Any = None, at: Any = (0, 1, 1.2), size: float = 3.0) -> Any:
    """Adds a square that faces the camera."""
    bpy.ops.mesh.primitive_plane_add(size=size, location=at, rotation=(math.pi / 2, 0, 0))
    thing = bpy.context.object
    if material is not None:
        thing.data.materials.append(material)
    return thing


def picture(name: str = "picture", size: int = 64, data: bool = False) -> Any:
    """Makes a packed image: coloured tiles, or with ``data`` a normal map of bumps."""
    y, x = np.mgrid[0:size, 0:size] / size
    if data:
        nx, ny = 0.5 * np.cos(6 * np.pi * x), 0.5 * np.cos(6 * np.pi * y)
        nz = np.sqrt(1 - nx**2 - ny**2)
        rgb = [0.5 * nx + 0.5, 0.5 * ny + 0.5, 0.5 * nz + 0.5]
    else:
        tile = (np.floor(4 * x) + np.floor(4 * y)) % 2
        rgb = [0.2 + 0.6 * x, 0.2 + 0.6 * tile, 0.2 + 0.6 * y]
    alpha = np.ones_like(x) if data else (0.3 + 0.7 * (x > 0.5))
    pixels = np.stack([*rgb, alpha], axis=-1).astype(np.float32)
    made = bpy.data.images.new(name, size, size, alpha=True)
    made.colorspace_settings.name = "Non-Color" if data else "sRGB"
    made.pixels.foreach_set(pixels.ravel())
    made.update()
    made.pack()
    return made


def textured(name: str = "material", **inputs: Any) -> tuple[Any, Any, Any]:
    """Makes a principled material whose base colour is an image; returns material and nodes."""
    made = principled(name, roughness=1.0, specular_ior_level=0.0, **inputs)
    node = add(made, "ShaderNodeTexImage", image=picture(), interpolation="Linear")
    wire(made, node.outputs["Color"], shader_of(made).inputs["Base Color"])
    return made, shader_of(made), node


def studio(strength: float = 0.4) -> None:
    """Adds the usual surroundings: floor, an area light, a dim world, the camera."""
    floor()
    light("AREA", 300.0, shape="SQUARE", size=1.5)
    world((strength, strength, strength))
    camera()


def show_lights() -> None:
    """Makes lights visible in Wavecomb, so that mirrors and smooth glass show them."""
    bpy.context.scene.wavecomb.lights = "visible"
