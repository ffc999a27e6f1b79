# SPDX-License-Identifier: Apache-2.0
"""Assigns materials to gprims, from bindings, GeomSubset bindings or display colours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdShade, Vt

from wavecomb.usd.geometry.attributes import MAX_WIDTH, PrimvarRequest, check_fit
from wavecomb.usd.geometry.curves import CurveArrays
from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.geometry.primvar import PrimvarError, as_integers, find_primvar, in_linear
from wavecomb.usd.geometry.triangulate import Topology
from wavecomb.usd.graphs.binding import bound, with_uv_sets
from wavecomb.usd.graphs.values import PARAMETERS, GraphTooLarge
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.materials.material import DEFAULT_COLOUR, MaterialTable
from wavecomb.usd.materials.network import colour, number
from wavecomb.usd.materials.surface import COLOUR_PARAMETERS, Surface
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport

FaceIds = NDArray[np.uint32]


@dataclass
class BoundMaterials:
    """The materials that are bound to a gprim.

    Attributes:
        material: Material id of all faces that no GeomSubset binding covers.
        by_face: (face count,) material id of each face if the faces have different materials.
        reads: Primvars of the gprim that the materials read, by name.
    """

    material: int
    by_face: FaceIds | None = None
    reads: dict[str, PrimvarRequest] = field(default_factory=dict)


class Assigner:
    """Assigns materials to gprims and collects the primvars that the materials read."""

    def __init__(self, context: LoadContext, table: MaterialTable) -> None:
        self.time, self.report = context.time, context.report
        self.table = table
        self._last: tuple[DrawItem, dict[Sdf.Path, Surface]] | None = None
        self._bound_graphs: dict[tuple[Any, ...], tuple[Surface, Surface]] = {}

    def uv_names(self, draw: DrawItem) -> tuple[str, ...]:
        """Returns names of the UV sets that the bound materials read, in order of first use."""
        if not draw.subsets:
            own = () if draw.material is None else self._surface(draw, draw.material).uv_names
            if len(own) <= 1:
                return own
        names: list[str] = []
        for material in (draw.material, *draw.subset_materials):
            if material is not None:
                names += self._surface(draw, material).uv_names
        return tuple(dict.fromkeys(names))

    def assign(
        self, draw: DrawItem, mesh: MeshArrays | CurveArrays, otherwise: int | None
    ) -> BoundMaterials:
        """Returns the materials of a gprim.

        Args:
            draw: The gprim with its material bindings.
            mesh: Geometry arrays of the gprim.
            otherwise: Material id for a gprim with neither binding nor display colour; None means
                grey.
        """
        if draw.material is None and draw.is_plain:
            return BoundMaterials(self.table.plain() if otherwise is None else otherwise)
        surface = None if draw.material is None else self._surface(draw, draw.material)
        self._report_hair(draw, mesh)
        if surface is not None and not draw.subsets and is_uniform(surface):
            return BoundMaterials(self.table.add(surface))
        primvars = _Primvars(draw, mesh, self.time, self.report)
        sets = self.uv_names(draw)
        # If the materials of the mesh read several UV sets, use the first of these sets that exists
        # on the mesh as its texture coordinates.
        if len(sets) > 1:
            primvars.own_uv = next((n for n in sets if primvars.find(n, 2) is not None), "")
        if surface is None or surface.stand_in:
            assigned = BoundMaterials(self._display(primvars, otherwise))
        else:
            assigned = BoundMaterials(self._bound(primvars, surface))
        if draw.subsets and isinstance(mesh, MeshArrays) and mesh.topology is not None:
            assigned.by_face = self._subsets(draw, mesh.topology, assigned.material, primvars)
        assigned.reads = primvars.read
        return assigned

    def shared_material(self, draw: DrawItem) -> int | None:
        """Returns a gprim's material id if the material is simple: in use, and equal on all gprims.

        A simple material emits no light, and neither the material nor its displacement reads values
        of the gprim. Returns None for other materials and for gprims with GeomSubsets or with
        display colours. Assumes that a gprim without a binding takes no material from its instance.
        """
        if draw.subsets:
            return None
        if draw.material is None:
            return self.table.plain_in_use() if draw.is_plain else None
        surface, number = self.table.in_use(draw.material) or (None, 0)
        if surface is None or surface.uv_names or surface.displacement is not None:
            return None
        if surface.program == "hair" or not is_uniform(surface):
            return None
        return None if self.table.any_emits(number, None) else number

    def _surface(self, draw: DrawItem, material: UsdShade.Material) -> Surface:
        """Returns the surface of a material on a gprim."""
        surface = self.table.surface(material)
        if not surface.object_reads:
            return surface
        if self._last is None or self._last[0] is not draw:
            self._last = (draw, {})
        path, known = material.GetPath(), self._last[1]
        if path not in known:
            known[path] = self._surface_of_object(draw, material, surface)
        return known[path]

    def _surface_of_object(
        self, draw: DrawItem, material: UsdShade.Material, surface: Surface
    ) -> Surface:
        values: dict[str, Any] = {}
        # The value of a primvar may be the name of another primvar. The second pass reads the
        # primvars that the first pass found in this way.
        for _ in range(2):
            new = [name for name in surface.object_reads if name not in values]
            if not new:
                break
            values |= {name: self._one_value(draw, name) for name in new}
            given = {name: value for name, value in values.items() if value is not None}
            surface = self.table.surface_of_object(material, given)
        return surface

    def _one_value(self, draw: DrawItem, name: str) -> Any:
        """Returns the value of a primvar on a gprim.

        If the primvar varies, its mean is used, and the approximation is reported.
        """
        path = draw.prim.GetPath()
        if (text := _text_of(draw, name, self.time)) is not None:
            return text
        try:
            found = find_primvar(draw.prim, name, draw.inherited, self.time)
        except PrimvarError as error:
            self.report.warn(f"{error}: ignored", path)
            return None
        if found is None or len(found.values) == 0:
            return None
        values = in_linear(found, self.report, path).values
        if not (values == values[0]).all():
            what = f"varying primvar {name!r} for an input of a texture (its mean is used)"
            self.report.missing(what, path)
            return _plain(values.mean(axis=0, dtype=np.float64))
        return _plain(values[0])

    def _report_hair(self, draw: DrawItem, mesh: MeshArrays | CurveArrays) -> None:
        """Reports hair materials on geometry other than tubes."""
        materials = (draw.material, *draw.subset_materials)
        if not any(m is not None and self.table.surface(m).program == "hair" for m in materials):
            return
        if isinstance(mesh, MeshArrays):
            what = "hair on a mesh (as tubes along its texture's u)"
        elif mesh.kind.endswith("ribbon"):
            what = "hair on ribbons (shaded as round fibres)"
        else:
            return
        self.report.missing(what, draw.prim.GetPath())

    def _subsets(
        self, draw: DrawItem, topology: Topology, base: int, primvars: _Primvars
    ) -> FaceIds | None:
        per_face = np.full(topology.face_count, base, np.uint32)
        bound = False
        for subset, material in zip(draw.subsets, draw.subset_materials, strict=True):
            if material is None:
                continue
            index = as_integers(subset.GetAttribute("indices").Get(self.time), np.int64)
            inside = (index >= 0) & (index < topology.face_count)
            if not inside.all():
                self.report.warn("subset refers to faces that do not exist", subset.GetPath())
                index = index[inside]
            surface = self._surface(draw, material)
            shown = self._display(primvars, None) if surface.stand_in else None
            per_face[index] = self._bound(primvars, surface) if shown is None else shown
            bound = True
        return per_face if bound else None

    def _bound(self, primvars: _Primvars, surface: Surface) -> int:
        """Returns the material id of a surface with the gprim's constant primvars inserted."""
        if surface.graph is not None and surface.graph.depends_on_mesh:
            surface = self._with_graph(primvars, surface)
        if primvars.own_uv:
            surface = self._with_uv_sets(primvars, surface)
        varying: list[str] = []
        brightest = primvars.highest(surface.emission_attributes())
        for parameter, name in surface.primvars.items():
            found = primvars.find(name, 3 if parameter in COLOUR_PARAMETERS else 1)
            if found is None:
                continue
            if found.is_constant:
                surface = surface.with_value(parameter, _plain(found.first))
                continue
            if parameter not in PARAMETERS:
                what = f"varying primvar for {parameter} (its mean is used)"
                self.report.missing(what, primvars.path)
                surface = surface.with_value(parameter, _plain(found.mean))
                continue
            varying.append(parameter)
            primvars.keep(found)
            if parameter == "emission":
                brightest = max(brightest, found.highest)
        return self.table.add(self.table.varied(surface, tuple(varying)), brightest)

    def _with_graph(self, primvars: _Primvars, surface: Surface) -> Surface:
        """Returns the surface with its graph adapted to the gprim's transform and primvars."""
        graph = surface.graph
        values: dict[str, tuple[float, ...]] = {}
        varying: dict[str, int] = {}
        for name in graph.primvars if graph is not None else ():
            found = primvars.find(name, 0)
            if found is None:
                continue
            if found.is_constant:
                values[name] = tuple(float(x) for x in found.first)
            else:
                varying[name] = found.width
                primvars.keep(found)
        matrix = primvars.matrix
        key = (id(surface), matrix.tobytes(), tuple(values.items()), tuple(varying.items()))
        if key not in self._bound_graphs:
            try:
                made = bound(surface, matrix, values, varying)
            except GraphTooLarge:
                made = surface
            # The key contains id(surface). Storing the surface keeps it alive, so that Python does
            # not reuse the id.
            self._bound_graphs[key] = (surface, made)
        return self._bound_graphs[key][1]

    def _with_uv_sets(self, primvars: _Primvars, surface: Surface) -> Surface:
        """Returns the surface with textures that read additional UV sets as primvars."""
        first = surface.uv_names[0] if surface.uv_names else ""
        named = {p: surface.texture_uvs.get(p, first) for p in surface.textures}
        others = {name for name in (first, *named.values()) if name and name != primvars.own_uv}
        there = {name: found for name in others if (found := primvars.find(name, 2)) is not None}
        if not there:
            return surface
        for found in there.values():
            primvars.keep(found)
        key = (id(surface), primvars.own_uv, tuple(sorted(there)))
        if key not in self._bound_graphs:
            sets = {p: name for p, name in named.items() if name in there}
            try:
                made = with_uv_sets(surface, sets, first if first in there else "")
            except GraphTooLarge:
                made = surface
            self._bound_graphs[key] = (surface, made)
        return self._bound_graphs[key][1]

    def _display(self, primvars: _Primvars, otherwise: int | None) -> int:
        """Returns the material id for a gprim's displayColor and displayOpacity."""
        colours = primvars.find("displayColor", 3)
        opacities = primvars.find("displayOpacity", 1)
        if colours is None and opacities is None:
            return self.table.plain() if otherwise is None else otherwise
        opacity = 1.0
        if opacities is not None and opacities.is_constant:
            opacity = min(max(number(float(opacities.first[0]), 1.0), 0.0), 1.0)
        varying = []
        for parameter, found in (("base_color", colours), ("opacity", opacities)):
            if found is not None and not found.is_constant:
                varying.append(parameter)
                primvars.keep(found)
        shown = DEFAULT_COLOUR
        if colours is not None and colours.is_constant:
            shown = colour(colours.first, DEFAULT_COLOUR)
        return self.table.plain(shown, opacity, tuple(varying))


def is_uniform(surface: Surface) -> bool:
    """Returns whether a surface looks the same on all gprims."""
    graph = surface.graph
    reads = surface.primvars or (graph and graph.depends_on_mesh) or surface.emission_attributes()
    return not (reads or surface.texture_uvs or surface.object_reads or surface.stand_in)


class _Primvars:
    """The primvars of a gprim; each is read once, and invalid ones are reported."""

    def __init__(
        self, draw: DrawItem, mesh: MeshArrays | CurveArrays, time: Usd.TimeCode, report: LoadReport
    ) -> None:
        self.read: dict[str, PrimvarRequest] = {}
        # Name of the primvar that contains the mesh's texture coordinates. Set if the materials
        # read several UV sets.
        self.own_uv = ""
        self._draw = draw
        self._mesh = mesh
        self._time = time
        self._report = report
        self._found: dict[tuple[str, int], PrimvarRequest | None] = {}

    @property
    def path(self) -> Sdf.Path:
        """Path of the gprim."""
        return self._draw.prim.GetPath()

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(4, 4) transform from the gprim to its group (the world or a prototype)."""
        return np.array(self._draw.matrix, np.float64)

    def find(self, name: str, width: int) -> PrimvarRequest | None:
        """Returns a valid primvar with at least ``width`` components, or None.

        A ``width`` of 0 accepts any number of components, at most ``MAX_WIDTH``.
        """
        draw = self._draw
        if draw.names and not draw.inherited and f"primvars:{name}" not in draw.names:
            return None
        key = name, width
        if key not in self._found:
            try:
                self._found[key] = self._lookup(name, width)
            except PrimvarError as error:
                self._report.warn(f"{error}: ignored", self.path)
                self._found[key] = None
        return self._found[key]

    def highest(self, names: Iterable[str]) -> float:
        """Returns the largest value of the named primvars that materials read at hits, or 0."""
        return max((self.read[name].highest for name in names if name in self.read), default=0.0)

    def keep(self, wanted: PrimvarRequest) -> None:
        """Records that a material reads the primvar at each hit."""
        name = wanted.primvar.name
        known = self.read.get(name)
        if known is None or known.width < wanted.width:
            self.read[name] = wanted

    def _lookup(self, name: str, width: int) -> PrimvarRequest | None:
        primvar = find_primvar(self._draw.prim, name, self._draw.inherited, self._time)
        if primvar is None or len(primvar.values) == 0:
            return None
        primvar = in_linear(primvar, self._report, self.path)
        # Shapes without topology, such as implicit surfaces, can only have a single value per
        # primvar.
        if self._mesh.topology is None:
            primvar = replace(primvar, values=primvar.values[:1], interpolation="constant")
        check_fit(primvar, self._mesh, width)
        values = np.asarray(primvar.values[:, :MAX_WIDTH], np.float32)
        if not np.isfinite(values).all():
            what = f"primvar {name!r} with values that are not finite: set to 0"
            self._report.warn(what, self.path)
            values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        return PrimvarRequest(replace(primvar, values=values), width or values.shape[1])


def _text_of(draw: DrawItem, name: str, time: Usd.TimeCode) -> str | None:
    """Returns the value of a constant string or token primvar; None for any other primvar."""
    attribute = draw.prim.GetAttribute(f"primvars:{name}")
    if not attribute.HasAuthoredValue():
        inherited = [p.GetAttr() for p in draw.inherited if p.GetPrimvarName() == name]
        if not inherited:
            return None
        attribute = inherited[0]
    value = attribute.Get(time)
    if isinstance(value, (Vt.StringArray, Vt.TokenArray)) and len(value) == 1:
        value = value[0]
    return value if isinstance(value, str) else None


def _plain(values: Iterable[Any]) -> Any:
    numbers = tuple(float(v) for v in values)
    return numbers if len(numbers) > 1 else numbers[0]
