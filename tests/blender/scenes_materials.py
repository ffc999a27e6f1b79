# SPDX-License-Identifier: Apache-2.0
"""Parity scenes of materials and textures."""

from __future__ import annotations

from typing import Any

import bpy
from build import (
    add,
    light,
    picture,
    principled,
    put,
    shader,
    shader_of,
    show_lights,
    sphere,
    studio,
    textured,
    wall,
    wire,
)
from registry import scene


def _ball(**inputs: Any) -> Any:
    studio()
    material = principled(**inputs)
    sphere(material)
    if "transmission_weight" in inputs:
        show_lights()
    return material


@scene("Principled")
def principled_default() -> None:
    """The default material."""
    _ball()


@scene("Principled")
def principled_colour() -> None:
    """A base colour."""
    _ball(base_color=(0.7, 0.2, 0.1), roughness=0.3)


@scene("Principled")
def principled_smooth() -> None:
    """Low roughness."""
    _ball(base_color=(0.2, 0.3, 0.6), roughness=0.08)


@scene("Principled")
def principled_metal() -> None:
    """A metal with an edge tint."""
    _ball(base_color=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.3, specular_tint=(1.0, 0.9, 0.8))


@scene("Principled")
def principled_metal_half() -> None:
    """Half metallic."""
    _ball(base_color=(0.8, 0.5, 0.3), metallic=0.5, roughness=0.4)


@scene("Principled")
def principled_ior() -> None:
    """A high index of refraction."""
    _ball(base_color=(0.5, 0.1, 0.1), ior=2.2, roughness=0.2)


@scene("Principled")
def principled_specular_level() -> None:
    """A low Specular IOR Level."""
    _ball(base_color=(0.1, 0.3, 0.5), specular_ior_level=0.2, roughness=0.25)


@scene("Principled")
def principled_specular_high() -> None:
    """A high Specular IOR Level."""
    _ball(base_color=(0.1, 0.3, 0.5), specular_ior_level=1.0, roughness=0.25)


@scene("Principled")
def principled_specular_tint() -> None:
    """A tinted reflection."""
    _ball(base_color=(0.2, 0.2, 0.2), specular_tint=(1.0, 0.4, 0.2), ior=1.8, roughness=0.3)


@scene("Principled")
def principled_anisotropic() -> None:
    """An anisotropic metal."""
    _ball(base_color=(0.8, 0.8, 0.8), metallic=1.0, roughness=0.4, anisotropic=0.7)


@scene("Principled", 0.99, 1.015, 0.15, "another model of rough diffuse surfaces (EON)")
def principled_diffuse_roughness() -> None:
    """A rough diffuse base, where Blender has it."""
    names = {"roughness": 1.0, "specular_ior_level": 0.0}
    material = _ball(base_color=(0.7, 0.5, 0.3), **names)
    node = shader_of(material)
    if "Diffuse Roughness" in node.inputs:
        node.inputs["Diffuse Roughness"].default_value = 0.8


@scene("Principled", spp=256)
def principled_glass() -> None:
    """Clear glass."""
    _ball(transmission_weight=1.0, roughness=0.0, ior=1.45, base_color=(1, 1, 1))


@scene("Principled", spp=256)
def principled_glass_tinted() -> None:
    """Coloured glass."""
    _ball(transmission_weight=1.0, roughness=0.0, ior=1.45, base_color=(0.3, 0.8, 0.5))


@scene("Principled", spp=256)
def principled_glass_rough() -> None:
    """Rough glass."""
    _ball(transmission_weight=1.0, roughness=0.4, ior=1.45, base_color=(0.9, 0.9, 0.9))


@scene("Principled")
def principled_transmission_half() -> None:
    """Half transmissive."""
    _ball(transmission_weight=0.5, roughness=0.3, base_color=(0.8, 0.3, 0.2))


@scene("Principled")
def principled_coat() -> None:
    """A clear coat."""
    _ball(base_color=(0.6, 0.1, 0.1), roughness=0.6, coat_weight=1.0, coat_roughness=0.05)


@scene("Principled")
def principled_coat_tint() -> None:
    """A tinted coat over metal."""
    _ball(
        base_color=(0.8, 0.8, 0.8), metallic=1.0, roughness=0.4, coat_weight=0.8,
        coat_tint=(1.0, 0.6, 0.3), coat_roughness=0.1,
    )  # fmt: skip


@scene("Principled")
def principled_sheen() -> None:
    """Sheen."""
    _ball(base_color=(0.1, 0.1, 0.3), roughness=0.9, sheen_weight=1.0, sheen_roughness=0.4)


@scene("Principled")
def principled_sheen_tint() -> None:
    """A tinted sheen."""
    _ball(
        base_color=(0.1, 0.2, 0.1), roughness=0.9, sheen_weight=0.7, sheen_roughness=0.6,
        sheen_tint=(1.0, 0.5, 0.3),
    )  # fmt: skip


@scene("Principled")
def principled_emission() -> None:
    """Emission."""
    _ball(base_color=(0.1, 0.1, 0.1), emission_color=(1.0, 0.5, 0.2), emission_strength=3.0)


@scene("Principled")
def principled_alpha() -> None:
    """Partly transparent."""
    _ball(base_color=(0.7, 0.3, 0.2), alpha=0.4)


@scene("Principled", spp=256)
def principled_subsurface() -> None:
    """Subsurface scattering with a short free path."""
    _ball(
        base_color=(0.8, 0.5, 0.4), subsurface_weight=1.0, subsurface_scale=0.1,
        subsurface_radius=(1.0, 0.5, 0.25), roughness=0.6,
    )  # fmt: skip


@scene("Principled", spp=256)
def principled_subsurface_deep() -> None:
    """Subsurface scattering with a long free path."""
    _ball(
        base_color=(0.8, 0.8, 0.6), subsurface_weight=1.0, subsurface_scale=0.5,
        subsurface_radius=(1.0, 0.8, 0.5), roughness=0.6,
    )  # fmt: skip


@scene("Principled")
def principled_thin_film() -> None:
    """A thin film on glass-like plastic."""
    _ball(
        base_color=(0.05, 0.05, 0.05), roughness=0.2, thin_film_thickness=400.0, thin_film_ior=1.8,
    )  # fmt: skip


# ---- other shaders -------------------------------------------------------------------------------


def _node(kind: str, **inputs: Any) -> Any:
    studio()
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    shader(material, kind, **inputs)
    sphere(material)
    return material


@scene("Shaders")
def shader_diffuse() -> None:
    """Diffuse BSDF."""
    _node("ShaderNodeBsdfDiffuse", Color=(0.6, 0.3, 0.2))


@scene("Shaders")
def shader_diffuse_rough() -> None:
    """Rough Diffuse BSDF."""
    _node("ShaderNodeBsdfDiffuse", Color=(0.6, 0.3, 0.2), Roughness=0.8)


@scene("Shaders")
def shader_glossy() -> None:
    """Glossy BSDF."""
    _node("ShaderNodeBsdfAnisotropic", Color=(0.7, 0.6, 0.3), Roughness=0.3)


@scene("Shaders", spp=256)
def shader_glass() -> None:
    """Glass BSDF."""
    _node("ShaderNodeBsdfGlass", Color=(0.9, 0.95, 1.0), Roughness=0.0, IOR=1.5)
    show_lights()


@scene("Shaders")
def shader_translucent() -> None:
    """Translucent BSDF."""
    _node("ShaderNodeBsdfTranslucent", Color=(0.7, 0.7, 0.3))


@scene("Shaders")
def shader_transparent() -> None:
    """Tinted Transparent BSDF."""
    _node("ShaderNodeBsdfTransparent", Color=(0.4, 0.7, 0.9))


def _mixture(first: str, second: str, factor: float, a: Any = None, b: Any = None) -> None:
    studio()
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    mix = shader(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = factor
    for i, (kind, values) in enumerate(((first, a), (second, b)), start=1):
        wire(material, put(add(material, kind), **(values or {})).outputs[0], mix.inputs[i])
    sphere(material)


@scene("Shaders")
def mix_diffuse_glossy() -> None:
    """Mix of a diffuse and a glossy shader with their own colours."""
    _mixture(
        "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfAnisotropic", 0.4,
        {"Color": (0.2, 0.5, 0.7)}, {"Color": (0.8, 0.8, 0.8), "Roughness": 0.2},
    )  # fmt: skip


@scene("Shaders")
def mix_transparent() -> None:
    """Mix of a transparent and a diffuse shader."""
    _mixture(
        "ShaderNodeBsdfTransparent", "ShaderNodeBsdfDiffuse", 0.6, {}, {"Color": (0.7, 0.2, 0.2)}
    )


@scene("Shaders")
def mix_translucent() -> None:
    """Mix of a diffuse and a translucent shader."""
    _mixture(
        "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent", 0.5,
        {"Color": (0.6, 0.6, 0.2)}, {"Color": (0.6, 0.6, 0.2)},
    )  # fmt: skip


@scene("Shaders")
def add_emission() -> None:
    """Sum of a diffuse shader and an emission."""
    studio()
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    total = shader(material, "ShaderNodeAddShader")
    base = put(add(material, "ShaderNodeBsdfDiffuse"), Color=(0.3, 0.4, 0.5))
    glow = put(add(material, "ShaderNodeEmission"), Color=(1.0, 0.4, 0.1), Strength=0.8)
    wire(material, base.outputs[0], total.inputs[0])
    wire(material, glow.outputs[0], total.inputs[1])
    sphere(material)


# ---- textures ------------------------------------------------------------------------------------


@scene("Textures")
def texture_image() -> None:
    """An image by texture coordinates."""
    studio()
    wall(textured()[0])


@scene("Textures")
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


@scene("Textures")
def texture_normal_map() -> None:
    """A normal map."""
    studio()
    material = principled(base_color=(0.6, 0.6, 0.6), roughness=0.4)
    node = add(material, "ShaderNodeTexImage", image=picture("normals", data=True))
    convert = add(material, "ShaderNodeNormalMap")
    wire(material, node.outputs["Color"], convert.inputs["Color"])
    wire(material, convert.outputs["Normal"], shader_of(material).inputs["Normal"])
    wall(material)


@scene("Textures")
def texture_roughness() -> None:
    """Roughness and metalness by an image."""
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
    """Hue, gamma, contrast, inversion and a multiplied colour."""
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
    """Two colours by a Fresnel node, in a group."""
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
