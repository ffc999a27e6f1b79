# SPDX-License-Identifier: Apache-2.0
"""UsdGeomNurbsCurves and UsdGeomHermiteCurves as Bezier segments.

A polynomial piece of order up to 4 is one cubic, so that it is drawn exactly; rational pieces and
those of higher order are ``PARTS`` cubics each, with the true points and tangents at their ends.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb.usd.geometry.nurbs import Floats, Spline, rational
from wavecomb.usd.geometry.primvar import Primvar, as_array
from wavecomb.usd.geometry.strands import Index, Strands, lay_out, runs
from wavecomb.usd.geometry.triangulate import MeshError

PARTS = 8
"""Cubics for each piece between knots that is no cubic itself."""


@dataclass(frozen=True)
class _Piece:
    """One curve.

    Attributes:
        shares: (segments, 4, order) of control points in the Bezier points.
        columns: (segments, order) which control points these are.
    """

    shares: Floats
    columns: Index


@dataclass(frozen=True)
class NurbsStrands(Strands):
    """Curves whose Bezier points are sums of their control points.

    Attributes:
        pieces: Of each curve.
    """

    pieces: tuple[_Piece, ...] = ()

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
    """Curves of points and tangents; all else is linear between points.

    Attributes:
        tangents: (n, 3) where a curve goes to from each of the prim's points.
    """

    tangents: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def fit(self, primvar: Primvar, width: int) -> tuple[NDArray[Any], str]:
        """As of all strands; there is one value for each point, whatever it is called."""
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


def hermite_strands(prim: Usd.Prim, counts: Index, time: Usd.TimeCode) -> HermiteStrands:
    """The layout of a UsdGeomHermiteCurves prim of ``counts`` points each.

    Raises:
        MeshError: Its tangents are none.
    """
    tangents = as_array(prim.GetAttribute("tangents").Get(time))
    total = int(counts.sum())
    if tangents is None or tangents.shape != (total, 3) or not np.isfinite(tangents).all():
        have = 0 if tangents is None else len(tangents)
        raise MeshError(f"{total} points need as many tangents, finite ones, and there are {have}")
    plain = lay_out(counts, "linear", "nonperiodic")
    sizes = plain.sizes | {"varying": total}
    return HermiteStrands(
        "hermite", plain.wrap, plain.kept, plain.counts, plain.starts, plain.segments,
        plain.starts, sizes, tangents.astype(np.float64),
    )  # fmt: skip


def nurbs_strands(prim: Usd.Prim, counts: Index, time: Usd.TimeCode) -> NurbsStrands:
    """The layout of a UsdGeomNurbsCurves prim of ``counts`` control points each.

    Raises:
        MeshError: Its knots, orders or weights are none.
    """

    def numbers(name: str, columns: int) -> Floats:
        values = as_array(prim.GetAttribute(name).Get(time))
        if values is None:
            return np.empty((0, columns))
        if values.shape[1] != columns:
            raise MeshError(f"its {name} are no numbers")
        return values.astype(np.float64)

    orders = numbers("order", 1)[:, 0].astype(np.intp)
    if len(orders) == 1:
        orders = np.repeat(orders, len(counts))  # one for all, as many exporters write it
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
    known: dict[bytes, _Piece] = {}
    pieces: list[_Piece] = []
    for i, (count, order) in enumerate(zip(counts.tolist(), orders.tolist(), strict=True)):
        mine = knots[first_knot[i] : first_knot[i] + count + order]
        heavy = weights[first[i] : first[i] + count] if len(weights) else None
        span = limits[i] if len(limits) == len(counts) else None
        key = np.concatenate([[order], mine, [] if heavy is None else heavy,
                              [] if span is None else span]).tobytes()  # fmt: skip
        if key not in known:
            known[key] = _piece(Spline.of(mine, order, count, span), heavy)
        pieces.append(known[key])
    segments = np.array([len(one.shares) for one in pieces], np.intp)
    sizes = {
        "constant": 1,
        "uniform": len(counts),
        "varying": int((segments + 1).sum()),
        "vertex": int(counts.sum()),
    }
    varying = np.cumsum(segments + 1) - segments - 1
    return NurbsStrands(
        "nurbs", "nonperiodic", np.arange(len(counts)), counts, first, segments, varying, sizes,
        tuple(pieces),
    )  # fmt: skip


def _piece(spline: Spline, weights: Floats | None) -> _Piece:
    """Bezier points of a curve as sums of its control points."""
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
    return _Piece(shares, columns)
