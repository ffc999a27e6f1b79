# SPDX-License-Identifier: Apache-2.0
"""UsdSkel skinning, and mesh points that change while the shutter is open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from wavecomb.usd.geometry.primvar import as_array
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.layers.population import containing_prototypes
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.time_codes import frame_number

if TYPE_CHECKING:
    # The import takes 8 ms, so only functions that read skeletons import UsdSkel.
    from pxr import UsdSkel

    from wavecomb.usd.geometry.shutter import Track

Array = NDArray[Any]

_PROXIES = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


class Skin:
    """The skinning and blend shapes of one mesh."""

    def __init__(
        self, skeleton: UsdSkel.SkeletonQuery, query: UsdSkel.SkinningQuery, report: LoadReport
    ) -> None:
        self.skeleton = skeleton
        self.query = query
        self.report = report
        self.prim: Usd.Prim = query.GetPrim()
        self._shapes = None
        if query.HasBlendShapes():
            from pxr import UsdSkel

            self._shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(self.prim))

    def varies(self) -> bool:
        """Returns whether animation or skeleton-to-mesh transform may change over time."""
        animation = self.skeleton.GetAnimQuery()
        if animation and (
            animation.JointTransformsMightBeTimeVarying()
            or animation.BlendShapeWeightsMightBeTimeVarying()
        ):
            return True
        here, there = _moving_above(self.prim), _moving_above(self.skeleton.GetPrim())
        return self.query.HasJointInfluences() and here != there

    def samples(self, interval: Gf.Interval) -> set[float]:
        """Returns the time codes of the animation's samples within an interval."""
        animation = self.skeleton.GetAnimQuery()
        if not animation:
            return set()
        return {
            *animation.GetJointTransformTimeSamplesInInterval(interval),
            *animation.GetBlendShapeWeightTimeSamplesInInterval(interval),
        }

    def transforms(self, time: float) -> Array:
        """Returns joint transforms (k, 4, 4), from which the number of motion steps is derived."""
        found = self.skeleton.ComputeSkinningTransforms(Usd.TimeCode(time))
        return np.zeros((1, 4, 4)) if found is None else np.array(found)

    def points(self, points: Any, time: Usd.TimeCode) -> Array:
        """Returns deformed points (n, 3) in object space.

        Raises:
            SkinError: The joint influences or the points do not match the mesh.
        """
        try:
            deformed = Vt.Vec3fArray(points)
        except TypeError:
            raise SkinError("points of another type") from None
        self._blend(deformed, time)
        if not self.query.HasJointInfluences():
            return np.array(deformed, np.float32)
        joints = self._joints(time)
        if not self.query.ComputeSkinnedPoints(joints, deformed, time):
            raise SkinError("joint influences that do not fit")
        return (_under(np.asarray(deformed), self._to_mesh(time))).astype(np.float32)

    def normals(
        self, normals: Array, corners: Array | None, count: int, time: Usd.TimeCode
    ) -> Array:
        """Returns deformed normals (n, 3).

        The normals belong to ``count`` points or, if ``corners`` is given, to corners whose points
        have the indices ``corners``. Normals use linear blending even if the skinning method is
        dual quaternion; the difference is small after normalisation.

        Raises:
            SkinError: The joint influences do not match the mesh.
        """
        if not self.query.HasJointInfluences():
            return normals
        influences = self.query.ComputeVaryingJointInfluences(count)
        if influences is None or len(influences[0]) % count:
            raise SkinError("joint influences that do not fit")
        index, weight = (np.asarray(part).reshape(count, -1) for part in influences)
        each = index.shape[1]
        if corners is not None:
            index, weight = index[corners], weight[corners]
        bind = self.query.GetGeomBindTransform(time)
        turns = np.array([_normal_matrix(bind * m) for m in self._ordered(self._joints(time))])
        if index.min(initial=0) < 0 or index.max(initial=0) >= len(turns):
            raise SkinError("joint influences that do not fit")
        turned = np.zeros(normals.shape)
        for k in range(each):
            turned += weight[:, k, None] * np.einsum("ni,nij->nj", normals, turns[index[:, k]])
        turned = turned @ _normal_matrix(self._to_mesh(time))
        length = np.sqrt(np.einsum("ij,ij->i", turned, turned))
        return (turned / np.where(length > 0, length, 1)[:, None]).astype(np.float32)

    def _ordered(self, joints: Any) -> list[Gf.Matrix4d]:
        """Returns joint transforms of the skeleton in the joint order of the mesh."""
        own = self.query.GetJointOrder()
        if not own:
            return list(joints)
        place = {name: i for i, name in enumerate(self.skeleton.GetJointOrder())}
        still = Gf.Matrix4d(1.0)
        return [joints[place[name]] if name in place else still for name in own]

    def _joints(self, time: Usd.TimeCode) -> Any:
        joints = self.skeleton.ComputeSkinningTransforms(time)
        if joints is None:
            raise SkinError("a skeleton without a pose")
        return joints

    def _blend(self, points: Any, time: Usd.TimeCode) -> None:
        """Applies blend shapes to points in place."""
        animation, mapper = self.skeleton.GetAnimQuery(), self.query.GetBlendShapeMapper()
        if self._shapes is None or not animation or mapper is None:
            return
        weights = animation.ComputeBlendShapeWeights(time)
        if weights is None:
            return
        parts = self._shapes.ComputeSubShapeWeights(mapper.Remap(weights))
        indices = self._shapes.ComputeBlendShapePointIndices()
        offsets = self._shapes.ComputeSubShapePointOffsets()
        if not self._shapes.ComputeDeformedPoints(*parts, indices, offsets, points):
            raise SkinError("blend shapes that do not fit")

    def _to_mesh(self, time: Usd.TimeCode) -> Gf.Matrix4d:
        """Returns the transform from the skeleton's object space to the mesh's object space."""
        xforms = UsdGeom.XformCache(time)
        inverse = xforms.GetLocalToWorldTransform(self.prim).GetInverse()
        return xforms.GetLocalToWorldTransform(self.skeleton.GetPrim()) * inverse


MAX_SKINNED_INSTANCES = 100_000
"""Maximum number of skinned instances with separate prototypes, since instancing can multiply
them."""


class SkinError(ValueError):
    """Raised if skinning data does not fit its mesh; the message gives the reason."""


class Skeletons:
    """The skinning data of a stage's meshes, collected as the traversal reaches SkelRoots."""

    def __init__(self, report: LoadReport) -> None:
        self.report = report
        self._cache: UsdSkel.Cache | None = None
        self._roots: set[Sdf.Path] = set()
        self._skins: dict[Sdf.Path, Skin] = {}
        self._holding: set[Sdf.Path] | None = None
        self._apart = 0

    def enter(self, prim: Usd.Prim) -> None:
        """Collects the meshes below a SkelRoot that are bound to skeletons."""
        if prim.GetPath() in self._roots:
            return
        from pxr import UsdSkel

        cache = self._cache = self._cache or UsdSkel.Cache()
        root = UsdSkel.Root(prim)
        self._roots.add(prim.GetPath())
        if not cache.Populate(root, _PROXIES):
            return
        for binding in cache.ComputeSkelBindings(root, _PROXIES) or ():
            skeleton = cache.GetSkelQuery(binding.GetSkeleton())
            for query in binding.GetSkinningTargets():
                if skeleton and (query.HasJointInfluences() or query.HasBlendShapes()):
                    skin = Skin(skeleton, query, self.report)
                    self._skins[query.GetPrim().GetPath()] = skin

    def of(self, prim: Usd.Prim) -> Skin | None:
        """Returns the skinning data of a mesh; None if the mesh is not bound to a skeleton."""
        return self._skins.get(prim.GetPath()) if self._skins else None

    def needs_own_prototype(self, instance: Usd.Prim, prototype: Usd.Prim) -> bool:
        """Returns whether an instance needs a separate prototype because of its animation."""
        # Check the instance's type, since the root prim of a prototype has no type.
        apart = (
            instance.GetTypeName() == "SkelRoot"
            or prototype.GetPath() in self._holders(prototype.GetStage())
            or (bool(self._roots) and self._is_below_root(instance.GetPath()))
        )
        if not apart:
            return False
        self._apart += 1
        if self._apart > MAX_SKINNED_INSTANCES:
            what = (
                f"more than {MAX_SKINNED_INSTANCES} skeletal instances: the rest use the pose of "
                "the first one"
            )
            self.report.warn(what, instance.GetPath())
            return False
        return True

    def _is_below_root(self, path: Sdf.Path) -> bool:
        return any(above in self._roots for above in path.GetPrefixes())

    def _holders(self, stage: Usd.Stage) -> set[Sdf.Path]:
        """Returns the prototypes that contain a SkelRoot, directly or in nested instances."""
        if self._holding is None:
            self._holding = containing_prototypes(
                stage, lambda prim: prim.GetTypeName() == "SkelRoot"
            )
        return self._holding


def skinned_points(skin: Skin, points: Any, time: Usd.TimeCode) -> Any:
    """Returns skinned points of a mesh; warns and returns the rest pose if skinning fails."""
    try:
        return skin.points(points, time)
    except SkinError as error:
        what = f"{error}: drawn in rest pose"
        skin.report.warn(what, skin.prim.GetPath())
        return as_array(points)


def _moving_above(prim: Usd.Prim) -> set[Sdf.Path]:
    """Returns the paths of the prim and its ancestors that have animated transforms."""
    moving: set[Sdf.Path] = set()
    while prim:
        xformable = UsdGeom.Xformable(prim)
        if xformable and xformable.TransformMightBeTimeVarying():
            moving.add(prim.GetPath())
        prim = prim.GetParent()
    return moving


def _under(points: Array, matrix: Gf.Matrix4d) -> Array:
    m = np.array(matrix)
    moved: Array = points @ m[:3, :3] + m[3, :3]
    return moved


def _normal_matrix(matrix: Gf.Matrix4d) -> Array:
    """Returns the inverse transpose (3, 3), which transforms normals as row vectors."""
    linear = np.array(matrix)[:3, :3]
    if abs(np.linalg.det(linear)) < 1e-12:
        return np.eye(3)
    return np.asarray(np.linalg.inv(linear).T)


def deforms(prim: Usd.Prim, skin: Skin | None) -> bool:
    """Returns whether the shape of a mesh may change over time."""
    if skin is not None and skin.varies():
        return True
    points = prim.GetAttribute("points")
    return bool(points and points.ValueMightBeTimeVarying()) or _has_velocities(prim)


def _has_velocities(prim: Usd.Prim) -> bool:
    velocities = prim.GetAttribute("velocities")
    return bool(velocities and velocities.HasAuthoredValue())


def points_at_time(prim: Usd.Prim, time: Usd.TimeCode) -> Any:
    """Returns the points at a time code; velocities extrapolate from the preceding time sample."""
    if frame_number(time) is not None and _has_velocities(prim):
        found = UsdGeom.PointBased(prim).ComputePointsAtTime(time, time)
        if found:
            return found
    return prim.GetAttribute("points").Get(time)


def step_times(prim: Usd.Prim, skin: Skin | None, motion: Motion) -> list[float]:
    """Returns the time codes at which the shape of a mesh is sampled."""
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
    """Returns points (n, 3) in object space at each time; None if the number of points changes.

    If velocities or accelerations exist, they replace interpolation between samples, as
    UsdGeomPointBased requires.
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
    """Returns the transform at a time code from a mesh to its group (the world or a prototype)."""
    return still if track is None else track.at(time)
