# SPDX-License-Identifier: GPL-3.0-or-later
"""Translations of single value nodes, by node type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .exr import write
from .graph import Value, colour, number, vector
from .images import file_of, space_of
from .lights import blackbody
from .nodes import Nodes
from .usda import Asset, safe_name

MakeValue = Callable[[Nodes, Any, Any], "Value | None"]
WRAPS = {"REPEAT": "periodic", "EXTEND": "clamp", "CLIP": "constant", "MIRROR": "mirror"}


# ---- inputs --------------------------------------------------------------------------------------


def _rgb(n: Nodes, node: Any, socket: Any) -> Value:
    return colour(socket.default_value)


def _value(n: Nodes, node: Any, socket: Any) -> Value:
    return number(socket.default_value)


def _uv(n: Nodes, name: str = "") -> Value:
    """Returns texture coordinates; the exporter names the active set "st"."""
    name = safe_name(name) if name and name != "UVMap" else "st"
    flat = n.graph.node("geompropvalue_vector2", "vector2", geomprop=name)
    return n.graph.to("vector3", flat)


def _uv_map(n: Nodes, node: Any, socket: Any) -> Value:
    return _uv(n, node.uv_map)


def _coordinates(n: Nodes, node: Any, socket: Any) -> Value | None:
    if socket.name == "UV":
        return _uv(n)
    if socket.name == "Object" and node.object is None:
        return n.graph.node("position_vector3", "vector3", space="object")
    if socket.name == "Normal":
        return n.graph.node("normal_vector3", "vector3", space="object")
    if socket.name == "Generated":
        return _generated(n)
    return None


def _generated(n: Nodes) -> Value | None:
    """Returns generated coordinates, 0 to 1 in the bounds of the object with the material."""
    owners = {
        thing.data.name: thing
        for thing in n.into.scene.objects
        if thing.type == "MESH"
        and any(s.material and s.material.name == n.owner for s in thing.material_slots)
    }
    boxes = {tuple(tuple(round(v, 5) for v in c) for c in t.bound_box) for t in owners.values()}
    if len(boxes) != 1:
        return None
    corners = list(boxes.pop())
    low = [min(c[i] for c in corners) for i in range(3)]
    size = [max(max(c[i] for c in corners) - low[i], 1e-6) for i in range(3)]
    place = n.graph.node("position_vector3", "vector3", space="object")
    moved = n.graph.op("subtract", place, vector(low))
    return n.graph.op("divide", moved, vector(size))


def _geometry(n: Nodes, node: Any, socket: Any) -> Value | None:
    if socket.name == "Position":
        return n.graph.node("position_vector3", "vector3", space="world")
    if socket.name in ("Normal", "True Normal"):
        return n.graph.node("normal_vector3", "vector3", space="world")
    return None


def _attribute(n: Nodes, node: Any, socket: Any) -> Value | None:
    name = node.attribute_name if node.type == "ATTRIBUTE" else node.layer_name
    if not name or (node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY"):
        return None
    if socket.name == "Alpha":
        return None
    kind = "float" if socket.name in ("Fac", "Factor") else "color3"
    found = n.graph.node(f"geompropvalue_{kind}", kind, geomprop=safe_name(name))
    return n.graph.to("vector3", found) if socket.name == "Vector" else found


def _image(n: Nodes, node: Any, socket: Any) -> Value | None:
    if node.image is None:
        return colour((0, 0, 0)) if socket.name == "Color" else number(0.0)
    if node.projection != "FLAT":
        return None
    uses_alpha = any(link.is_valid for link in node.outputs["Alpha"].links)
    file = file_of(n.into, node.image, associate=not uses_alpha)
    if file is None:
        return None
    where = n.read(node, "Vector") if node.inputs["Vector"].links else _uv(n)
    flat = n.graph.to("vector2", where)
    kind = "color3" if socket.name == "Color" else "vector4"
    inputs: dict[str, Any] = {"file": Asset(file), "texcoord": flat}
    inputs["uaddressmode"] = inputs["vaddressmode"] = WRAPS[node.extension]
    if node.extension == "CLIP":
        inputs["default"] = Value(kind, (0.0,) * (3 if kind == "color3" else 4))
    if node.interpolation == "Closest":
        inputs["filtertype"] = "closest"
    made = n.graph.node(f"image_{kind}", kind, **inputs)
    prim = n.into.layer.over(made.path.rpartition(".")[0])
    space = space_of(n.into, node.image) if kind == "color3" else "raw"
    line = next(i for i, text in enumerate(prim.lines) if text.startswith("asset inputs:file"))
    prim.lines[line] += f' (colorSpace = "{space}")'
    return made if kind == "color3" else n.graph.component(made, 3)


# ---- vectors -------------------------------------------------------------------------------------


def _mapping(n: Nodes, node: Any, socket: Any) -> Value | None:
    if node.inputs["Rotation"].links:
        return None
    g, kind = n.graph, node.vector_type
    point = n.read(node, "Vector")
    scale = n.read(node, "Scale", "vector3")
    place = n.read(node, "Location", "vector3") if "Location" in node.inputs else vector((0, 0, 0))
    turn = node.inputs["Rotation"].default_value.to_matrix()
    if kind == "TEXTURE":
        point = g.op("subtract", point, place)
        return g.op("divide", _turned(n, point, turn.transposed()), scale)
    if kind == "NORMAL":
        turned = _turned(n, g.op("divide", point, scale), turn)
        return g.node("normalize_vector3", "vector3", in_=turned)
    turned = _turned(n, g.op("multiply", point, scale), turn)
    return turned if kind == "VECTOR" else g.op("add", turned, place)


def _turned(n: Nodes, point: Value, turn: Any) -> Value:
    if all(abs(turn[i][j] - (i == j)) < 1e-7 for i in range(3) for j in range(3)):
        return point
    rows = [
        n.graph.node("dotproduct_vector3", "float", in1=point, in2=vector(turn[i]))
        for i in range(3)
    ]
    return n.graph.combine("vector3", *rows)


def _normal_map(n: Nodes, node: Any, socket: Any) -> Value | None:
    if node.space != "TANGENT":
        return None
    picked = n.graph.to("vector3", n.read(node, "Color"))
    scale = n.read(node, "Strength", "float")
    return n.graph.node("normalmap_float", "vector3", in_=picked, scale=scale)


# ---- colours -------------------------------------------------------------------------------------


def _mix(n: Nodes, node: Any, socket: Any) -> Value | None:
    """Translates the node Mix, whose sockets of equal name differ by identifier."""
    names = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}
    if node.data_type not in names:
        return None
    by_id = {one.identifier: one for one in node.inputs}
    ending = names[node.data_type]
    kind = {"Float": "float", "Vector": "vector3", "Color": "color3"}[ending]
    a, b = (n.socket(by_id[f"{side}_{ending}"], kind) for side in "AB")
    factor = n.socket(by_id["Factor_Float"], "float")
    if node.clamp_factor:
        factor = n.graph.clamped(factor)
    blend = node.blend_type if ending == "Color" else "MIX"
    return _blended(n, blend, a, b, factor, ending == "Color" and node.clamp_result)


def _mix_rgb(n: Nodes, node: Any, socket: Any) -> Value | None:
    factor = n.graph.clamped(n.read(node, "Fac", "float"))
    a, b = n.read(node, "Color1", "color3"), n.read(node, "Color2", "color3")
    return _blended(n, node.blend_type, a, b, factor, node.use_clamp)


def _blended(n: Nodes, blend: str, a: Value, b: Value, factor: Value, clamp: bool) -> Value | None:
    g = n.graph
    one = Value(a.kind, (1.0,) * 3)
    plain = {"MULTIPLY": "multiply", "ADD": "add", "SUBTRACT": "subtract", "DIVIDE": "divide"}
    if blend == "MIX":
        made: Value | None = g.mix(a, b, factor)
    elif blend in plain:
        made = g.mix(a, g.op(plain[blend], a, b), factor)
    elif blend in ("DARKEN", "LIGHTEN"):
        made = g.mix(a, g.op("min" if blend == "DARKEN" else "max", a, b), factor)
    elif blend == "SCREEN":
        inverse = g.op("multiply", g.op("subtract", one, a), g.op("subtract", one, b))
        made = g.mix(a, g.op("subtract", one, inverse), factor)
    elif blend == "DIFFERENCE":
        made = g.mix(a, g.op("absval", g.op("subtract", a, b)), factor)
    elif blend == "OVERLAY":
        made = g.mix(a, g.node("overlay_color3", "color3", fg=b, bg=a), factor)
    else:
        return None
    return g.clamped(made) if clamp and made is not None else made


def _ramp(n: Nodes, node: Any, socket: Any) -> Value | None:
    """Translates the node Color Ramp to a lookup in an image of 1024 texels."""
    at = n.graph.clamped(n.read(node, "Fac", "float"))
    ramp = node.color_ramp
    if at.constant is not None:
        found = ramp.evaluate(at.constant)
        return number(found[3]) if socket.name == "Alpha" else colour(found)
    if socket.name == "Alpha":
        return None
    file = _ramp_file(n, node)
    scaled = n.graph.op("add", n.graph.op("multiply", at, number(1023 / 1024)), number(0.5 / 1024))
    where = n.graph.node("combine2_vector2", "vector2", in1=scaled, in2=number(0.5))
    kind = "closest" if ramp.interpolation == "CONSTANT" else "linear"
    made = n.graph.node(
        "image_color3", "color3", file=Asset(file), texcoord=where, uaddressmode="clamp",
        vaddressmode="clamp", filtertype=kind,
    )  # fmt: skip
    prim = n.into.layer.over(made.path.rpartition(".")[0])
    line = next(i for i, text in enumerate(prim.lines) if text.startswith("asset inputs:file"))
    prim.lines[line] += ' (colorSpace = "lin_rec709")'
    return made


def _ramp_file(n: Nodes, node: Any) -> str:
    """Writes a colour ramp as a floating-point image."""
    file = n.into.file(f"ramp-{safe_name(n.owner)}-{safe_name(node.name)}.exr")
    rows = [tuple(node.color_ramp.evaluate(i / 1023.0))[:3] for i in range(1024)]
    texels = np.array(rows, np.float32)
    write(file, {name: texels[None, :, i] for i, name in enumerate("RGB")})
    return file


def _invert(n: Nodes, node: Any, socket: Any) -> Value:
    base = n.read(node, "Color", "color3")
    inverse = n.graph.op("subtract", colour((1, 1, 1)), base)
    return n.graph.mix(base, inverse, n.read(node, 0, "float"))


def _gamma(n: Nodes, node: Any, socket: Any) -> Value:
    base, gamma = n.read(node, "Color", "color3"), n.read(node, "Gamma", "float")
    return n.graph.node("power_color3FA", "color3", in1=base, in2=gamma)


def _bright_contrast(n: Nodes, node: Any, socket: Any) -> Value:
    # out = a x + b with a = 1 + contrast, b = brightness - contrast / 2, not below 0.
    g = n.graph
    contrast, bright = n.read(node, "Contrast", "float"), n.read(node, "Bright", "float")
    slope = g.to("color3", g.op("add", contrast, number(1.0)))
    lift = g.op("subtract", bright, g.op("multiply", contrast, number(0.5)))
    made = g.op(
        "add", g.op("multiply", n.read(node, "Color", "color3"), slope), g.to("color3", lift)
    )
    return g.op("max", made, colour((0, 0, 0)))


def _hue(n: Nodes, node: Any, socket: Any) -> Value:
    g = n.graph
    base = n.read(node, "Color", "color3")
    hue, saturation, value = (n.read(node, k, "float") for k in ("Hue", "Saturation", "Value"))
    hsv = g.node("rgbtohsv_color3", "color3", in_=base)
    turned = g.op("add", g.component(hsv, 0), g.op("add", hue, number(0.5)))
    turned = g.node("modulo_float", "float", in1=turned, in2=number(1.0))
    strong = g.clamped(g.op("multiply", g.component(hsv, 1), saturation))
    bright = g.op("multiply", g.component(hsv, 2), value)
    made = g.node("hsvtorgb_color3", "color3", in_=g.combine("color3", turned, strong, bright))
    made = g.op("max", made, colour((0, 0, 0)))
    return g.mix(base, made, n.read(node, "Fac" if "Fac" in node.inputs else "Factor", "float"))


def _blackbody(n: Nodes, node: Any, socket: Any) -> Value | None:
    if node.inputs["Temperature"].links:
        return None
    return colour(blackbody(float(node.inputs["Temperature"].default_value)))


def _separate(n: Nodes, node: Any, socket: Any) -> Value | None:
    if getattr(node, "mode", "RGB") != "RGB":
        return None
    return n.graph.component(n.read(node, 0), [o.name for o in node.outputs].index(socket.name))


def _combine(n: Nodes, node: Any, socket: Any) -> Value | None:
    if getattr(node, "mode", "RGB") != "RGB":
        return None
    kind = "vector3" if node.type == "COMBXYZ" else "color3"
    return n.graph.combine(kind, *(n.read(node, i, "float") for i in range(3)))


def _to_grey(n: Nodes, node: Any, socket: Any) -> Value:
    return n.graph.to("float", n.read(node, "Color", "color3"))


TYPES: dict[str, MakeValue] = {
    "RGB": _rgb,
    "VALUE": _value,
    "UVMAP": _uv_map,
    "TEX_COORD": _coordinates,
    "NEW_GEOMETRY": _geometry,
    "ATTRIBUTE": _attribute,
    "VERTEX_COLOR": _attribute,
    "TEX_IMAGE": _image,
    "MAPPING": _mapping,
    "NORMAL_MAP": _normal_map,
    "MIX": _mix,
    "MIX_RGB": _mix_rgb,
    "VALTORGB": _ramp,
    "INVERT": _invert,
    "GAMMA": _gamma,
    "BRIGHTCONTRAST": _bright_contrast,
    "HUE_SAT": _hue,
    "BLACKBODY": _blackbody,
    "SEPARATE_COLOR": _separate,
    "SEPRGB": _separate,
    "SEPXYZ": _separate,
    "COMBINE_COLOR": _combine,
    "COMBRGB": _combine,
    "COMBXYZ": _combine,
    "RGBTOBW": _to_grey,
}

from . import math_nodes  # noqa: E402

TYPES.update(math_nodes.TYPES)
