# SPDX-License-Identifier: Apache-2.0
"""Blender scenes compared with Cycles: textures and value nodes."""

from __future__ import annotations

from typing import Any

import bpy
from build import (
    add,
    cube,
    light,
    picture,
    principled,
    put,
    shader_of,
    sphere,
    studio,
    textured,
    wall,
    wire,
)
from registry import scene

# ---- textures ------------------------------------------------------------------------------------


@scene("Textures")
def texture_image() -> None:
    """An image mapped by texture coordinates."""
    studio()
    wall(textured()[0])


@scene("Textures", outside=0.15, why="filtering of textures")
def texture_mapping() -> None:
    """An image, scaled, turned and moved."""
    studio()
    material, _, node = textured()
    where = add(material, "ShaderNodeTexCoord")
    mapping = add(material, "ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (2.0, 1.5, 1.0)
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, 0.5)
    mapping.inputs["Location"].default_value = (0.2, -0.1, 0.0)
    wire(material, where.outputs["UV"], mapping.inputs["Vector"])
    wire(material, mapping.outputs["Vector"], node.inputs["Vector"])
    wall(material)


@scene("Textures")
def texture_clip() -> None:
    """An image that is black outside of 0 to 1."""
    studio()
    material, _, node = textured()
    node.extension = "CLIP"
    mapping = add(material, "ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (1.6, 1.6, 1.0)
    where = add(material, "ShaderNodeTexCoord")
    wire(material, where.outputs["UV"], mapping.inputs["Vector"])
    wire(material, mapping.outputs["Vector"], node.inputs["Vector"])
    wall(material)


@scene("Textures")
def texture_alpha() -> None:
    """An image whose alpha cuts the surface out."""
    studio()
    material, surface, node = textured()
    wire(material, node.outputs["Alpha"], surface.inputs["Alpha"])
    wall(material)


def _normal_mapped() -> Any:
    studio()
    material = principled(base_color=(0.6, 0.6, 0.6), roughness=0.4)
    node = add(material, "ShaderNodeTexImage", image=picture("normals", data=True))
    convert = add(material, "ShaderNodeNormalMap")
    wire(material, node.outputs["Color"], convert.inputs["Color"])
    wire(material, convert.outputs["Normal"], shader_of(material).inputs["Normal"])
    wall(material)
    return material


@scene("Textures", 0.99, 1.03, 0.42, "Bump Map Correction of Cycles darkens tilted normals")
def texture_normal_map() -> None:
    """A normal map."""
    _normal_mapped()


@scene("Textures")
def texture_normal_map_plain() -> None:
    """A normal map without Bump Map Correction."""
    _normal_mapped().cycles.use_bump_map_correction = False


@scene("Textures", outside=0.2, why="sharp highlights converge slowly")
def texture_roughness() -> None:
    """Roughness and metalness driven by an image."""
    studio()
    material = principled(base_color=(0.8, 0.6, 0.4))
    node = add(material, "ShaderNodeTexImage", image=picture())
    node.image.colorspace_settings.name = "Non-Color"
    split = add(material, "ShaderNodeSeparateColor")
    wire(material, node.outputs["Color"], split.inputs[0])
    wire(material, split.outputs["Red"], shader_of(material).inputs["Roughness"])
    wire(material, split.outputs["Green"], shader_of(material).inputs["Metallic"])
    sphere(material)


@scene("Textures")
def texture_ramp() -> None:
    """A gradient through a colour ramp."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    gradient = add(material, "ShaderNodeTexGradient")
    ramp = add(material, "ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.7, 0.05, 0.02, 1)
    ramp.color_ramp.elements.new(0.4).color = (0.9, 0.8, 0.1, 1)
    ramp.color_ramp.elements[-1].color = (0.05, 0.1, 0.7, 1)
    where = add(material, "ShaderNodeTexCoord")
    wire(material, where.outputs["UV"], gradient.inputs["Vector"])
    wire(material, gradient.outputs["Fac"], ramp.inputs["Fac"])
    wire(material, ramp.outputs["Color"], shader_of(material).inputs["Base Color"])
    wall(material)


@scene("Textures")
def texture_checker() -> None:
    """A checker in generated coordinates."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    node = put(
        add(material, "ShaderNodeTexChecker"), Color1=(0.7, 0.2, 0.1), Color2=(0.1, 0.3, 0.7),
        Scale=4.3,
    )  # fmt: skip
    wire(material, node.outputs["Color"], shader_of(material).inputs["Base Color"])
    sphere(material)


@scene("Textures")
def texture_colour_nodes() -> None:
    """An image with adjusted hue, gamma and contrast, inverted and multiplied by a colour."""
    studio()
    material, surface, node = textured()
    hue = put(add(material, "ShaderNodeHueSaturation"), Hue=0.6, Saturation=0.8, Value=0.9)
    gamma = put(add(material, "ShaderNodeGamma"), Gamma=1.4)
    contrast = put(add(material, "ShaderNodeBrightContrast"), Bright=0.05, Contrast=0.2)
    mix = add(material, "ShaderNodeMix", data_type="RGBA", blend_type="MULTIPLY")
    mix.inputs[0].default_value = 0.5
    mix.inputs[7].default_value = (0.9, 0.6, 0.5, 1.0)
    invert = put(add(material, "ShaderNodeInvert"), Color=(0, 0, 0))
    invert.inputs[0].default_value = 0.3
    wire(material, node.outputs["Color"], hue.inputs["Color"])
    wire(material, hue.outputs[0], gamma.inputs["Color"])
    wire(material, gamma.outputs[0], contrast.inputs["Color"])
    wire(material, contrast.outputs[0], mix.inputs[6])
    wire(material, mix.outputs[2], invert.inputs["Color"])
    wire(material, invert.outputs[0], surface.inputs["Base Color"])
    wall(material)


@scene("Textures")
def texture_fresnel_mix() -> None:
    """Two colours that a Fresnel node mixes, in a node group."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    group = bpy.data.node_groups.new("edge", "ShaderNodeTree")
    group.interface.new_socket("Centre", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    entry, leave = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    weight = put(group.nodes.new("ShaderNodeFresnel"), IOR=1.6)
    mix = group.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    mix.inputs[7].default_value = (0.9, 0.9, 0.2, 1.0)
    group.links.new(weight.outputs[0], mix.inputs[0])
    group.links.new(entry.outputs[0], mix.inputs[6])
    group.links.new(mix.outputs[2], leave.inputs[0])
    node = add(material, "ShaderNodeGroup")
    node.node_tree = group
    node.inputs[0].default_value = (0.1, 0.2, 0.6, 1.0)
    wire(material, node.outputs[0], shader_of(material).inputs["Base Color"])
    sphere(material)


@scene("Textures")
def texture_vertex_colour() -> None:
    """A colour attribute."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    node = add(material, "ShaderNodeVertexColor", layer_name="Tint")
    wire(material, node.outputs["Color"], shader_of(material).inputs["Base Color"])
    thing = sphere(material)
    tint = thing.data.color_attributes.new("Tint", "FLOAT_COLOR", "POINT")
    for vertex, value in zip(thing.data.vertices, tint.data, strict=True):
        x, y, z = vertex.co
        value.color = (0.5 + 0.5 * x, 0.5 + 0.5 * y, 0.5 + 0.5 * z, 1.0)
    light("POINT", 100.0, at=(-3, -3, 2))


# ---- nodes that are baked ------------------------------------------------------------------------


def _procedural(kind: str, output: str = "Color", **inputs: Any) -> Any:
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    node = put(add(material, kind), **inputs)
    wire(material, node.outputs[output], shader_of(material).inputs["Base Color"])
    sphere(material)
    return material


@scene("Baked")
def baked_noise() -> None:
    """A noise texture in generated coordinates."""
    _procedural("ShaderNodeTexNoise", Scale=4.0)


@scene("Baked")
def baked_voronoi() -> None:
    """A Voronoi texture's distance."""
    _procedural("ShaderNodeTexVoronoi", output="Distance", Scale=4.0)


@scene("Baked")
def baked_brick() -> None:
    """Bricks on a wall, by its texture coordinates."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    node = put(add(material, "ShaderNodeTexBrick"), Scale=4.0, Color1=(0.6, 0.2, 0.1))
    where = add(material, "ShaderNodeTexCoord")
    wire(material, where.outputs["UV"], node.inputs["Vector"])
    wire(material, node.outputs["Color"], shader_of(material).inputs["Base Color"])
    wall(material)


@scene("Baked")
def baked_magic() -> None:
    """A magic texture, and a distorted wave that drives roughness."""
    material = _procedural("ShaderNodeTexMagic", Scale=3.0)
    wave = put(add(material, "ShaderNodeTexWave"), Scale=2.0, Distortion=4.0)
    wire(material, wave.outputs["Fac"], shader_of(material).inputs["Roughness"])
    shader_of(material).inputs["Specular IOR Level"].default_value = 0.5


@scene("Baked")
def baked_two_objects() -> None:
    """A noise through a colour ramp on two objects that share a material."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    node = put(add(material, "ShaderNodeTexNoise"), Scale=3.0)
    ramp = add(material, "ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.7, 0.05, 0.02, 1)
    ramp.color_ramp.elements[1].color = (0.1, 0.6, 0.8, 1)
    wire(material, node.outputs[0], ramp.inputs["Fac"])
    wire(material, ramp.outputs["Color"], shader_of(material).inputs["Base Color"])
    sphere(material, at=(-1.0, 0, 0.8), radius=0.8)
    cube(material, at=(1.2, 0.5, 0.7), size=1.4)


@scene("Baked")
def baked_bump() -> None:
    """A bump map from a noise texture."""
    studio()
    material = principled(base_color=(0.6, 0.6, 0.6), roughness=0.5)
    material.cycles.use_bump_map_correction = False
    noise = put(add(material, "ShaderNodeTexNoise"), Scale=5.0, Detail=0.0)
    bump = put(add(material, "ShaderNodeBump"), Strength=0.6, Distance=0.3)
    wire(material, noise.outputs[0], bump.inputs["Height"])
    wire(material, bump.outputs["Normal"], shader_of(material).inputs["Normal"])
    sphere(material)


@scene("Baked")
def baked_displacement() -> None:
    """A displacement that Blender renders as a bump."""
    studio()
    material = principled(base_color=(0.5, 0.6, 0.5), roughness=0.6)
    material.cycles.use_bump_map_correction = False
    noise = put(add(material, "ShaderNodeTexNoise"), Scale=5.0, Detail=0.0)
    node = put(add(material, "ShaderNodeDisplacement"), Scale=0.15)
    wire(material, noise.outputs[0], node.inputs["Height"])
    output = material.node_tree.get_output_node("CYCLES")
    wire(material, node.outputs[0], output.inputs["Displacement"])
    wall(material)


@scene("Baked")
def baked_group() -> None:
    """A noise in a node group, then colour curves."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    group = bpy.data.node_groups.new("spots", "ShaderNodeTree")
    group.interface.new_socket("Size", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    entry, leave = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    noise = group.nodes.new("ShaderNodeTexNoise")
    group.links.new(entry.outputs[0], noise.inputs["Scale"])
    group.links.new(noise.outputs["Color"], leave.inputs[0])
    node = add(material, "ShaderNodeGroup")
    node.node_tree = group
    node.inputs[0].default_value = 3.0
    curves = add(material, "ShaderNodeRGBCurve")
    curves.mapping.curves[3].points.new(0.5, 0.3)
    curves.mapping.update()
    wire(material, node.outputs[0], curves.inputs["Color"])
    wire(material, curves.outputs[0], shader_of(material).inputs["Base Color"])
    sphere(material)


@scene("Baked")
def baked_group_alone() -> None:
    """A noise in a node group, whose output is used directly."""
    studio()
    material = principled(roughness=1.0, specular_ior_level=0.0)
    group = bpy.data.node_groups.new("spots", "ShaderNodeTree")
    group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    leave = group.nodes.new("NodeGroupOutput")
    noise = group.nodes.new("ShaderNodeTexNoise")
    group.links.new(noise.outputs[0], leave.inputs[0])
    node = add(material, "ShaderNodeGroup")
    node.node_tree = group
    wire(material, node.outputs[0], shader_of(material).inputs["Base Color"])
    sphere(material)
