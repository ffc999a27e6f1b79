# SPDX-License-Identifier: GPL-3.0-or-later
"""Replaces nodes without a translation by textures that Cycles bakes in a separate process."""

from __future__ import annotations

import glob
import hashlib
import json
import os
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from .bake import content, is_animated, run_blender
from .context import Translation, data_path
from .usda import text_of

LAYER = "wavecombBake"
SIZE = 1024
MOST_CORNERS = 1_000_000
"""Corners of faces of all baked objects together; more are not unwrapped."""

_BY_VIEW = {"LAYER_WEIGHT", "FRESNEL", "LIGHT_PATH", "CAMERA", "PARTICLE_INFO", "HAIR_INFO"}
_COORDINATES_BY_VIEW = {"Camera", "Window", "Reflection"}


def owners(into: Translation, name: str) -> list[Any]:
    """Returns the mesh objects that use a material."""
    return [
        thing
        for thing in into.depsgraph.objects
        if thing.type == "MESH"
        and any(s.material is not None and s.material.name == name for s in thing.material_slots)
    ]


def is_bakeable(node: Any) -> bool:
    """Returns whether the outputs of a node depend on the place on the surface only."""
    return not any(_depends_on_view(one) for one in _above(node, set()))


def _above(node: Any, known: set[int]) -> Iterator[Any]:
    if node.as_pointer() in known:
        return
    known.add(node.as_pointer())
    yield node
    for inner in getattr(getattr(node, "node_tree", None), "nodes", ()):
        yield from _above(inner, known)
    for socket in node.inputs:
        for link in socket.links:
            yield from _above(link.from_node, known)


def _depends_on_view(node: Any) -> bool:
    if node.type in _BY_VIEW:
        return True
    used = {socket.name for socket in node.outputs if socket.is_linked}
    return node.type == "TEX_COORD" and bool(used & _COORDINATES_BY_VIEW)


def request(into: Translation, material: str, node: Any, socket: Any, kind: str) -> str | None:
    """Asks for the bake of an output socket; returns the file of its image, None if impossible.

    Args:
        into: The translation.
        material: Name of the material.
        node: Node of the material's own tree.
        socket: Output of the node.
        kind: "value", "normal" for a normal in world space, "height" for a displacement node.
    """
    chosen = owners(into, material)
    # Instances have no texture coordinates of their own.
    if not chosen or material in into.instanced or not is_bakeable(node):
        return None
    corners = sum(len(thing.data.loops) for thing in chosen)
    if corners == 0 or corners > MOST_CORNERS:
        return None
    row = {"material": material, "node": node.name, "socket": socket.identifier, "kind": kind}
    key = json.dumps(row) + _key(into, material, chosen)
    file = into.file(f"baked-{hashlib.sha256(key.encode()).hexdigest()[:16]}.exr")
    into.bakes.append({**row, "file": file})
    return file


def _key(into: Translation, name: str, chosen: list[Any]) -> str:
    material = next(
        s.material
        for s in chosen[0].material_slots
        if s.material is not None and s.material.name == name
    )
    key = content(material)
    if is_animated(material):
        key += f"\n{into.time}"
    return key + "".join(f"\n{thing.name} {_topology(thing)}" for thing in chosen)


def _topology(thing: Any) -> str:
    corners = np.empty(len(thing.data.loops), np.int32)
    thing.data.loops.foreach_get("vertex_index", corners)
    return f"{len(thing.data.vertices)} {zlib.crc32(corners.tobytes())}"


def write_textures(into: Translation) -> None:
    """Bakes what was asked for, unless it was before, and writes the texture coordinates."""
    if not into.bakes:
        return
    names = sorted({row["material"] for row in into.bakes})
    things = {thing.name: thing for name in names for thing in owners(into, name)}
    key = "".join(f"{name} {_topology(thing)}\n" for name, thing in things.items())
    file = into.file(f"coordinates-{hashlib.sha256(key.encode()).hexdigest()[:16]}.npz")
    missing = [row for row in into.bakes if not os.path.exists(row["file"])]
    if missing or not os.path.exists(file):
        # Images of another set of objects do not fit the coordinates.
        for old in glob.glob(into.file("coordinates-*.npz")):
            os.remove(old)
        _bake(into, list(things.values()), file)
    if not os.path.exists(file):
        for name in names:
            into.report.miss("textures of nodes that could not be baked", name)
        return
    with np.load(file) as found:
        for i, thing in enumerate(things.values()):
            prim = into.layer.over(data_path(thing))
            prim.lines.append(f"texCoord2f[] primvars:{LAYER} = {text_of(found[str(i)])} (")
            prim.lines += ['    interpolation = "faceVarying"', ")"]


def _bake(into: Translation, things: list[Any], coordinates: str) -> None:
    """Writes evaluated copies of the objects to a file, and bakes in another Blender."""
    import bpy

    blend, job_file = into.file("bake.blend"), into.file("bake.json")
    copies, meshes = [], []
    try:
        for thing in things:
            meshes.append(bpy.data.meshes.new_from_object(thing, depsgraph=into.depsgraph))
            copy = bpy.data.objects.new("wavecomb", meshes[-1])
            copy.matrix_world = thing.matrix_world
            copies.append(copy)
        names = [copy.name for copy in copies]
        bpy.data.libraries.write(blend, set(copies), path_remap="ABSOLUTE", fake_user=True)
    finally:
        for copy in copies:
            bpy.data.objects.remove(copy)
        for mesh in meshes:
            bpy.data.meshes.remove(mesh)
    job = {"blend": blend, "objects": names, "requests": into.bakes, "time": into.time}
    job |= {"coordinates": coordinates, "size": SIZE * (1 if len(things) == 1 else 2)}
    with open(job_file, "w", encoding="utf-8") as stream:
        json.dump(job, stream)
    run_blender("bake_textures.py", [job_file])
