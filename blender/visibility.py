# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes ray visibility, holdouts, shadow catchers and materials of volumes."""

from __future__ import annotations

from typing import Any

from .context import Translation, data_path, material_path, object_path

_BOUNCES = ("diffuse", "glossy", "transmission", "volume_scatter")
SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME"}


def write_visibility(into: Translation) -> None:
    """Writes attributes of holdouts, and of objects that are hidden from some rays."""
    _hide_originals(into)
    for thing in into.depsgraph.objects:
        if thing.type not in SHAPES or thing.data is None:
            continue
        # Children inherit visibility attributes in USD, but not in Blender, so the attributes of an
        # object with children are written to its data. Data of instances cannot be overridden.
        path = data_path(thing) if thing.children else object_path(thing)
        flags = _flags(into, thing)
        if thing.is_shadow_catcher:
            into.options += ["--catcher", object_path(thing)]
        if flags:
            prim = into.layer.over(path)
            for name in flags:
                value = name == "holdout"
                prim.set(f"bool primvars:wavecomb:{name}", value)
        if thing.type == "VOLUME" and thing.material_slots and thing.material_slots[0].material:
            prim = into.layer.over(data_path(thing))
            prim.apply("MaterialBindingAPI")
            prim.relate("material:binding", material_path(thing.material_slots[0].material))


def _hide_originals(into: Translation) -> None:
    """Hides objects that their parent instances, since the exporter also writes the originals."""
    # The objects of the depsgraph do not include these originals.
    for thing in into.depsgraph.scene.objects:
        if thing.parent is None or thing.parent.instance_type not in ("VERTS", "FACES"):
            continue
        hidden = into.layer.over(object_path(thing))
        if into.instancing:
            hidden.metadata.append("active = false")
        else:
            # The original is not deactivated, since instances refer to its data.
            hidden.set("token visibility", "invisible")


def _flags(into: Translation, thing: Any) -> list[str]:
    found = []
    if not thing.visible_camera:
        found.append("visibility:camera")
    if not thing.visible_shadow:
        found.append("visibility:shadow")
    hidden = [kind for kind in _BOUNCES if not getattr(thing, f"visible_{kind}", True)]
    if len(hidden) == len(_BOUNCES):
        found.append("visibility:bounces")
    elif hidden:
        into.report.miss(f"object hidden from {', '.join(hidden)} rays only", thing.name)
    if thing.is_holdout:
        found.append("holdout")
    return found
