# SPDX-License-Identifier: Apache-2.0
"""Blender scenes compared with Cycles: lights and worlds."""

from __future__ import annotations

import math

import bpy
import numpy as np
from build import camera, cube, floor, light, shader, sphere, world
from registry import scene


def _ground(strength: float = 0.0) -> None:
    floor()
    diffuse = bpy.data.materials.new("diffuse")
    diffuse.use_nodes = True
    shader(diffuse, "ShaderNodeBsdfDiffuse", Color=(0.6, 0.4, 0.3))
    cube(diffuse, at=(0, 0, 0.6), size=1.2)
    world((strength,) * 3)
    camera()


@scene("Lights")
def light_point() -> None:
    """A point light without size."""
    _ground()
    light("POINT", 800.0, shadow_soft_size=0.0)


DISK = "Cycles samples a soft point light as a disk that faces the surface"


@scene("Lights", 0.99, 1.02, 0.1, DISK)
def light_point_soft() -> None:
    """A point light with a radius."""
    _ground()
    light("POINT", 800.0, shadow_soft_size=0.5)


@scene("Lights")
def light_point_sphere() -> None:
    """A point light with a radius and without soft falloff."""
    _ground()
    light("POINT", 800.0, shadow_soft_size=0.5, use_soft_falloff=False)


@scene("Lights")
def light_sun() -> None:
    """A sharp sun."""
    _ground()
    light("SUN", 3.0, angle=0.0)


@scene("Lights")
def light_sun_wide() -> None:
    """A sun of 20 degrees."""
    _ground()
    light("SUN", 3.0, angle=math.radians(20))


@scene("Lights")
def light_sun_half_sky() -> None:
    """A sun of 120 degrees."""
    _ground()
    light("SUN", 3.0, angle=math.radians(120))


@scene("Lights")
def light_spot() -> None:
    """A spot light with a sharp edge."""
    _ground(0.05)
    light("SPOT", 1500.0, spot_size=math.radians(40), spot_blend=0.0, shadow_soft_size=0.0)


@scene("Lights")
def light_spot_blend() -> None:
    """A spot light whose edge is blended."""
    _ground(0.05)
    light("SPOT", 1500.0, spot_size=math.radians(50), spot_blend=0.5, shadow_soft_size=0.0)


@scene("Lights")
def light_spot_wide() -> None:
    """A wide spot light with a full blend and a radius."""
    _ground(0.05)
    light("SPOT", 1500.0, spot_size=math.radians(120), spot_blend=1.0, shadow_soft_size=0.3)


@scene("Lights")
def light_area_square() -> None:
    """A square area light."""
    _ground()
    light("AREA", 300.0, shape="SQUARE", size=1.0)


@scene("Lights")
def light_area_rectangle() -> None:
    """A rectangle whose object is scaled."""
    _ground()
    thing = light("AREA", 300.0, shape="RECTANGLE", size=1.0, size_y=0.4)
    thing.scale = (2.0, 1.5, 1.0)


@scene("Lights")
def light_area_disk() -> None:
    """A disk."""
    _ground()
    light("AREA", 300.0, shape="DISK", size=1.4)


@scene("Lights")
def light_area_ellipse() -> None:
    """An ellipse."""
    _ground()
    light("AREA", 300.0, shape="ELLIPSE", size=2.0, size_y=0.7)


@scene("Lights")
def light_area_spread() -> None:
    """An area light with a spread of 60 degrees."""
    _ground(0.02)
    light("AREA", 300.0, shape="SQUARE", size=1.0, spread=math.radians(60))


@scene("Lights")
def light_area_spread_wide() -> None:
    """An area light with a spread of 140 degrees."""
    _ground(0.02)
    light("AREA", 300.0, shape="SQUARE", size=1.0, spread=math.radians(140))


@scene("Lights")
def light_coloured() -> None:
    """Two coloured lights, one of them hidden in renders."""
    _ground()
    light("POINT", 500.0, color=(1.0, 0.3, 0.1), shadow_soft_size=0.2)
    light("POINT", 500.0, at=(-3, -1, 3), color=(0.1, 0.4, 1.0), shadow_soft_size=0.2)
    light("POINT", 5000.0, at=(0, -3, 3)).hide_render = True


@scene("Lights")
def light_emission_node() -> None:
    """A light whose nodes scale and colour it by a black body."""
    _ground()
    thing = light("POINT", 400.0, shadow_soft_size=0.3)
    thing.data.use_nodes = True
    tree = thing.data.node_tree
    node = next(n for n in tree.nodes if n.type == "EMISSION")
    node.inputs["Strength"].default_value = 2.0
    body = tree.nodes.new("ShaderNodeBlackbody")
    body.inputs["Temperature"].default_value = 3200.0
    tree.links.new(body.outputs[0], node.inputs["Color"])


@scene("Lights")
def light_no_shadow() -> None:
    """A light without shadows beside a light with shadows."""
    _ground()
    light("POINT", 500.0, shadow_soft_size=0.1, use_shadow=False)
    light("POINT", 500.0, at=(-3, -1, 3), shadow_soft_size=0.1)


@scene("Lights")
def light_many() -> None:
    """Thirty point lights."""
    _ground()
    for i in range(30):
        angle = i * 0.7
        where = (3 * math.cos(angle), 3 * math.sin(angle), 0.5 + 0.1 * i)
        light("POINT", 40.0, at=where, shadow_soft_size=0.1, color=(1, 0.5 + 0.015 * i, 0.3))


@scene("Lights")
def light_linked() -> None:
    """A light that illuminates one of two objects."""
    floor()
    near, far = sphere(at=(-1.2, 0, 1)), sphere(at=(1.2, 0, 1))
    world((0.05, 0.05, 0.05))
    camera()
    thing = light("AREA", 300.0, shape="SQUARE", size=1.0)
    only = bpy.data.collections.new("only")
    only.objects.link(near)
    thing.light_linking.receiver_collection = only
    assert far is not None


@scene("Lights")
def light_in_view() -> None:
    """Area and point lights that the camera sees."""
    _ground(0.1)
    light("AREA", 40.0, at=(-1.5, 1, 2.5), target=(-1, -7, 2.5), shape="SQUARE", size=1.0)
    light("POINT", 60.0, at=(1.6, 1, 2.4), shadow_soft_size=0.4)


@scene("Lights")
def light_emissive_mesh() -> None:
    """An emissive ball."""
    _ground(0.02)
    glow = bpy.data.materials.new("glow")
    glow.use_nodes = True
    shader(glow, "ShaderNodeEmission", Color=(1.0, 0.7, 0.4), Strength=12.0)
    sphere(glow, at=(1.5, -1.0, 1.5), radius=0.4, segments=48)


# ---- worlds --------------------------------------------------------------------------------------


@scene("Worlds")
def world_colour() -> None:
    """A world of one colour."""
    _ground()
    world((0.3, 0.5, 0.9), 1.3)


@scene("Worlds")
def world_none() -> None:
    """A scene without a world."""
    _ground()
    bpy.context.scene.world = None
    light("SUN", 2.0, angle=0.1)


def _panorama(size: int = 256) -> bpy.types.Image:
    y, x = np.mgrid[0 : size // 2, 0:size]
    u, v = (x + 0.5) / size, (y + 0.5) / (size // 2)
    sun = np.exp(-(((u - 0.3) * 14) ** 2 + ((v - 0.75) * 9) ** 2)) * 30.0
    sky = [0.2 + 0.5 * v + sun, 0.3 + 0.4 * u + 0.8 * sun, 0.8 * v + 0.4 * sun, np.ones_like(u)]
    made = bpy.data.images.new("panorama", size, size // 2, float_buffer=True)
    made.colorspace_settings.name = "Linear Rec.709"
    made.pixels.foreach_set(np.stack(sky, -1).astype(np.float32).ravel())
    made.update()
    made.pack()
    return made


def _environment(turn: float | None = None) -> None:
    node = world()
    tree = bpy.context.scene.world.node_tree
    picture = tree.nodes.new("ShaderNodeTexEnvironment")
    picture.image = _panorama()
    tree.links.new(picture.outputs["Color"], node.inputs["Color"])
    if turn is not None:
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Rotation"].default_value = (0.3, 0.2, turn)
        where = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(where.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], picture.inputs["Vector"])


@scene("Worlds")
def world_image() -> None:
    """An environment image."""
    _ground()
    _environment()


@scene("Worlds")
def world_image_turned() -> None:
    """An environment image that a mapping node rotates."""
    _ground()
    _environment(1.1)


@scene("Worlds")
def world_sky() -> None:
    """A sky texture, baked."""
    _ground()
    node = world(strength=0.3)
    tree = bpy.context.scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    kinds = {item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items}
    sky.sky_type = "PREETHAM" if "PREETHAM" in kinds else "HOSEK_WILKIE"
    sky.sun_direction = (0.4, -0.5, 0.6)
    sky.turbidity = 3.0
    tree.links.new(sky.outputs["Color"], node.inputs["Color"])


@scene("Worlds")
def world_gradient() -> None:
    """A world whose nodes, a gradient by height, are baked."""
    _ground()
    node = world()
    tree = bpy.context.scene.world.node_tree
    where = tree.nodes.new("ShaderNodeTexCoord")
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.1, 0.05, 0.02, 1)
    ramp.color_ramp.elements[1].color = (0.2, 0.5, 1.0, 1)
    tree.links.new(where.outputs["Generated"], split.inputs[0])
    tree.links.new(split.outputs["Z"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], node.inputs["Color"])
