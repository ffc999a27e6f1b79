# SPDX-License-Identifier: Apache-2.0
"""Convert recorded materials and textures to shader nodes of Cycles."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray
from recorded import Recorded

_SMOOTH = 0.0317
"""Wavecomb treats surfaces below this roughness as smooth."""


class Nodes:
    """Builder of a Blender material: adds shader nodes and connects their sockets."""

    def __init__(self, tree: Any, images: Images) -> None:
        self.tree = tree
        self.images = images
        tree.nodes.clear()

    def add(self, kind: str, **inputs: Any) -> Any:
        """Add a node. Keywords connect or set node inputs; "_" in a keyword stands for a space."""
        node = self.tree.nodes.new(kind)
        for name, value in inputs.items():
            socket = node.inputs[name.replace("_", " ")]
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            elif socket.type == "RGBA":
                socket.default_value = (*(float(v) for v in value), 1.0)
            else:
                socket.default_value = value
        return node

    def out(self, kind: str, socket: Any, use: str = "Surface") -> None:
        """Connect a socket to the output node of a material or world."""
        self.tree.links.new(socket, self.add(kind).inputs[use])

    def vector(self, operation: str, *operands: Any) -> Any:
        """Add a node for component-wise arithmetic on vectors."""
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        for socket, value in zip(node.inputs, operands, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs["Vector"]

    def texture(self, use: dict[str, Any], signed: bool = False) -> Any:
        """Add a lookup of texel * scale + bias, or of the plain texel for `signed` normal maps."""
        node = self.tree.nodes.new("ShaderNodeTexImage")
        node.image, node.extension = self.images.get(use["texture"])
        a, b, c, d, e, f = use.get("uv", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
        if b or d:
            raise NotImplementedError("a rotated texture")
        if (a, c, e, f) != (1.0, 0.0, 1.0, 0.0):
            uv = self.add("ShaderNodeUVMap").outputs["UV"]
            moved = self.vector("MULTIPLY_ADD", uv, (a, e, 1.0), (c, f, 0.0))
            self.tree.links.new(moved, node.inputs["Vector"])
        value, channel = node.outputs["Color"], use.get("channel", "rgb")
        scale, bias = (
            np.broadcast_to(np.asarray(use.get(k, d), float), 4)
            for k, d in (("scale", 1), ("bias", 0))
        )
        if signed:
            if tuple(scale[:3]) != (2.0,) * 3 or tuple(bias[:3]) != (-1.0,) * 3:
                raise NotImplementedError("a normal map that is not stored as (n + 1) / 2")
            return value
        if channel == "a":
            value, scale, bias = node.outputs["Alpha"], scale[[3] * 4], bias[[3] * 4]
        if any(scale[:3] != 1.0) or any(bias[:3] != 0.0):
            value = self.vector("MULTIPLY_ADD", value, tuple(scale[:3]), tuple(bias[:3]))
        if channel in ("r", "g", "b"):
            split = self.add("ShaderNodeSeparateXYZ", Vector=value)
            value = split.outputs["rgb".index(channel)]
        return value

    def parameter(self, m: dict[str, Any], name: str, default: Any) -> Any:
        """Return the texture node of a material parameter, or the value if it has no texture."""
        use = m.get("textures", {}).get(name)
        return self.texture(use) if use is not None else m.get(name, default)


class Images:
    """Blender images of recorded textures, made once for each; 8-bit textures stay 8-bit."""

    def __init__(self, recorded: Recorded) -> None:
        self.recorded = recorded
        self._made: dict[int, Any] = {}

    def get(self, number: int) -> tuple[Any, str]:
        """Return an image and its extension mode."""
        texture = self.recorded.textures[number]
        if number not in self._made:
            pixels = texture["pixels"]
            small = pixels.dtype == np.uint8
            space = "sRGB" if small and texture["srgb"] else "Non-Color"
            values = pixels.astype(np.float32) / (255.0 if small else 1.0)
            self._made[number] = image(values, space, small)
        wraps = {"repeat": "REPEAT", "mirror": "MIRROR", "clamp": "EXTEND", "black": "CLIP"}
        return self._made[number], wraps[texture.get("wrap_s", "repeat")]


def image(values: NDArray[np.float32], space: str, small: bool) -> Any:
    """Make a Blender image from an array (height, width, 1 to 4 channels), top row first."""
    height, width, channels = values.shape
    four = np.ones((height, width, 4), np.float32)
    four[:, :, :channels] = values
    if channels <= 2:
        four[:, :, :3] = values[:, :, :1]
        four[:, :, 3] = values[:, :, 1] if channels == 2 else 1.0
    made = bpy.data.images.new("texture", width, height, alpha=True, float_buffer=not small)
    made.colorspace_settings.name = space
    made.alpha_mode = "CHANNEL_PACKED"
    made.pixels.foreach_set(np.ascontiguousarray(four[::-1]).ravel())
    made.update()
    return made


def make_material(recorded: Recorded, number: int, images: Images) -> Any:
    """Make a Blender material for a recorded material, with the closest nodes."""
    m = recorded.materials[number]
    made = bpy.data.materials.new(m.get("name") or f"material{number}")
    made.use_nodes = True
    nodes = Nodes(made.node_tree, images)
    makers = {
        "diffuse": _diffuse,
        "metal": _metal,
        "dielectric": _dielectric,
        "plastic": _principled,
        "principled": _principled,
        "openpbr": _openpbr,
        "hair": _hair,
    }
    surface = makers[m["program"]](nodes, m) if m["program"] in makers else None
    emission = m.get("emission", (0.0, 0.0, 0.0))
    if any(emission):
        shines = nodes.add("ShaderNodeEmission", Color=emission, Strength=1.0).outputs[0]
        if surface is None:
            surface = shines
        else:
            both = nodes.add("ShaderNodeAddShader")
            for socket, part in zip(both.inputs, (surface, shines), strict=True):
                nodes.tree.links.new(part, socket)
            surface = both.outputs[0]
    nodes.out("ShaderNodeOutputMaterial", surface)
    return made


def _normal(nodes: Nodes, m: dict[str, Any]) -> dict[str, Any]:
    use = m.get("textures", {}).get("normal")
    if use is None:
        return {}
    return {
        "Normal": nodes.add("ShaderNodeNormalMap", Color=nodes.texture(use, signed=True)).outputs[0]
    }


def _roughness(nodes: Nodes, m: dict[str, Any]) -> Any:
    value = nodes.parameter(m, "roughness", 0.5)
    return 0.0 if isinstance(value, float) and value < _SMOOTH else value


def _diffuse(nodes: Nodes, m: dict[str, Any]) -> Any:
    colour = nodes.parameter(m, "base_color", (0.18,) * 3)
    node = nodes.add("ShaderNodeBsdfDiffuse", Color=colour, Roughness=0.0, **_normal(nodes, m))
    return node.outputs[0]


def _metal(nodes: Nodes, m: dict[str, Any]) -> Any:
    inputs = {"Roughness": _roughness(nodes, m), **_normal(nodes, m)}
    measured = any(m.get("conductor_eta", (0, 0, 0)))
    if measured:
        inputs |= {"IOR": m["conductor_eta"], "Extinction": m["conductor_k"]}
    else:
        tint = m.get("specular_color", (0, 0, 0))
        inputs["Base_Color"] = nodes.parameter(m, "base_color", (0.18,) * 3)
        inputs["Edge_Tint"] = tint if any(tint) else (1.0,) * 3
    node = nodes.add("ShaderNodeBsdfMetallic", **inputs)
    node.fresnel_type = "PHYSICAL_CONDUCTOR" if measured else "F82"
    node.distribution = "MULTI_GGX"
    return node.outputs[0]


def _dielectric(nodes: Nodes, m: dict[str, Any]) -> Any:
    """Convert glass. The tint is squared, since Principled transmits the root of base colour."""
    tint = np.asarray(m.get("base_color", (1.0,) * 3))
    node = nodes.add(
        "ShaderNodeBsdfPrincipled",
        Base_Color=tint**2,
        Roughness=_roughness(nodes, m),
        IOR=float(m.get("ior", 1.5)),
        Transmission_Weight=1.0,
        **_normal(nodes, m),
    )
    node.distribution = "GGX"
    return node.outputs[0]


def _principled(nodes: Nodes, m: dict[str, Any]) -> Any:
    """Convert `principled` or `plastic`, which is a diffuse base under a dielectric interface."""
    ior = float(m.get("ior", 1.5))
    node = nodes.add(
        "ShaderNodeBsdfPrincipled",
        Base_Color=nodes.parameter(m, "base_color", (0.18,) * 3),
        Roughness=_roughness(nodes, m),
        Metallic=nodes.parameter(m, "metallic", 0.0),
        IOR=ior,
        Coat_Weight=nodes.parameter(m, "clearcoat", 0.0),
        Coat_Roughness=nodes.parameter(m, "clearcoat_roughness", 0.01),
        Coat_IOR=ior,
        **_normal(nodes, m),
    )
    node.distribution = "MULTI_GGX"
    opacity = nodes.parameter(m, "opacity", 1.0)
    if isinstance(opacity, float) and opacity >= 1.0:
        return node.outputs[0]
    clear = nodes.add("ShaderNodeBsdfTransparent", Color=(1.0,) * 3).outputs[0]
    if not m.get("presence"):
        clear = _clear_interface(nodes, m, ior, clear)
    return _mix(nodes, opacity, clear, node.outputs[0])


def _clear_interface(nodes: Nodes, m: dict[str, Any], ior: float, clear: Any) -> Any:
    """Add the reflection of a UsdPreviewSurface of opacity 0 to its straight transmission."""
    if float(m.get("metallic", 0.0)) or float(m.get("clearcoat", 0.0)):
        raise NotImplementedError("a metal or a coat that transmits light")
    reflects = nodes.add(
        "ShaderNodeBsdfAnisotropic",
        Color=(1.0,) * 3,
        Roughness=_roughness(nodes, m),
        **_normal(nodes, m),
    )
    reflects.distribution = "MULTI_GGX"
    # The node inverts the index at back faces, where UsdPreviewSurface reflects as at front faces.
    back = nodes.add("ShaderNodeNewGeometry").outputs["Backfacing"]
    index = nodes.tree.nodes.new("ShaderNodeMath")
    index.operation = "MULTIPLY_ADD"
    nodes.tree.links.new(back, index.inputs[0])
    index.inputs[1].default_value, index.inputs[2].default_value = 1.0 / ior - ior, ior
    fresnel = nodes.add("ShaderNodeFresnel", IOR=index.outputs[0], **_normal(nodes, m))
    return _mix(nodes, fresnel.outputs[0], clear, reflects.outputs[0])


def _mix(nodes: Nodes, share: Any, first: Any, second: Any) -> Any:
    """Mix two closures; `share` is that of the second."""
    node = nodes.tree.nodes.new("ShaderNodeMixShader")
    for socket, value in zip(node.inputs, (share, first, second), strict=True):
        if isinstance(value, bpy.types.NodeSocket):
            nodes.tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node.outputs[0]


def _openpbr(nodes: Nodes, m: dict[str, Any]) -> Any:
    """Convert the base, specular, coat and subsurface lobes of OpenPBR, and ignore other lobes."""
    layers = m.get("openpbr", {})
    below = float(layers.get("subsurface_weight", 0.0))
    radius = np.asarray(layers.get("subsurface_radius", (0.0,) * 3), np.float64)
    colour = layers.get("subsurface_color") if below > 0 else None
    node = nodes.add(
        "ShaderNodeBsdfPrincipled",
        Base_Color=colour or nodes.parameter(m, "base_color", (0.8,) * 3),
        Roughness=_roughness(nodes, m),
        Metallic=nodes.parameter(m, "metallic", 0.0),
        IOR=float(m.get("ior", 1.5)),
        Coat_Weight=float(m.get("clearcoat", 0.0)),
        Coat_Roughness=float(m.get("clearcoat_roughness", 0.0)),
        Coat_IOR=float(layers.get("coat_ior", 1.6)),
        Subsurface_Weight=below if radius.any() else 0.0,
        Subsurface_Radius=tuple(float(r) for r in radius),
        Subsurface_Scale=1.0,
        Subsurface_Anisotropy=float(layers.get("subsurface_anisotropy", 0.0)),
        **_normal(nodes, m),
    )
    node.subsurface_method = "RANDOM_WALK"
    return node.outputs[0]


def _hair(nodes: Nodes, m: dict[str, Any]) -> Any:
    """Convert hair by its multiple-scattering colour; value graphs per strand are ignored."""
    node = nodes.tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    node.model = "CHIANG"
    node.parametrization = "COLOR"
    values = {
        "Color": (*(float(v) for v in m.get("base_color", (0.18,) * 3)), 1.0),
        "Roughness": float(m.get("roughness", 0.5)),
        "Radial Roughness": float(m.get("azimuthal_roughness", 0.3)),
        "Coat": 0.0,
        "IOR": float(m.get("ior", 1.5)),
        "Offset": 0.0,
        "Random Roughness": 0.0,
    }
    for name, value in values.items():
        if name in node.inputs:
            node.inputs[name].default_value = value
    return node.outputs[0]
