# SPDX-License-Identifier: Apache-2.0
"""Reads the transforms of all instances of a point instancer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from wavecomb.usd.geometry.primvar import as_array, as_integers
from wavecomb.usd.geometry.shutter import Motion, Track
from wavecomb.usd.geometry.triangulate import cross
from wavecomb.usd.stage.context import POSITIONS, positions_are_coarse
from wavecomb.usd.stage.report import LoadReport

Matrices = NDArray[np.float64]


@dataclass(frozen=True)
class Instances:
    """The instances of a point instancer.

    Attributes:
        transforms: (k, 4, 4) for row vectors, in the instancer's space.
        prototypes: (k,) index of each instance's prototype.
        kept: (k,) index of each instance in the authored arrays.
        authored: Length of the authored arrays.
    """

    transforms: Matrices
    prototypes: NDArray[np.int64]
    kept: NDArray[np.intp]
    authored: int


def rotations(quaternions: NDArray[Any]) -> Matrices:
    """Converts quaternions (i, j, k, real), (k, 4), to rotations (k, 3, 3) for row vectors."""
    q = np.asarray(quaternions, np.float64)
    length = np.sqrt(np.einsum("ij,ij->i", q, q))
    usable = (length > 0) & np.isfinite(length)
    q = np.where(usable[:, None], q / np.where(usable, length, 1)[:, None], (0.0, 0.0, 0.0, 1.0))
    x, y, z, w = q.T
    out = np.empty((len(q), 3, 3))
    out[:, 0, 0] = 1 - 2 * (y * y + z * z)
    out[:, 0, 1] = 2 * (x * y + z * w)
    out[:, 0, 2] = 2 * (x * z - y * w)
    out[:, 1, 0] = 2 * (x * y - z * w)
    out[:, 1, 1] = 1 - 2 * (x * x + z * z)
    out[:, 1, 2] = 2 * (y * z + x * w)
    out[:, 2, 0] = 2 * (x * z + y * w)
    out[:, 2, 1] = 2 * (y * z - x * w)
    out[:, 2, 2] = 1 - 2 * (x * x + y * y)
    return out


def are_valid(transforms: Matrices) -> NDArray[np.bool_]:
    """Returns a mask (k,) of the transforms (k, 4, 4) that are finite and invertible."""
    linear = transforms[:, :3, :3]
    finite: NDArray[np.bool_] = np.asarray((np.abs(transforms) < 1e18).all(axis=(1, 2)))
    a, b, c = np.where(finite[:, None, None], linear, 0.0).transpose(1, 0, 2)
    volume = np.abs(np.einsum("ij,ij->i", cross(a, b), c))
    edges = [np.sqrt(np.einsum("ij,ij->i", row, row)) for row in (a, b, c)]
    return finite & (volume > 1e-9 * edges[0] * edges[1] * edges[2])


def read_instances(
    prim: Usd.Prim, time: Usd.TimeCode, prototype_count: int, report: LoadReport
) -> Instances | None:
    """Reads the visible instances of a point instancer; returns None if it is invalid."""
    instancer = UsdGeom.PointInstancer(prim)
    path = prim.GetPath()
    index = as_integers(instancer.GetProtoIndicesAttr().Get(time), np.int64)
    positions = as_array(instancer.GetPositionsAttr().Get(time))
    count = len(index)
    if count == 0:
        return None
    if positions is None or positions.shape != (count, 3):
        report.warn("point instancer left out: positions do not match protoIndices", path)
        return None
    keep = _mask(instancer, time, count, report)
    outside = (index < 0) | (index >= prototype_count)
    if outside.any():
        what = "instances left out: prototype index out of range"
        report.warn(what, path, int(outside.sum()))
        keep &= ~outside
    linear = _linear(instancer, time, count, report)
    kept = np.flatnonzero(keep)
    if positions_are_coarse(positions[kept]):
        report.warn(POSITIONS, path)
    transforms = np.zeros((len(kept), 4, 4))
    transforms[:, :3, :3] = linear if linear.ndim == 2 else linear[kept]
    transforms[:, 3, :3] = positions[kept]
    transforms[:, 3, 3] = 1.0
    return Instances(transforms, index[kept], kept, count)


def moved_instances(
    prim: Usd.Prim,
    motion: Motion,
    track: Track | None,
    outer: Matrices | None,
    instances: Instances,
    report: LoadReport,
) -> Matrices | None:
    """Returns transforms (k, s, 4, 4) of instances over the shutter; None if they are static.

    Velocities, accelerations and angular velocities have the effect that UsdGeomPointInstancer
    defines.

    Args:
        prim: The point instancer.
        motion: The shutter.
        track: Animated transform of the instancer; None if it is static.
        outer: (4, 4) static transform from the instancer to its group (the world or a prototype);
            None is the identity.
        instances: Instances of the point instancer at the time of the frame.
        report: Collects warnings.
    """
    instancer = UsdGeom.PointInstancer(prim)
    names = ("positions", "orientations", "orientationsf", "scales")
    varying = [a for a in map(prim.GetAttribute, names) if a and a.ValueMightBeTimeVarying()]
    speeds = [prim.GetAttribute(name) for name in ("velocities", "angularVelocities")]
    changes = bool(varying) or any(a.HasAuthoredValue() for a in speeds)
    if track is None and not changes:
        return None
    whole = None if track is None else track.steps()
    least = 2 if whole is None else len(whole)
    if prim.GetAttribute("angularVelocities").HasAuthoredValue() or len(varying) > 1:
        least = max(least, 3)
    times = motion.sampled(varying, least)
    inner = [instances.transforms] * len(times)
    if changes:
        found = instancer.ComputeInstanceTransformsAtTimes(
            [Usd.TimeCode(time) for time in times],
            Usd.TimeCode(motion.frame),
            UsdGeom.PointInstancer.ExcludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
        if len(found) != len(times) or any(len(one) != instances.authored for one in found):
            what = "point instancer's motion does not match protoIndices: not blurred"
            report.warn(what, prim.GetPath())
            return None
        inner = [np.array(one)[instances.kept] for one in found]
    places = [outer if track is None else np.array(track.at(time)) for time in times]
    steps = [
        one if place is None else one @ place for one, place in zip(inner, places, strict=True)
    ]
    out = np.stack(steps, axis=1)
    return None if (out == out[:, :1]).all() else out


def _mask(
    instancer: UsdGeom.PointInstancer, time: Usd.TimeCode, count: int, report: LoadReport
) -> NDArray[np.bool_]:
    """Returns a mask (count,) of the instances that are visible and active."""
    keep = np.ones(count, bool)
    hidden: list[int] = []
    hidden += as_integers(instancer.GetInvisibleIdsAttr().Get(time), np.int64).tolist()
    inactive = instancer.GetPrim().GetMetadata("inactiveIds")
    if inactive is not None:
        hidden += [int(i) for i in inactive.GetAddedOrExplicitItems()]
    if not hidden:
        return keep
    value = instancer.GetIdsAttr().Get(time)
    numbers = np.arange(count) if value is None else as_integers(value, np.int64)
    if len(numbers) != count:
        what = "point instancer ids do not match protoIndices: ignored"
        report.warn(what, instancer.GetPath())
        numbers = np.arange(count)
    return ~np.isin(numbers, np.array(hidden, np.int64))


def _linear(
    instancer: UsdGeom.PointInstancer, time: Usd.TimeCode, count: int, report: LoadReport
) -> Matrices:
    """Returns scale and rotation of each instance (count, 3, 3); (3, 3) if all are the identity."""
    path = instancer.GetPath()
    out: Matrices = np.eye(3)
    turns = None
    for name in ("orientationsf", "orientations"):
        turns = as_array(instancer.GetPrim().GetAttribute(name).Get(time))
        if turns is not None and len(turns):
            break
    if turns is not None and len(turns):
        if turns.shape == (count, 4):
            out = rotations(turns)
        else:
            report.warn("point instancer orientations do not match: ignored", path)
    scales = as_array(instancer.GetScalesAttr().Get(time))
    if scales is not None and len(scales):
        if scales.shape == (count, 3):
            # Ignore NumPy's warnings about invalid scales, since ``are_valid`` removes instances
            # with such scales.
            with np.errstate(invalid="ignore"):
                out = out * scales.astype(np.float64)[:, :, None]
        else:
            report.warn("point instancer scales do not match: ignored", path)
    return out
