# SPDX-License-Identifier: Apache-2.0
"""Builds groups of objects (the world and the prototypes) from prims, and instances them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from itertools import repeat
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from wavecomb.usd.geometry.attributes import on_shape
from wavecomb.usd.geometry.curves import CurveArrays, uniform_scale
from wavecomb.usd.geometry.gprims import COUNTS, WORDS, GprimReader, MemoryCheck, add_shape
from wavecomb.usd.geometry.mesh_arrays import IDENTITY, UV_NAMES, MeshArrays, is_translation
from wavecomb.usd.geometry.strands import StrandDetail
from wavecomb.usd.geometry.subdivision import SubdivisionSurfaces
from wavecomb.usd.instances.group import Group, Matrices, Scope, emitter_of
from wavecomb.usd.instances.instance_materials import (
    InstanceBinding,
    InstanceBindings,
    InstanceMaterials,
)
from wavecomb.usd.instances.mesh_batch import DrawCount, LoadProgress, MeshBatches
from wavecomb.usd.instances.placement import GroupInstancer, VolumeInstancer, outline_of
from wavecomb.usd.instances.point_instancer import moved_instances, read_instances
from wavecomb.usd.lights.mesh_light import MeshLights
from wavecomb.usd.materials.assignment import Assigner, BoundMaterials
from wavecomb.usd.materials.bindings import BindingScan, bound_materials
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.materials.material import INHERIT_MATERIAL, MaterialTable
from wavecomb.usd.stage.collections import LightGroups
from wavecomb.usd.stage.context import LoadContext, world_to_scene
from wavecomb.usd.stage.frame_cache import MeshCache
from wavecomb.usd.stage.traversal import STRANDS, CollectedPrims, InstancePrim, Traversal

_ANY = Usd.PrimIsActive & Usd.PrimIsLoaded
"""Predicate for prims in prototypes of point instancers; the prims may be overs or classes."""

MAX_NESTING = 100
"""Deepest nesting of instances; each level is a recursive call of ``GroupBuilder``."""


class GroupBuilder:
    """Builder of all groups of a scene (the world and the prototypes) from prims."""

    def __init__(
        self,
        context: LoadContext,
        traversal: Traversal,
        materials: MaterialTable,
        light_groups: LightGroups,
        surfaces: SubdivisionSurfaces,
        *,
        cache: MeshCache | None = None,
        progress: LoadProgress | None = None,
        detail: StrandDetail | None = None,
        notes_emitters: bool = False,
    ) -> None:
        """Creates a builder for loading one scene.

        ``cache`` stores mesh arrays between frames. ``progress`` is the progress callback.
        ``detail`` simplifies curves that are in the world group. If ``notes_emitters`` is set,
        groups collect their emissive meshes. ``has_other_emission`` then states whether curves,
        points or materials of instances emit light, which groups do not collect.
        """
        self.notes_emitters = notes_emitters
        self.has_other_emission = False
        self.context = context
        self.builder, self.report = context.builder, context.report
        self.traversal, self.materials = traversal, materials
        self.light_groups, self.surfaces = light_groups, surfaces
        self.gprims = GprimReader(context, surfaces, traversal.skeletons, cache)
        self.memory_check = MemoryCheck(context.stage, context.time)
        self.count, self.detail = DrawCount(progress), detail
        self.assigner = Assigner(context, materials)
        self.mesh_lights = MeshLights(context, traversal.lights, materials)
        self.bindings = BindingScan()
        self.instancer = GroupInstancer(context, self.mesh_lights)
        self.instance_materials = InstanceMaterials(context, materials)
        self.instance_bindings = InstanceBindings(context, materials)
        self.volumes = VolumeInstancer(context)
        self._groups: dict[Hashable, Group] = {}
        self._known: dict[Sdf.Path, UsdShade.Material] = {}
        self._building: set[Hashable] = set()

    def world(self) -> Group:
        """Reads the whole stage into group 0."""
        group = Group("world", number=0)
        roots = list(self.context.stage.GetPseudoRoot().GetChildren())
        self._fill(group, roots, Scope(), "default", base=world_to_scene(self.context.origin))
        return group

    def _fill(
        self,
        group: Group,
        roots: Sequence[Usd.Prim],
        scope: Scope,
        purpose: str,
        predicate: Any = None,
        base: Gf.Matrix4d = IDENTITY,
    ) -> None:
        """Reads prims and their descendants into a group, with the parent transform ``base``."""
        found = self.traversal.walk(roots, purpose, predicate, scope.inherited, base)
        group.lights += found.lights
        self.memory_check.check(found.draws)
        self._bind(found, scope)
        if scope.material is not None:
            for draw in found.draws:
                if scope.override or draw.material is None:
                    draw.material = scope.material
        for draw in found.volumes:
            self.volumes.add(group, draw, scope)
        group.has_lights_or_volumes |= bool(group.lights or group.volumes)
        self.count.found += len(found.draws)
        for draw in found.stand_ins:
            for material in draw.subset_materials:
                if material is not None:
                    self.materials.expect(material)
            self._draw(group, draw, scope)
        MeshBatches(
            self.context, group, scope, self.gprims, self.assigner, self.instancer,
            draw=self._draw, count=self.count.add,
        ).draw(found.draws)  # fmt: skip
        self._place_instances(group, found.instances, scope)
        for instance in found.instancers:
            self._place_instancer(group, instance, scope)

    def _bind(self, found: CollectedPrims, scope: Scope) -> None:
        """Resolves all material bindings of a group together."""
        if scope.override:
            return
        prims = found.binding_prims()
        if scope == Scope() and not found.has_bindings:  # no prim above the roots binds either
            found.bind(repeat(None))
            return
        if scope.alias is not None:
            prims = [self._proxy(prim, scope.alias) for prim in prims]
        # Use the same Python object for all occurrences of a material, since dict lookups of
        # identical objects are faster than comparisons of paths.
        known = self._known
        bound = found.bind(
            None if material is None else known.setdefault(material.GetPath(), material)
            for material in bound_materials(prims, self.context.binding_purposes)
        )
        used = {id(material): material for material in bound if material is not None}
        for material in used.values():
            self.materials.expect(material)

    def _proxy(self, prim: Usd.Prim, alias: tuple[Sdf.Path, Sdf.Path]) -> Usd.Prim:
        path = prim.GetPath().ReplacePrefix(*alias)
        return self.context.stage.GetPrimAtPath(path) or prim

    def _draw(self, group: Group, draw: DrawItem, scope: Scope) -> None:
        """Adds one gprim to a group."""
        kind = draw.kind
        baked = kind == "mesh" and self.gprims.deforms(kind, draw.prim)
        if draw.track is not None and not baked:
            steps = draw.track.steps()
            still = replace(draw, matrix=draw.matrix if steps is None else IDENTITY, track=None)
            if steps is None:
                return self._draw(group, still, scope)
            return self._draw_alone(group, still, draw.matrix, scope, steps)
        is_turned = kind == "splats" and not is_translation(draw.matrix)
        if is_turned or (kind in STRANDS.values() and uniform_scale(draw.matrix) is None):
            own = replace(draw, matrix=IDENTITY)
            return self._draw_alone(group, own, draw.matrix, scope)
        if kind == "splats":
            if draw.material is not None:
                self.report.missing("materials of splats (they have colours)", draw.prim.GetPath())
            draw = replace(draw, material=None, subsets=(), subset_materials=[])
        if scope.override:
            draw.subsets = ()
        mesh_light = self.mesh_lights.of(draw, kind)
        if mesh_light is not None and mesh_light.material is not None:
            draw = replace(draw, material=None, subsets=(), subset_materials=[])
        names = self.assigner.uv_names(draw)
        if scope.inside and draw.material is None and not names:
            names = UV_NAMES
        path = str(draw.prim.GetPath())
        in_world = group.number == 0
        shape = self.gprims.read(draw, names, in_world, self.detail if in_world else None)
        if shape is None:
            return
        if mesh_light is not None and mesh_light.material is not None:
            assigned = BoundMaterials(mesh_light.material)
        elif kind == "splats":
            assigned = BoundMaterials(self.materials.splats())
        else:
            assigned = self._materials(draw, shape, scope)
        material, faces = assigned.material, None
        if assigned.by_face is not None and isinstance(shape, MeshArrays) and shape.topology:
            faces = assigned.by_face[shape.topology.face_ids()]
        name = self.report.place(path)
        emits = self.materials.any_emits(material, faces)
        may_emit = mesh_light is not None or material == INHERIT_MATERIAL or emits
        if self.notes_emitters and emits:
            if isinstance(shape, MeshArrays):
                group.emitters.append(emitter_of(shape, material, faces))
                group.has_lights_or_volumes = True
            else:
                self.has_other_emission = True
        asset_length = self.instancer.asset_length(draw.prim, path, name, draw.parent)
        options: dict[str, Any] = dict(material=material, name=name, asset_length=asset_length)
        if faces is not None:
            options["face_materials"] = faces
        if assigned.reads:
            mirrored = draw.matrix.GetDeterminant3() < 0
            options["attributes"] = on_shape(assigned.reads, shape, mirrored)
        if may_emit:
            options["light_group"] = self.light_groups.of(draw.prim, draw.inherited)
        if mesh_light is not None:
            options["mesh_light"] = mesh_light.number
            if mesh_light.is_sampled_only:
                group.sampled_light = draw.prim.GetPath()
                if kind == "mesh" and self.gprims.deforms(kind, draw.prim):
                    self.mesh_lights.report_motion(group.sampled_light)
        try:
            number = add_shape(self.builder, shape, options)
        except ValueError as error:
            self.report.warn(f"{WORDS[kind]} left out: {error}")
            return
        self.builder.add_to_group(self.instancer.number(group), number)
        group.grow(shape.bounds)
        if self.context.framed is not None:
            more = self.context.framed if group.number == 0 else None
            group.reach(outline_of(shape, self.surfaces, more), more)
        if isinstance(shape, MeshArrays) and shape.cage is not None:
            self.surfaces.add(group, number, draw, shape, assigned)
        self.report.tally(COUNTS[kind])

    def _draw_alone(
        self,
        group: Group,
        draw: DrawItem,
        matrix: Gf.Matrix4d,
        scope: Scope,
        steps: Matrices | None = None,
    ) -> None:
        """Adds a gprim as a separate instance with the transform ``matrix``.

        This function is for gprims with rigid motion (``steps`` are transforms (s, 4, 4)), for
        curves or points with non-uniform scale, and for rotated splats, whose colours depend on
        direction.
        """
        path = draw.prim.GetPath()
        child = Group(str(path), self.report.place(path))
        self._draw(child, draw, scope)
        if child.empty:
            return
        inherit, matrices = np.array([INHERIT_MATERIAL], np.uint32), np.array(matrix)[None]
        motion = None if steps is None else steps[None]
        self.instancer.add(group, child, matrices, inherit, [draw.prim], motion=motion)

    def _materials(
        self, draw: DrawItem, mesh: MeshArrays | CurveArrays, scope: Scope
    ) -> BoundMaterials:
        inherits = draw.material is None and scope.bound and not any(draw.subset_materials)
        if (scope.override and scope.material is None) or inherits:
            return BoundMaterials(INHERIT_MATERIAL)
        return self.assigner.assign(draw, mesh, INHERIT_MATERIAL if scope.inside else None)

    def _group(
        self,
        key: Hashable,
        name: str,
        root: Sdf.Path,
        roots: Sequence[Usd.Prim],
        scope: Scope,
        purpose: str,
        predicate: Any = None,
    ) -> Group | None:
        """Returns the group that contains the given prims; each group is built only once.

        Returns None with a warning if the group would contain itself.
        """
        known = self._groups.get(key)
        if known is not None:
            return known
        if key in self._building or len(self._building) == MAX_NESTING:
            deep = f"instances in instances, more than {MAX_NESTING} deep"
            what = "prototype contains itself" if key in self._building else deep
            self.report.warn(f"{what}: left out", name)
            return None
        self._building.add(key)
        try:
            group = Group(name, self.report.place(root))
            self._fill(group, roots, scope, purpose, predicate)
        finally:
            self._building.discard(key)
        self._groups[key] = group
        return group

    def _place_instances(
        self, parent: Group, instances: Sequence[InstancePrim], scope: Scope
    ) -> None:
        """Adds native instances; instances of a prototype are added together."""
        batches: dict[tuple[int, int], tuple[Group, list[tuple[Any, ...]]]] = {}
        for instance in instances:
            child = self._instance_group(instance, scope)
            if child is None:
                continue
            material = self.instance_materials.of_instance(instance, scope)
            if self.materials.any_emits(material, None):
                self.has_other_emission = True
            steps = None if instance.track is None else instance.track.steps()
            count = 0 if steps is None else len(steps)
            _, batch = batches.setdefault((id(child), count), (child, []))
            batch.append((np.array(instance.matrix), material, instance.prim, steps))
        for (_, count), (child, batch) in batches.items():
            matrices, materials, prims, moves = zip(*batch, strict=True)
            ids = np.array(materials, np.uint32)
            motion = np.stack(moves) if count else None
            self.instancer.add(parent, child, np.stack(matrices), ids, prims, motion=motion)
        self.report.tally("instances", len(instances))

    def _instance_group(self, instance: InstancePrim, scope: Scope) -> Group | None:
        prim = instance.prim
        prototype = prim.GetPrototype()
        path = prototype.GetPath()
        proxy = self._proxy(prim, scope.alias) if scope.alias else prim
        strong, collections = self.bindings.above(proxy)
        override = scope.override or (strong and not collections)
        alias, exact = None, None
        if not override and (collections or scope.alias is not None):
            alias = (path, proxy.GetPath())
            exact = self.instance_materials.of_proxies(proxy)
        bound = alias is None and (instance.material is not None or (scope.bound and not override))
        binding = self.instance_bindings.of_instance(instance, proxy, scope)
        inner = Scope(inside=True, bound=bound, override=override, alias=alias, root=path)
        inner = binding.on(inner)
        key = ("native", path, inner.bound, override, instance.purpose, exact, binding.key)
        roots = list(prototype.GetChildren())
        return self._group(key, str(prim.GetPath()), path, roots, inner, instance.purpose)

    def _place_instancer(self, parent: Group, instance: InstancePrim, scope: Scope) -> None:
        """Adds the instances of a point instancer; instances of a prototype are added together."""
        prim = instance.prim
        path = prim.GetPath()
        targets = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
        self.report.tally("point instancers")
        instances = read_instances(prim, self.context.time, len(targets), self.report)
        if instances is None or len(instances.kept) == 0:
            return
        authored = self.instance_materials.of_instancer(instance, instances.authored, scope)
        materials = authored[instances.kept]
        order = np.argsort(instances.prototypes, kind="stable")
        ranked = instances.prototypes[order]
        outer = None if instance.matrix == IDENTITY else np.array(instance.matrix)
        moved, shutter = None, self.context.motion
        if shutter is not None:
            moved = moved_instances(prim, shutter, instance.track, outer, instances, self.report)
        for index, target in enumerate(targets):
            first, last = np.searchsorted(ranked, [index, index + 1])
            if first == last:
                continue
            root = self.context.stage.GetPrimAtPath(target)
            if not root:
                self.report.warn(f"point instancer prototype {target} does not exist", path)
                continue
            of_root = order[first:last]
            for which, binding in self.instance_bindings.of_points(
                instance, root, instances.kept[of_root], instances.authored, _ANY
            ):
                child = self._prototype_group(root, instance, scope, binding)
                if child is None:
                    continue
                chosen = of_root[which]
                transforms = instances.transforms[chosen]
                if outer is not None:
                    transforms = transforms @ outer
                numbers = instances.kept[chosen].astype(np.uint32)
                motion = None if moved is None else np.ascontiguousarray(moved[chosen])
                ids = materials[chosen]
                self.instancer.add(parent, child, transforms, ids, [prim], numbers, motion)
        self.report.tally("point instances", len(instances.kept))

    def _prototype_group(
        self, root: Usd.Prim, instance: InstancePrim, scope: Scope, binding: InstanceBinding
    ) -> Group | None:
        """Returns the group of a point instancer's prototype."""
        path = root.GetPath()
        within = path.HasPrefix(scope.root) and scope.inside
        outer = replace(scope, inherited=()) if within else Scope(root=path)
        inner = binding.on(replace(outer, inside=True))
        path_of_material = None if inner.material is None else inner.material.GetPath()
        key = (
            "point", path, inner.bound, inner.override, instance.purpose, inner.alias, binding.key,
            path_of_material,
        )  # fmt: skip
        return self._group(key, str(path), path, [root], inner, instance.purpose, _ANY)
