# SPDX-License-Identifier: Apache-2.0
"""Converts UsdGeomNurbsCurves and UsdGeomHermiteCurves to Bezier segments.

A polynomial span of order up to 4 is converted exactly to one cubic segment. Other spans are
approximated by ``PARTS`` cubic segments, whose end points and tangents are exact. Basis functions
follow formulas 2.5 and 2.7 of L. Piegl and W. Tiller, The NURBS Book (1997), vectorised over all
samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb.usd.geometry.primvar import Primvar, as_array
from wavecomb.usd.geometry.strands import PER_CURVE, Index, Strands, lay_out, runs
from wavecomb.usd.geometry.triangulate import MeshError
from wavecomb.usd.stage.report import LoadReport

PARTS = 8
"""Number of cubic segments for a knot span that cannot be converted exactly."""


@dataclass(frozen=True)
class _BezierConversion:
    """Conversion of one curve to Bezier segments.

    Attributes:
        shares: (segments, 4, order) weights of the curve's control points for each Bezier point.
        columns: (segments, order) indices of the control points to which ``shares`` applies.
    """

    shares: Floats
    columns: Index


@dataclass(frozen=True)
class NurbsStrands(Strands):
    """NURBS curves, whose Bezier points are linear combinations of their control points.

    Attributes:
        pieces: Conversion of each curve to Bezier segments.
    """

    pieces: tuple[_BezierConversion, ...] = ()

    def only(self, kept: NDArray[np.bool_] | slice) -> NurbsStrands:
        """Returns the curves that a mask or slice selects."""
        numbers = np.arange(len(self.pieces))[kept].tolist()
        fields = {name: getattr(self, name)[kept] for name in PER_CURVE}
        return replace(self, pieces=tuple(self.pieces[i] for i in numbers), **fields)

    def _bezier(self, values: NDArray[Any]) -> list[Floats]:
        out = np.empty((4, self.count, values.shape[1]))
        done = 0
        for piece, start in zip(self.pieces, self.starts, strict=True):
            points = np.asarray(values[start + piece.columns], np.float64)
            end = done + len(points)
            out[:, done:end] = np.einsum("sij,sjc->isc", piece.shares, points)
            done = end
        return list(out)


@dataclass(frozen=True)
class HermiteStrands(Strands):
    """Cubic Hermite curves, whose primvars are interpolated linearly between points.

    Attributes:
        tangents: (n, 3) tangents at the points of the prim.
    """

    tangents: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def fit(self, primvar: Primvar, width: int) -> tuple[NDArray[Any], str]:
        """Returns the values of a primvar; vertex interpolation is treated as varying."""
        values, kind = super().fit(primvar, width)
        return values, "varying" if kind == "vertex" else kind

    def _bezier(self, values: NDArray[Any]) -> list[Floats]:
        curve, at = runs(self.segments)
        first = self.starts[curve] + at
        begin, end = (np.asarray(values[i], np.float64) for i in (first, first + 1))
        return [
            begin,
            begin + self.tangents[first] / 3.0,
            end - self.tangents[first + 1] / 3.0,
            end,
        ]


def hermite_strands(
    prim: Usd.Prim, counts: Index, time: Usd.TimeCode, report: LoadReport
) -> HermiteStrands:
    """Reads the layout of a UsdGeomHermiteCurves prim with ``counts`` points per curve.

    Curves whose tangents are not finite are left out with a warning.

    Raises:
        MeshError: The number of tangents differs from the number of points, or no curve remains.
    """
    tangents = as_array(prim.GetAttribute("tangents").Get(time))
    total = int(counts.sum())
    if tangents is None or tangents.shape != (total, 3):
        have = 0 if tangents is None else len(tangents)
        raise MeshError(f"{total} points need as many tangents, and there are {have}")
    plain = lay_out(counts, "linear", "nonperiodic")
    sizes = plain.sizes | {"varying": total}
    strands = HermiteStrands(
        "hermite", plain.wrap, plain.kept, plain.counts, plain.starts, plain.segments,
        plain.starts, sizes, tangents.astype(np.float64),
    )  # fmt: skip
    bad = ~np.isfinite(tangents).all(axis=1)
    if not bad.any():
        return strands
    good = strands.over_each(np.maximum, bad) == 0
    _report_invalid(prim, report, good, "their tangents are not finite")
    return replace(strands, **{name: getattr(strands, name)[good] for name in PER_CURVE})


def _report_invalid(prim: Usd.Prim, report: LoadReport, good: NDArray[np.bool_], why: str) -> None:
    if not good.any():
        raise MeshError(why)
    report.warn(f"{int((~good).sum())} of {len(good)} curves left out: {why}", prim.GetPath())


def nurbs_strands(
    prim: Usd.Prim, counts: Index, time: Usd.TimeCode, report: LoadReport
) -> NurbsStrands:
    """Reads the layout of a UsdGeomNurbsCurves prim with ``counts`` control points per curve.

    Curves with invalid knots, order or weights are left out with a warning.

    Raises:
        MeshError: The number of knots, orders or weights is wrong, or no curve remains.
    """

    def numbers(name: str, columns: int) -> Floats:
        values = as_array(prim.GetAttribute(name).Get(time))
        if values is None:
            return np.empty((0, columns))
        if values.shape[1] != columns:
            raise MeshError(f"its {name} are not numbers")
        return values.astype(np.float64)

    orders = numbers("order", 1)[:, 0].astype(np.intp)
    if len(orders) == 1:
        # Many exporters write a single order, which applies to all curves.
        orders = np.repeat(orders, len(counts))
    if len(orders) != len(counts):
        raise MeshError(f"{len(counts)} curves have {len(orders)} orders")
    knots, weights = numbers("knots", 1)[:, 0], numbers("pointWeights", 1)[:, 0]
    limits = numbers("ranges", 2)
    if len(knots) != int((counts + orders).sum()):
        wanted = int((counts + orders).sum())
        raise MeshError(f"its curves need {wanted} knots, and there are {len(knots)}")
    if len(weights) not in (0, int(counts.sum())):
        raise MeshError(f"{int(counts.sum())} points have {len(weights)} pointWeights")
    first_knot, first = np.cumsum(counts + orders) - counts - orders, np.cumsum(counts) - counts
    known: dict[bytes, _BezierConversion | str] = {}
    found: list[_BezierConversion | str] = []
    for i, (count, order) in enumerate(zip(counts.tolist(), orders.tolist(), strict=True)):
        mine = knots[first_knot[i] : first_knot[i] + count + order]
        heavy = weights[first[i] : first[i] + count] if len(weights) else None
        span = limits[i] if len(limits) == len(counts) else None
        key = np.concatenate([[order], mine, [] if heavy is None else heavy,
                              [] if span is None else span]).tobytes()  # fmt: skip
        if key not in known:
            try:
                known[key] = _bezier_conversion(Spline.of(mine, order, count, span), heavy)
            except MeshError as error:
                known[key] = str(error)
        found.append(known[key])
    good = np.array([not isinstance(one, str) for one in found])
    if not good.all():
        whys = list(dict.fromkeys(one for one in found if isinstance(one, str)))
        _report_invalid(prim, report, good, "; ".join(whys[:3]))
    # The segment counts include the excluded curves, since primvar arrays have values for all
    # authored curves.
    segments = np.array(
        [max(counts[i] - orders[i] + 1, 0) if isinstance(one, str) else len(one.shares)
         for i, one in enumerate(found)], np.intp,
    )  # fmt: skip
    sizes = {
        "constant": 1,
        "uniform": len(counts),
        "varying": int((segments + 1).sum()),
        "vertex": int(counts.sum()),
    }
    varying = np.cumsum(segments + 1) - segments - 1
    return NurbsStrands(
        "nurbs", "nonperiodic", np.flatnonzero(good), counts[good], first[good], segments[good],
        varying[good], sizes, tuple(one for one in found if not isinstance(one, str)),
    )  # fmt: skip


def _bezier_conversion(spline: Spline, weights: Floats | None) -> _BezierConversion:
    """Computes the weights that convert a curve to Bezier segments."""
    parts = 1 if spline.order <= 4 and weights is None else PARTS
    size = spline.ends[:, 1:] - spline.ends[:, :1]
    at = spline.ends[:, :1] + size * np.linspace(0.0, 1.0, parts + 1)
    at[:, -1] = spline.ends[:, 1]
    span = np.repeat(spline.spans, parts)
    columns = spline.columns(span)
    heavy = None if weights is None else weights[columns]
    begin, leave = rational(*spline.weights(span, at[:, :-1].ravel()), heavy)
    end, arrive = rational(*spline.weights(span, at[:, 1:].ravel()), heavy)
    third = np.repeat(size[:, 0] / (3.0 * parts), parts)[:, None]
    shares = np.stack([begin, begin + third * leave, end - third * arrive, end], axis=1)
    return _BezierConversion(shares, columns)


Floats = NDArray[np.float64]

MAX_ORDER = 32
"""Largest order of a NURBS curve; curves of higher order are considered mistakes."""


@dataclass(frozen=True)
class Spline:
    """B-spline basis functions over a knot vector.

    Attributes:
        knots: (count + order,) knot values, non-decreasing.
        order: Degree + 1.
        count: Number of control points.
        spans: (k,) index of the first knot of each non-empty span.
        ends: (k, 2) parameters at the start and the end of each span, clipped to ``limits``.
    """

    knots: Floats
    order: int
    count: int
    spans: NDArray[np.intp]
    ends: Floats

    @classmethod
    def of(cls, knots: Floats, order: int, count: int, limits: Floats | None = None) -> Spline:
        """Creates the basis; raises MeshError if the parameters are invalid.

        Args:
            knots: (count + order,).
            order: Order of the curve.
            count: Number of control points.
            limits: Parameter range of the curve; None means the full domain of the basis.

        Raises:
            MeshError: The parameters do not define a curve.
        """
        if not 2 <= order <= min(count, MAX_ORDER):
            raise MeshError(f"order {order} with {count} control points")
        if len(knots) != count + order:
            raise MeshError(f"{len(knots)} knots where {count + order} are needed")
        # Comparisons with NaN are false, so NaN counts as invalid.
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
        """Evaluates basis functions and their derivatives at parameters on given spans.

        Returns two (m, order) arrays, for the control points whose indices ``columns`` returns; all
        other basis functions are 0.
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
        """Returns the indices (m, order) of the control points that affect each parameter."""
        return span[:, None] - (self.order - 1) + np.arange(self.order)


def rational(values: Floats, slopes: Floats, weights: Floats | None) -> tuple[Floats, Floats]:
    """Converts basis functions and derivatives (m, order) to rational basis functions with weights.

    Raises:
        MeshError: The weighted sum of the basis functions is 0 at some parameter.
    """
    if weights is None:
        return values, slopes
    values, slopes = values * weights, slopes * weights
    total = values.sum(axis=1, keepdims=True)
    # Comparisons with NaN are false, so NaN counts as invalid.
    if not bool((np.abs(total) > 1e-30).all()):
        raise MeshError("its pointWeights add up to 0")
    values = values / total
    return values, slopes / total - values * (slopes.sum(axis=1, keepdims=True) / total)
