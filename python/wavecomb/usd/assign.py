# SPDX-License-Identifier: Apache-2.0
"""Material ids of a mesh: bound, of its subsets, or of its display colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdShade

from wavecomb.usd.colour import face_values, quantise
from wavecomb.usd.curves import CurveArrays
from wavecomb.usd.graph_bind import asks_for, bound
from wavecomb.usd.graph_code import GraphTooLarge
from wavecomb.usd.material import DEFAULT_COLOUR, MaterialTable
from wavecomb.usd.mesh import MeshArrays, find_primvar
from wavecomb.usd.network import colour, number
from wavecomb.usd.primvar import Primvar, PrimvarError, as_integers
from wavecomb.usd.report import LoadReport
from wavecomb.usd.shutter import Track
from wavecomb.usd.strands import Strands
from wavecomb.usd.surface import COLOUR_SLOTS, Surface
from wavecomb.usd.triangulate import Topology

FaceIds = NDArray[np.uint32]


@dataclass
class Draw:
    """A gprim to draw.

    Attributes:
        prim: Mesh, implicit shape, curves or points.
        matrix: From it to its group.
        inherited: Constant primvars of its ancestors.
        subsets: GeomSubset prims that bind materials.
        material: Bound to it.
        subset_materials: Bound to each subset.
        track: In place of ``matrix`` where that changes while the shutter is open.
    """

    prim: Usd.Prim
    matrix: Gf.Matrix4d
    inherited: Sequence[Any] = ()
    subsets: Sequence[Usd.Prim] = ()
    material: UsdShade.Material | None = None
    subset_materials: list[UsdShade.Material | None] = field(default_factory=list)
    track: Track | None = None


class Assigner:
    """Gives meshes their materials."""

    def __init__(self, table: MaterialTable, time: Usd.TimeCode, report: LoadReport) -> None:
        self.table = table
        self.time = time
        self.report = report
        self._bound_graphs: dict[tuple[Any, ...], tuple[Surface, Surface]] = {}

    def uv_names(self, draw: Draw) -> tuple[str, ...]:
        """Texture coordinates that the bound materials read, first use first."""
        names: list[str] = []
        for material in (draw.material, *draw.subset_materials):
            if material is not None:
                names += self.table.surface(material).uv_names
        unique = tuple(dict.fromkeys(names))
        if len(unique) > 1:
            what = "several sets of texture coordinates on a mesh (first used for all)"
            self.report.missing(what, draw.prim.GetPath())
        return unique

    def assign(
        self, draw: Draw, mesh: MeshArrays | CurveArrays, otherwise: int | None
    ) -> tuple[int, FaceIds | None]:
        """The material of a mesh, and one for each triangle where they differ.

        Args:
            draw: The gprim with its bindings.
            mesh: Its arrays.
            otherwise: Id to use where nothing is bound and there is no display colour; None: grey.
        """
        if draw.material is None:
            base, faces = self._display(draw, mesh, otherwise)
        else:
            base, faces = self._bound(draw, mesh, self.table.surface(draw.material))
        if draw.subsets and isinstance(mesh, MeshArrays) and mesh.topology is not None:
            faces = self._subsets(draw, mesh, base, faces)
        return base, faces

    def _subsets(
        self, draw: Draw, mesh: MeshArrays, base: int, faces: FaceIds | None
    ) -> FaceIds | None:
        topology = mesh.topology
        if topology is None:
            return faces
        per_face = np.full(topology.face_count, 0xFFFFFFFF, np.int64)
        own: dict[int, FaceIds] = {}
        for k, (subset, material) in enumerate(
            zip(draw.subsets, draw.subset_materials, strict=True)
        ):
            if material is None:
                continue
            index = as_integers(subset.GetAttribute("indices").Get(self.time), np.int64)
            inside = (index >= 0) & (index < topology.face_count)
            if not inside.all():
                self.report.warn("subset names faces that are not there", subset.GetPath())
                index = index[inside]
            number_, varying = self._bound(draw, mesh, self.table.surface(material))
            per_face[index] = k
            own[k] = np.full(topology.count, number_, np.uint32) if varying is None else varying
        if not own:
            return faces
        result = np.full(topology.count, base, np.uint32) if faces is None else faces.copy()
        which = per_face[topology.face_ids()]
        for k, ids in own.items():
            result[which == k] = ids[which == k]
        return result

    def _bound(
        self, draw: Draw, mesh: MeshArrays | CurveArrays, surface: Surface
    ) -> tuple[int, FaceIds | None]:
        """Ids of a surface; one that reads primvars is made anew with this mesh's values."""
        if asks_for(surface.graph):
            surface = self._with_graph(draw, mesh, surface)
        by_face: tuple[str, NDArray[Any]] | None = None
        # One may vary by face: the base colour where it does, for that shows most.
        slots = sorted(surface.primvars.items(), key=lambda item: item[0] != "base_color")
        for slot, name in slots:
            width = 3 if slot in COLOUR_SLOTS else 1
            values = self._values(draw, name, mesh.topology, width)
            if values is None or len(values) == 0:
                continue
            if len(values) == 1:
                surface = surface.with_value(slot, _plain(values[0]))
            elif by_face is None:
                self.report.note(
                    "varying primvar in a material: one value for each face", draw.prim.GetPath()
                )
                by_face = slot, values
                surface = surface.with_value(slot, _plain(values.mean(axis=0)))
            else:
                what = f"varying primvar for {slot} (its mean is used)"
                self.report.missing(what, draw.prim.GetPath())
                surface = surface.with_value(slot, _plain(values.mean(axis=0)))
        if by_face is None:
            return self.table.add(surface), None
        slot, values = by_face
        palette, index = quantise(np.repeat(values, 3, axis=1) if values.shape[1] == 1 else values)
        ids = [
            self.table.add(surface.with_value(slot, _plain(c[: values.shape[1]]))) for c in palette
        ]
        return ids[0], np.array(ids, np.uint32)[index]

    def _with_graph(self, draw: Draw, mesh: MeshArrays | CurveArrays, surface: Surface) -> Surface:
        """A surface whose graph reads the mesh's own space or its primvars, as it is there."""
        graph = surface.graph
        values: dict[str, tuple[float, ...]] = {}
        for name in graph.primvars if graph is not None else ():
            found = None
            for width in (4, 3, 2, 1):
                found = self._primvar_of(draw, name, mesh.topology, width)
                if found is not None:
                    break
            if found is None or len(found) == 0:
                continue
            if len(found) > 1 and float(np.ptp(found, axis=0).max()) > 0:
                what = f"varying primvar {name} in a shading network (its mean is used)"
                self.report.missing(what, draw.prim.GetPath())
            values[name] = tuple(float(x) for x in found.mean(axis=0))
        matrix = np.array(draw.matrix, np.float64)
        key = (id(surface), matrix.tobytes(), tuple(values.items()))
        if key not in self._bound_graphs:
            try:
                made = bound(surface, matrix, values)
            except GraphTooLarge:
                made = surface
            # Holding the surface keeps its address from being used again.
            self._bound_graphs[key] = (surface, made)
        return self._bound_graphs[key][1]

    def _primvar_of(
        self, draw: Draw, name: str, topology: Topology | Strands | None, width: int
    ) -> NDArray[Any] | None:
        """A primvar on each triangle where it has so many components; else None."""
        try:
            primvar = find_primvar(draw.prim, name, draw.inherited, self.time)
        except PrimvarError:
            return None
        if primvar is None or len(primvar.values) == 0 or primvar.values.shape[1] != width:
            return None
        return self._values(draw, name, topology, width)

    def _display(
        self, draw: Draw, mesh: MeshArrays | CurveArrays, otherwise: int | None
    ) -> tuple[int, FaceIds | None]:
        """Ids for displayColor and displayOpacity."""
        colours = self._values(draw, "displayColor", mesh.topology, 3)
        if colours is None or len(colours) == 0:
            return self.table.plain() if otherwise is None else otherwise, None
        opacity = self._opacity(draw, mesh.topology)
        if len(colours) == 1:
            return self.table.plain(colour(colours[0], DEFAULT_COLOUR), opacity), None
        palette, index = quantise(colours)
        if len(palette) > 1:
            what = "varying displayColor: one colour for each face"
            self.report.note(what, draw.prim.GetPath())
        ids = np.array([self.table.plain(entry, opacity) for entry in palette], np.uint32)
        return int(ids[0]), ids[index] if len(ids) > 1 else None

    def _opacity(self, draw: Draw, topology: Topology | Strands | None) -> float:
        values = self._values(draw, "displayOpacity", topology, 1)
        if values is None or len(values) == 0:
            return 1.0
        if len(values) > 1 and float(np.ptp(values)) > 0:
            what = "varying displayOpacity (its mean is used)"
            self.report.missing(what, draw.prim.GetPath())
        return min(max(number(float(values.mean()), 1.0), 0.0), 1.0)

    def _values(
        self, draw: Draw, name: str, topology: Topology | Strands | None, width: int
    ) -> NDArray[Any] | None:
        """A primvar on each triangle, (m, width) or (1, width); None where there is none."""
        try:
            primvar: Primvar | None = find_primvar(draw.prim, name, draw.inherited, self.time)
            if primvar is None or len(primvar.values) == 0:
                return None
            if topology is not None and (len(primvar.values) > 1 or topology.point_count == 1):
                return face_values(primvar, topology, width)
            if primvar.values.shape[1] < width:
                raise PrimvarError(f"primvar {name!r} has too few components")
            return np.asarray(primvar.values[:1, :width], np.float64)
        except PrimvarError as error:
            self.report.warn(f"{error}: ignored", draw.prim.GetPath())
            return None


def _plain(values: Any) -> Any:
    numbers = tuple(float(v) for v in values)
    return numbers if len(numbers) > 1 else numbers[0]
