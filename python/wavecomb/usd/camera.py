# SPDX-License-Identifier: Apache-2.0
"""The camera: one of the stage's, or one that frames what there is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdRender

from wavecomb.errors import WavecombError
from wavecomb.usd.network import number, pair, word
from wavecomb.usd.report import LoadReport
from wavecomb.usd.search import every
from wavecomb.usd.shutter import Motion

Matrix = NDArray[np.float64]

_TENTH = 0.1
"""Focal length and aperture are in tenths of a scene unit."""

ALL_ROUND = (-math.pi, math.pi, -0.5 * math.pi, 0.5 * math.pi)
"""Window of a latlong camera: all directions."""

MAX_STOPS = 60.0
MAX_EXPOSURE = 1e12
"""Beyond these an exposure is taken for a mistake."""

MAX_CLIP_PLANES = 16

_FRAME_TAN = 0.4
"""Half the opening of the default camera, on the plane z = -1."""


PROJECTIONS = ("perspective", "orthographic", "latlong")
CONFORMS = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)
"""UsdRender's aspectRatioConformPolicy."""


@dataclass(frozen=True)
class View:
    """Arguments of ``SceneBuilder.set_camera``."""

    transform: Matrix
    options: dict[str, Any]


@dataclass(frozen=True)
class Lens:
    """What is chosen beside a camera, by options and render settings.

    Attributes:
        projection: One of ``PROJECTIONS``; None: the camera's.
        exposure: Whether the camera's exposure multiplies light.
        depth_of_field: Whether its lens blurs what is out of focus.
        conform: What gives way where the shapes of aperture and picture differ.
        pixel_aspect: Width of a pixel / its height.
    """

    projection: str | None = None
    exposure: bool = True
    depth_of_field: bool = True
    conform: str = CONFORMS[0]
    pixel_aspect: float = 1.0

    def options(self) -> dict[str, Any]:
        """Of ``View``, where they are not the default."""
        out: dict[str, Any] = {}
        if self.conform != CONFORMS[0]:
            out["conform"] = self.conform
        if self.pixel_aspect != 1.0:
            out["pixel_aspect"] = self.pixel_aspect
        return out


def find_camera(stage: Usd.Stage, wanted: str | None) -> Usd.Prim | None:
    """The camera asked for, else the render settings', else the stage's first.

    Raises:
        WavecombError: The camera asked for is none.
    """
    if wanted is not None:
        return _named(stage, wanted)
    settings = UsdRender.Settings.GetStageRenderSettings(stage)
    candidates = [settings.GetPrim()] if settings else []
    render = stage.GetPrimAtPath("/Render")
    if render:
        candidates += [p for p in render.GetChildren() if p.IsA(UsdRender.Settings)]
    for prim in candidates:
        for target in UsdRender.Settings(prim).GetCameraRel().GetForwardedTargets():
            camera = stage.GetPrimAtPath(target)
            if camera and camera.IsA(UsdGeom.Camera):
                return camera
    for prim in Usd.PrimRange.Stage(stage):
        if prim.GetTypeName() == "Camera":
            return prim
    return next(every(stage, _is_camera), None)


def _is_camera(prim: Usd.Prim) -> bool:
    return bool(prim.IsA(UsdGeom.Camera))


MAX_CAMERAS = 1000
"""Cameras that are listed; instances may multiply them."""


def all_cameras(stage: Usd.Stage) -> list[Usd.Prim]:
    """The cameras of the stage, those inside instances too, in the stage's order."""
    return list(islice(every(stage, _is_camera), MAX_CAMERAS))


def _named(stage: Usd.Stage, wanted: str) -> Usd.Prim:
    """A camera by path, or by name where that is unique."""
    if Sdf.Path.IsValidPathString(wanted) and wanted.startswith("/"):
        prim = stage.GetPrimAtPath(wanted)
        if prim and prim.IsA(UsdGeom.Camera):
            return prim
    cameras = all_cameras(stage)
    by_name = [p for p in cameras if p.GetName() == wanted]
    if len(by_name) == 1:
        return by_name[0]
    known = ", ".join(str(p.GetPath()) for p in cameras[:8]) or "none"
    raise WavecombError(f"no camera {wanted}; the stage has: {known}")


def read_camera(
    prim: Usd.Prim,
    to_world: Matrix,
    time: Usd.TimeCode,
    report: LoadReport,
    lens: Lens = Lens(),
) -> View | None:
    """The view of a camera prim; None, and a warning, where it cannot be used.

    Args:
        prim: A UsdGeomCamera.
        to_world: (4, 4), row vectors.
        time: Of evaluation.
        report: For what is odd.
        lens: What is chosen beside it.
    """
    camera = UsdGeom.Camera(prim)
    path = prim.GetPath()
    frame = _rigid(to_world)
    focal = number(camera.GetFocalLengthAttr().Get(time), 50.0)
    wide = number(camera.GetHorizontalApertureAttr().Get(time), 20.955)
    high = number(camera.GetVerticalApertureAttr().Get(time), 15.2908)
    if frame is None or focal <= 0 or wide <= 0 or high <= 0:
        report.warn("camera left out: its transform, focal length or aperture is no good", path)
        return None
    x = number(camera.GetHorizontalApertureOffsetAttr().Get(time), 0.0)
    y = number(camera.GetVerticalApertureOffsetAttr().Get(time), 0.0)
    edges = (x - wide / 2, x + wide / 2, y - high / 2, y + high / 2)
    projection = lens.projection or word(camera.GetProjectionAttr().Get(time), PROJECTIONS[0])
    if projection not in PROJECTIONS:
        report.warn(f"camera has the projection {projection}: drawn in perspective", path)
        projection = PROJECTIONS[0]
    options: dict[str, Any] = {"window": tuple(v / focal for v in edges), **lens.options()}
    if projection != PROJECTIONS[0]:
        options["projection"] = projection
    if projection == "orthographic":
        options["window"] = tuple(_TENTH * v for v in edges)
    elif projection == "latlong":
        options["window"] = ALL_ROUND
    if lens.exposure and (scale := _exposure_scale(camera, time, report)) != 1.0:
        options["exposure"] = scale
    near, far = pair(camera.GetClippingRangeAttr().Get(time), (0.0, 0.0))
    if 0 <= near < far:
        options |= {"near_clip": near, "far_clip": min(far, 1e30)}
    if planes := _clip_planes(camera, time, report):
        options["clip_planes"] = planes
    stop = number(camera.GetFStopAttr().Get(time), 0.0)
    focus = number(camera.GetFocusDistanceAttr().Get(time), 0.0)
    if not lens.depth_of_field or projection == "latlong":
        pass
    elif stop > 0 and focus > 0:
        options |= {"lens_radius": _TENTH * focal / (2.0 * stop), "focus_distance": focus}
    elif stop > 0:
        report.warn("camera has fStop but no focusDistance: drawn without depth of field", path)
    return View(frame, options)


def _exposure_scale(camera: UsdGeom.Camera, time: Usd.TimeCode, report: LoadReport) -> float:
    """What a camera multiplies light by: ``UsdGeomCamera::ComputeLinearExposureScale``."""
    prim = camera.GetPrim()

    def value(name: str, default: float) -> float:
        attribute = prim.GetAttribute(name)
        return number(attribute.Get(time), default) if attribute else default

    stops = value("exposure", 0.0)
    iso, seconds = value("exposure:iso", 100.0), value("exposure:time", 1.0)
    stop, response = value("exposure:fStop", 1.0), value("exposure:responsivity", 1.0)
    if min(iso, seconds, response) < 0 or stop <= 0 or abs(stops) > MAX_STOPS:
        report.warn("camera exposure left out: a value of it is no good", prim.GetPath())
        return 1.0
    scale = 2.0**stops * seconds * iso / 100.0 * response / (stop * stop)
    if not scale <= MAX_EXPOSURE:
        report.warn("camera exposure left out: it is too large", prim.GetPath())
        return 1.0
    return scale


def _clip_planes(
    camera: UsdGeom.Camera, time: Usd.TimeCode, report: LoadReport
) -> list[tuple[float, ...]]:
    """Clipping planes (a, b, c, d) in the camera's space; those that are no good are left out."""
    found = []
    for plane in camera.GetClippingPlanesAttr().Get(time) or ():
        numbers = tuple(map(float, plane))
        if np.isfinite(numbers).all() and any(numbers[:3]):
            found.append(numbers)
        else:
            report.warn("clipping plane of a camera left out: it is none", camera.GetPath())
    if len(found) > MAX_CLIP_PLANES:
        report.warn(f"camera has more than {MAX_CLIP_PLANES} clipping planes", camera.GetPath())
    return found[:MAX_CLIP_PLANES]


def camera_motion(prim: Usd.Prim, motion: Motion | None) -> Matrix | None:
    """Transforms (s, 4, 4) of a camera at equal steps over the shutter; None: it stands still."""
    if motion is None:
        return None
    frames: list[Matrix | None] = []

    def frame(time: float) -> Matrix:
        world = np.array(motion.xforms(time).GetLocalToWorldTransform(prim))
        frames.append(_rigid(world))
        return world if frames[-1] is None else frames[-1]

    steps = motion.steps(frame)
    return None if any(f is None for f in frames) else steps


def _rigid(to_world: Matrix) -> Matrix | None:
    """A camera's transform without scale; None where it has no inverse."""
    out = np.array(to_world, np.float64)
    lengths = np.linalg.norm(out[:3, :3], axis=1)
    if not np.isfinite(out).all() or lengths.min() <= 0:
        return None
    out[:3, :3] /= lengths[:, None]
    return None if abs(np.linalg.det(out[:3, :3])) < 1e-6 else out


def frame_bounds(bounds: Matrix | None, up_axis: str, lens: Lens = Lens()) -> View:
    """A three-quarter view that fits bounds (2, 3) in its frame; None: of the origin."""
    if bounds is None:
        bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    centre = 0.5 * (bounds[0] + bounds[1])
    size = float(np.linalg.norm(bounds[1] - bounds[0])) or 1.0
    up = np.array({"X": (1.0, 0, 0), "Z": (0, 0, 1.0)}.get(up_axis, (0, 1.0, 0)))
    # Half right of the front, a little from above; the front is +Z, or -Y where Z is up.
    front = {"X": (0, 0, 1.0), "Z": (0, -1.0, 0)}.get(up_axis, (0, 0, 1.0))
    side = np.cross(up, front)
    back = np.asarray(front) + 0.6 * side + 0.42 * up
    back /= np.linalg.norm(back)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    true_up = np.cross(back, right)
    picks = [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    corners = bounds[picks, range(3)] - centre
    reach = np.maximum(np.abs(corners @ right), np.abs(corners @ true_up)) / _FRAME_TAN
    distance = 1.08 * float((reach + corners @ back).max()) or size
    frame = np.eye(4)
    frame[0, :3], frame[1, :3], frame[2, :3] = right, true_up, back
    frame[3, :3] = centre + distance * back
    t = _FRAME_TAN
    options: dict[str, Any] = {
        "window": (-t, t, -t, t), "near_clip": 1e-4 * distance, **lens.options()
    }  # fmt: skip
    if lens.projection == "orthographic":
        t *= distance
        options |= {"window": (-t, t, -t, t), "projection": lens.projection}
    elif lens.projection == "latlong":
        options |= {"window": ALL_ROUND, "projection": lens.projection}
    return View(frame, options)
