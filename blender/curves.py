# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes bevelled curves and NURBS surfaces as meshes, as Blender itself renders them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .context import Translation, data_path, material_path, object_path
from .usda import Prim, safe_name


def write_curves(into: Translation) -> None:
    """Writes curve objects as meshes; Blender's exporter writes strands of a fixed width."""
    for thing in into.depsgraph.objects:
        # The exporter of Blender 4.2 does not write text objects.
        kinds = ("CURVE", "SURFACE") if into.instancing else ("CURVE", "SURFACE", "FONT")
        if thing.type not in kinds or thing.data is None:
            continue
        mesh = thing.to_mesh()
        try:
            path = object_path(thing)
            if thing.type == "FONT":
                _define(into, thing, path)
            for old in (data_path(thing), f"{path}/{safe_name(thing.name)}_0"):
                into.layer.over(old).metadata += ["active = false", "references = None"]
            if mesh is not None and len(mesh.polygons):
                prim = into.layer.define(f"{path}/WavecombMesh", "Mesh")
                _write(into, thing, mesh, prim)
        finally:
            thing.to_mesh_clear()


def _define(into: Translation, thing: Any, path: str) -> None:
    """Defines the prim of an object that the exporter does not write."""
    prim = into.layer.define(path, "Xform")
    # write_motion has written the transforms of objects that move.
    if not any("xformOpOrder" in line for line in prim.lines):
        world = thing.matrix_world
        above = thing.parent.matrix_world.inverted_safe() if thing.parent is not None else None
        prim.transform({into.time: world.copy() if above is None else above @ world})


def _write(into: Translation, thing: Any, mesh: Any, prim: Prim) -> None:
    prim.set("point3f[] points", _read(mesh.vertices, "co", 3, np.float32))
    prim.set("int[] faceVertexCounts", _read(mesh.polygons, "loop_total", 1, np.int32))
    prim.set("int[] faceVertexIndices", _read(mesh.loops, "vertex_index", 1, np.int32))
    prim.set("token subdivisionScheme", "none")
    normals = np.empty(3 * len(mesh.loops), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    prim.set("normal3f[] primvars:normals", normals.reshape(-1, 3))
    prim.lines[-1] += ' (interpolation = "faceVarying")'
    used = [slot.material for slot in thing.material_slots if slot.material is not None]
    prim.apply("MaterialBindingAPI")
    if used:
        prim.relate("material:binding", material_path(used[0]))
    if len(used) > 1:
        into.report.miss("second material of a curve", thing.name)


def _read(items: Any, name: str, width: int, kind: Any) -> np.ndarray:
    found = np.empty(width * len(items), kind)
    items.foreach_get(name, found)
    return found.reshape(-1, width) if width > 1 else found
