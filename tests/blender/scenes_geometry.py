# SPDX-License-Identifier: Apache-2.0
"""Blender scenes compared with Cycles: geometry, instances and visibility."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from build import (
    camera,
    cube,
    floor,
    light,
    link,
    principled,
    shader,
    sphere,
    studio,
    world,
)
from registry import scene


@scene("Geometry")
def mesh_two_materials() -> None:
    """A cube whose faces have three materials."""
    studio()
    thing = cube(principled("a", base_color=(0.7, 0.1, 0.1)))
    thing.data.materials.append(principled("b", base_color=(0.1, 0.6, 0.1)))
    thing.data.materials.append(principled("c.001", base_color=(0.1, 0.1, 0.7)))
    for i, polygon in enumerate(thing.data.polygons):
        polygon.material_index = i % 3


@scene("Geometry")
def mesh_no_material() -> None:
    """An object without material, smooth, with a space and an accent in its name."""
    studio()
    sphere().name = "Kugel é 1.001"


@scene("Geometry")
def mesh_subdivided() -> None:
    """A subdivided cube, with a bevel."""
    studio()
    thing = cube(principled(base_color=(0.3, 0.5, 0.6)))
    thing.modifiers.new("bevel", "BEVEL").width = 0.2
    modifier = thing.modifiers.new("subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 3


@scene("Geometry")
def mesh_parented() -> None:
    """A child whose parent is moved, turned and scaled unevenly."""
    studio()
    parent = cube(principled(base_color=(0.6, 0.4, 0.2)), at=(-1, 0, 0.5), size=1.0)
    parent.scale = (1.5, 0.7, 1.0)
    child = sphere(principled("b", base_color=(0.2, 0.6, 0.3)), at=(1.4, 0.2, 0.9), radius=0.7)
    child.parent = parent


@scene("Geometry")
def text_and_curve() -> None:
    """A text and a bevelled curve."""
    studio()
    text = bpy.data.curves.new("text", "FONT")
    text.body, text.extrude, text.align_x = "Wave", 0.15, "CENTER"
    thing = link("text", text, (0, -0.5, 0.1), (math.pi / 2, 0, 0))
    thing.data.materials.append(principled(base_color=(0.7, 0.3, 0.2)))
    curve = bpy.data.curves.new("curve", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.15, 6
    line = curve.splines.new("BEZIER")
    line.bezier_points.add(2)
    for point, x in zip(line.bezier_points, (-2.0, 0.0, 2.0), strict=True):
        point.co, point.handle_left_type, point.handle_right_type = (x, 0.5, 1.5), "AUTO", "AUTO"
        point.co.z += 0.5 * math.cos(x)
    thing = link("curve", curve)
    curve.materials.append(principled("b", base_color=(0.2, 0.3, 0.7)))


@scene("Geometry")
def metaballs() -> None:
    """Metaballs."""
    studio()
    data = bpy.data.metaballs.new("meta")
    data.resolution = data.render_resolution = 0.08
    for x in (-0.7, 0.7):
        data.elements.new().co = (x, 0, 0)
    thing = link("meta", data, (0, 0, 1))
    data.materials.append(principled(base_color=(0.6, 0.6, 0.2)))
    assert thing is not None


def _hair_nodes(material: Any) -> None:
    node = shader(material, "ShaderNodeBsdfHairPrincipled")
    node.parametrization = "COLOR"
    node.inputs["Color"].default_value = (0.4, 0.2, 0.1, 1.0)
    if hasattr(node, "model"):
        node.model = "CHIANG"


def _strands(material: Any, count: int = 1500, radius: float = 0.01) -> None:
    random = np.random.default_rng(1)
    data = bpy.data.hair_curves.new("strands")
    data.add_curves([5] * count)
    roots = random.uniform(-1.2, 1.2, (count, 2))
    t = np.linspace(0.0, 1.0, 5)
    bend = random.normal(0.0, 0.3, (count, 1, 2)) * t[None, :, None] ** 2
    points = np.concatenate(
        [roots[:, None, :] + bend, np.broadcast_to(1.5 * t[:, None], (count, 5, 1))], -1
    )
    data.points.foreach_set("position", points.astype(np.float32).ravel())
    data.points.foreach_set("radius", np.full(5 * count, radius, np.float32))
    data.materials.append(material)
    link("strands", data)


@scene("Geometry", outside=0.2, spp=128, why="thickness of strands at their ends")
def hair_diffuse() -> None:
    """Curves with a diffuse shader."""
    studio()
    material = bpy.data.materials.new("hair")
    material.use_nodes = True
    shader(material, "ShaderNodeBsdfDiffuse", Color=(0.5, 0.3, 0.2))
    _strands(material)


@scene(
    "Geometry",
    0.98,
    1.01,
    0.2,
    spp=64,
    why="thickness of strands at their ends, lobes of Chiang's model",
)
def hair_principled() -> None:
    """Curves with a Principled Hair BSDF."""
    studio()
    material = bpy.data.materials.new("hair")
    material.use_nodes = True
    _hair_nodes(material)
    _strands(material)


@scene("Instances")
def instance_linked_data() -> None:
    """Objects that share a mesh, with separate materials."""
    studio()
    first = cube(principled("a", base_color=(0.7, 0.2, 0.1)), at=(-2, 0, 0.5), size=1.0)
    for i in range(1, 4):
        thing = link(f"copy {i}", first.data, (-2 + 1.3 * i, 0.3 * i, 0.5), (0, 0, 0.5 * i))
        if i == 3:
            thing.material_slots[0].link = "OBJECT"
            thing.material_slots[0].material = principled("own", base_color=(0.1, 0.5, 0.2))


@scene("Instances")
def instance_collection() -> None:
    """Instances of a collection that contains a light."""
    floor()
    world((0.1, 0.1, 0.1))
    camera()
    group = bpy.data.collections.new("group")
    thing = cube(principled(base_color=(0.3, 0.4, 0.7)), at=(0, 0, 0.3), size=0.6)
    bpy.context.scene.collection.objects.unlink(thing)
    lamp = light("POINT", 30.0, at=(0, 0, 1.4), shadow_soft_size=0.1)
    bpy.context.scene.collection.objects.unlink(lamp)
    for one in (thing, lamp):
        group.objects.link(one)
    for x in (-1.8, 0.0, 1.8):
        empty = link("instance", None, (x, 0, 0), (0, 0, x))
        empty.instance_type, empty.instance_collection = "COLLECTION", group


@scene("Instances")
def instance_text_and_curve() -> None:
    """Instances of a collection with a text and a bevelled curve."""
    studio()
    group = bpy.data.collections.new("group")
    text = bpy.data.curves.new("text", "FONT")
    text.body, text.extrude, text.align_x = "Ab", 0.15, "CENTER"
    text.materials.append(principled("a", base_color=(0.7, 0.3, 0.2)))
    curve = bpy.data.curves.new("curve", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.1, 4
    line = curve.splines.new("POLY")
    line.points.add(1)
    for point, x in zip(line.points, (-0.6, 0.6), strict=True):
        point.co = (x, 0.0, 1.0, 1.0)
    curve.materials.append(principled("b", base_color=(0.2, 0.3, 0.7)))
    for thing in (link("text", text, (0, 0, 0.1), (math.pi / 2, 0, 0)), link("curve", curve)):
        bpy.context.scene.collection.objects.unlink(thing)
        group.objects.link(thing)
    for x in (-1.5, 1.5):
        empty = link("instance", None, (x, 0, 0), (0, 0, 0.3 * x))
        empty.instance_type, empty.instance_collection = "COLLECTION", group


@scene("Instances")
def instance_vertices() -> None:
    """An object instanced on the vertices of another."""
    studio()
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=5, y_subdivisions=4, size=4, location=(0, 0, 0.4)
    )
    parent = bpy.context.object
    child = sphere(principled(base_color=(0.7, 0.4, 0.1)), at=(0, 0, 0), radius=0.25, segments=24)
    child.parent = parent
    parent.instance_type = "VERTS"
    parent.show_instancer_for_render = False


@scene("Instances")
def instance_geometry_nodes() -> None:
    """Points instanced by geometry nodes."""
    studio()
    tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    entry, leave = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    on_points = tree.nodes.new("GeometryNodeInstanceOnPoints")
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["As Instance"].default_value = True
    model = cube(principled(base_color=(0.2, 0.5, 0.5)), at=(0, 0, 0), size=0.4)
    model.hide_render = True
    info.inputs["Object"].default_value = model
    tree.links.new(entry.outputs[0], on_points.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], on_points.inputs["Instance"])
    tree.links.new(on_points.outputs[0], leave.inputs[0])
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=4, y_subdivisions=4, size=3, location=(0, 0, 0.6)
    )
    bpy.context.object.modifiers.new("scatter", "NODES").node_group = tree


# ---- visibility ----------------------------------------------------------------------------------


@scene("Visibility")
def visible_no_camera() -> None:
    """An object that the camera does not see, but that casts a shadow."""
    studio()
    sphere(principled()).visible_camera = False


@scene("Visibility")
def visible_no_shadow() -> None:
    """An object without shadow, and one hidden in renders."""
    studio(0.0)
    sphere(principled(base_color=(0.6, 0.3, 0.3))).visible_shadow = False
    sphere(principled("b"), at=(2, 0, 1)).hide_render = True


@scene("Visibility")
def film_transparent() -> None:
    """A transparent film, with a holdout."""
    studio()
    bpy.context.scene.render.film_transparent = True
    sphere(principled(base_color=(0.6, 0.3, 0.3)))
    cube(principled("b"), at=(1.2, -1.5, 0.5), size=0.8).is_holdout = True
