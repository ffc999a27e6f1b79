# SPDX-License-Identifier: Apache-2.0
"""Groups of the scene while they are filled, what acts on them from outside, and their emitters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdShade

from wavecomb.usd.cameras import framing
from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.lights.light import Light
from wavecomb.usd.looks.material import MaterialTable
from wavecomb.usd.volumes.volume import Volume

Matrices = NDArray[np.float64]
T = TypeVar("T")

MOST_STEPS = 64
"""Steps of a place that moves within one that moves."""

_MANY_BOXES = 1024
"""More are made one before others are added."""

_MOST_SHOWN = 2048
"""Boxes that are kept apart."""


@dataclass(frozen=True)
class Place:
    """A transform, which may change while the shutter is open.

    Attributes:
        middle: (4, 4), in mid-shutter.
        steps: (s, 4, 4) at equal steps over the shutter; None: it stands still.
    """

    middle: Matrices
    steps: Matrices | None = None

    def within(self, outer: Place) -> Place:
        """The place in what the space of this one is placed in."""
        inner, outside = self.steps, outer.steps
        middle = self.middle @ outer.middle
        if inner is None and outside is None:
            return Place(middle)
        if inner is None or outside is None:
            left = self.middle if inner is None else inner
            return Place(middle, left @ (outer.middle if outside is None else outside))
        segments = math.lcm(len(inner) - 1, len(outside) - 1)
        if segments >= MOST_STEPS:
            segments = max(len(inner), len(outside)) - 1
        count = segments + 1
        return Place(middle, _resampled(inner, count) @ _resampled(outside, count))


@dataclass(frozen=True)
class Emitter:
    """An emissive mesh in its group's space.

    Attributes:
        centre: (3,) middle of its bounds.
        areas: By material id, the area of faces with it.
    """

    centre: NDArray[np.float64]
    areas: Mapping[int, float]


@dataclass
class Group:
    """Meshes, lights, volumes and instances that are placed together.

    Attributes:
        number: In the scene, once something is in it.
        boxes: Bounds (2, 3) of what is in it, in its own space.
        outlines: Where what is in it reaches farthest, in its own space; see ``framing``.
        root: Prim path that the names of what is in it begin with.
        lights: With their places in the group.
        volumes: With their transforms (4, 4) in the group.
        children: Groups that hold lights or volumes placed in it, and where.
        surfaced: The same of groups that hold surfaces to be refined.
        holds_placed: Whether lights or volumes are in it, or in what is placed in it.
        sampled_lamp: A mesh light in it that cannot move.
        emitters: Emissive meshes in it, of stages without lights.
        shown: The first boxes, none of which are joined.
    """

    name: str
    root: str = ""
    number: int | None = None
    boxes: list[NDArray[Any]] = field(default_factory=list)
    lights: list[tuple[Light, Place]] = field(default_factory=list)
    volumes: list[tuple[Volume, Matrices]] = field(default_factory=list)
    children: list[tuple[Group, list[Place]]] = field(default_factory=list)
    surfaced: list[tuple[Group, Matrices]] = field(default_factory=list)
    holds_placed: bool = False
    has_surfaces: bool = False
    sampled_lamp: Sdf.Path | None = None
    outlines: list[NDArray[np.float64]] = field(default_factory=list)
    outlined: int = 0
    emitters: list[Emitter] = field(default_factory=list)
    shown: list[NDArray[Any]] = field(default_factory=list)

    @property
    def empty(self) -> bool:
        """Whether nothing is in it that is drawn."""
        return self.number is None

    def grow(self, bounds: NDArray[Any]) -> None:
        """Makes the bounds hold others (2, 3) too."""
        self.boxes.append(bounds)
        if len(self.shown) < _MOST_SHOWN:
            self.shown.append(bounds)
        whole = self.bounds if len(self.boxes) > _MANY_BOXES else None
        if whole is not None:
            self.boxes = [whole]

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """(2, 3) Of all that is in it, in its own space."""
        if not self.boxes:
            return None
        boxes = np.array(self.boxes, np.float64)
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def reach(self, points: NDArray[np.float64], more: NDArray[np.float64] | None) -> None:
        """Adds points to the outlines; ``more``: directions in which these are exact."""
        self.outlines.append(points)
        self.outlined += len(points)
        if self.outlined > framing.MANY_POINTS:
            self.outlines = [framing.outline(np.concatenate(self.outlines), more)]
            self.outlined = len(self.outlines[0])


@dataclass(frozen=True)
class Scope:
    """What acts on a group from outside.

    Attributes:
        inside: It is placed by instances, so a mesh may leave its material to them.
        bound: The instance brings a bound material, which goes before display colours.
        override: A binding above is stronger than all in the group.
        alias: (prototype, instance): bindings are looked up on the instance's proxies.
        root: Path of the native prototype that the group comes from.
        worn: The bound material, where what has none of its own wears it itself, as it reads
            primvars there.
        brings: Constant primvars of the instances.
    """

    inside: bool = False
    bound: bool = False
    override: bool = False
    alias: tuple[Sdf.Path, Sdf.Path] | None = None
    root: Sdf.Path = Sdf.Path.absoluteRootPath
    worn: UsdShade.Material | None = None
    brings: tuple[Any, ...] = ()


def middle_of(motion: Matrices) -> Matrices:
    """(k, 4, 4) in the middle of steps (k, s, 4, 4)."""
    last = motion.shape[1] - 1
    middle: Matrices = 0.5 * (motion[:, last // 2] + motion[:, (last + 1) // 2])
    return middle


def changes_size(steps: Matrices) -> bool:
    """Whether a transform (s, 4, 4) that moves stretches by another factor at another step."""
    sizes = np.linalg.svd(steps[:, :3, :3], compute_uv=False)
    return bool((np.abs(sizes - sizes[:1]) > 1e-2 * sizes[:1].max()).any())


def _resampled(steps: Matrices, count: int) -> Matrices:
    """(s, 4, 4) at ``count`` equal steps, by straight lines."""
    at = np.linspace(0.0, len(steps) - 1.0, count)
    before = np.minimum(at.astype(np.intp), len(steps) - 2)
    part = (at - before)[:, None, None]
    mixed: Matrices = steps[before] * (1.0 - part) + steps[before + 1] * part
    return mixed


def placed_lights(group: Group, limit: int) -> list[tuple[Light, Place]]:
    """All lights of a group and of what is placed in it, at most ``limit``."""
    return _placed(group, limit, lambda one: one.lights)


def placed_volumes(group: Group, limit: int) -> list[tuple[Volume, Matrices]]:
    """All volumes of a group and of what is placed in it, at most ``limit``."""
    found = _placed(group, limit, lambda one: [(v, Place(m)) for v, m in one.volumes])
    return [(volume, place.middle) for volume, place in found]


def placed_emitters(group: Group, limit: int) -> list[tuple[Emitter, Place]]:
    """All emitters of a group and of what is placed in it, at most ``limit``."""
    return _placed(group, limit, lambda one: [(e, Place(np.eye(4))) for e in one.emitters])


def _placed(
    group: Group, limit: int, of: Callable[[Group], list[tuple[T, Place]]]
) -> list[tuple[T, Place]]:
    out = list(of(group)[:limit])
    for child, places in group.children:
        inner = _placed(child, limit, of)
        for place in places:
            if len(out) >= limit:
                return out
            out += [(one, local.within(place)) for one, local in inner]
    return out[:limit]


LEAST = 0.02
"""Irradiance on an object that counts as light, a hundredth of that of the default dome."""

MOST = 2048
"""Objects, and emitters, that are looked at."""


def emitter_of(shape: MeshArrays, material: int, faces: NDArray[np.uint32] | None) -> Emitter:
    """The emitter that a mesh is; ``faces``: the material of each triangle where they differ."""
    positions = shape.positions.reshape(-1, *shape.positions.shape[-2:])[0].astype(np.float64)
    a, b, c = (positions[shape.triangles[:, corner]] for corner in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centre = np.asarray(shape.bounds, np.float64).mean(axis=0)
    if faces is None:
        return Emitter(centre, {material: float(areas.sum())})
    used = np.unique(faces)
    return Emitter(centre, {int(one): float(areas[faces == one].sum()) for one in used})


def light_what_is_drawn(world: Group, materials: MaterialTable) -> bool:
    """Whether half of the objects get as much light as ``LEAST`` from emitters, one for each box.

    The light of an emitter counts as that of a point in its middle, at the distance of an object's
    middle and no nearer than its size. Shadows and bounces are left out. Neither the camera nor
    the frame's samples matter, so that frames of a shot and tasks of a farm decide alike.
    """
    boxes = np.array(world.shown[:MOST], np.float64)
    powers, centres = _placed_powers(world, materials)
    if len(boxes) == 0 or len(powers) == 0:
        return False
    middles = boxes.mean(axis=1)
    sizes = 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    apart = np.linalg.norm(middles[:, None] - centres[None], axis=2)
    distances = np.maximum(np.maximum(apart, sizes[:, None]), 1e-30)
    irradiance = (powers / (4.0 * math.pi * distances * distances)).sum(axis=1)
    return bool((irradiance >= LEAST).mean() >= 0.5)


def _placed_powers(
    world: Group, materials: MaterialTable
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Power of each emitter and its centre (n, 3) in the world."""
    powers: list[float] = []
    centres: list[Any] = []
    for emitter, place in placed_emitters(world, MOST):
        radiance_area = sum(
            materials.mean_emission(material) * area for material, area in emitter.areas.items()
        )
        matrix = place.middle
        scale = abs(float(np.linalg.det(matrix[:3, :3]))) ** (2.0 / 3.0)
        powers.append(math.pi * radiance_area * scale)
        centres.append(emitter.centre @ matrix[:3, :3] + matrix[3, :3])
    return np.array(powers, np.float64), np.array(centres, np.float64).reshape(-1, 3)


_MOST_PLACED = 1 << 20
"""Placements of a group that are looked at."""


def placements(world: Group) -> dict[int, Matrices]:
    """Where the groups that hold surfaces are placed: id of a group -> (k, 4, 4).

    Of each group ``_MOST_PLACED`` count: instances in instances may multiply them.
    """
    order: list[Group] = []
    _after_its_users(world, set(), order)
    found: dict[int, Matrices] = {id(world): np.eye(4)[None]}
    for group in reversed(order):
        placed = found[id(group)]
        for child, transforms in group.surfaced:
            some = transforms[: max(1, _MOST_PLACED // len(placed))]
            every = (some[:, None] @ placed[None]).reshape(-1, 4, 4)
            known = found.get(id(child))
            both = every if known is None else np.concatenate([known, every])
            found[id(child)] = both[:_MOST_PLACED]
    return found


def _after_its_users(group: Group, met: set[int], order: list[Group]) -> None:
    """Groups that hold surfaces: each before those that it is placed in."""
    met.add(id(group))
    for child, _ in group.surfaced:
        if id(child) not in met:
            _after_its_users(child, met, order)
    order.append(group)
