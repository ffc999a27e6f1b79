# SPDX-License-Identifier: Apache-2.0
"""Blender scenes compared with Cycles: cameras, motion, volumes, and combined features."""

from __future__ import annotations

import math
from typing import Any

import bpy
from build import (
    add,
    camera,
    cube,
    floor,
    light,
    link,
    principled,
    shader,
    shader_of,
    show_lights,
    sphere,
    studio,
    textured,
    wire,
    world,
)
from registry import scene

# ---- cameras -------------------------------------------------------------------------------------


def _row(**options: Any) -> Any:
    studio()
    for i, at in enumerate(((-1.6, -2, 0.6), (0, 0, 0.6), (1.6, 2, 0.6))):
        tint = (0.7, 0.2 + 0.2 * i, 0.1)
        sphere(principled(f"m{i}", base_color=tint), at=at, radius=0.6, segments=48)
    return camera(**options)


@scene("Cameras")
def camera_wide() -> None:
    """A wide lens with a vertical sensor fit."""
    _row(lens=24.0, sensor_fit="VERTICAL", sensor_height=20.0)


@scene("Cameras")
def camera_shift() -> None:
    """A shifted lens."""
    _row(shift_x=0.12, shift_y=-0.08)


@scene("Cameras")
def camera_orthographic() -> None:
    """An orthographic camera."""
    _row(type="ORTHO", ortho_scale=6.0)


@scene("Cameras", spp=256)
def camera_depth_of_field() -> None:
    """Depth of field."""
    data = _row(lens=60.0).data
    data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 6.0, 0.1


@scene("Cameras", spp=256)
def camera_focus_object() -> None:
    """Depth of field on an object, with six blades."""
    data = _row(lens=60.0).data
    data.dof.use_dof, data.dof.aperture_fstop, data.dof.aperture_blades = True, 0.1, 6
    data.dof.focus_object = bpy.data.objects["Sphere"]


@scene("Cameras")
def camera_panorama() -> None:
    """An equirectangular panorama."""
    thing = _row(type="PANO")
    kind = thing.data if hasattr(thing.data, "panorama_type") else thing.data.cycles
    kind.panorama_type = "EQUIRECTANGULAR"
    thing.location, thing.rotation_euler = (0.3, -3, 1.5), (math.pi / 2, 0, 0.2)


@scene("Cameras")
def camera_border() -> None:
    """A render region, cropped."""
    _row()
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.0, 0.5


@scene("Cameras")
def camera_pixel_aspect() -> None:
    """Pixels that are not square."""
    _row()
    bpy.context.scene.render.pixel_aspect_x = 1.5


# ---- motion --------------------------------------------------------------------------------------


def _blurred(shutter: float = 0.5) -> None:
    scene_ = bpy.context.scene
    scene_.render.use_motion_blur, scene_.render.motion_blur_shutter = True, shutter
    scene_.frame_set(10)


def _moved(thing: Any, path: str, first: Any, last: Any) -> None:
    for frame, value in ((9, first), (11, last)):
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)
    animation = thing.animation_data.action
    curves = getattr(animation, "fcurves", None)
    if curves is None:
        curves = animation.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


@scene("Motion", spp=256)
def motion_object() -> None:
    """A moving ball."""
    studio()
    _moved(sphere(principled(base_color=(0.7, 0.3, 0.2))), "location", (-1, 0, 1), (1, 0, 1))
    _blurred()


@scene("Motion", spp=256)
def motion_turn() -> None:
    """A turning cube, with a shutter that opens at the start of the frame."""
    studio()
    _moved(cube(principled(base_color=(0.3, 0.3, 0.7))), "rotation_euler", (0, 0, 0), (0, 0, 1.2))
    _blurred(0.8)
    render = bpy.context.scene.render
    if hasattr(render, "motion_blur_position"):
        render.motion_blur_position = "START"
    else:
        bpy.context.scene.cycles.motion_blur_position = "START"


@scene("Motion", spp=256)
def motion_camera() -> None:
    """A moving camera."""
    thing = _row()
    _moved(thing, "location", (-0.4, -7, 3), (0.4, -7, 3))
    _blurred()


@scene("Motion", spp=256)
def motion_deform() -> None:
    """A mesh that shape keys deform."""
    studio()
    thing = sphere(principled(base_color=(0.3, 0.6, 0.3)), segments=48)
    thing.shape_key_add(name="rest")
    key = thing.shape_key_add(name="wide")
    for point in key.data:
        point.co.x *= 2.0
    for frame, value in ((9, 0.0), (11, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    _blurred()


# ---- volumes -------------------------------------------------------------------------------------


def _fog(kind: str, **inputs: Any) -> Any:
    studio(0.6)
    material = bpy.data.materials.new("fog")
    material.use_nodes = True
    shader(material, kind, to="Volume", **inputs)
    # Keep the cube slightly above the floor: if faces coincide, the extent of the medium is
    # undefined.
    cube(material, at=(0, 0, 1.02))
    return material


@scene("Volumes", spp=256)
def volume_scatter() -> None:
    """A cube of fog."""
    _fog("ShaderNodeVolumeScatter", Color=(0.8, 0.8, 0.9), Density=0.8)


@scene("Volumes")
def volume_absorption() -> None:
    """A cube that only absorbs."""
    _fog("ShaderNodeVolumeAbsorption", Color=(0.2, 0.5, 0.8), Density=1.0)


@scene("Volumes")
def volume_principled() -> None:
    """A Principled Volume that scatters forwards."""
    _fog(
        "ShaderNodeVolumePrincipled", Color=(0.6, 0.7, 0.5), Density=1.2, Anisotropy=0.4
    )  # fmt: skip


# ---- combinations --------------------------------------------------------------------------------


@scene(
    "Combined",
    0.96,
    1.03,
    0.2,
    "noisy caustics of rough glass under a light hidden from the camera",
)
def combined_still_life() -> None:
    """Glass, metal, cloth and a texture under three lights."""
    floor((0.5, 0.4, 0.3))
    world((0.1, 0.12, 0.15))
    camera()
    light("AREA", 200.0, shape="RECTANGLE", size=2.0, size_y=0.5)
    light("SPOT", 400.0, at=(-3, -3, 4), spot_size=1.0, spot_blend=0.4, shadow_soft_size=0.2)
    light("SUN", 0.5, angle=0.1, color=(1.0, 0.8, 0.6))
    sphere(
        principled("glass", transmission_weight=1.0, roughness=0.05),
        at=(-1.3, -0.5, 0.6),
        radius=0.6,
    )
    sphere(
        principled("gold", metallic=1.0, base_color=(0.9, 0.6, 0.2), roughness=0.2),
        at=(1.3, 0, 0.7),
        radius=0.7,
    )
    sphere(
        principled("cloth", sheen_weight=0.8, base_color=(0.3, 0.1, 0.2)),
        at=(0, 1, 0.8),
        radius=0.8,
    )
    cube(textured("tiles")[0], at=(0, -1.4, 0.3), size=0.6)


@scene("Combined")
def combined_room() -> None:
    """A closed room with one area light and many diffuse bounces."""
    diffuse = bpy.data.materials.new("walls")
    diffuse.use_nodes = True
    shader(diffuse, "ShaderNodeBsdfDiffuse", Color=(0.7, 0.65, 0.6))
    room = cube(diffuse, at=(0, 0, 2), size=4.0, turn=(0, 0, 0))
    room.scale.y = 2.5
    sphere(principled(base_color=(0.2, 0.3, 0.7), roughness=0.3), at=(0.6, 1.5, 0.8), radius=0.8)
    light("AREA", 120.0, at=(0, 0, 3.9), target=(0, 0, 0), shape="SQUARE", size=1.0)
    camera(at=(0, -4.5, 2), target=(0, 2, 1.6), lens=28.0)


@scene("Combined", outside=0.1, why="filtering of textures far away")
def combined_outdoor() -> None:
    """Sun and sky on textured and instanced objects, with depth of field."""
    floor((0.3, 0.35, 0.2))
    world((0.4, 0.55, 0.8), 0.8)
    light("SUN", 4.0, angle=math.radians(0.5))
    first = cube(textured("tiles")[0], at=(-2, 0, 0.5), size=1.0)
    for i in range(1, 6):
        link(f"copy {i}", first.data, (-2 + 0.9 * i, 0.8 * i - 1.0, 0.5), (0, 0, 0.4 * i))
    data = camera(lens=50.0).data
    data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 7.0, 0.4


@scene("Combined", spp=256)
def combined_motion_lights() -> None:
    """A turning emissive object among moving metal balls."""
    studio(0.1)
    glow = principled("glow", emission_color=(1.0, 0.5, 0.2), emission_strength=6.0)
    thing = cube(glow, at=(0, 0, 0.8), size=0.5)
    metal = principled("metal", metallic=1.0, base_color=(0.8, 0.8, 0.9), roughness=0.3)
    _moved(sphere(metal, radius=0.5), "location", (-1.8, 0, 0.5), (-1.2, 0, 0.5))
    sphere(metal, at=(1.4, 0.3, 0.6), radius=0.6)
    _blurred()
    assert thing is not None


def _mirrors() -> None:
    studio(0.1)
    mirror = principled("mirror", metallic=1.0, roughness=0.0, base_color=(0.95, 0.95, 0.95))
    thing = cube(mirror, at=(0, 1.5, 1.2), size=2.4, turn=(0, 0, 0.1))
    thing.scale.y = 0.05
    sphere(
        principled("car", base_color=(0.5, 0.02, 0.02), coat_weight=1.0),
        at=(-0.7, -0.6, 0.7),
        radius=0.7,
    )
    light("POINT", 60.0, at=(3.5, -3.5, 2.5), shadow_soft_size=0.2)


@scene("Combined")
def combined_mirrors() -> None:
    """A mirror and a coated ball, which both reflect a visible light."""
    _mirrors()
    show_lights()


@scene("Combined")
def combined_mirrors_hidden_light() -> None:
    """The same mirrors with lights that the camera does not see."""
    _mirrors()


@scene("Combined")
def combined_graph() -> None:
    """A material graph in which an image, a ramp and a facing-ratio mask drive five inputs."""
    studio()
    material, surface, node = textured("graph")
    surface.inputs["Specular IOR Level"].default_value = 0.5
    facing = add(material, "ShaderNodeLayerWeight")
    facing.inputs["Blend"].default_value = 0.3
    wire(material, facing.outputs["Facing"], surface.inputs["Metallic"])
    scaled = add(material, "ShaderNodeMath", operation="MULTIPLY_ADD")
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = 0.6, 0.2
    wire(material, node.outputs["Alpha"], scaled.inputs[0])
    wire(material, scaled.outputs[0], surface.inputs["Roughness"])
    wire(material, node.outputs["Color"], surface.inputs["Sheen Tint"])
    surface.inputs["Sheen Weight"].default_value = 0.4
    assert shader_of(material) == surface
    sphere(material)
