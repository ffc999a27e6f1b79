# SPDX-License-Identifier: Apache-2.0
"""Traverses the prims of a stage and collects the prims that will be rendered."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdVol

from wavecomb.usd.geometry.mesh_arrays import IDENTITY, TETRAHEDRA
from wavecomb.usd.geometry.primvar import authored_names
from wavecomb.usd.geometry.shapes import SHAPES
from wavecomb.usd.geometry.shutter import Track
from wavecomb.usd.geometry.skeleton import Skeletons
from wavecomb.usd.geometry.splats import SPLATS
from wavecomb.usd.instances.group import AnimatedTransform
from wavecomb.usd.instances.point_instancer import are_valid
from wavecomb.usd.lights.light import KINDS as LIGHT_KINDS
from wavecomb.usd.lights.light import Light, LightReader
from wavecomb.usd.materials.draw_item import DrawItem, Parent
from wavecomb.usd.materials.network import word
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.draw_modes import DrawModes
from wavecomb.usd.stage.ray_visibility import NAMES as RAY_NAMES
from wavecomb.usd.stage.ray_visibility import RayVisibility

Matrices = NDArray[np.float64]

STRANDS = {
    "BasisCurves": "curves", "NurbsCurves": "curves", "HermiteCurves": "curves", "Points": "points",
}  # fmt: skip
DRAWN = frozenset(("mesh", "patch", "shape", "splats", *STRANDS.values()))
"""Kinds of prims that become geometry in the scene."""


class AuthoredNames(NamedTuple):
    """Names of properties with authored opinions.

    Attributes:
        names: Names of all authored properties.
        has_primvars: Whether the names include a primvar.
        has_bindings: Whether the names include a material binding.
    """

    names: frozenset[str]
    has_primvars: bool
    has_bindings: bool

    @classmethod
    def of(cls, names: Sequence[str]) -> AuthoredNames:
        """Classifies names."""
        prefixes = "primvars:", "material:binding"
        return cls(frozenset(names), *(any(n.startswith(p) for n in names) for p in prefixes))


@dataclass
class InstancePrim:
    """A native instance or a point instancer, which is expanded after bindings are resolved."""

    prim: Usd.Prim
    matrix: Gf.Matrix4d
    purpose: str
    inherited: Sequence[Any]
    material: UsdShade.Material | None = None
    track: Track | None = None


@dataclass
class CollectedPrims:
    """Prims that a traversal collected for one group."""

    draws: list[DrawItem] = field(default_factory=list)
    volumes: list[DrawItem] = field(default_factory=list)
    instances: list[InstancePrim] = field(default_factory=list)
    instancers: list[InstancePrim] = field(default_factory=list)
    lights: list[tuple[Light, AnimatedTransform]] = field(default_factory=list)
    stand_ins: list[DrawItem] = field(default_factory=list)
    has_bindings: bool = False
    """Whether a prim at or below the roots binds a material."""

    def binding_prims(self) -> list[Usd.Prim]:
        """Returns all prims with material bindings, in the order that ``bind`` expects."""
        prims = [draw.prim for draw in (*self.draws, *self.volumes)]
        prims += [instance.prim for instance in self.instances]
        return prims + [subset for draw in self.draws for subset in draw.subsets]

    def bind(self, materials: Iterable[UsdShade.Material | None]) -> list[UsdShade.Material | None]:
        """Assigns materials to ``binding_prims``; returns the materials of surfaces."""
        materials = iter(materials)
        for draw in (*self.draws, *self.volumes):
            draw.material = next(materials)
        for instance in self.instances:
            instance.material = next(materials)
        for draw in self.draws:
            if draw.subsets:
                # USD resolves a subset without a binding to the material of its mesh.
                draw.subset_materials = [next(materials) for _ in draw.subsets]
        bound = [m for draw in self.draws for m in (draw.material, *draw.subset_materials)]
        return bound + [instance.material for instance in self.instances]


class Traversal:
    """Traversal that collects the prims to render, one group at a time."""

    def __init__(self, context: LoadContext, lights: LightReader, rays: RayVisibility) -> None:
        """``rays`` reads prims that author ray visibility."""
        self.time, self.report, self.motion = context.time, context.report, context.motion
        self.purposes = frozenset(context.purposes)
        self.lights = lights
        self.rays = rays
        self.skeletons = Skeletons(self.report)
        self.xforms = UsdGeom.XformCache(self.time)
        self.modes = DrawModes(self.time, self.report)
        self._kinds: dict[str, str] = {}
        self._counts: dict[Sdf.Path, int] = {}
        self._names: dict[tuple[str, ...], AuthoredNames] = {}

    def kind(self, prim: Usd.Prim) -> str:
        """Returns the kind of a prim, computed once per type name."""
        name = str(prim.GetTypeName())
        kind = self._kinds.get(name)
        if kind is None:
            if prim.IsA(UsdGeom.Mesh) or name == TETRAHEDRA:
                kind = "mesh"
            elif name == "NurbsPatch":
                kind = "patch"
            elif name in SHAPES:
                kind = "shape"
            elif name in STRANDS:
                kind = STRANDS[name]
            elif name == SPLATS:
                kind = "splats"
            elif name in LIGHT_KINDS:
                kind = "light"
            elif prim.IsA(UsdVol.Volume):
                kind = "volume"
            elif prim.IsA(UsdGeom.PointInstancer):
                kind = "instancer"
            elif name == "PortalLight":
                # Portals are read together with the dome light that refers to them.
                kind = "xform"
            elif prim.IsA(UsdLux.BoundableLightBase) or prim.IsA(UsdLux.NonboundableLightBase):
                kind = "unsupported light"
            elif prim.IsA(UsdGeom.Gprim):
                kind = "unsupported"
            elif prim.IsA(UsdGeom.Imageable):
                kind = "xform" if prim.IsA(UsdGeom.Xformable) else "scope"
            else:
                kind = "shading" if prim.IsA(UsdShade.NodeGraph) else "other"
            self._kinds[name] = kind
        return kind

    def walk(
        self,
        roots: Sequence[Usd.Prim],
        purpose: str = "default",
        predicate: Any = None,
        inherited: Sequence[Any] = (),
        base: Gf.Matrix4d = IDENTITY,
    ) -> CollectedPrims:
        """Collects the prims at and below some roots, in stage order.

        Args:
            roots: Prims to start from; transforms include the roots' transforms, but not their
                parents' transforms.
            purpose: Purpose of the roots' parents.
            predicate: Predicate of the children to visit; None is USD's default.
            inherited: Constant primvars that the roots inherit.
            base: Transform of the roots' parents and of prims that reset the transform stack.
        """
        found = CollectedPrims()
        time, local = self.time, self.xforms.GetLocalTransformation
        proxies = Usd.TraverseInstanceProxies(
            Usd.PrimDefaultPredicate if predicate is None else predicate
        )
        # Each entry describes a prim to visit: the prim, the transform and the animated transform
        # of its parent, its purpose, inherited primvars, the predicate for its children, its
        # parent, and its draw mode.
        stack: list[
            tuple[Usd.Prim, Gf.Matrix4d, Track | None, str, Sequence[Any], Any, Parent | None, str]
        ]
        stack = [
            (prim, base, None, purpose, inherited, predicate, None, "default")
            for prim in reversed(roots)
        ]
        kinds, known_names = self._kinds, self._names
        has_instances = bool(roots and roots[0].GetStage().GetPrototypes())
        while stack:
            prim, matrix, track, purpose, inherited, pick, parent, mode = stack.pop()
            type_name = prim.GetTypeName()
            kind = kinds.get(type_name) or self.kind(prim)
            if kind == "shading":
                continue
            names: frozenset[str] = frozenset()
            listed = tuple(prim.GetAuthoredPropertyNames())
            authored = known_names.get(listed)
            if authored is None:  # Most prims share a set of property names.
                authored = known_names[listed] = AuthoredNames.of(listed)
            if authored.has_bindings:
                found.has_bindings = True
            if kind != "other":
                names = authored.names
                if (
                    "visibility" in names
                    and word(prim.GetAttribute("visibility").Get(time)) == "invisible"
                ):
                    continue
                if not RAY_NAMES.isdisjoint(names):
                    self.rays.read(prim)
                if "purpose" in names:
                    attribute = prim.GetAttribute("purpose")
                    if attribute.HasAuthoredValue():
                        purpose = word(attribute.Get(), purpose)
                if kind != "scope" and "xformOpOrder" in names:
                    own, resets = local(prim)
                    if self.motion is not None:
                        above = base if resets else matrix
                        track = self.motion.track_of(prim, None if resets else track, above)
                    if resets:
                        matrix = own if base is IDENTITY else own * base
                    elif own != IDENTITY:
                        matrix = own * matrix
                if "model:drawMode" in names:
                    mode = self.modes.mode(prim, mode)
            shown = purpose in self.purposes
            if mode != "default" and self.modes.applies(prim):
                if shown:
                    self._stand_in(found, prim, mode, matrix, track)
                continue
            if has_instances and prim.IsInstance():
                prototype = prim.GetPrototype()
                if self._shared(prototype) and not self.skeletons.needs_own_prototype(
                    prim, prototype
                ):
                    self.report.alias(prototype.GetPath(), prim.GetPath())
                    inherited = inherit(prim, inherited)
                    instance = InstancePrim(prim, matrix, purpose, inherited, track=track)
                    found.instances.append(instance)
                    continue
                pick = proxies
            if type_name == "SkelRoot":
                self.skeletons.enter(prim)
            children = prim.GetChildren() if pick is None else prim.GetFilteredChildren(pick)
            if kind in DRAWN:
                if shown:
                    subsets = [c for c in children if _binds(c)] if children else []
                    if subsets and type_name == TETRAHEDRA:
                        self.report.missing("materials of parts of a TetMesh", prim.GetPath())
                        subsets = []
                    found.draws.append(
                        DrawItem(
                            prim, matrix, inherited, subsets, None, [], track, names, kind, parent
                        )
                    )
            elif kind == "instancer":
                if shown:
                    instance = InstancePrim(prim, matrix, purpose, inherited, track=track)
                    found.instancers.append(instance)
                continue
            elif kind == "light":
                if shown:
                    steps = None
                    if track is not None and self.motion is not None:
                        matrix, steps = track.at(self.motion.middle), track.steps()
                    self._light(found, prim, matrix, steps)
            elif kind == "volume":
                if shown:
                    if track is not None and self.motion is not None:
                        self.report.note("moving volume: still, in mid-shutter", prim.GetPath())
                        matrix = track.at(self.motion.middle)
                    found.volumes.append(
                        DrawItem(prim, matrix, inherited, kind=kind, parent=parent)
                    )
            elif kind.startswith("unsupported"):
                if shown:
                    self.report.missing(str(prim.GetTypeName()), prim.GetPath())
            elif children and authored.has_primvars and kind in ("xform", "scope"):
                inherited = inherit(prim, inherited)
            if children:
                above = Parent(prim, parent)
                for child in reversed(children):
                    stack.append((child, matrix, track, purpose, inherited, pick, above, mode))
        return found

    def _stand_in(
        self,
        found: CollectedPrims,
        prim: Usd.Prim,
        mode: str,
        matrix: Gf.Matrix4d,
        track: Track | None,
    ) -> None:
        """Adds the stand-in geometry of a model with a draw mode."""
        made = self.modes.stand_in(prim, mode)
        if made is not None:
            names = authored_names(made.prim)
            looks: list[UsdShade.Material | None] = list(made.materials)
            draw = DrawItem(
                made.prim, matrix, (), made.subsets, None, looks, track, names, made.kind
            )
            found.stand_ins.append(draw)

    def _shared(self, prototype: Usd.Prim) -> bool:
        """Returns whether a prototype has several instances.

        A prototype with a single instance is read without instancing.
        """
        path = prototype.GetPath()
        known = self._counts.get(path)
        if known is None:
            known = self._counts[path] = len(prototype.GetInstances())
        return known > 1

    def _light(
        self, found: CollectedPrims, prim: Usd.Prim, matrix: Gf.Matrix4d, steps: Matrices | None
    ) -> None:
        scale = abs(matrix.GetDeterminant3()) ** (1.0 / 3.0)
        light = self.lights.read(prim, scale)
        transform = light.local @ np.array(matrix)
        if steps is not None:
            steps = light.local @ steps
        if not are_valid(transform[None] if steps is None else np.stack([transform, *steps])).all():
            self.report.warn("light left out: its transform has no inverse", prim.GetPath())
            return
        self.report.tally("lights")
        found.lights.append((light, AnimatedTransform(transform, steps)))


def inherit(prim: Usd.Prim, inherited: Sequence[Any]) -> Sequence[Any]:
    """Returns the primvars that children of a prim inherit."""
    more = UsdGeom.PrimvarsAPI(prim).FindIncrementallyInheritablePrimvars(list(inherited))
    return more if more else inherited


def _binds(prim: Usd.Prim) -> bool:
    """Returns whether a child of a mesh is a face subset that binds a material."""
    return (
        prim.GetTypeName() == "GeomSubset"
        and word(prim.GetAttribute("familyName").Get()) == "materialBind"
        and word(prim.GetAttribute("elementType").Get(), "face") == "face"
    )
