# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes Blender's lights as UsdLux lights with the radiance that Cycles gives them."""

from __future__ import annotations

import hashlib
import math
import os
from typing import Any

from mathutils import Matrix, Vector

from .context import OWN, Translation, object_path
from .ies import profile, spot_law, spread_law
from .usda import Asset, Prim, safe_name

Colour = tuple[float, float, float]

_AREA_SHAPES = {"SQUARE", "RECTANGLE", "DISK", "ELLIPSE"}


def write_lights(into: Translation) -> int:
    """Writes every visible light of the scene, instances included; returns their number."""
    count = 0
    for instance in into.depsgraph.object_instances:
        thing = instance.object
        if thing.type != "LIGHT" or not instance.show_self:
            continue
        if thing.hide_render:
            continue
        path = f"{OWN}/Lights/{safe_name(thing.name)}_{count}"
        samples = {into.time: instance.matrix_world.copy()}
        if not instance.is_instance:
            samples = into.matrices(thing.name, samples[into.time])
        _write(into, thing, path, samples)
        count += 1
    return count


def _write(into: Translation, thing: Any, path: str, samples: dict[float, Any]) -> None:
    light = thing.data
    writers = {"POINT": _point, "SPOT": _point, "SUN": _sun, "AREA": _area}
    kinds = {"POINT": "SphereLight", "SPOT": "SphereLight", "SUN": "DistantLight"}
    if light.type == "AREA" and _is_portal(light):
        _portal(into, light, path, samples)
        return
    kind = kinds.get(light.type)
    if kind is None:
        kind = "RectLight" if light.shape in ("SQUARE", "RECTANGLE") else "DiskLight"
    prim = into.layer.define(path, kind)
    colour = _colour(into, light)
    scale = writers[light.type](into, light, prim, samples)
    prim.set("color3f inputs:color", tuple(float(value) for value in colour))
    prim.set("float inputs:intensity", scale * light.energy)
    if not getattr(light, "use_shadow", True):
        prim.set("bool inputs:shadow:enable", False)
    if thing.lightgroup:
        prim.set("string wavecomb:lightGroup", thing.lightgroup)
    _links(into, thing, prim)
    if into.scene.wavecomb.lights == "auto" and not thing.visible_camera:
        prim.set("bool primvars:wavecomb:visibility:camera", False)
        if not (_sees(thing, "glossy") or _sees(thing, "transmission")):
            prim.set("bool primvars:wavecomb:visibility:bounces", False)
    hidden = [k for k in ("diffuse", "glossy", "transmission") if not _sees(thing, k)]
    if hidden:
        into.report.miss(f"light hidden from {' and '.join(hidden)} rays", thing.name)


def _sees(thing: Any, kind: str) -> bool:
    return bool(getattr(thing, f"visible_{kind}", True))


def _is_portal(light: Any) -> bool:
    return bool(getattr(light.cycles, "is_portal", False))


# ---- colour --------------------------------------------------------------------------------------


def _colour(into: Translation, light: Any) -> Colour:
    tint = [float(value) for value in light.color]
    if getattr(light, "use_temperature", False):
        tint = [a * float(b) for a, b in zip(tint, light.temperature_color, strict=True)]
    factor = 2.0 ** float(getattr(light, "exposure", 0.0))
    nodes = _node_factor(into, light)
    return tuple(value * factor * node for value, node in zip(tint, nodes, strict=True))  # type: ignore[return-value]


def _node_factor(into: Translation, light: Any) -> Colour:
    """Returns colour times strength of the emission node of a light with nodes."""
    if not light.use_nodes or light.node_tree is None:
        return (1.0, 1.0, 1.0)
    output = next((n for n in light.node_tree.nodes if n.type == "OUTPUT_LIGHT"), None)
    links = output.inputs["Surface"].links if output is not None else ()
    if not links:
        return (0.0, 0.0, 0.0)
    node = links[0].from_node
    if node.type != "EMISSION":
        into.report.miss(f"light node {node.bl_label}", light.name)
        return (1.0, 1.0, 1.0)
    colour = tuple(node.inputs["Color"].default_value)[:3]
    strength = float(node.inputs["Strength"].default_value)
    if node.inputs["Color"].links:
        source = node.inputs["Color"].links[0].from_node
        if source.type == "BLACKBODY" and not source.inputs["Temperature"].links:
            colour = blackbody(float(source.inputs["Temperature"].default_value))
        elif source.type == "RGB":
            colour = tuple(source.outputs[0].default_value)[:3]
        else:
            into.report.miss(f"light colour from the node {source.bl_label}", light.name)
    if node.inputs["Strength"].links:
        source = node.inputs["Strength"].links[0].from_node
        if source.type == "VALUE":
            strength = float(source.outputs[0].default_value)
        else:
            into.report.miss(f"light strength from the node {source.bl_label}", light.name)
    r, g, b = (float(value) * strength for value in colour)
    return (r, g, b)


def blackbody(kelvin: float) -> Colour:
    """Returns the linear Rec.709 colour of a black body with a luminance of 1.

    Evaluates Planck's law with the analytic fit to the CIE 1931 observer of Wyman, Sloan and
    Shirley 2013.
    """
    kelvin = min(max(kelvin, 800.0), 12000.0)
    xyz = [0.0, 0.0, 0.0]
    for nm in range(380, 781, 5):
        power = (nm * 1e-9) ** -5.0 / math.expm1(1.4387769e-2 / (nm * 1e-9 * kelvin))
        for i, value in enumerate(_observer(float(nm))):
            xyz[i] += power * value
    x, y, z = (value / xyz[1] for value in xyz)
    r = 3.2404542 * x - 1.5371385 * y - 0.4985314 * z
    g = -0.9692660 * x + 1.8760108 * y + 0.0415560 * z
    b = 0.0556434 * x - 0.2040259 * y + 1.0572252 * z
    return (max(r, 0.0), max(g, 0.0), max(b, 0.0))


def _observer(nm: float) -> Colour:
    def lobe(scale: float, mean: float, low: float, high: float) -> float:
        t = (nm - mean) * (low if nm < mean else high)
        return scale * math.exp(-0.5 * t * t)

    x = lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(0.362, 442.0, 0.0624, 0.0374)
    x += lobe(-0.065, 501.1, 0.0490, 0.0382)
    y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322)
    z = lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)
    return (x, y, z)


# ---- shapes --------------------------------------------------------------------------------------


def _rigid(matrix: Any) -> Any:
    """Returns a matrix without scale and mirroring."""
    place, turn, _ = matrix.decompose()
    return Matrix.LocRotScale(place, turn, None)


def _point(into: Translation, light: Any, prim: Prim, samples: dict[float, Any]) -> float:
    """Writes a point or spot light; returns the intensity of one watt."""
    radius = float(light.shadow_soft_size)
    prim.transform({time: _rigid(matrix) for time, matrix in samples.items()})
    prim.set("float inputs:radius", radius)
    prim.set("bool inputs:normalize", True)
    if radius <= 0.0:
        prim.set("bool treatAsPoint", True)
    if light.type == "SPOT":
        law = spot_law(light.spot_size, light.spot_blend)
        _shape(into, prim, profile(law, 0.5 * light.spot_size))
        if light.use_square:
            into.report.miss("square cone of a spot light", light.name)
    if getattr(light, "normalize", True):
        return 1.0 / math.pi
    return 4.0 * radius * radius if radius > 0.0 else 1.0 / math.pi


def _sun(into: Translation, light: Any, prim: Prim, samples: dict[float, Any]) -> float:
    """Writes a sun, whose strength is its irradiance; returns the intensity of one watt."""
    prim.transform({time: _rigid(matrix) for time, matrix in samples.items()})
    prim.set("float inputs:angle", math.degrees(light.angle))
    prim.set("bool inputs:normalize", True)
    if getattr(light, "normalize", True) or light.angle <= 0.0:
        return 1.0
    return math.pi * math.sin(min(0.5 * light.angle, 0.5 * math.pi)) ** 2


def _area(into: Translation, light: Any, prim: Prim, samples: dict[float, Any]) -> float:
    """Writes an area light; returns the intensity of one watt.

    The scale of the object becomes part of the size, so that the area is as in Cycles.
    """
    width = float(light.size)
    height = float(light.size_y) if light.shape in ("RECTANGLE", "ELLIPSE") else width
    sizes = [matrix.to_scale() for matrix in samples.values()]
    along = (abs(sizes[0].x) * width, abs(sizes[0].y) * height)
    is_round = light.shape in ("DISK", "ELLIPSE")
    if is_round:
        stretch = Matrix.Diagonal(Vector((0.5 * along[0], 0.5 * along[1], 1.0, 1.0)))
        prim.transform({time: _rigid(m) @ stretch for time, m in samples.items()})
        prim.set("float inputs:radius", 1.0)
    else:
        prim.transform({time: _rigid(m) for time, m in samples.items()})
        prim.set("float inputs:width", along[0])
        prim.set("float inputs:height", along[1])
    prim.set("bool inputs:normalize", True)
    if light.spread < math.pi - 1e-4:
        _shape(into, prim, profile(spread_law(light.spread), 0.5 * light.spread))
    if getattr(light, "normalize", True):
        return 1.0 / math.pi
    area = along[0] * along[1] * (0.25 * math.pi if is_round else 1.0)
    return area / math.pi


def _portal(into: Translation, light: Any, path: str, samples: dict[float, Any]) -> None:
    into.report.approximate("portal (no effect on the mean)", light.name)


def _shape(into: Translation, prim: Prim, text: str) -> None:
    """Applies an angular law as an IES profile; equal profiles share a file."""
    name = f"profile-{hashlib.sha256(text.encode()).hexdigest()[:16]}.ies"
    file = into.file(name)
    if not os.path.exists(file):
        with open(file, "w", encoding="ascii") as stream:
            stream.write(text)
    prim.apply("ShapingAPI")
    prim.set("asset inputs:shaping:ies:file", Asset(file))
    prim.set("bool inputs:shaping:ies:normalize", False)


# ---- linking -------------------------------------------------------------------------------------


def _links(into: Translation, thing: Any, prim: Prim) -> None:
    linking = getattr(thing, "light_linking", None)
    if linking is None:
        return
    for collection, name in (
        (linking.receiver_collection, "lightLink"),
        (linking.blocker_collection, "shadowLink"),
    ):
        if collection is not None:
            _link(prim, collection, name)


def _link(prim: Prim, collection: Any, name: str) -> None:
    """Writes a collection of Blender's light linking as a collection of UsdLux."""
    included: list[str] = []
    excluded: list[str] = []
    for rows, things in (
        (collection.collection_objects, collection.objects),
        (collection.collection_children, collection.children),
    ):
        for row, one in zip(rows, things, strict=False):
            members = [one] if hasattr(one, "data") else list(one.all_objects)
            paths = [object_path(member) for member in members]
            state = row.light_linking.link_state
            (excluded if state == "EXCLUDE" else included).extend(paths)
    prim.set(f"bool collection:{name}:includeRoot", not included)
    if included:
        prim.relate(f"collection:{name}:includes", *included)
    if excluded:
        prim.relate(f"collection:{name}:excludes", *excluded)
