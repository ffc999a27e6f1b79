# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes ray visibility, holdouts, shadow catchers and materials of volumes."""

from __future__ import annotations

from typing import Any

from .context import Translation, data_path, material_path, object_path

_BOUNCES = ("diffuse", "glossy", "transmission", "volume_scatter")
SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME"}


def write_visibility(into: Translation) -> None:
    """Writes attributes of objects that some rays do not see, or that are holdouts."""
    _hide_originals(into)
    for thing in into.depsgraph.objects:
        if thing.type not in SHAPES or thing.data is None:
            continue
        # Flags of Blender are not inherited by children, while those of USD are. The shapes of
        # instances cannot be overridden.
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
    """Removes objects that their parent instances; the exporter writes the original as well."""
    # The render's depsgraph does not list them.
    for thing in into.depsgraph.scene.objects:
        if thing.parent is None or thing.parent.instance_type not in ("VERTS", "FACES"):
            continue
        hidden = into.layer.over(object_path(thing))
        if into.instancing:
            hidden.metadata.append("active = false")
        else:
            # Instances refer to the shape below the original.
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
