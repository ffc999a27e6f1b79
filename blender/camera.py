# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the camera and the render settings."""

from __future__ import annotations

import math
from typing import Any

from .context import OWN, Translation
from .usda import Path, Prim

CAMERA = f"{OWN}/Camera"
SETTINGS = "/Render/Settings"


class NoCamera(Exception):
    """Raised if a scene has no supported camera; the message gives the reason."""


def write_camera(into: Translation, size: tuple[int, int]) -> None:
    """Writes the scene's camera for a full image of ``size`` pixels.

    Raises:
        NoCamera: The scene has no camera, or the camera's projection is not supported.
    """
    scene, thing = into.scene, into.scene.camera
    if thing is None:
        raise NoCamera("the scene has no camera")
    if thing.type != "CAMERA":
        raise NoCamera(f"the camera {thing.name} is a {thing.type.lower()} object")
    data = thing.data
    prim = into.layer.define(CAMERA, "Camera")
    matrices = into.matrices(thing.name, thing.matrix_world)
    prim.transform({time: _without_scale(matrix) for time, matrix in matrices.items()})
    if data.type == "PANO":
        _panorama(into, thing)
    else:
        _frame(into, data, prim, size)
        _lens(into, thing, data, prim)
    near = float(data.clip_start)
    prim.set("float2 clippingRange", (near, float(data.clip_end)))
    exposure = float(getattr(scene.cycles, "film_exposure", 1.0)) if _has_cycles(scene) else 1.0
    if exposure > 0.0 and exposure != 1.0:
        prim.set("float exposure", math.log2(exposure))
    settings = into.layer.define(SETTINGS, "RenderSettings")
    settings.set("int2 resolution", size)
    settings.relate("camera", CAMERA)
    aspect = scene.render.pixel_aspect_x / scene.render.pixel_aspect_y
    settings.set("float pixelAspectRatio", float(aspect))
    into.layer.metadata.append(f'renderSettingsPrimPath = "{Path(SETTINGS)}"')


def _has_cycles(scene: Any) -> bool:
    return hasattr(scene, "cycles")


def _without_scale(matrix: Any) -> Any:
    return matrix.normalized()


def _frame(into: Translation, data: Any, prim: Prim, size: tuple[int, int]) -> None:
    """Writes the camera's aperture, which is the part of the sensor that the image shows."""
    render = into.scene.render
    across = size[0] * render.pixel_aspect_x
    up = size[1] * render.pixel_aspect_y
    fit = data.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if across >= up else "VERTICAL"
        sensor = data.sensor_width
    else:
        sensor = data.sensor_width if fit == "HORIZONTAL" else data.sensor_height
    # Converts millimetres (Blender) to tenths of scene units, which are metres (USD).
    fitted = float(sensor) * 1e-2
    if data.type == "ORTHO":
        fitted = float(data.ortho_scale) * 10.0
        prim.set("token projection", "orthographic")
    width, height = (fitted, fitted * up / across)
    if fit == "VERTICAL":
        width, height = (fitted * across / up, fitted)
    prim.set("float horizontalAperture", width)
    prim.set("float verticalAperture", height)
    prim.set("float horizontalApertureOffset", float(data.shift_x) * fitted)
    prim.set("float verticalApertureOffset", float(data.shift_y) * fitted)
    prim.set("float focalLength", float(data.lens) * 1e-2)


def _lens(into: Translation, thing: Any, data: Any, prim: Prim) -> None:
    dof = data.dof
    if not dof.use_dof:
        return
    if data.type == "ORTHO":
        into.report.miss("depth of field of an orthographic camera", thing.name)
        return
    distance = float(dof.focus_distance)
    if dof.focus_object is not None:
        target = dof.focus_object.evaluated_get(into.depsgraph).matrix_world.translation
        forward = -_without_scale(thing.matrix_world).col[2].to_3d()
        distance = abs((target - thing.matrix_world.translation).dot(forward))
    prim.set("float focusDistance", max(distance, 1e-4))
    prim.set("float fStop", float(dof.aperture_fstop))
    if dof.aperture_blades >= 3:
        prim.set("int wavecomb:lens:apertureBlades", int(dof.aperture_blades))
        turn = math.degrees(dof.aperture_rotation)
        prim.set("float wavecomb:lens:apertureRotation", turn)
    if abs(dof.aperture_ratio - 1.0) > 1e-4:
        prim.set("float wavecomb:lens:squeeze", float(dof.aperture_ratio))


def _panorama(into: Translation, thing: Any) -> None:
    data = thing.data
    source = data if hasattr(data, "panorama_type") else data.cycles
    kind = str(source.panorama_type)
    if kind != "EQUIRECTANGULAR":
        raise NoCamera(f"the panorama {kind.lower()} of the camera {thing.name} is not supported")
    full = (-0.5 * math.pi, 0.5 * math.pi, -math.pi, math.pi)
    names = ("latitude_min", "latitude_max", "longitude_min", "longitude_max")
    if any(abs(getattr(source, n) - v) > 1e-4 for n, v in zip(names, full, strict=True)):
        into.report.miss("range of an equirectangular camera (all directions)", thing.name)
    into.options += ["--camera-projection", "latlong"]
