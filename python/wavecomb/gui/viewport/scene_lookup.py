# SPDX-License-Identifier: Apache-2.0
"""Functions with which a session looks up objects on the stage and in the scene.

Independent of Qt.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.gui.viewport.engine import Edit
from wavecomb.gui.viewport.navigate import Pose, pose_of
from wavecomb.usd.stage.context import WORLD, Origin, to_scene_space

if TYPE_CHECKING:
    from pxr import Usd

    from wavecomb._core import Renderer, Scene
    from wavecomb.usd import LoadedStage


def camera_pose(
    usd: Usd.Stage, path: str, time: float | None, origin: Origin = WORLD
) -> Pose | None:
    """Returns the pose of a camera prim, or None if the prim is not a supported camera.

    Args:
        usd: The stage.
        path: Path of the prim.
        time: Time code; None means the start of the stage.
        origin: World position of the scene's origin.
    """
    from pxr import Sdf, UsdGeom

    from wavecomb.usd.cameras.camera import read_camera
    from wavecomb.usd.stage.report import LoadReport
    from wavecomb.usd.stage.time_codes import time_code

    if not Sdf.Path.IsValidPathString(path):
        return None
    prim = usd.GetPrimAtPath(path)
    if not prim or not prim.IsA(UsdGeom.Camera):
        return None
    code: Usd.TimeCode = time_code(usd, time)
    to_world = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(prim))
    view = read_camera(prim, to_scene_space(to_world, origin), code, LoadReport())
    return None if view is None else pose_of(view.transform, view.options, path)


def edits_again(
    scene: Scene,
    materials: Mapping[str, Mapping[str, Any]],
    lights: Mapping[tuple[str, int], Mapping[str, Any]],
) -> Edit:
    """Converts edits by name to edits by index, for a scene that was loaded again.

    Args:
        scene: The new scene.
        materials: Edited values by material name.
        lights: Edited values by ``light_key`` of the light.
    """
    numbers = {name: i for i, (name, _) in enumerate(scene.materials)}
    edit = Edit()
    for name, values in materials.items():
        if name in numbers:
            edit.materials[numbers[name]] = dict(values)
    for i in range(len(scene.lights)):
        found = lights.get(light_key(scene, i), {})
        if found:
            edit.lights[i] = dict(found)
    return edit


def prim_bounds(
    usd: Usd.Stage, loaded: LoadedStage, path: str, scene: Scene | None = None
) -> NDArray[np.float64] | None:
    """Returns the bounds (2, 3) of a prim's geometry and lights in scene space, or None.

    Args:
        usd: The stage.
        loaded: The loaded stage.
        path: Path in the notation of ``Renderer.pick``, in which "/World/Forest[12]/Leaves" is an
            instance below the prim "/World/Forest".
        scene: The scene with all edits; None means the loaded scene.
    """
    from pxr import Gf, Sdf, UsdGeom

    from wavecomb.usd.stage.time_codes import code_of

    plain = path.partition("[")[0]
    if not Sdf.Path.IsValidPathString(plain):
        return None
    found = Gf.Range3d()
    for corner in (scene or loaded.scene).bounds_of(plain) or ():
        found.UnionWith(Gf.Vec3d(*corner))
    drawn = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render]
    boxes = UsdGeom.BBoxCache(code_of(loaded.frame), drawn)
    for light in loaded.lights:
        if light == plain or light.startswith(f"{plain}/"):
            prim = usd.GetPrimAtPath(light)
            if prim:
                box = boxes.ComputeWorldBound(prim).ComputeAlignedRange()
                shift = Gf.Vec3d(*loaded.origin)
                found.UnionWith(Gf.Range3d(box.GetMin() - shift, box.GetMax() - shift))
    if found.IsEmpty():
        return None
    return np.array([found.GetMin(), found.GetMax()], np.float64)


def light_key(scene: Scene, index: int) -> tuple[str, int]:
    """Returns the key of a light: its name, and its number among lights with the same name."""
    names = [name for name, _ in scene.lights[: index + 1]]
    return names[-1], names.count(names[-1]) - 1


def make_renderer(scene: Scene, threads: int) -> Renderer:
    """Creates a renderer of the core."""
    from wavecomb import _core

    return _core.Renderer(scene, threads)
