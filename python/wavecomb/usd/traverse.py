# SPDX-License-Identifier: Apache-2.0
"""Walks the stage: prims into groups, groups into the scene."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade

from wavecomb.usd.assign import Assigner, Draw
from wavecomb.usd.colour import quantise
from wavecomb.usd.instancing import read_instances, sound
from wavecomb.usd.light import KINDS as LIGHT_KINDS
from wavecomb.usd.light import Light, LightReader
from wavecomb.usd.material import (
    DEFAULT_COLOUR,
    INHERIT_MATERIAL,
    BindingScan,
    MaterialTable,
    bound_materials,
)
from wavecomb.usd.mesh import IDENTITY, UV_NAMES, MeshArrays, MeshReader
from wavecomb.usd.network import colour
from wavecomb.usd.primvar import PrimvarError, from_attribute
from wavecomb.usd.report import LoadReport
from wavecomb.usd.shapes import SHAPES
from wavecomb.usd.triangulate import MeshError

if TYPE_CHECKING:
    from wavecomb import _core

Matrices = NDArray[np.float64]

_ANY = Usd.PrimIsActive & Usd.PrimIsLoaded
"""Prototypes of point instancers may be overs or classes, so that nothing else draws them."""

_UNSUPPORTED = (
    "BasisCurves", "NurbsCurves", "HermiteCurves", "Points", "NurbsPatch", "TetMesh", "Volume",
)  # fmt: skip


@dataclass
class Group:
    """Meshes, lights and instances that are placed together.

    Attributes:
        number: In the scene, once something is in it.
        bounds: (2, 3) in its own space.
        lights: With their transforms (4, 4) in the group.
        children: Groups placed in it, transforms (k, 4, 4).
    """

    name: str
    number: int | None = None
    bounds: NDArray[Any] | None = None
    lights: list[tuple[Light, Matrices]] = field(default_factory=list)
    children: list[tuple[Group, Matrices]] = field(default_factory=list)
    lit: bool = False

    @property
    def empty(self) -> bool:
        """Whether nothing is in it that is drawn."""
        return self.number is None

    def grow(self, bounds: NDArray[Any]) -> None:
        """Makes the bounds hold others (2, 3) too."""
        if self.bounds is None:
            self.bounds = np.array(bounds, np.float64)
        else:
            np.minimum(self.bounds[0], bounds[0], out=self.bounds[0])
            np.maximum(self.bounds[1], bounds[1], out=self.bounds[1])


@dataclass(frozen=True)
class Scope:
    """What acts on a group from outside.

    Attributes:
        inside: It is placed by instances, so a mesh may leave its material to them.
        bound: The instance brings a bound material, which goes before display colours.
        override: A binding above is stronger than all in the group.
        alias: (prototype, instance): bindings are looked up on the instance's proxies.
        root: Path of the native prototype that the group comes from.
    """

    inside: bool = False
    bound: bool = False
    override: bool = False
    alias: tuple[Sdf.Path, Sdf.Path] | None = None
    root: Sdf.Path = Sdf.Path.absoluteRootPath


@dataclass
class Placed:
    """A native instance or a point instancer, to be expanded once bindings are known."""

    prim: Usd.Prim
    matrix: Gf.Matrix4d
    purpose: str
    inherited: Sequence[Any]
    material: UsdShade.Material | None = None


@dataclass
class Gathered:
    """What a walk found in one group."""

    draws: list[Draw] = field(default_factory=list)
    instances: list[Placed] = field(default_factory=list)
    instancers: list[Placed] = field(default_factory=list)


class Walker:
    """Turns prims into groups of the scene."""

    def __init__(
        self,
        stage: Usd.Stage,
        time: Usd.TimeCode,
        purposes: Sequence[str],
        builder: _core.SceneBuilder,
        materials: MaterialTable,
        lights: LightReader,
        report: LoadReport,
    ) -> None:
        self.stage = stage
        self.time = time
        self.purposes = frozenset(purposes)
        self.builder = builder
        self.materials = materials
        self.lights = lights
        self.report = report
        self.xforms = UsdGeom.XformCache(time)
        self.meshes = MeshReader(time, report)
        self.assigner = Assigner(materials, time, report)
        self.bindings = BindingScan()
        self._groups: dict[Hashable, Group] = {}
        self._building: set[Hashable] = set()
        self._kinds: dict[str, str] = {}

    def world(self) -> Group:
        """Reads the whole stage into group 0."""
        group = Group("world", number=0)
        self._fill(group, list(self.stage.GetPseudoRoot().GetChildren()), Scope(), "default")
        return group

    # Gathering -----------------------------------------------------------------------------------

    def _kind(self, prim: Usd.Prim) -> str:
        """What a prim is to the walk; found once for each type."""
        name = str(prim.GetTypeName())
        kind = self._kinds.get(name)
        if kind is None:
            if prim.IsA(UsdGeom.Mesh):
                kind = "mesh"
            elif name in SHAPES:
                kind = "shape"
            elif name in LIGHT_KINDS:
                kind = "light"
            elif prim.IsA(UsdGeom.PointInstancer):
                kind = "instancer"
            elif prim.IsA(UsdLux.BoundableLightBase) or prim.IsA(UsdLux.NonboundableLightBase):
                kind = "unsupported light"
            elif prim.IsA(UsdGeom.Gprim) or name in _UNSUPPORTED:
                kind = "unsupported"
            elif prim.IsA(UsdGeom.Imageable):
                kind = "xform" if prim.IsA(UsdGeom.Xformable) else "scope"
            else:
                kind = "shading" if prim.IsA(UsdShade.NodeGraph) else "other"
            self._kinds[name] = kind
        return kind

    def _gather(
        self, group: Group, roots: Sequence[Usd.Prim], scope: Scope, purpose: str, predicate: Any
    ) -> Gathered:
        """Walks down from some prims, in stage order."""
        found = Gathered()
        time, local = self.time, self.xforms.GetLocalTransformation
        proxies = Usd.TraverseInstanceProxies(
            Usd.PrimDefaultPredicate if predicate is None else predicate
        )
        # (prim, transform of its parent, purpose, inherited primvars, predicate for its children)
        stack = [(prim, IDENTITY, purpose, (), predicate) for prim in reversed(roots)]
        while stack:
            prim, matrix, purpose, inherited, pick = stack.pop()
            kind = self._kind(prim)
            if kind == "shading":
                continue
            if kind != "other":
                if prim.GetAttribute("visibility").Get(time) == "invisible":
                    continue
                authored = prim.GetAttribute("purpose")
                if authored.HasAuthoredValue():
                    purpose = authored.Get()
                if kind != "scope":
                    own, resets = local(prim)
                    if resets:
                        matrix = own
                    elif own != IDENTITY:
                        matrix = own * matrix
            shown = purpose in self.purposes
            if prim.IsInstance():
                prototype = prim.GetPrototype()
                if len(prototype.GetInstances()) > 1:
                    inherited = self._inherit(prim, inherited)
                    found.instances.append(Placed(prim, matrix, purpose, inherited))
                    continue
                pick = proxies
            children = prim.GetChildren() if pick is None else prim.GetFilteredChildren(pick)
            if kind == "mesh" or kind == "shape":
                if shown:
                    subsets = [c for c in children if _binds(c)] if children else ()
                    found.draws.append(Draw(prim, matrix, inherited, subsets))
            elif kind == "instancer":
                if shown:
                    found.instancers.append(Placed(prim, matrix, purpose, inherited))
                continue
            elif kind == "light":
                if shown:
                    self._light(group, prim, matrix)
            elif kind.startswith("unsupported"):
                if shown:
                    self.report.missing(str(prim.GetTypeName()), prim.GetPath())
            elif children and kind in ("xform", "scope"):
                inherited = self._inherit(prim, inherited)
                if prim.GetTypeName() == "SkelRoot":
                    self.report.note("skeletal meshes are drawn in rest pose", prim.GetPath())
            for child in reversed(children):
                stack.append((child, matrix, purpose, inherited, pick))
        return found

    def _inherit(self, prim: Usd.Prim, inherited: Sequence[Any]) -> Sequence[Any]:
        """Primvars that the children of a prim inherit."""
        more = UsdGeom.PrimvarsAPI(prim).FindIncrementallyInheritablePrimvars(list(inherited))
        return more if more else inherited

    def _light(self, group: Group, prim: Usd.Prim, matrix: Gf.Matrix4d) -> None:
        light = self.lights.read(prim)
        transform = light.local @ np.array(matrix)
        if not bool(sound(transform[None])[0]):
            self.report.warn("light left out: its transform has no inverse", prim.GetPath())
            return
        self.report.tally("lights")
        group.lights.append((light, transform))
        group.lit = True

    # Building ------------------------------------------------------------------------------------

    def _fill(
        self,
        group: Group,
        roots: Sequence[Usd.Prim],
        scope: Scope,
        purpose: str,
        predicate: Any = None,
    ) -> None:
        """Reads prims and all below them into a group."""
        found = self._gather(group, roots, scope, purpose, predicate)
        self._bind(found, scope)
        for draw in found.draws:
            self._draw(group, draw, scope)
        self._place_instances(group, found.instances, scope)
        for placed in found.instancers:
            self._place_instancer(group, placed, scope)

    def _bind(self, found: Gathered, scope: Scope) -> None:
        """Looks all bindings of a group up at once."""
        if scope.override:
            return
        prims = [draw.prim for draw in found.draws]
        prims += [placed.prim for placed in found.instances]
        prims += [subset for draw in found.draws for subset in draw.subsets]
        if scope.alias is not None:
            prims = [self._proxy(prim, scope.alias) for prim in prims]
        materials = iter(bound_materials(prims))
        for draw in found.draws:
            draw.material = next(materials)
        for placed in found.instances:
            placed.material = next(materials)
        for draw in found.draws:
            draw.subset_materials = [next(materials) for _ in draw.subsets]
            # A subset without a binding of its own computes the mesh's.

    def _proxy(self, prim: Usd.Prim, alias: tuple[Sdf.Path, Sdf.Path]) -> Usd.Prim:
        path = prim.GetPath().ReplacePrefix(*alias)
        return self.stage.GetPrimAtPath(path) or prim

    def _draw(self, group: Group, draw: Draw, scope: Scope) -> None:
        """Adds one gprim to a group."""
        if scope.override:
            draw.subsets = ()
        names = self.assigner.uv_names(draw)
        if scope.inside and draw.material is None and not names:
            names = UV_NAMES
        kind = self._kind(draw.prim)
        try:
            mesh: MeshArrays | None
            if kind == "shape":
                mesh = self.meshes.shape(draw.prim, draw.matrix)
            else:
                mesh = self.meshes.mesh(draw.prim, draw.matrix, names, draw.inherited)
        except MeshError as error:
            self.report.warn(f"mesh left out: {error}", draw.prim.GetPath())
            return
        except (Tf.ErrorException, MemoryError) as error:
            what = "out of memory" if isinstance(error, MemoryError) else "USD cannot read it"
            self.report.warn(f"mesh left out: {what}", draw.prim.GetPath())
            return
        if mesh is None:
            self.report.note("mesh without faces", draw.prim.GetPath())
            return
        material, faces = self._materials(draw, mesh, scope)
        number = self.builder.add_mesh(
            mesh.positions,
            mesh.triangles,
            normals=mesh.normals,
            uvs=mesh.uvs,
            face_materials=faces,
            material=material,
            name=str(draw.prim.GetPath()),
        )
        self.builder.add_to_group(self._number(group), number)
        group.grow(mesh.bounds)
        self.report.tally("meshes" if kind == "mesh" else "shapes")

    def _materials(self, draw: Draw, mesh: MeshArrays, scope: Scope) -> tuple[int, Any]:
        if scope.override:
            return INHERIT_MATERIAL, None
        otherwise = INHERIT_MATERIAL if scope.inside else self.materials.plain()
        if draw.material is None and scope.bound and not any(draw.subset_materials):
            return INHERIT_MATERIAL, None
        return self.assigner.assign(draw, mesh, otherwise)

    def _number(self, group: Group) -> int:
        """A group's number in the scene; made when something comes into it."""
        if group.number is None:
            group.number = self.builder.add_group(group.name)
            self.report.tally("groups")
        return group.number

    def _group(
        self,
        key: Hashable,
        name: str,
        roots: Sequence[Usd.Prim],
        scope: Scope,
        purpose: str,
        predicate: Any = None,
    ) -> Group | None:
        """The group of some prims, made once; None, and a warning, where it contains itself."""
        known = self._groups.get(key)
        if known is not None:
            return known
        if key in self._building:
            self.report.warn("prototype contains itself: left out", name)
            return None
        self._building.add(key)
        try:
            group = Group(name)
            self._fill(group, roots, scope, purpose, predicate)
        finally:
            self._building.discard(key)
        self._groups[key] = group
        return group

    def _place_instances(self, parent: Group, instances: Sequence[Placed], scope: Scope) -> None:
        """Adds native instances, all of one prototype at a time."""
        batches: dict[int, tuple[Group, list[Any], list[int]]] = {}
        for placed in instances:
            child = self._instance_group(placed, scope)
            if child is None:
                continue
            material = self._instance_material(placed, scope)
            batch = batches.setdefault(id(child), (child, [], []))
            batch[1].append(np.array(placed.matrix))
            batch[2].append(material)
        for child, matrices, materials in batches.values():
            transforms = np.stack(matrices)
            self._add(parent, child, transforms, np.array(materials, np.uint32), child.name)
        self.report.tally("instances", len(instances))

    def _instance_group(self, placed: Placed, scope: Scope) -> Group | None:
        prim = placed.prim
        prototype = prim.GetPrototype()
        path = prototype.GetPath()
        proxy = self._proxy(prim, scope.alias) if scope.alias else prim
        strong, collections = self.bindings.above(proxy)
        override = scope.override or (strong and not collections)
        alias, exact = None, None
        if not override and (collections or scope.alias is not None):
            alias = (path, proxy.GetPath())
            exact = self._proxy_bindings(proxy)
        bound = placed.material is not None or (scope.bound and not override)
        inner = Scope(True, bound and alias is None, override, alias, path)
        key = ("native", path, inner.bound, override, placed.purpose, exact)
        roots = list(prototype.GetChildren())
        return self._group(key, str(prim.GetPath()), roots, inner, placed.purpose)

    def _proxy_bindings(self, instance: Usd.Prim) -> tuple[str, ...]:
        """Material paths of all below an instance: tells which instances may share a group."""
        prims = [
            prim
            for prim in Usd.PrimRange(instance, Usd.TraverseInstanceProxies())
            if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)
        ]
        return tuple(str(m.GetPath()) if m else "" for m in bound_materials(prims))

    def _instance_material(self, placed: Placed, scope: Scope) -> int:
        """The id for the meshes of an instance that have none of their own."""
        if placed.material is not None:
            return self.materials.add(self.materials.surface(placed.material))
        if scope.override or scope.bound:
            return INHERIT_MATERIAL
        for primvar in placed.inherited:
            if primvar.GetPrimvarName() == "displayColor":
                value = from_attribute(primvar.GetAttr(), "displayColor", self.time)
                if value is not None and len(value.values):
                    return self.materials.plain(colour(value.values[0], DEFAULT_COLOUR))
        return INHERIT_MATERIAL if scope.inside else self.materials.plain()

    def _place_instancer(self, parent: Group, placed: Placed, scope: Scope) -> None:
        """Adds a point instancer, all instances of one prototype at a time."""
        prim = placed.prim
        path = prim.GetPath()
        targets = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
        self.report.tally("point instancers")
        instances = read_instances(prim, self.time, len(targets), self.report)
        if instances is None or len(instances.kept) == 0:
            return
        materials = self._instancer_materials(placed, instances.authored, scope)[instances.kept]
        order = np.argsort(instances.prototypes, kind="stable")
        ranked = instances.prototypes[order]
        outer = None if placed.matrix == IDENTITY else np.array(placed.matrix)
        for index, target in enumerate(targets):
            first, last = np.searchsorted(ranked, [index, index + 1])
            if first == last:
                continue
            root = self.stage.GetPrimAtPath(target)
            if not root:
                self.report.warn(f"point instancer prototype {target} is not there", path)
                continue
            child = self._prototype_group(root, placed, scope)
            if child is None:
                continue
            chosen = order[first:last]
            transforms = instances.transforms[chosen]
            if outer is not None:
                transforms = transforms @ outer
            self._add(parent, child, transforms, materials[chosen], str(path))
        self.report.tally("point instances", len(instances.kept))

    def _prototype_group(self, root: Usd.Prim, placed: Placed, scope: Scope) -> Group | None:
        """The group of a point instancer's prototype, wherever it is."""
        path = root.GetPath()
        within = path.HasPrefix(scope.root) and scope.inside
        inner = Scope(
            True,
            scope.bound and within,
            scope.override and within,
            scope.alias if within else None,
            scope.root if within else path,
        )
        key = ("point", path, inner.bound, inner.override, placed.purpose, inner.alias)
        return self._group(key, str(path), [root], inner, placed.purpose, _ANY)

    def _instancer_materials(self, placed: Placed, count: int, scope: Scope) -> NDArray[np.uint32]:
        """(count,) ids for the instances of a point instancer: by its displayColor."""
        default = INHERIT_MATERIAL if scope.inside else self.materials.plain()
        if scope.bound or scope.override:
            return np.full(count, INHERIT_MATERIAL, np.uint32)
        inherited = self._inherit(placed.prim, placed.inherited)
        attribute = placed.prim.GetAttribute("primvars:displayColor")
        if attribute.HasAuthoredValue():
            attributes = [attribute]
        else:
            attributes = [p.GetAttr() for p in inherited if p.GetPrimvarName() == "displayColor"]
        for candidate in attributes:
            try:
                primvar = from_attribute(candidate, "displayColor", self.time)
            except PrimvarError as error:
                self.report.warn(f"{error}: ignored", placed.prim.GetPath())
                continue
            if primvar is None or primvar.values.shape[1] < 3:
                continue
            if len(primvar.values) == 1:
                return np.full(count, self.materials.plain(primvar.values[0]), np.uint32)
            if len(primvar.values) == count:
                palette, index = quantise(primvar.values[:, :3])
                ids = np.array([self.materials.plain(c) for c in palette], np.uint32)
                return ids[index]
            what = "point instancer displayColor does not match protoIndices: ignored"
            self.report.warn(what, placed.prim.GetPath())
        return np.full(count, default, np.uint32)

    def _add(
        self,
        parent: Group,
        child: Group,
        transforms: Matrices,
        materials: NDArray[np.uint32],
        name: str,
    ) -> None:
        """Places a group k times."""
        usable = sound(transforms)
        if not usable.all():
            what = "instances left out: transform without an inverse"
            self.report.warn(what, name, int((~usable).sum()))
            transforms, materials = transforms[usable], materials[usable]
        if len(transforms) == 0:
            return
        if child.lit:
            parent.children.append((child, transforms))
            parent.lit = True
        if child.number is None:
            return
        self.builder.add_instances(self._number(parent), child.number, transforms, materials)
        if child.bounds is not None:
            lo, hi = child.bounds
            centre, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
            linear = transforms[:, :3, :3]
            middle = centre @ linear + transforms[:, 3, :3]
            reach = half @ np.abs(linear)
            parent.grow(np.array([(middle - reach).min(axis=0), (middle + reach).max(axis=0)]))


def _binds(prim: Usd.Prim) -> bool:
    """Whether a child of a mesh is a face subset that binds a material."""
    return (
        prim.GetTypeName() == "GeomSubset"
        and prim.GetAttribute("familyName").Get() == "materialBind"
        and prim.GetAttribute("elementType").Get() in (None, "face")
    )


def placed_lights(group: Group, limit: int) -> list[tuple[Light, Matrices]]:
    """All lights of a group and of what is placed in it, at most ``limit``."""
    out = list(group.lights[:limit])
    for child, transforms in group.children:
        inner = placed_lights(child, limit)
        for transform in transforms:
            if len(out) >= limit:
                return out
            out += [(light, local @ transform) for light, local in inner]
    return out[:limit]
