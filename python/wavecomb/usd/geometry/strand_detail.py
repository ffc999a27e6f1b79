# SPDX-License-Identifier: Apache-2.0
"""Fewer and wider strands where they are thin in the picture, of the same opacity."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf

from wavecomb.usd.geometry.strands import Strands
from wavecomb.usd.geometry.view_size import ViewSize
from wavecomb.usd.stage.report import LoadReport

LEAST_SHARE = 1.0 / 256.0
"""Of strands that are kept, however thin they are."""


class StrandDetail:
    """Thins out strands for one view.

    Of strands that are narrower than ``pixels``, a share is kept that is as large as they are
    narrow, and each is widened by as much, so that together they cover what they covered (Cook,
    Halstead, Planck and Ryu 2007, stochastic simplification). Which are kept is a matter of their
    number in the prim: farther away there are always fewer of the same ones.
    """

    def __init__(self, view: ViewSize, pixels: float, report: LoadReport) -> None:
        """``pixels``: no strand is made wider than that."""
        self.view = view
        self.target = pixels
        self.report = report

    def thin(
        self,
        path: Sdf.Path,
        strands: Strands,
        points: NDArray[Any],
        widths: NDArray[Any],
        matrix: Gf.Matrix4d,
    ) -> tuple[Strands, NDArray[np.float64]]:
        """The strands that are kept, and how many times as wide each of them is to be.

        Args:
            path: Of the prim.
            strands: All of them.
            points: (n, 3) as authored.
            widths: (k,) the greatest of each, in the units of the points.
            matrix: From the prim to the world.
        """
        share = np.clip(self._pixels(strands, points, widths, matrix) / self.target, 0.0, 1.0)
        share = np.maximum(share, LEAST_SHARE)
        kept = even(strands.kept) < share
        if not kept.any():
            kept[np.argmax(share)] = True
        if not kept.all():
            what = f"strands thinner than {self.target:g} pixels left out, and others widened"
            self.report.note(what, path, len(kept) - int(kept.sum()))
        return strands.only(kept), 1.0 / share[kept]

    def _pixels(
        self,
        strands: Strands,
        points: NDArray[Any],
        widths: NDArray[Any],
        matrix: Gf.Matrix4d,
    ) -> NDArray[np.float64]:
        """Widths of strands where they are nearest to the camera."""
        to_world = np.array(matrix)
        size = np.cbrt(abs(np.linalg.det(to_world[:3, :3])))
        nearest = strands.over_each(np.minimum, self.view.distances(points, to_world))
        wide = widths * (size * self.view.per_length)
        return np.asarray(wide / np.maximum(nearest, 1e-30), np.float64)


def even(numbers: NDArray[np.intp]) -> NDArray[np.float64]:
    """Numbers in [0, 1) that look random, one for each (the finaliser of SplitMix64)."""
    with np.errstate(over="ignore"):
        x = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    return np.asarray((x >> np.uint64(11)).astype(np.float64) * 2.0**-53, np.float64)
