# SPDX-License-Identifier: Apache-2.0
"""Blender scenes compared with Cycles: materials."""

from __future__ import annotations

from typing import Any

import bpy
from build import (
    add,
    principled,
    put,
    shader,
    shader_of,
    show_lights,
    sphere,
    studio,
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
    """A material with a high index of refraction."""
    _ball(base_color=(0.5, 0.1, 0.1), ior=2.2, roughness=0.2)


@scene("Principled")
def principled_specular_level() -> None:
    """A material with a low Specular IOR Level."""
    _ball(base_color=(0.1, 0.3, 0.5), specular_ior_level=0.2, roughness=0.25)


@scene("Principled")
def principled_specular_high() -> None:
    """A material with a high Specular IOR Level."""
    _ball(base_color=(0.1, 0.3, 0.5), specular_ior_level=1.0, roughness=0.25)


@scene("Principled", outside=0.15, why="grazing reflections are tinted too")
def principled_specular_tint() -> None:
    """A tinted reflection."""
    _ball(base_color=(0.2, 0.2, 0.2), specular_tint=(1.0, 0.4, 0.2), ior=1.8, roughness=0.3)


@scene("Principled")
def principled_anisotropic() -> None:
    """An anisotropic metal."""
    _ball(base_color=(0.8, 0.8, 0.8), metallic=1.0, roughness=0.4, anisotropic=0.7)


@scene("Principled", 0.99, 1.015, 0.15, "another model of rough diffuse surfaces (EON)")
def principled_diffuse_roughness() -> None:
    """A rough diffuse base, in Blender versions that support it."""
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
    show_lights()


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


BOUNDARY = "light enters by refraction in Cycles, partly or wholly; the means agree"


@scene("Principled", outside=0.1, why=BOUNDARY, spp=256)
def principled_subsurface() -> None:
    """Subsurface scattering with a short free path."""
    _ball(
        base_color=(0.8, 0.5, 0.4), subsurface_weight=1.0, subsurface_scale=0.1,
        subsurface_radius=(1.0, 0.5, 0.25), roughness=0.6,
    )  # fmt: skip


@scene("Principled", outside=0.1, why=BOUNDARY, spp=256)
def principled_subsurface_deep() -> None:
    """Subsurface scattering with a long free path."""
    _ball(
        base_color=(0.8, 0.8, 0.6), subsurface_weight=1.0, subsurface_scale=0.5,
        subsurface_radius=(1.0, 0.8, 0.5), roughness=0.6,
    )  # fmt: skip


@scene("Principled", outside=0.1, why=BOUNDARY, spp=256)
def principled_subsurface_skin() -> None:
    """Subsurface scattering with the method that is meant for skin."""
    material = _ball(
        base_color=(0.8, 0.5, 0.4), subsurface_weight=1.0, subsurface_scale=0.1,
        subsurface_radius=(1.0, 0.5, 0.25), roughness=0.6,
    )  # fmt: skip
    shader_of(material).subsurface_method = "RANDOM_WALK_SKIN"


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


@scene("Shaders", outside=0.15, why="another model of rough diffuse surfaces (EON)")
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


@scene("Shaders", 0.96, 1.0, 0.2, "shadows of a hidden light get the tint's smallest component")
def shader_transparent() -> None:
    """Tinted Transparent BSDF, lit by a light that the camera does not see."""
    _node("ShaderNodeBsdfTransparent", Color=(0.4, 0.7, 0.9))


@scene("Shaders", spp=256)
def shader_transparent_visible_light() -> None:
    """Tinted Transparent BSDF, lit by a light with a shape."""
    _node("ShaderNodeBsdfTransparent", Color=(0.4, 0.7, 0.9))
    show_lights()


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
    """Mix of a diffuse and a glossy shader with different colours."""
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
