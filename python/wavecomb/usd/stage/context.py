# SPDX-License-Identifier: Apache-2.0
"""State that all readers of one load share: stage, frame, origin, options and report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt

from wavecomb.load_options import PURPOSES, LoadOptions
from wavecomb.usd.geometry.mesh_arrays import IDENTITY
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

Origin = tuple[float, float, float]

NEAR = 2.0**14
"""Largest coordinate whose spacing of float32 numbers is at most 1/1024 unit."""

CELL = 2.0**12
"""Grid spacing of scene origins, so that most frames of a moving camera share an origin."""

MANY = 4096
"""Maximum number of prims that determine the centre of a stage without a camera."""

DEEP = 256
"""Maximum depth of prims that are considered, because USD computes transforms recursively."""

WORLD: Origin = (0.0, 0.0, 0.0)
"""The world's origin, which is also the scene's origin if the camera is near."""


def find_origin(
    stage: Usd.Stage, time: Usd.TimeCode, camera: Usd.Prim | None, purposes: Sequence[str]
) -> Origin:
    """Returns the origin of a scene: near the camera, or at the centre of drawn prims without one.

    The origin depends only on stage, frame and camera, so that all regions, tiles and machines that
    render one image agree.

    Args:
        stage: The stage.
        time: Time code of the frame.
        camera: Camera prim; None if the default camera frames the bounds.
        purposes: Purposes of the geometry that is rendered.
    """
    if camera is not None:
        matrix = UsdGeom.XformCache(time).GetLocalToWorldTransform(camera)
        return _snapped(np.array(matrix.ExtractTranslation()))
    places = _places(stage, time, frozenset(purposes))
    if len(places) == 0:
        return WORLD
    return _snapped(0.5 * (places.min(axis=0) + places.max(axis=0)))


def _places(stage: Usd.Stage, time: Usd.TimeCode, purposes: frozenset[str]) -> NDArray[np.float64]:
    """Returns world positions (n, 3) of drawn prims: centres of extents, else prim origins.

    USD's bounds computation would read every point, and would crash on inconsistent arrays.
    """
    xforms = UsdGeom.XformCache(time)
    found = []
    for prim in islice(filter(_is_drawn, stage.Traverse()), MANY):
        if UsdGeom.Imageable(prim).ComputePurpose() not in purposes:
            continue
        middle = Gf.Vec3d(0.0)
        extent = prim.GetAttribute("extent").Get(time)
        if isinstance(extent, Vt.Vec3fArray) and len(extent) == 2:
            middle = 0.5 * (Gf.Vec3d(extent[0]) + Gf.Vec3d(extent[1]))
        found.append(xforms.GetLocalToWorldTransform(prim).Transform(middle))
    places = np.array(found, np.float64).reshape(-1, 3)
    return places[np.isfinite(places).all(axis=1)]


def _is_drawn(prim: Usd.Prim) -> bool:
    if prim.GetPath().pathElementCount > DEEP:
        return False
    is_light = prim.IsA(UsdLux.BoundableLightBase)
    return prim.IsInstance() or (prim.IsA(UsdGeom.Boundable) and not is_light)


def _snapped(place: NDArray[np.float64]) -> Origin:
    """Rounds a position to a scene origin; positions near 0 or not finite give ``WORLD``."""
    if not np.isfinite(place).all() or np.abs(place).max() < NEAR:
        return WORLD
    x, y, z = np.round(place / CELL) * CELL + 0.0
    return float(x), float(y), float(z)


def world_to_scene(origin: Origin) -> Gf.Matrix4d:
    """Returns the transform from the world to the scene; for ``WORLD``, the object ``IDENTITY``."""
    if origin == WORLD:
        return IDENTITY
    return Gf.Matrix4d(1.0).SetTranslate(-Gf.Vec3d(*origin))


def to_scene_space(matrices: NDArray[np.float64], origin: Origin) -> NDArray[np.float64]:
    """Converts transforms (..., 4, 4) to the world into transforms to the scene."""
    if origin == WORLD:
        return matrices
    out = np.array(matrices, np.float64)
    out[..., 3, :3] -= np.asarray(origin)
    return out


_STEP = 2.0**-23
"""Relative spacing of float32 numbers."""

_COARSE = 1e-3
"""Fraction of a shape's size above which the spacing of float32 coordinates is visible."""

STORED = (
    "points are stored too far from the prim's own origin: their single precision is coarser than "
    "a thousandth of the shape; store them nearer and move the prim by a transform"
)
INSTANCED = (
    "shapes are too far from the origin of their prototype: single precision there is coarser "
    "than a thousandth of them; move the instances instead"
)
POSITIONS = (
    "instances are placed too far from their instancer: the single precision of positions is "
    "coarser than a thousandth of their extent; move the instancer by a transform"
)


def problem_of(bounds: NDArray[Any], matrix: Gf.Matrix4d, *, in_world: bool) -> str | None:
    """Returns a message if single precision is too coarse for a shape, else None.

    Args:
        bounds: (2, 3) bounds of the shape in the space of its group.
        matrix: Transform from the prim to its group.
        in_world: Whether the shape's group is the world, which is built around the camera.
    """
    (a, b, c), (x, y, z) = bounds.tolist()
    size = max(x - a, y - b, z - c)
    reach = max(x, y, z, -a, -b, -c)
    if not in_world and reach > NEAR and reach * _STEP > _COARSE * size:
        return INSTANCED
    move = matrix.GetRow3(3)
    p, q, r = 0.5 * (a + x) - move[0], 0.5 * (b + y) - move[1], 0.5 * (c + z) - move[2]
    # The prim's distance and its size are both in the units of the prim's group, so their ratio can
    # be compared with a constant. Chained comparisons are used for speed, since this runs for every
    # prim.
    far = size * (_COARSE / _STEP)
    if -far <= p <= far and -far <= q <= far and -far <= r <= far:
        return None
    return None if max(abs(p), abs(q), abs(r)) <= NEAR * _scale(matrix) else STORED


def may_be_coarse(
    bounds: NDArray[Any], matrices: NDArray[np.float64], *, in_world: bool
) -> NDArray[np.intp]:
    """Returns the indices of all shapes for which ``problem_of`` may return a message.

    ``bounds`` (k, 2, 3) and ``matrices`` (k, 4, 4) are the arguments of ``problem_of``.
    """
    low, high = bounds[:, 0].astype(np.float64), bounds[:, 1].astype(np.float64)
    size = (high - low).max(axis=1)
    reach = np.maximum(high, -low).max(axis=1)
    away = np.abs(0.5 * (low + high) - matrices[:, 3, :3]).max(axis=1)
    found = ~(away <= size * (_COARSE / _STEP))
    if not in_world:
        found |= (reach > NEAR) & (reach * _STEP > _COARSE * size)
    return np.flatnonzero(found)


def _scale(matrix: Gf.Matrix4d) -> float:
    return float(abs(matrix.GetDeterminant3()) ** (1.0 / 3.0))


def positions_are_coarse(positions: NDArray[Any]) -> bool:
    """Returns whether float32 positions (n, 3) of instances are too coarse for their extent."""
    if len(positions) < 2:
        return False
    reach = float(np.abs(positions).max())
    return reach > NEAR and reach * _STEP > _COARSE * float(np.ptp(positions, axis=0).max())


BINDING_PURPOSES = ("full", "preview")
"""Default purposes of material bindings, in order of preference."""


@dataclass
class LoadContext:
    """State of one load of a stage at one frame.

    Attributes:
        stage: The stage.
        time: Time code of the frame.
        builder: Scene builder that receives the geometry, materials and lights.
        report: Collects notes, warnings and unsupported features.
        options: Options of the load.
        motion: The shutter; None means no motion blur.
        origin: World position that becomes the origin of the scene.
        purposes: Purposes of the geometry that is rendered.
        binding_purposes: Purposes of material bindings in order of preference.
        framed: Directions (k, 3) along which the world's extent is measured to frame the default
            camera; None if a camera prim defines the view.
    """

    stage: Usd.Stage
    time: Usd.TimeCode
    builder: _core.SceneBuilder
    report: LoadReport = field(default_factory=LoadReport)
    options: LoadOptions = field(default_factory=LoadOptions)
    motion: Motion | None = None
    origin: Origin = WORLD
    purposes: tuple[str, ...] = PURPOSES[:2]
    binding_purposes: tuple[str, ...] = BINDING_PURPOSES
    framed: Any = None

    @property
    def up_axis(self) -> str:
        """The stage's up axis: X, Y or Z."""
        return str(UsdGeom.GetStageUpAxis(self.stage))

    @property
    def hides_lights(self) -> bool:
        """Whether the shapes of lights are invisible to all rays."""
        return self.options.lights == "hidden"

    def at(self, time: float) -> LoadContext:
        """Returns the context at another time, without motion and with a separate report."""
        return replace(self, time=Usd.TimeCode(time), report=LoadReport(), motion=None)
