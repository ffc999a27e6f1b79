# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes bevelled curves and NURBS surfaces as meshes, as Blender itself renders them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .context import OWN, ROOT, Translation, data_path, local_matrix, material_path, object_path
from .usda import Prim, safe_name

KINDS = ("CURVE", "SURFACE", "FONT")
_UNUSED = 2**31 - 1
"""Value of the unused numbers of an instance's persistent id."""


def write_curves(into: Translation) -> None:
    """Writes curve objects as meshes; Blender's exporter writes strands of a fixed width."""
    for thing in into.depsgraph.objects:
        # The exporter of Blender 4.2 does not write text objects.
        kinds = ("CURVE", "SURFACE") if into.instancing else KINDS
        if thing.type not in kinds or thing.data is None:
            continue
        path = object_path(thing)
        if thing.type == "FONT":
            _define(into, thing, path)
        _hide_strands(into, thing)
        _write_mesh(into, thing, f"{path}/WavecombMesh")


def _hide_strands(into: Translation, thing: Any) -> None:
    """Deactivates what the exporter has written for the shape of a curve object."""
    for old in (data_path(thing), f"{object_path(thing)}/{safe_name(thing.name)}_0"):
        into.layer.over(old).metadata += ["active = false", "references = None"]


def write_instanced_curves(into: Translation) -> None:
    """Writes instances of curves and texts as meshes, each shape once.

    Blender's exporter writes instances of curves as strands, whose width it takes for a radius of
    1, and no texts.
    """
    found = []
    for instance in into.depsgraph.object_instances:
        thing = instance.object
        if not instance.is_instance or not instance.show_self or thing.type not in KINDS:
            continue
        ids = [str(one) for one in instance.persistent_id if one < _UNUSED]
        name = "_".join([safe_name(thing.name), *reversed(ids)])
        above = object_path(instance.parent.original)
        found.append((thing.original, instance.matrix_world.copy(), f"{above}/{name}"))
    first: dict[str, str] = {}
    for count, (original, matrix, exported) in enumerate(found):
        # The exporter of Blender 5.0 writes prototypes of curves that reference themselves.
        for old in (exported, f"{ROOT}/prototypes/{exported.rpartition('/')[2]}"):
            into.layer.over(old).metadata += ["active = false"]
        if original.hide_render:  # Blender shows no instances of such a curve.
            _hide_strands(into, original)
            continue
        path = f"{OWN}/Curves/{safe_name(original.name)}_{count}"
        into.layer.define(path, "Xform").transform({into.time: matrix})
        shape = f"{path}/Shape"
        if original.name in first:
            copy = into.layer.define(shape, "Mesh")
            copy.metadata.append(f"references = <{first[original.name]}>")
        elif _write_mesh(into, original.evaluated_get(into.depsgraph), shape):
            first[original.name] = shape


def _define(into: Translation, thing: Any, path: str) -> None:
    """Defines the prim of an object that the exporter does not write."""
    prim = into.layer.define(path, "Xform")
    # write_motion has written the transforms of objects that move.
    if not any("xformOpOrder" in line for line in prim.lines):
        prim.transform({into.time: local_matrix(thing)})


def _write_mesh(into: Translation, thing: Any, path: str) -> bool:
    """Writes the mesh that Blender makes of a curve; returns whether it has faces."""
    mesh = thing.to_mesh()
    try:
        has_faces = mesh is not None and len(mesh.polygons) > 0
        if has_faces:
            _write(into, thing, mesh, into.layer.define(path, "Mesh"))
        return has_faces
    finally:
        thing.to_mesh_clear()


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
