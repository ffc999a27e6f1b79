# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the stage of a scene: geometry by the exporter of Blender, the rest by this extension."""

from __future__ import annotations

import os
import struct
import time
from dataclasses import dataclass, field
from typing import Any

import bpy

from .camera import CAMERA, write_camera
from .context import Translation
from .curves import write_curves, write_instanced_curves
from .lights import write_lights
from .materials import write_materials
from .motion import Sampled, write_motion
from .report import Report
from .textures import write_textures
from .usda import Asset, Layer, text_of
from .visibility import write_visibility
from .world import write_world

GEOMETRY, CORRECTION, STAGE = "geometry.usdc", "correction.usda", "stage.usda"


class ExportError(Exception):
    """Raised if a scene cannot be exported; the message gives the reason."""


@dataclass
class Exported:
    """A stage on disk.

    Attributes:
        stage: File of the stage.
        options: Options of ``wavecomb render`` that the scene needs.
        report: Messages of the translation.
        exporter_s: Seconds of Blender's exporter; 0 if the geometry was reused.
        correction_s: Seconds of the correction layer.
    """

    stage: str
    options: list[str]
    report: Report
    exporter_s: float = 0.0
    correction_s: float = 0.0


@dataclass
class Session:
    """State that is kept between the frames of an animation, to reuse exported geometry.

    Attributes:
        folder: Folder of the stage.
        signature: Content of the geometry file, see ``geometry_signature``.
        exports: Number of exports so far.
    """

    folder: str
    signature: object = None
    exports: int = 0
    extra: dict[str, Any] = field(default_factory=dict)


def export_geometry(file: str, scene: Any, view_layer: Any) -> None:
    """Runs Blender's exporter for geometry and material assignments.

    Raises:
        ExportError: The exporter failed.
    """
    wanted: dict[str, Any] = {
        "filepath": file,
        "check_existing": False,
        "selected_objects_only": False,
        "visible_objects_only": False,
        "export_animation": False,
        "export_hair": True,
        "export_uvmaps": True,
        "rename_uvmaps": True,
        "export_mesh_colors": True,
        "export_normals": True,
        "export_materials": True,
        "export_subdivision": "TESSELLATE",
        "export_armatures": False,
        "export_shapekeys": False,
        "use_instancing": _has_prototypes(),
        "evaluation_mode": "RENDER",
        "generate_preview_surface": False,
        "generate_materialx_network": False,
        "convert_orientation": False,
        "export_textures": False,
        "export_textures_mode": "KEEP",
        "relative_paths": False,
        "xform_op_mode": "MAT",
        "root_prim_path": "/root",
        "export_custom_properties": False,
        "author_blender_name": False,
        "convert_world_material": False,
        "allow_unicode": False,
        "export_meshes": True,
        "export_lights": False,
        "export_cameras": False,
        "export_curves": True,
        "export_points": True,
        "export_volumes": True,
        "triangulate_meshes": False,
        "merge_parent_xform": False,
        "convert_scene_units": "METERS",
    }
    known = {prop.identifier for prop in bpy.ops.wm.usd_export.get_rna_type().properties}
    chosen = {name: value for name, value in wanted.items() if name in known}
    try:
        with bpy.context.temp_override(scene=scene, view_layer=view_layer):
            done = bpy.ops.wm.usd_export(**chosen)
    except RuntimeError as error:
        raise ExportError(f"Blender's USD exporter failed: {str(error).strip()}") from error
    if "FINISHED" not in done or not os.path.exists(file):
        raise ExportError("Blender's USD exporter wrote no file")
    if not _is_complete(file):
        raise ExportError(f"Blender's USD exporter wrote an incomplete {file}: is the disk full?")


def _is_complete(file: str) -> bool:
    """Returns whether a binary USD file has its table of contents, which is written last.

    The exporter reports success even if the disk is full.
    """
    size = os.path.getsize(file)
    with open(file, "rb") as stream:
        head = stream.read(24)
        if len(head) < 24 or not head.startswith(b"PXR-USDC"):
            return False
        (at,) = struct.unpack("<q", head[16:24])
        if not 24 <= at <= size - 8:
            return False
        stream.seek(at)
        (count,) = struct.unpack("<Q", stream.read(8))
    # A section has a name of 16 bytes, a start and a size.
    return bool(size >= at + 8 + 32 * count)


def _has_prototypes() -> bool:
    """Returns whether the exporter writes prototypes that can be overridden."""
    return bpy.app.version >= (5, 0, 0)


def export_stage(
    depsgraph: Any, session: Session, size: tuple[int, int], sampled: Sampled | None = None
) -> Exported:
    """Writes the stage of an evaluated scene; reuses the geometry if it did not change.

    Raises:
        ExportError: The scene cannot be exported.
        NoCamera: The scene cannot be rendered from its camera.
    """
    scene = depsgraph.scene
    file = os.path.join(session.folder, GEOMETRY)
    signature = sampled.signature if sampled is not None else None
    start = time.perf_counter()
    exporter = 0.0
    if signature is None or signature != session.signature or not os.path.exists(file):
        export_geometry(file, scene, depsgraph.view_layer)
        session.signature, session.exports = signature, session.exports + 1
        if sampled is not None:
            session.extra["base"] = sampled.base
        exporter = time.perf_counter() - start
    frame = float(scene.frame_current_final)
    into = Translation(depsgraph, session.folder, Layer(), Report(), frame)
    into.instancing = _has_prototypes()
    if sampled is not None:
        into.samples = sampled.matrices
        write_motion(into, sampled, session.extra.get("base", {}))
    write_camera(into, size)
    write_lights(into)
    write_world(into)
    write_materials(into)
    write_textures(into)
    write_curves(into)
    write_instanced_curves(into)
    write_visibility(into)
    try:
        into.layer.save(into.file(CORRECTION))
        _write_root(into, scene)
    except OSError as error:
        raise ExportError(f"{session.folder} cannot be written: {error.strerror}") from error
    total = time.perf_counter() - start
    return Exported(into.file(STAGE), into.options, into.report, exporter, total - exporter)


def _write_root(into: Translation, scene: Any) -> None:
    """Writes the root layer, which puts the correction over the exporter's file."""
    fps = scene.render.fps / scene.render.fps_base
    settings = [line for line in into.layer.metadata if line.startswith("renderSettings")]
    lines = [
        "#usda 1.0",
        "(",
        '    defaultPrim = "root"',
        "    metersPerUnit = 1",
        '    upAxis = "Z"',
        f"    timeCodesPerSecond = {text_of(float(fps))}",
        *(f"    {line}" for line in settings),
        f"    subLayers = [{text_of(Asset(f'./{CORRECTION}'))}, {text_of(Asset(f'./{GEOMETRY}'))}]",
        ")",
        "",
    ]
    with open(into.file(STAGE), "w", encoding="utf-8") as stream:
        stream.write("\n".join(lines))


__all__ = ["CAMERA", "ExportError", "Exported", "Session", "export_geometry", "export_stage"]
