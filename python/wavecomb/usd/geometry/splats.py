# SPDX-License-Identifier: Apache-2.0
"""Reads UsdGeomPoints as spheres, and reads Gaussian splats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd

from wavecomb.usd.geometry.curves import (
    Array,
    CurveArrays,
    read_points,
    read_uvs,
    read_widths,
    thick_extent,
    uniform_scale,
)
from wavecomb.usd.geometry.mesh_arrays import IDENTITY, bake, check_matrix, invalid_point_mask
from wavecomb.usd.geometry.primvar import as_array
from wavecomb.usd.geometry.strands import lay_out_points
from wavecomb.usd.geometry.triangulate import MeshError
from wavecomb.usd.stage.report import LoadReport

SPLATS = "ParticleField3DGaussianSplat"
"""Type name of Gaussian splat prims."""

MIN_SCALE, MAX_SCALE = 1e-9, 1e9
"""Range of splat scales that the core accepts."""

_MAX_DEGREE = 3
_REACH = 3.0
_SH = "radiance:sphericalHarmonics"


@dataclass
class SplatArrays(CurveArrays):
    """Gaussian splats in the space of their group; ``radii`` are the radii of bounding spheres.

    Attributes:
        scales: (n, 3) standard deviations along the splats' axes.
        orientations: (n, 4) quaternions w, x, y, z.
        opacities: (n,) from 0 to 1.
        harmonics: (n, k, 3) spherical harmonics of the colour minus 0.5; k is 1, 4, 9 or 16.
    """

    scales: Array
    orientations: Array
    opacities: Array
    harmonics: Array


class SplatReader:
    """Reader of the Gaussian splats of one stage."""

    def __init__(self, time: Usd.TimeCode, report: LoadReport) -> None:
        self.time = time
        self.report = report

    def splats(self, prim: Usd.Prim, matrix: Gf.Matrix4d) -> SplatArrays | None:
        """Reads splats in the space of their group; returns None if the prim has no splats.

        Args:
            prim: A ParticleField3DGaussianSplat.
            matrix: Transform from the prim to its group, which may only translate.

        Raises:
            MeshError: The splats are invalid.
        """
        check_matrix(matrix)
        found = self._values(prim, "positions", 3)
        if found is None or len(found) == 0:
            return None
        n = len(found)
        positions = bake(found, matrix)
        scales = self._fitting(prim, "scales", (1.0, 1.0, 1.0), n)
        turns = self._fitting(prim, "orientations", (0.0, 0.0, 0.0, 1.0), n)
        opacities = self._fitting(prim, "opacities", (1.0,), n)[:, 0]
        harmonics = self._harmonics(prim, n)
        with np.errstate(over="ignore", invalid="ignore"):
            sizes = np.einsum("ij,ij->i", turns, turns)
        bad = {
            "middles that are not finite or too far away": ~(np.abs(positions) < 1e18).all(1),
            f"scales that are not from {MIN_SCALE:g} to {MAX_SCALE:g}": ~(
                (scales >= MIN_SCALE) & (scales <= MAX_SCALE)
            ).all(1),
            "orientations of length zero or not finite": ~((sizes > 1e-20) & (sizes < 1e20)),
            "opacities that are negative or not finite": ~((opacities >= 0) & (opacities < np.inf)),
            "colours that are not finite": ~np.isfinite(harmonics).all((1, 2)),
        }
        kept = np.ones(n, bool)
        for what, wrong in bad.items():
            if wrong.any():
                self.report.warn(f"splats left out: {what}", prim.GetPath(), int(wrong.sum()))
                kept &= ~wrong
        if not kept.any():
            return None
        if (high := int((opacities[kept] > 1).sum())) > 0:
            self.report.warn("splats with opacities above 1: set to 1", prim.GetPath(), high)
        if not kept.all():
            positions, scales, turns, opacities, harmonics = (
                values[kept] for values in (positions, scales, turns, opacities, harmonics)
            )
        radii = np.asarray(_REACH * scales.max(1), np.float32)
        return SplatArrays(
            "splat", positions, None, radii, None, None, thick_extent(positions, radii),
            lay_out_points(len(positions)), _plain(scales), _plain(turns[:, [3, 0, 1, 2]]),
            _plain(np.minimum(opacities, 1.0)), harmonics,
        )  # fmt: skip

    def _values(self, prim: Usd.Prim, name: str, width: int) -> NDArray[Any] | None:
        """Returns the values (n, width) of a float attribute, or else of its half float variant.

        Returns None if neither attribute exists.
        """
        for full in (name, f"{name}h"):
            values = as_array(prim.GetAttribute(full).Get(self.time))
            if values is not None and len(values) and values.shape[1] == width:
                return np.asarray(values, np.float32)
        return None

    def _fitting(
        self, prim: Usd.Prim, name: str, otherwise: tuple[float, ...], count: int
    ) -> NDArray[Any]:
        """Returns the values of an attribute, (count, width).

        Longer arrays are cut and shorter arrays are ignored, as UsdVol requires.
        """
        values = self._values(prim, name, len(otherwise))
        if values is not None and len(values) > count:
            self.report.warn(f"more {name} than splats: the first ones are used", prim.GetPath())
        if values is not None and len(values) < count:
            self.report.warn(f"fewer {name} than splats: ignored", prim.GetPath())
            values = None
        if values is None:
            return np.broadcast_to(np.array(otherwise, np.float32), (count, len(otherwise)))
        return values[:count]

    def _harmonics(self, prim: Usd.Prim, count: int) -> Array:
        """Returns spherical harmonics of colours, (count, k, 3); grey if there are none."""
        degree = prim.GetAttribute(f"{_SH}Degree").Get()
        degree = 3 if degree is None else int(degree)
        values = self._values(prim, f"{_SH}Coefficients", 3)
        wanted = count * (max(degree, 0) + 1) ** 2
        if values is None:
            self.report.warn("splats without colours: drawn grey", prim.GetPath())
        elif degree < 0 or len(values) < wanted:
            what = f"fewer harmonics of splats than degree {degree} asks for: drawn grey"
            self.report.warn(what, prim.GetPath())
            values = None
        elif len(values) > wanted:
            what = f"more harmonics of splats than degree {degree} needs: the first ones are used"
            self.report.warn(what, prim.GetPath())
        if values is None:
            return np.zeros((count, 1, 3), np.float32)
        harmonics = values[:wanted].reshape(count, -1, 3)
        if degree > _MAX_DEGREE:
            what = f"spherical harmonics of splats above degree {_MAX_DEGREE}"
            self.report.missing(what, prim.GetPath())
        return _plain(harmonics[:, : (_MAX_DEGREE + 1) ** 2])


def _plain(values: NDArray[Any]) -> Array:
    return np.ascontiguousarray(values, np.float32)


class PointReader:
    """Reader of the points of one stage."""

    def __init__(self, time: Usd.TimeCode, report: LoadReport) -> None:
        self.time = time
        self.report = report

    def points(
        self,
        prim: Usd.Prim,
        matrix: Gf.Matrix4d,
        uv_names: Sequence[str],
        inherited: Sequence[Any] = (),
    ) -> CurveArrays | None:
        """Reads points in the space of their group; returns None if the prim has no points.

        Parameters and errors are the same as for ``CurveReader.curves``.
        """
        check_matrix(matrix)
        positions = read_points(prim, self.time)
        if positions is None:
            return None
        layout = lay_out_points(len(positions))
        bad = invalid_point_mask(positions)
        if bad.all():
            raise MeshError("their positions are not finite or too far away")
        if matrix != IDENTITY:
            positions = bake(positions, matrix)
        widths, _ = read_widths(prim, layout, self.time, self.report)
        radii = np.asarray(widths[:, 0] * (0.5 * (uniform_scale(matrix) or 1.0)), np.float32)
        if len(radii) == 1:
            radii = np.repeat(radii, len(positions))
        if bad.any():
            what = f"{int(bad.sum())} of {len(bad)} points left out"
            where = prim.GetPath()
            self.report.warn(f"{what}: they are not finite or too far away", where)
            positions, radii = positions.copy(), radii.copy()
            positions[bad], radii[bad] = positions[np.flatnonzero(~bad)[0]], 0.0
        bounds = thick_extent(positions, radii)
        uvs = None
        if uv_names:
            found = read_uvs(prim, layout, uv_names, inherited, self.time, self.report)
            if found is not None:
                pairs = np.asarray(found[0], np.float32)
                wanted = np.broadcast_to(pairs, (len(positions), 2))
                uvs = np.ascontiguousarray(wanted)
        return CurveArrays(
            "sphere", positions, None, np.ascontiguousarray(radii), None, uvs, bounds, layout
        )
