# SPDX-License-Identifier: Apache-2.0
"""Reads UsdGeomMesh, UsdGeomTetMesh and implicit shapes as arrays for the core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd

from wavecomb.usd.geometry.cage import SCHEMES, Cage, read_rules, sharp_edges
from wavecomb.usd.geometry.mesh_arrays import (
    IDENTITY,
    TETRAHEDRA,
    UV_NAMES,
    Array,
    MeshArrays,
    bake,
    bake_and_triangulate,
    bake_normals,
    check_matrix,
    extent,
    invalid_point_mask,
    is_translation,
    read_faces,
    remove_invalid_points,
    replace_invalid_steps,
    transform_shape,
)
from wavecomb.usd.geometry.primvar import (
    Primvar,
    PrimvarError,
    as_array,
    as_integers,
    authored_names,
    finite_uvs,
    first_primvar,
    from_attribute,
    plain_attribute,
    read_primvar,
    spread,
)
from wavecomb.usd.geometry.shapes import read_shape
from wavecomb.usd.geometry.shutter import Motion, Track
from wavecomb.usd.geometry.skeleton import (
    Skeletons,
    Skin,
    SkinError,
    matrix_at,
    points_at,
    points_at_time,
    skinned_points,
    step_times,
)
from wavecomb.usd.geometry.triangulate import MeshError, Topology, smooth_normals, triangulate
from wavecomb.usd.materials.network import word
from wavecomb.usd.stage.report import LoadReport


def _scheme(prim: Usd.Prim, names: frozenset[str], time: Usd.TimeCode) -> str | None:
    """Returns the subdivision scheme of a mesh; ``names`` are the mesh's authored properties."""
    if "subdivisionScheme" not in names:
        return "none" if prim.GetTypeName() == TETRAHEDRA else "catmullClark"
    return word(prim.GetAttribute("subdivisionScheme").Get(time), "none")


_NORMALS = ("primvars:normals", "normals")


class MeshReader:
    """Reader of the meshes and implicit shapes of one stage."""

    def __init__(
        self,
        time: Usd.TimeCode,
        report: LoadReport,
        subdivide: bool = True,
        skeletons: Skeletons | None = None,
        motion: Motion | None = None,
    ) -> None:
        """Creates a reader for one frame.

        Args:
            time: Time code of the frame.
            report: Collects warnings.
            subdivide: Whether subdivision meshes get a control cage; their authored normals are
                then ignored.
            skeletons: Skeletons that deform the meshes bound to them.
            motion: Shutter over which shapes are read; None reads shapes at ``time`` only.
        """
        self.time = time
        self.report = report
        self.subdivide = subdivide
        self.skeletons = skeletons
        self.motion = motion

    def shape(self, prim: Usd.Prim, matrix: Gf.Matrix4d, names: frozenset[str]) -> MeshArrays:
        """Reads an implicit shape in the space of its group (the world or a prototype).

        ``names`` are the authored properties of the shape.
        """
        mirrored = check_matrix(matrix)
        shape = read_shape(prim, self.time, names)
        if shape is None or len(shape.triangles) == 0:
            raise MeshError("no faces")
        positions, normals, bounds = transform_shape(shape.positions, shape.normals, matrix)
        triangles = shape.triangles[:, ::-1] if mirrored else shape.triangles
        return MeshArrays(positions, np.ascontiguousarray(triangles), normals, shape.uvs, bounds)

    def mesh(
        self,
        prim: Usd.Prim,
        matrix: Gf.Matrix4d,
        uv_names: Sequence[str],
        names: frozenset[str],
        inherited: Sequence[Any] = (),
        displaced: bool = False,
    ) -> MeshArrays | None:
        """Reads a mesh as polygons in the space of its group; returns None if the mesh is empty.

        Args:
            prim: A UsdGeomMesh or UsdGeomTetMesh.
            matrix: Transform from mesh space to the space of its group (the world or a prototype).
            uv_names: Names of primvars for texture coordinates; the first primvar that exists is
                used. Empty if texture coordinates are not needed.
            names: Names of the mesh's authored properties, from ``authored_names``.
            inherited: Constant primvars of the mesh's ancestors.
            displaced: Whether the points of the mesh will be displaced.

        Raises:
            MeshError: The mesh is invalid.
        """
        get, time = prim.GetAttribute, self.time
        mirrored = check_matrix(matrix)
        skin = self._skin(prim)
        value = points_at_time(prim, time) if "velocities" in names else get("points").Get(time)
        points = as_array(value)
        if skin is not None and points is not None and len(points):
            points = skinned_points(skin, value, time)
        counts, indices = read_faces(prim, time)
        if points is None or len(points) == 0 or len(counts) == 0:
            return None
        if points.shape[1] != 3:
            raise MeshError("points are not triples")
        points = np.ascontiguousarray(points, np.float32)
        holes = as_integers(get("holeIndices").Get(time)) if "holeIndices" in names else None
        flip = "orientation" in names and word(get("orientation").Get(time)) == "leftHanded"
        placed = None
        if not flip and holes is None:
            placed = bake_and_triangulate(points, counts, indices, matrix)
        has_bad = False
        if placed is None:
            has_bad = bool(invalid_point_mask(points, matrix).any())
            if has_bad:
                points, holes, what = remove_invalid_points(points, matrix, counts, indices, holes)
                if what:
                    self.report.warn(f"mesh without {what}", prim.GetPath())
            placed = self._placed(prim, points, counts, indices, holes, flip, matrix)
        positions, bounds, topology = placed
        scheme = _scheme(prim, names, time)
        subdivided = self.subdivide and scheme in SCHEMES
        normals = self._normals(prim, points, topology, scheme, names)
        primvar = self._coordinates(prim, topology, uv_names, inherited) if uv_names else None
        uvs, primvar = self._uvs(prim, topology, primvar)
        if normals is not None and not is_translation(matrix):
            normals = bake_normals(normals, matrix)
        cage = None
        if subdivided or displaced:
            rules = read_rules(prim, time, self.report) if subdivided else {}
            if has_bad:
                rules["holes"] = holes
            kind = str(scheme) if subdivided else "none"
            cage = Cage(
                points, counts, indices, matrix, flip, kind, rules, primvar, topology,
                normals is not None,
            )  # fmt: skip
        triangles = topology.triangles
        if mirrored:
            triangles = np.ascontiguousarray(triangles[:, ::-1])
            normals, uvs = _reverse(normals), _reverse(uvs)
        return MeshArrays(positions, triangles, normals, uvs, bounds, topology, cage)

    def _placed(
        self,
        prim: Usd.Prim,
        points: Array,
        counts: NDArray[np.int32],
        indices: NDArray[np.int32],
        holes: NDArray[np.int32] | None,
        flip: bool,
        matrix: Gf.Matrix4d,
    ) -> tuple[Array, Array, Topology]:
        """Returns points in the group's space, their bounds, and the triangulated faces.

        Raises:
            MeshError: The mesh is invalid.
        """
        positions = points if matrix == IDENTITY else bake(points, matrix)
        bounds = extent(positions)
        topology = triangulate(points, counts, indices, holes, flip)
        if topology.hurried:
            what = "a face crosses itself too often to be split with care; its triangles overlap"
            self.report.warn(what, prim.GetPath())
        return positions, bounds, topology

    def over_shutter(
        self, prim: Usd.Prim, mesh: MeshArrays, matrix: Gf.Matrix4d, track: Track | None
    ) -> MeshArrays:
        """Returns the arrays of ``mesh`` with points and normals at the shutter steps.

        Args:
            prim: A UsdGeomMesh that changes over time, for which ``deforms`` returns True.
            mesh: Arrays of the mesh at the time of the frame.
            matrix: Transform from mesh space to the space of its group (the world or a prototype).
            track: Animated transform that replaces ``matrix``; None if the transform is static.

        Raises:
            MeshError: The mesh is invalid.
        """
        motion, topology, skin = self.motion, mesh.topology, self._skin(prim)
        if motion is None or topology is None:
            return mesh
        times = step_times(prim, skin, motion)
        shapes = points_at(prim, skin, times, motion.frame, self.report)
        if shapes is None or len(shapes[0]) != len(mesh.positions):
            return mesh
        shapes = replace_invalid_steps(shapes)
        matrices = [matrix_at(track, matrix, time) for time in times]
        if track is None and all(np.array_equal(shape, shapes[0]) for shape in shapes):
            return mesh
        mirrored = check_matrix(matrix)
        names = authored_names(prim)
        scheme = _scheme(prim, names, self.time)
        positions = np.stack([bake(p, m) for p, m in zip(shapes, matrices, strict=True)])
        normals: list[Array] = []
        for points, to_group, time in zip(shapes, matrices, times, strict=True):
            if mesh.normals is None:
                break
            then = MeshReader(Usd.TimeCode(time), LoadReport(), self.subdivide, self.skeletons)
            found = then._normals(prim, points, topology, scheme, names)
            if found is not None:
                found = bake_normals(found, to_group)
                normals.append(_reverse(found) if mirrored else found)
        if mesh.normals is not None and {n.shape for n in normals} != {mesh.normals.shape}:
            normals = [mesh.normals] * len(times)
        return replace(
            mesh,
            positions=positions,
            normals=np.stack(normals) if normals else None,
            bounds=extent(positions.reshape(-1, 3)),
            cage=mesh.cage and replace(mesh.cage, steps=list(zip(shapes, matrices, strict=True))),
        )

    def _skin(self, prim: Usd.Prim) -> Skin | None:
        return None if self.skeletons is None else self.skeletons.of(prim)

    def _normals(
        self,
        prim: Usd.Prim,
        points: Array,
        topology: Topology,
        scheme: str | None,
        names: frozenset[str],
    ) -> Array | None:
        """Returns normals per point (n, 3) or per corner (m, 3, 3); None for flat shading.

        Returns authored normals if there are any, otherwise smooth normals for subdivision
        surfaces. As UsdGeomMesh requires, authored normals of subdivided meshes are ignored.
        """
        if scheme not in SCHEMES:
            if scheme not in (None, "none"):
                what = f"subdivisionScheme {scheme!r} is none of {', '.join(SCHEMES)}: polygons"
                self.report.warn(what, prim.GetPath())
            return self._authored_normals(prim, points, topology, names)
        authored = None if self.subdivide else self._authored_normals(prim, points, topology, names)
        if authored is not None or scheme == "bilinear":
            return authored
        edges = None
        if "creaseIndices" in names:
            # If the mesh is subdivided, do not report invalid creases here, since the reader of the
            # subdivision cage reports them.
            report = LoadReport() if self.subdivide else self.report
            edges = sharp_edges(prim, topology.point_count, self.time, report)
        return smooth_normals(points, topology, edges)

    def _authored_normals(
        self, prim: Usd.Prim, points: Array, topology: Topology, names: frozenset[str]
    ) -> Array | None:
        """Returns the mesh's ``primvars:normals`` or ``normals``; None if both are invalid."""
        if names.isdisjoint(_NORMALS):
            return None
        try:
            primvar = read_primvar(prim, "normals", self.time)
            if primvar is None:
                primvar = plain_attribute(prim, "normals", self.time)
            if primvar is None:
                return None
            primvar = self._skinned_normals(prim, primvar, topology)
            normals, at = spread(primvar, topology, 3)
        except PrimvarError as error:
            self.report.warn(f"{error}: ignored", prim.GetPath())
            return None
        flat = normals.reshape(-1, 3)
        lengths = np.einsum("ij,ij->i", flat, flat)
        # Comparisons with NaN are false, so NaN counts as invalid.
        if not float(np.maximum.reduce(lengths, axis=None, initial=0.0)) < 1e30:
            self.report.warn("normals that are not finite: ignored", prim.GetPath())
            return None
        if at == "constant":
            normals = np.repeat(normals, len(points), axis=0)
        elif float(np.minimum.reduce(lengths, axis=None, initial=1.0)) <= 0.0:
            self.report.warn("normals of length zero: replaced by smooth ones", prim.GetPath())
            smooth = smooth_normals(points, topology)
            if at == "corner":
                smooth = smooth[topology.triangles]
            normals = np.where(lengths.reshape(*normals.shape[:-1], 1) > 0, normals, smooth)
        return np.ascontiguousarray(normals, np.float32)

    def _skinned_normals(self, prim: Usd.Prim, primvar: Primvar, topology: Topology) -> Primvar:
        """Applies skinning to authored normals, which may be per point or per corner."""
        skin = self._skin(prim)
        corners = topology.indices if primvar.interpolation == "faceVarying" else None
        wanted = topology.point_count if corners is None else len(corners)
        kinds = ("vertex", "varying", "faceVarying")
        if skin is None or primvar.interpolation not in kinds or len(primvar.values) != wanted:
            return primvar
        try:
            authored = np.asarray(primvar.values[:, :3], np.float64)
            values = skin.normals(authored, corners, topology.point_count, self.time)
        except SkinError:
            return primvar
        return replace(primvar, values=values)

    def _coordinates(
        self,
        prim: Usd.Prim,
        topology: Topology,
        names: Sequence[str],
        inherited: Sequence[Any],
    ) -> Primvar | None:
        """Returns the primvar for texture coordinates.

        If materials name primvars but the mesh has none of them, all texture coordinates are (0,
        0).
        """
        try:
            primvar = first_primvar(prim, names, inherited, self.time)
            if primvar is None:
                primvar = self._any_coordinates(prim)
                if primvar is None and names is not UV_NAMES:
                    what = f"no primvar {names[0]!r} for its textures: all at (0, 0)"
                    self.report.warn(what, prim.GetPath())
                    zeros = np.zeros((topology.point_count, 2), np.float32)
                    return Primvar(zeros, "vertex", names[0])
                if primvar is not None and names is not UV_NAMES:
                    what = f"no primvar {names[0]!r}: used {primvar.name!r} in its place"
                    self.report.warn(what, prim.GetPath())
        except PrimvarError as error:
            self.report.warn(f"{error}: ignored", prim.GetPath())
            return None
        return primvar

    def _uvs(
        self, prim: Usd.Prim, topology: Topology, primvar: Primvar | None
    ) -> tuple[Array | None, Primvar | None]:
        """Returns texture coordinates (n, 2), (m, 3, 2) or None, and their primvar if valid."""
        if primvar is None:
            return None, None
        try:
            uvs, at = spread(primvar, topology, 2)
        except PrimvarError as error:
            self.report.warn(f"{error}: ignored", prim.GetPath())
            return None, None
        uvs = finite_uvs(uvs, self.report, prim.GetPath())
        if at == "constant":
            uvs = np.repeat(uvs, topology.point_count, axis=0)
        return uvs, primvar

    def _any_coordinates(self, prim: Usd.Prim) -> Primvar | None:
        """Returns the first authored primvar whose type is a texture coordinate type."""
        for attribute in prim.GetAuthoredAttributes():
            name = attribute.GetName()
            coordinates = attribute.GetTypeName() == Sdf.ValueTypeNames.TexCoord2fArray
            if coordinates and name.startswith("primvars:"):
                found = from_attribute(attribute, name[len("primvars:") :], self.time)
                if found is not None:
                    return found
        return None


def _reverse(values: Any) -> Any:
    """Reverses the corner order in values of shape (m, 3, c); returns other values unchanged."""
    if values is None or values.ndim != 3:
        return values
    return np.ascontiguousarray(values[:, ::-1])
