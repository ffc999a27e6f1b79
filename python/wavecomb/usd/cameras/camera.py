# SPDX-License-Identifier: Apache-2.0
"""Reads a USD camera, or makes a default camera that frames the whole stage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdRender

from wavecomb.errors import WavecombError
from wavecomb.image.files.render_output import fitted_window
from wavecomb.load_options import PROJECTIONS
from wavecomb.usd.cameras.framing import corners, fit, fit_flat, planes
from wavecomb.usd.cameras.lens import lens_values, read_map
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.layers.population import matching_prims
from wavecomb.usd.materials.network import number, pair, word
from wavecomb.usd.render_settings.reader import CONFORMS
from wavecomb.usd.stage.report import LoadReport

Matrix = NDArray[np.float64]

_TENTH = 0.1
"""USD gives focal length and apertures in tenths of a scene unit."""

_MAX_WINDOW = 1e30
"""Largest coordinate of the image rectangle ("window") of a camera on the plane z = -1."""

_MIN_WINDOW = 2.0**-16
"""Smallest size of a camera's window as a fraction of its largest coordinate. Float32 has 128 steps
in a window of this size."""

ALL_ROUND = (-math.pi, math.pi, -0.5 * math.pi, 0.5 * math.pi)
"""Window of a latlong camera that sees all directions, in radians of longitude and latitude."""

MAX_STOPS = 60.0
MAX_EXPOSURE = 1e12
"""Largest exposures in stops and as a factor; larger values are considered mistakes and ignored."""

MAX_CLIP_PLANES = 16

_FRAME_TAN = 0.4
"""Half the width of the default camera's view on the plane z = -1."""


@dataclass(frozen=True)
class View:
    """Arguments of ``SceneBuilder.set_camera``."""

    transform: Matrix
    options: dict[str, Any]


@dataclass(frozen=True)
class Lens:
    """Lens options that come from the command line and render settings, not from the camera prim.

    Attributes:
        projection: One of ``PROJECTIONS``; None uses the camera's projection.
        exposure: Whether the camera's exposure scales the image radiance.
        depth_of_field: Whether the lens blurs objects that are out of focus.
        conform: Rule that fits the camera's aperture to the image if their aspect ratios differ.
        pixel_aspect: Width of a pixel divided by its height.
        settings: Values of ``lens.ATTRIBUTES`` as text; they override the prim's attributes.
        st_map: Path of an ST map that describes the lens distortion; the map overrides distortion
            coefficients.
    """

    projection: str | None = None
    exposure: bool = True
    depth_of_field: bool = True
    conform: str = CONFORMS[0]
    pixel_aspect: float = 1.0
    settings: Mapping[str, str] = field(default_factory=dict)
    st_map: str | None = None

    def options(
        self,
        prim: Usd.Prim | None = None,
        time: Usd.TimeCode | None = None,
        report: LoadReport | None = None,
    ) -> dict[str, Any]:
        """Returns the lens options that differ from their defaults, for ``View.options``.

        Raises:
            WavecombError: A setting or the ST map is invalid.
        """
        out = lens_values(prim, time, self.settings, report or LoadReport())
        if self.st_map is not None:
            out["lens_map"] = read_map(self.st_map)
        if self.conform != CONFORMS[0]:
            out["conform"] = self.conform
        if self.pixel_aspect != 1.0:
            out["pixel_aspect"] = self.pixel_aspect
        return out


def find_camera(stage: Usd.Stage, wanted: str | None, has_cameras: bool = True) -> Usd.Prim | None:
    """Returns the camera ``wanted``, else the render settings' camera, else the first of the stage.

    ``has_cameras`` may be False if the stage is known to have no cameras, which saves a search.

    Raises:
        WavecombError: ``wanted`` names no camera.
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
    if not has_cameras:
        return None
    for prim in Usd.PrimRange.Stage(stage):
        if prim.GetTypeName() == "Camera":
            return prim
    return next(matching_prims(stage, _is_camera), None)


def _is_camera(prim: Usd.Prim) -> bool:
    return bool(prim.IsA(UsdGeom.Camera))


MAX_CAMERAS = 1000
"""Maximum number of cameras in a listing, since instancing can multiply cameras."""


def all_cameras(stage: Usd.Stage) -> list[Usd.Prim]:
    """Returns the cameras of the stage in stage order, including those inside instances."""
    return list(islice(matching_prims(stage, _is_camera), MAX_CAMERAS))


def _named(stage: Usd.Stage, wanted: str) -> Usd.Prim:
    """Returns a camera by its path, or by its name if only one camera has that name."""
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
    """Reads the view of a camera prim; warns and returns None if the camera is invalid.

    Args:
        prim: A UsdGeomCamera.
        to_world: (4, 4) camera-to-world matrix for row vectors.
        time: Time code at which attributes are evaluated.
        report: Collects warnings.
        lens: Options that override or extend the prim's lens.
    """
    camera = UsdGeom.Camera(prim)
    path = prim.GetPath()
    frame = _rigid(to_world)
    focal = number(camera.GetFocalLengthAttr().Get(time), 50.0)
    wide = number(camera.GetHorizontalApertureAttr().Get(time), 20.955)
    high = number(camera.GetVerticalApertureAttr().Get(time), 15.2908)
    if frame is None or focal <= 0 or wide <= 0 or high <= 0:
        report.warn("camera left out: its transform, focal length or aperture is invalid", path)
        return None
    x = number(camera.GetHorizontalApertureOffsetAttr().Get(time), 0.0)
    y = number(camera.GetVerticalApertureOffsetAttr().Get(time), 0.0)
    edges = (x - wide / 2, x + wide / 2, y - high / 2, y + high / 2)
    projection = lens.projection or word(camera.GetProjectionAttr().Get(time), PROJECTIONS[0])
    if projection not in PROJECTIONS:
        report.warn(f"camera has the projection {projection}: drawn in perspective", path)
        projection = PROJECTIONS[0]
    by_focal = _TENTH if projection == "orthographic" else 1.0 / focal
    window = tuple(by_focal * v for v in edges)
    if projection != "latlong" and not _is_window(window):
        what = "camera left out: its aperture is too small beside its offset and focal length"
        report.warn(what, path)
        return None
    options: dict[str, Any] = {"window": window}
    options |= lens.options(prim, time, report)
    if projection != PROJECTIONS[0]:
        options["projection"] = projection
    if projection == "latlong":
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


def _is_window(window: tuple[float, ...]) -> bool:
    """Returns whether float32 coordinates are precise enough for the window, to about one pixel."""
    x0, x1, y0, y1 = window
    largest, smallest = max(map(abs, window)), min(x1 - x0, y1 - y0)
    return largest <= _MAX_WINDOW and smallest >= max(_MIN_WINDOW * largest, 1.0 / _MAX_WINDOW)


def _exposure_scale(camera: UsdGeom.Camera, time: Usd.TimeCode, report: LoadReport) -> float:
    """Returns the exposure factor, as ``UsdGeomCamera::ComputeLinearExposureScale`` defines it."""
    prim = camera.GetPrim()

    def value(name: str, default: float) -> float:
        return number(prim.GetAttribute(name).Get(time), default)

    stops = value("exposure", 0.0)
    iso, seconds = value("exposure:iso", 100.0), value("exposure:time", 1.0)
    stop, response = value("exposure:fStop", 1.0), value("exposure:responsivity", 1.0)
    if min(iso, seconds, response) < 0 or stop <= 0 or abs(stops) > MAX_STOPS:
        report.warn("camera exposure left out: one of its values is invalid", prim.GetPath())
        return 1.0
    scale = 2.0**stops * seconds * iso / 100.0 * response / (stop * stop)
    if not scale <= MAX_EXPOSURE:
        report.warn("camera exposure left out: it is too large", prim.GetPath())
        return 1.0
    return scale


def _clip_planes(
    camera: UsdGeom.Camera, time: Usd.TimeCode, report: LoadReport
) -> list[tuple[float, ...]]:
    """Reads the clipping planes (a, b, c, d) in camera space; warns about invalid planes."""
    found = []
    for plane in camera.GetClippingPlanesAttr().Get(time) or ():
        numbers = tuple(map(float, plane))
        if np.isfinite(numbers).all() and any(numbers[:3]):
            found.append(numbers)
        else:
            report.warn("clipping plane of a camera left out: it is invalid", camera.GetPath())
    if len(found) > MAX_CLIP_PLANES:
        report.warn(f"camera has more than {MAX_CLIP_PLANES} clipping planes", camera.GetPath())
    return found[:MAX_CLIP_PLANES]


def camera_motion(
    prim: Usd.Prim, motion: Motion | None, origin: Sequence[float] = (0.0, 0.0, 0.0)
) -> Matrix | None:
    """Returns (s, 4, 4) transforms at equal steps over the shutter; None if the camera is static.

    ``origin`` is the world-space position that becomes the origin of the scene.
    """
    if motion is None:
        return None
    frames: list[Matrix | None] = []

    def frame(time: float) -> Matrix:
        world = np.array(motion.xforms(time).GetLocalToWorldTransform(prim))
        world[3, :3] -= origin
        frames.append(_rigid(world))
        return world if frames[-1] is None else frames[-1]

    steps = motion.steps(frame)
    return None if any(f is None for f in frames) else steps


def _rigid(to_world: Matrix) -> Matrix | None:
    """Returns a camera's transform without scale; None if it has no inverse."""
    out = np.array(to_world, np.float64)
    lengths = np.linalg.norm(out[:3, :3], axis=1)
    if not np.isfinite(out).all() or lengths.min() <= 0:
        return None
    out[:3, :3] /= lengths[:, None]
    return None if abs(np.linalg.det(out[:3, :3])) < 1e-6 else out


def _frame_axes(up_axis: str) -> Matrix:
    """Returns the right, up and back axes of the default camera.

    The camera looks at the front of the stage from slightly right and above. The front of the stage
    is +Z, or -Y if Z is up.
    """
    up = np.array({"X": (1.0, 0, 0), "Z": (0, 0, 1.0)}.get(up_axis, (0, 1.0, 0)))
    front = {"X": (0, 0, 1.0), "Z": (0, -1.0, 0)}.get(up_axis, (0, 0, 1.0))
    side = np.cross(up, front)
    back = np.asarray(front) + 0.6 * side + 0.42 * up
    back /= np.linalg.norm(back)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def _frame_half(lens: Lens, size: tuple[int, int]) -> tuple[float, float]:
    """Returns half the width and height that the default camera sees of the plane z = -1."""
    t = _FRAME_TAN
    x0, x1, y0, y1 = fitted_window((-t, t, -t, t), *size, lens.conform, lens.pixel_aspect)
    return 0.5 * (x1 - x0), 0.5 * (y1 - y0)


def frame_planes(up_axis: str, lens: Lens, size: tuple[int, int]) -> Matrix:
    """Returns directions (4, 3) in which ``frame_points`` needs the geometry's extent."""
    flat = lens.projection == "orthographic"
    return planes(_frame_axes(up_axis), None if flat else _frame_half(lens, size))


def frame_points(
    points: NDArray[np.float64] | None,
    up_axis: str,
    lens: Lens = Lens(),
    size: tuple[int, int] = (1, 1),
) -> View:
    """Returns a three-quarter view that frames points (n, 3) or, for None, a cube at the origin.

    Args:
        points: Outline points of the visible geometry, from ``framing.outline``.
        up_axis: "X", "Y" or "Z".
        lens: Lens options.
        size: Width and height of the image; only their ratio matters.
    """
    if points is None or len(points) == 0:
        points = corners(np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]))
    axes, half, t = _frame_axes(up_axis), _frame_half(lens, size), _FRAME_TAN
    back = axes[2]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    frame = np.eye(4)
    frame[:3, :3] = axes
    options: dict[str, Any] = dict(lens.options())
    if lens.projection == "orthographic":
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        place, scale = fit_flat(points, axes, half)
        frame[3, :3] = place + extent * back
        t *= scale
        options |= {"near_clip": 1e-4 * extent, "projection": lens.projection}
    else:
        frame[3, :3] = fit(points, axes, half)
        options["near_clip"] = 1e-4 * float((frame[3, :3] - middle) @ back)
    options["window"] = (-t, t, -t, t)
    if lens.projection == "latlong":
        options |= {"window": ALL_ROUND, "projection": lens.projection}
    return View(frame, options)
