# SPDX-License-Identifier: Apache-2.0
"""Shapes of meshes that change while the shutter is open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from wavecomb.usd.geometry.primvar import as_array
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.geometry.skeleton import Skin, skinned_points
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.times import frame_number

if TYPE_CHECKING:
    from wavecomb.usd.geometry.shutter import Track

Array = NDArray[np.float32]


def deforms(prim: Usd.Prim, skin: Skin | None) -> bool:
    """Whether the shape of a mesh may change over time."""
    if skin is not None and skin.varies():
        return True
    points = prim.GetAttribute("points")
    return bool(points and points.ValueMightBeTimeVarying()) or _has_velocities(prim)


def _has_velocities(prim: Usd.Prim) -> bool:
    velocities = prim.GetAttribute("velocities")
    return bool(velocities and velocities.HasAuthoredValue())


def points_now(prim: Usd.Prim, time: Usd.TimeCode) -> Any:
    """Points at one time, as USD has them: velocities carry those of the sample before."""
    if frame_number(time) is not None and _has_velocities(prim):
        found = UsdGeom.PointBased(prim).ComputePointsAtTime(time, time)
        if found:
            return found
    return prim.GetAttribute("points").Get(time)


def step_times(prim: Usd.Prim, skin: Skin | None, motion: Motion) -> list[float]:
    """Time codes at which its shape is taken."""
    get = prim.GetAttribute
    attributes = [a for a in (get("points"), get("normals"), get("primvars:normals")) if a]
    if skin is None:
        least = 3 if get("accelerations").HasAuthoredValue() else 2
        return motion.sampled(attributes, least)
    joints = motion.steps(skin.transforms)
    interval = Gf.Interval(motion.open, motion.close, False, False)
    inside = skin.samples(interval)
    inside |= {t for a in attributes for t in a.GetTimeSamplesInInterval(interval)}
    return motion.fitting(sorted(inside), 2 if joints is None else len(joints))


def points_at(
    prim: Usd.Prim, skin: Skin | None, times: list[float], frame: float, report: LoadReport
) -> list[Array] | None:
    """Points (n, 3) at each time, in the mesh's space; None, and a note, where they do not match.

    Velocities and accelerations count as UsdGeomPointBased has it: they go before what lies
    between samples.
    """
    codes = [Usd.TimeCode(time) for time in times]
    found: list[Any] | None
    if _has_velocities(prim):
        found = UsdGeom.PointBased(prim).ComputePointsAtTimes(codes, Usd.TimeCode(frame))
    else:
        attribute = prim.GetAttribute("points")
        found = [attribute.Get(code) for code in codes]
    if found and skin is not None:
        found = [skinned_points(skin, p, code) for p, code in zip(found, codes, strict=True)]
    arrays = [as_array(points) for points in found or ()]
    good = [a for a in arrays if a is not None and a.shape == (len(a), 3) and len(a)]
    if len(good) != len(times) or len({len(a) for a in good}) != 1:
        what = "points differ in number over the shutter: its shape is not blurred"
        report.note(what, prim.GetPath())
        return None
    return [np.ascontiguousarray(a, np.float32) for a in good]


def matrix_at(track: Track | None, still: Gf.Matrix4d, time: float) -> Gf.Matrix4d:
    """From a mesh to its group."""
    return still if track is None else track.at(time)
