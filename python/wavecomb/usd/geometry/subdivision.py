# SPDX-License-Identifier: Apache-2.0
"""Subdivides and displaces meshes once the camera, and thus their size in the image, is known."""

from __future__ import annotations

import heapq
import math
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.run.isolation.memory import machine_limit
from wavecomb.usd.cameras.camera import View
from wavecomb.usd.geometry.attributes import RefinedAttributes
from wavecomb.usd.geometry.cage import Cage, ViewSize
from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.geometry.primvar import as_integers, spread
from wavecomb.usd.instances.group import placements
from wavecomb.usd.materials.assignment import BoundMaterials
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.instances.group import Group
    from wavecomb.usd.materials.material import MaterialTable
    from wavecomb.usd.stage.frame_cache import RefinedCache

TARGET_PIXELS = 2.0
"""Maximum edge length of refined faces, in pixels, at which automatic levels aim."""

AUTO_LEVEL = 8
"""Highest level that is chosen automatically; users may request up to ``MAX_LEVEL``."""

MAX_LEVEL = 10

AUTO_TRIANGLES = 16_000_000
"""Maximum number of triangles of all subdivided meshes together at automatic levels."""

BYTES_PER_TRIANGLE = 210
"""Measured peak memory per triangle during subdivision, in bytes; less is kept in the scene."""

_COARSE_FACES = 4096
"""Number of cage faces above which camera framing uses the cage instead of the limit surface."""

_BATCH_TRIANGLES = 4_000_000
"""Number of triangles that are refined together, which bounds the memory used."""


def parse_level(text: str | int) -> str | int:
    """Parses "off", "auto" or a subdivision level from 0 to ``MAX_LEVEL``.

    Raises:
        WavecombError: The text is not a valid subdivision setting.
    """
    if text in ("off", "auto"):
        return str(text)
    try:
        level = int(text)
    except (TypeError, ValueError):
        level = -1
    if isinstance(text, bool) or not 0 <= level <= MAX_LEVEL:
        raise WavecombError(
            f"subdivision {text!r}: must be off, auto or a level from 0 to {MAX_LEVEL}"
        )
    return level


@dataclass
class SubdivisionSurface:
    """A mesh to be subdivided or displaced.

    Attributes:
        number: Id of the mesh's polygons in the scene, which subdivision replaces.
        draw: Prim of the mesh with its material bindings.
        cage: Control cage of the mesh.
        bounds: (2, 3) bounds of the mesh in the space of its group (the world or a prototype).
        materials: Material ids of the mesh and the primvars that these materials read.
        group: Group that contains the mesh.
        moves: Displacements of the mesh, each a length or a texture use.
        face_moves: (faces,) index into ``moves`` of each face; -1 means no displacement.
        level: Subdivision level of the mesh.
    """

    number: int
    draw: DrawItem
    cage: Cage
    bounds: NDArray[Any]
    materials: BoundMaterials
    group: Group
    moves: list[Any] = field(default_factory=list)
    face_moves: NDArray[np.int32] | None = None
    level: int = 0

    @property
    def is_plain(self) -> bool:
        """Whether the subdivided mesh depends only on cage and level, not on its materials."""
        return not self.moves and not self.materials.reads

    @property
    def lowest(self) -> int:
        """Lowest useful level; displaced subdivision surfaces need at least level 1."""
        return 1 if self.moves and self.cage.scheme != "none" else 0


class SubdivisionSurfaces:
    """The subdivision surfaces and displaced meshes of a stage."""

    def __init__(self, context: LoadContext, materials: MaterialTable) -> None:
        self.builder, self.report = context.builder, context.report
        self.choice = parse_level(context.options.subdivision)
        self.size, self.threads = context.options.size, context.options.threads
        self.materials = materials
        self.cache: RefinedCache | None = None
        self._all: list[SubdivisionSurface] = []

    @property
    def subdivide(self) -> bool:
        """Whether subdivision is enabled."""
        return self.choice != "off"

    def is_displaced(self, draw: DrawItem) -> bool:
        """Returns whether a material that is bound to a mesh displaces its points."""
        # Handle meshes without GeomSubsets first, since nearly all meshes have none.
        if not draw.subsets:
            material = draw.material
            return material is not None and bool(self.materials.surface(material).displacement)
        bound = (draw.material, *draw.subset_materials)
        return any(m is not None and self.materials.surface(m).displacement for m in bound)

    def add(
        self,
        group: Group,
        number: int,
        draw: DrawItem,
        mesh: MeshArrays,
        materials: BoundMaterials,
    ) -> None:
        """Registers a mesh that is in the scene as polygons for subdivision or displacement."""
        cage = mesh.cage
        if cage is None:
            return
        surface = SubdivisionSurface(number, draw, cage, mesh.bounds, materials, group)
        self._displacements(surface)
        if surface.moves or (cage.scheme != "none" and self.choice != 0):
            group.has_surfaces = True
            self._all.append(surface)
        if cage.scheme != "none":
            self.report.tally("subdivision meshes")

    def limit_points(self, cage: Cage) -> NDArray[np.float32] | None:
        """Returns points near the limit surface of a cage.

        Returns None if the cage will not be subdivided, or is so fine that its points are close to
        the limit surface anyway.
        """
        if cage.scheme == "none" or not self.subdivide or self.choice == 0:
            return None
        if len(cage.counts) > _COARSE_FACES:
            return None
        description: dict[str, Any] = {
            "level": 2, "points": cage.points, "counts": cage.counts, "indices": cage.indices,
            "matrix": np.array(cage.matrix), "left_handed": cage.left_handed,
            "primvars": [], "scheme": cage.scheme,
            **cage.rules,
        }  # fmt: skip
        made = self.builder.make_surfaces(cage.over_shutter(description), self.threads)
        points = [one["positions"] for one in made if not isinstance(one, str)]
        return np.concatenate(points) if points else None

    def _displacements(self, surface: SubdivisionSurface) -> None:
        """Finds the displacement of each face of a mesh."""
        draw, count = surface.draw, len(surface.cage.counts)
        which = np.full(count, -1, np.int32)
        moves: list[Any] = []

        def note(displacement: Any) -> int:
            if displacement is None:
                return -1
            if displacement not in moves:
                moves.append(displacement)
            return moves.index(displacement)

        if draw.material is not None:
            which[:] = note(self.materials.surface(draw.material).displacement)
        for subset, material in zip(draw.subsets, draw.subset_materials, strict=bool(draw.subsets)):
            if material is not None:
                value = subset.GetAttribute("indices").Get(self.materials.time)
                index = as_integers(value, np.int64)
                index = index[(index >= 0) & (index < count)]
                which[index] = note(self.materials.surface(material).displacement)
        if (which >= 0).any():
            surface.moves, surface.face_moves = moves, which

    def finish(self, world: Group, view: View) -> None:
        """Chooses subdivision levels for a view and replaces polygons by subdivided meshes.

        Raises:
            WavecombError: The requested level needs more memory than the machine has.
        """
        if not self._all:
            return
        self._choose(world, view)
        levels = Counter(surface.level for surface in self._all if surface.cage.scheme != "none")
        waiting = deque(surface for surface in self._all if surface.level or surface.moves)
        if self.cache is None:
            # Release the subdivision cages of surfaces that are not refined. The cages of refined
            # surfaces are released after refinement.
            self._all = []
        while waiting:
            self._refine(self._next_batch(waiting))
        if levels:
            text = ", ".join(f"{count} at level {level}" for level, count in sorted(levels.items()))
            self.report.note(f"subdivision meshes refined: {text}")

    def _next_batch(self, waiting: deque[SubdivisionSurface]) -> list[SubdivisionSurface]:
        """Removes from the queue the next meshes, which are refined together."""
        batch: list[SubdivisionSurface] = []
        triangles = 0
        while waiting and triangles < _BATCH_TRIANGLES:
            batch.append(waiting.popleft())
            cage = batch[-1].cage
            triangles += cage.triangles_at(batch[-1].level) * max(1, len(cage.steps))
        return batch

    def has_same_levels(
        self, world: Group, view: View, size: tuple[int, int] | None = None
    ) -> bool:
        """Returns whether another view needs the same levels as the view given to ``finish``.

        This function requires ``cache``. ``size`` is the image size of the other view; None means
        that the size is unchanged.
        """
        size_before, self.size = self.size, self.size if size is None else size
        before = [surface.level for surface in self._all]
        report, self.report = self.report, LoadReport()
        try:
            self._choose(world, view)
            return before == [surface.level for surface in self._all]
        finally:
            self.report, self.size = report, size_before
            for surface, level in zip(self._all, before, strict=True):
                surface.level = level

    def _choose(self, world: Group, view: View) -> None:
        chosen = [s for s in self._all if s.cage.scheme != "none"]
        if isinstance(self.choice, int):
            for surface in chosen:
                surface.level = max(self.choice, surface.lowest)
            total = sum(s.cage.triangles_at(s.level) for s in chosen)
            needed, there = total * BYTES_PER_TRIANGLE, machine_limit()
            if there is not None and needed > 0.8 * there:
                raise WavecombError(
                    f"subdivision {self.choice}: {total:,} triangles need about "
                    f"{needed / 2**30:.0f} GiB of memory, this machine has {there / 2**30:.0f}; "
                    "choose a lower level, or auto"
                )
            return
        if not self.subdivide:
            return
        size = ViewSize(view, self.size)
        where = placements(world)
        for surface in chosen:
            placed = where.get(id(surface.group))
            if placed is None:
                continue
            pixels = size.edges(surface.cage, surface.bounds, placed)
            level = math.ceil(math.log2(max(pixels, 1e-9) / TARGET_PIXELS))
            surface.level = min(max(level, surface.lowest), AUTO_LEVEL)
        self._keep_in_memory(chosen)

    def _keep_in_memory(self, chosen: list[SubdivisionSurface]) -> None:
        """Lowers levels of the largest meshes until there are at most ``AUTO_TRIANGLES``."""
        counts = [s.cage.triangles_at(s.level) for s in chosen]
        total = sum(counts)
        heap = [(-count, i) for i, count in enumerate(counts) if chosen[i].level > chosen[i].lowest]
        heapq.heapify(heap)
        lowered: set[int] = set()
        while total > AUTO_TRIANGLES and heap:
            count, i = heapq.heappop(heap)
            surface = chosen[i]
            surface.level -= 1
            lowered.add(i)
            now = surface.cage.triangles_at(surface.level)
            total += count + now
            if surface.level > surface.lowest:
                heapq.heappush(heap, (-now, i))
        what = "subdivided less than the image needs, to limit memory"
        for i in sorted(lowered):
            self.report.note(what, chosen[i].draw.prim.GetPath())

    def _refine(self, batch: list[SubdivisionSurface]) -> None:
        """Refines meshes in parallel and replaces their polygons in the scene."""
        fresh = []
        for surface in batch:
            known = self._cached(surface)
            if known is None:
                fresh.append(surface)
            else:
                self._take(surface, known)
        if not fresh:
            return
        described = [self._describe(surface) for surface in fresh]
        steps = [s.cage.over_shutter(d) for s, d in zip(fresh, described, strict=True)]
        made = iter(self.builder.make_surfaces([d for each in steps for d in each], self.threads))
        for surface, each in zip(fresh, steps, strict=True):
            refined = _joined([next(made) for _ in each])
            if isinstance(refined, str):
                what = f"mesh not subdivided, {refined}: drawn as polygons"
                self.report.warn(what, surface.draw.prim.GetPath())
                continue
            if self.cache is not None and surface.is_plain:
                self.cache.put(surface.cage, surface.level, refined)
            self._take(surface, refined)

    def _cached(self, surface: SubdivisionSurface) -> dict[str, Any] | None:
        """Returns the refined mesh of the previous frame if mesh and level have not changed."""
        if self.cache is None or not surface.is_plain:
            return None
        return self.cache.get(surface.cage, surface.level)

    def _take(self, surface: SubdivisionSurface, refined: dict[str, Any]) -> None:
        if not refined["manifold"]:
            what = "subdivision mesh with edges or points that are not manifold: sharp there"
            self.report.warn(what, surface.draw.prim.GetPath())
        self._replace(surface, refined)

    def _describe(self, surface: SubdivisionSurface) -> dict[str, Any]:
        """Returns the description of a mesh for ``SceneBuilder.make_surfaces``."""
        cage = surface.cage
        out: dict[str, Any] = {
            "level": surface.level,
            "points": cage.points,
            "counts": cage.counts,
            "indices": cage.indices,
            "matrix": np.array(cage.matrix),
            "left_handed": cage.left_handed,
        }
        if surface.moves:
            out |= {"displacements": surface.moves, "face_displacement": surface.face_moves}
        out["primvars"] = RefinedAttributes(surface.materials.reads).described(cage, surface.level)
        if surface.level == 0:
            return out | self._polygons(cage)
        out |= {"scheme": cage.scheme, **cage.rules}
        if cage.uvs is not None:
            out["uvs"] = cage.primvar(cage.uvs, 2)
        return out

    def _polygons(self, cage: Cage) -> dict[str, Any]:
        """Returns the description of polygons that are displaced without subdivision."""
        topology = cage.topology
        out: dict[str, Any] = {
            # The triangles of the mesh already have the winding of right-handed meshes.
            "left_handed": False,
            "triangles": topology.triangles,
            "triangle_faces": np.ascontiguousarray(topology.face_ids(), np.uint32),
        }
        if cage.uvs is not None:
            values, at = spread(cage.uvs, topology, 2)
            if at == "corner":
                out["triangle_corners"] = np.arange(3 * topology.count, dtype=np.uint32)
            elif at == "constant":
                values = np.repeat(values, len(cage.points), axis=0)
            kind = "faceVarying" if at == "corner" else "vertex"
            values = np.ascontiguousarray(np.nan_to_num(values).reshape(-1, 2), np.float32)
            out["uvs"] = {"interpolation": kind, "values": values}
        return out

    def _replace(self, surface: SubdivisionSurface, refined: dict[str, Any]) -> None:
        materials, faces, normals = surface.materials, None, refined["normals"]
        if materials.by_face is not None:
            faces = materials.by_face[refined["faces"]]
        if surface.level == 0 and not surface.cage.smooth:
            normals = None
        try:
            self.builder.replace_mesh(
                surface.number, refined["positions"], refined["triangles"],
                normals=normals, uvs=refined["uvs"], face_materials=faces,
                material=materials.material,
                attributes=RefinedAttributes(materials.reads).of(refined),
            )  # fmt: skip
        except ValueError as error:
            path = surface.draw.prim.GetPath()
            self.report.warn(f"mesh not subdivided, {error}: drawn as polygons", path)


def _joined(steps: list[Any]) -> Any:
    """Combines the refined meshes of all shutter steps; returns an error message if one failed."""
    first = next((step for step in steps if isinstance(step, str)), steps[0])
    if len(steps) == 1 or isinstance(first, str):
        return first
    shapes = {name: [step[name] for step in steps] for name in ("positions", "normals")}
    return first | {
        name: None if any(part is None for part in parts) else np.stack(parts)
        for name, parts in shapes.items()
    }
