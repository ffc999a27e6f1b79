# SPDX-License-Identifier: Apache-2.0
"""UsdGeomPoints as spheres for the core."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pxr import Gf, Usd

from wavecomb.usd.geometry.bad_points import bad_points
from wavecomb.usd.geometry.curves import (
    CurveArrays,
    read_points,
    read_uvs,
    read_widths,
    thick_extent,
    uniform_scale,
)
from wavecomb.usd.geometry.mesh_arrays import IDENTITY, bake, check_matrix
from wavecomb.usd.geometry.strands import lay_out_points
from wavecomb.usd.geometry.triangulate import MeshError
from wavecomb.usd.stage.report import LoadReport


class PointReader:
    """Reads points of one stage."""

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
        """Points in their group's space; None where there are none.

        Arguments and errors are those of ``CurveReader.curves``.
        """
        check_matrix(matrix)
        positions = read_points(prim, self.time)
        if positions is None:
            return None
        layout = lay_out_points(len(positions))
        bad = bad_points(positions)
        if bad.all():
            raise MeshError("their places are not finite or absurdly far away")
        if matrix != IDENTITY:
            positions = bake(positions, matrix)
        widths, _ = read_widths(prim, layout, self.time, self.report)
        radii = np.asarray(widths[:, 0] * (0.5 * (uniform_scale(matrix) or 1.0)), np.float32)
        if len(radii) == 1:
            radii = np.repeat(radii, len(positions))
        if bad.any():
            what = f"{int(bad.sum())} of {len(bad)} points left out"
            where = prim.GetPath()
            self.report.warn(f"{what}: they are not finite or absurdly far away", where)
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
