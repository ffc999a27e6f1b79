# SPDX-License-Identifier: Apache-2.0
"""B-splines: basis functions and their derivatives, and where knots divide them.

Formulas 2.5 and 2.7 of L. Piegl, W. Tiller, The NURBS Book (1997), for all samples at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.geometry.triangulate import MeshError

Floats = NDArray[np.float64]

MAX_ORDER = 32
"""Orders beyond this are taken for a mistake."""


@dataclass(frozen=True)
class Spline:
    """Basis functions over a knot vector.

    Attributes:
        knots: (count + order,) not falling.
        order: Degree + 1.
        count: Control points.
        spans: (k,) numbers of the first knot of each piece that is not empty.
        ends: (k, 2) parameters where each piece begins and ends, within the range.
    """

    knots: Floats
    order: int
    count: int
    spans: NDArray[np.intp]
    ends: Floats

    @classmethod
    def of(cls, knots: Floats, order: int, count: int, limits: Floats | None = None) -> Spline:
        """A checked one.

        Args:
            knots: (count + order,).
            order: Of the curve.
            count: Control points.
            limits: Where it begins and ends; None: where all basis functions are there.

        Raises:
            MeshError: It is none.
        """
        if not 2 <= order <= min(count, MAX_ORDER):
            raise MeshError(f"order {order} with {count} control points")
        if len(knots) != count + order:
            raise MeshError(f"{len(knots)} knots where {count + order} are needed")
        # Written so that NaN fails too.
        if not (np.isfinite(knots).all() and bool((np.diff(knots) >= 0).all())):
            raise MeshError("its knots are not in order")
        low, high = float(knots[order - 1]), float(knots[count])
        if limits is not None and limits[0] < limits[1]:
            low, high = max(low, float(limits[0])), min(high, float(limits[1]))
        spans = np.arange(order - 1, count)
        ends = np.stack([np.maximum(knots[spans], low), np.minimum(knots[spans + 1], high)], axis=1)
        filled = ends[:, 1] > ends[:, 0]
        if not filled.any():
            raise MeshError("its range is empty")
        return cls(knots, order, count, spans[filled], ends[filled])

    def weights(self, span: NDArray[np.intp], at: Floats) -> tuple[Floats, Floats]:
        """Basis functions and their derivatives at parameters on given spans.

        (m, order) each, of the control points that ``columns`` says; all others are 0 there.
        """
        knots, degree = self.knots, self.order - 1
        values = lower = np.ones((len(at), 1))
        for d in range(1, degree + 1):
            lower, values = values, np.zeros((len(at), d + 1))
            carried = np.zeros(len(at))
            for r in range(d):
                right, left = knots[span + r + 1], knots[span + 1 - d + r]
                part = lower[:, r] / (right - left)
                values[:, r] = carried + (right - at) * part
                carried = (at - left) * part
            values[:, d] = carried
        slopes = np.zeros_like(values)
        for r in range(degree):
            rise = degree * lower[:, r] / (knots[span + r + 1] - knots[span + r + 1 - degree])
            slopes[:, r + 1] += rise
            slopes[:, r] -= rise
        return values, slopes

    def columns(self, span: NDArray[np.intp]) -> NDArray[np.intp]:
        """(m, order) control points that ``weights`` are of."""
        return span[:, None] - (self.order - 1) + np.arange(self.order)


def rational(values: Floats, slopes: Floats, weights: Floats | None) -> tuple[Floats, Floats]:
    """Basis functions and derivatives, (m, order), with weights of their control points, likewise.

    Raises:
        MeshError: The weights add up to nothing somewhere.
    """
    if weights is None:
        return values, slopes
    values, slopes = values * weights, slopes * weights
    total = values.sum(axis=1, keepdims=True)
    # Written so that NaN fails too.
    if not bool((np.abs(total) > 1e-30).all()):
        raise MeshError("its pointWeights add up to nothing")
    values = values / total
    return values, slopes / total - values * (slopes.sum(axis=1, keepdims=True) / total)
