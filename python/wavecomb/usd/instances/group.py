# SPDX-License-Identifier: Apache-2.0
"""Groups of objects (the world and the prototypes) and the emitters in them."""

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
from wavecomb.usd.materials.material import MaterialTable
from wavecomb.usd.volumes.volume import Volume

Matrices = NDArray[np.float64]
T = TypeVar("T")

MAX_STEPS = 64
"""Maximum number of motion steps of an animated transform nested in another animated transform."""

_MANY_BOXES = 1024
"""Number of bounding boxes of a group above which the boxes are merged."""

_MAX_SHOWN = 2048
"""Number of bounding boxes of a group that are kept without merging."""


@dataclass(frozen=True)
class AnimatedTransform:
    """A transform that may be animated.

    Attributes:
        middle: (4, 4) transform at mid-shutter.
        steps: (s, 4, 4) transforms at equal steps over the shutter; None if static.
    """

    middle: Matrices
    steps: Matrices | None = None

    def within(self, outer: AnimatedTransform) -> AnimatedTransform:
        """Returns the concatenation of this transform with an outer one."""
        inner, outside = self.steps, outer.steps
        middle = self.middle @ outer.middle
        if inner is None and outside is None:
            return AnimatedTransform(middle)
        if inner is None or outside is None:
            left = self.middle if inner is None else inner
            return AnimatedTransform(middle, left @ (outer.middle if outside is None else outside))
        segments = math.lcm(len(inner) - 1, len(outside) - 1)
        if segments >= MAX_STEPS:
            segments = max(len(inner), len(outside)) - 1
        count = segments + 1
        return AnimatedTransform(middle, _resampled(inner, count) @ _resampled(outside, count))


@dataclass(frozen=True)
class Emitter:
    """An emissive mesh in the space of its group (the world or a prototype).

    Attributes:
        centre: (3,) centre of the mesh's bounds.
        areas: Total area of the mesh's faces with each material, by material id.
    """

    centre: NDArray[np.float64]
    areas: Mapping[int, float]


@dataclass
class Group:
    """Meshes, lights, volumes and instances that are instanced together.

    Attributes:
        number: Id of the group in the scene, assigned when the first object is added.
        boxes: Bounds (2, 3) of the group's contents in group space.
        outlines: Extreme points of the group's contents in group space; see ``framing``.
        root: Prim path that is the common beginning of the names of the group's contents.
        lights: Lights with their transforms in group space.
        volumes: Volumes with their transforms (4, 4) in group space.
        children: Instanced groups that contain lights, volumes or emitters, with their transforms.
        surfaced: Instanced groups that contain meshes to be refined, with their transforms.
        has_lights_or_volumes: Whether the group or its child groups have lights, volumes or
            emitters.
        sampled_light: Path of a mesh light in the group that must not move.
        emitters: Emissive meshes in the group; only collected for stages without lights.
        shown: The first bounding boxes of the group, which are never merged.
    """

    name: str
    root: str = ""
    number: int | None = None
    boxes: list[NDArray[Any]] = field(default_factory=list)
    lights: list[tuple[Light, AnimatedTransform]] = field(default_factory=list)
    volumes: list[tuple[Volume, Matrices]] = field(default_factory=list)
    children: list[tuple[Group, list[AnimatedTransform]]] = field(default_factory=list)
    surfaced: list[tuple[Group, Matrices]] = field(default_factory=list)
    has_lights_or_volumes: bool = False
    has_surfaces: bool = False
    sampled_light: Sdf.Path | None = None
    outlines: list[NDArray[np.float64]] = field(default_factory=list)
    outlined: int = 0
    emitters: list[Emitter] = field(default_factory=list)
    shown: list[NDArray[Any]] = field(default_factory=list)

    @property
    def empty(self) -> bool:
        """Whether the group contains nothing to render."""
        return self.number is None

    def grow(self, bounds: NDArray[Any]) -> None:
        """Extends the bounds of the group to contain a box (2, 3)."""
        self.boxes.append(bounds)
        if len(self.shown) < _MAX_SHOWN:
            self.shown.append(bounds)
        self._merge_boxes()

    def grow_by(self, boxes: NDArray[Any]) -> None:
        """Extends the bounds of the group by boxes (k, 2, 3)."""
        self.boxes.append(np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]))
        self.shown.extend(boxes[: max(0, _MAX_SHOWN - len(self.shown))])
        self._merge_boxes()

    def _merge_boxes(self) -> None:
        whole = self.bounds if len(self.boxes) > _MANY_BOXES else None
        if whole is not None:
            self.boxes = [whole]

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """(2, 3) bounds of the group's contents in group space."""
        if not self.boxes:
            return None
        boxes = np.array(self.boxes, np.float64)
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def reach(self, points: NDArray[np.float64], more: NDArray[np.float64] | None) -> None:
        """Adds points to the group's outline, which is exact in the directions ``more``."""
        self.outlines.append(points)
        self.outlined += len(points)
        if self.outlined > framing.MANY_POINTS:
            self.outlines = [framing.outline(np.concatenate(self.outlines), more)]
            self.outlined = len(self.outlines[0])


@dataclass(frozen=True)
class Scope:
    """State that a group inherits from its instances.

    Attributes:
        inside: Whether the group is instanced, so that its meshes may use the material of their
            instance.
        bound: Whether a material is bound to the instance; this material overrides display colours.
        override: Whether a material binding of an ancestor is stronger than the bindings in the
            group.
        alias: Paths of prototype and instance if bindings are resolved on the instance's proxies.
        root: Path of the native prototype that the group comes from.
        material: Material for prims without a binding, if it reads their primvars.
        inherited: Constant primvars of the instances.
    """

    inside: bool = False
    bound: bool = False
    override: bool = False
    alias: tuple[Sdf.Path, Sdf.Path] | None = None
    root: Sdf.Path = Sdf.Path.absoluteRootPath
    material: UsdShade.Material | None = None
    inherited: tuple[Any, ...] = ()


def middle_transforms(motion: Matrices) -> Matrices:
    """Returns the transforms (k, 4, 4) at mid-shutter from those at steps (k, s, 4, 4)."""
    last = motion.shape[1] - 1
    middle: Matrices = 0.5 * (motion[:, last // 2] + motion[:, (last + 1) // 2])
    return middle


def changes_size(steps: Matrices) -> bool:
    """Returns whether the scale of an animated transform (s, 4, 4) changes."""
    sizes = np.linalg.svd(steps[:, :3, :3], compute_uv=False)
    return bool((np.abs(sizes - sizes[:1]) > 1e-2 * sizes[:1].max()).any())


def _resampled(steps: Matrices, count: int) -> Matrices:
    """Resamples transforms (s, 4, 4) to ``count`` equal steps by linear interpolation."""
    at = np.linspace(0.0, len(steps) - 1.0, count)
    before = np.minimum(at.astype(np.intp), len(steps) - 2)
    part = (at - before)[:, None, None]
    mixed: Matrices = steps[before] * (1.0 - part) + steps[before + 1] * part
    return mixed


def placed_lights(group: Group, limit: int) -> list[tuple[Light, AnimatedTransform]]:
    """Returns at most ``limit`` lights of a group and its child groups, with transforms."""
    return _placed(group, limit, lambda one: one.lights)


def placed_volumes(group: Group, limit: int) -> list[tuple[Volume, Matrices]]:
    """Returns at most ``limit`` volumes of a group and its child groups, with transforms."""
    found = _placed(group, limit, lambda one: [(v, AnimatedTransform(m)) for v, m in one.volumes])
    return [(volume, place.middle) for volume, place in found]


def placed_emitters(group: Group, limit: int) -> list[tuple[Emitter, AnimatedTransform]]:
    """Returns at most ``limit`` emitters of a group and its child groups, with transforms."""
    return _placed(
        group, limit, lambda one: [(e, AnimatedTransform(np.eye(4))) for e in one.emitters]
    )


def _placed(
    group: Group, limit: int, of: Callable[[Group], list[tuple[T, AnimatedTransform]]]
) -> list[tuple[T, AnimatedTransform]]:
    out = list(of(group)[:limit])
    for child, places in group.children:
        inner = _placed(child, limit, of)
        for place in places:
            if len(out) >= limit:
                return out
            out += [(one, local.within(place)) for one, local in inner]
    return out[:limit]


MIN_IRRADIANCE = 0.02
"""Smallest irradiance of a lit object: a hundredth of the default dome's irradiance."""

MAX_SAMPLED_EMITTERS = 2048
"""Maximum number of objects, and of emitters, for which irradiance is estimated."""


def emitter_of(shape: MeshArrays, material: int, faces: NDArray[np.uint32] | None) -> Emitter:
    """Returns the emitter that describes a mesh.

    ``faces`` holds the material of each triangle if the materials differ.
    """
    positions = shape.positions.reshape(-1, *shape.positions.shape[-2:])[0].astype(np.float64)
    a, b, c = (positions[shape.triangles[:, corner]] for corner in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centre = np.asarray(shape.bounds, np.float64).mean(axis=0)
    if faces is None:
        return Emitter(centre, {material: float(areas.sum())})
    used = np.unique(faces)
    return Emitter(centre, {int(one): float(areas[faces == one].sum()) for one in used})


def is_lit_by_emitters(world: Group, materials: MaterialTable) -> bool:
    """Returns whether the emitters illuminate at least half of the objects.

    An object counts as illuminated if its irradiance is at least ``MIN_IRRADIANCE``. Emitters are
    treated as point lights at their centres, no closer to an object than the object's radius. The
    estimate ignores shadows and indirect light. The result does not depend on the camera or on
    random samples, so that all frames of a shot and all tasks of a render farm agree.
    """
    boxes = np.array(world.shown[:MAX_SAMPLED_EMITTERS], np.float64)
    powers, centres = _emitter_powers(world, materials)
    if len(boxes) == 0 or len(powers) == 0:
        return False
    middles = boxes.mean(axis=1)
    sizes = 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    apart = np.linalg.norm(middles[:, None] - centres[None], axis=2)
    distances = np.maximum(np.maximum(apart, sizes[:, None]), 1e-30)
    irradiance = (powers / (4.0 * math.pi * distances * distances)).sum(axis=1)
    return bool((irradiance >= MIN_IRRADIANCE).mean() >= 0.5)


def _emitter_powers(
    world: Group, materials: MaterialTable
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the power (n,) of each emitter and its centre (n, 3) in world space."""
    powers: list[float] = []
    centres: list[Any] = []
    for emitter, place in placed_emitters(world, MAX_SAMPLED_EMITTERS):
        radiance_area = sum(
            materials.mean_emission(material) * area for material, area in emitter.areas.items()
        )
        matrix = place.middle
        scale = abs(float(np.linalg.det(matrix[:3, :3]))) ** (2.0 / 3.0)
        powers.append(math.pi * radiance_area * scale)
        centres.append(emitter.centre @ matrix[:3, :3] + matrix[3, :3])
    return np.array(powers, np.float64), np.array(centres, np.float64).reshape(-1, 3)


_MAX_PLACED = 1 << 20
"""Maximum number of transforms of a group that are taken into account."""


def placements(world: Group) -> dict[int, Matrices]:
    """Returns world transforms (k, 4, 4) by id of each group that has meshes to refine.

    Limits each group to ``_MAX_PLACED`` transforms, since nested instancing can multiply them.
    """
    order: list[Group] = []
    _append_in_order(world, set(), order)
    found: dict[int, Matrices] = {id(world): np.eye(4)[None]}
    for group in reversed(order):
        placed = found[id(group)]
        for child, transforms in group.surfaced:
            some = transforms[: max(1, _MAX_PLACED // len(placed))]
            every = (some[:, None] @ placed[None]).reshape(-1, 4, 4)
            known = found.get(id(child))
            both = every if known is None else np.concatenate([known, every])
            found[id(child)] = both[:_MAX_PLACED]
    return found


def _append_in_order(group: Group, met: set[int], order: list[Group]) -> None:
    """Appends groups so that each one precedes the groups that contain its instances."""
    met.add(id(group))
    for child, _ in group.surfaced:
        if id(child) not in met:
            _append_in_order(child, met, order)
    order.append(group)
