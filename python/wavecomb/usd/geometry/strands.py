# SPDX-License-Identifier: Apache-2.0
"""Layout of a prim's curves as Bezier segments, and simplification of thin strands.

Curves of every basis and wrap mode are converted to Bezier control points, or to the points of
polylines. The core therefore needs only one kind of cubic curve. Adjacent segments share their end
points. The conversion is exact up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf

from wavecomb.usd.geometry.cage import ViewSize
from wavecomb.usd.geometry.primvar import Primvar, PrimvarError
from wavecomb.usd.stage.report import LoadReport

Array = NDArray[np.float32]
Index = NDArray[np.intp]

GOES_ON_BEFORE = 0x80000000
GOES_ON_AFTER = 0x40000000
"""Segment flags: another segment precedes the segment's first point, or follows its last point."""

_TO_BEZIER: dict[str, NDArray[np.float64]] = {
    "bspline": np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6.0,
    "catmullRom": np.array([[0, 6, 0, 0], [-1, 6, 1, 0], [0, 1, 6, -1], [0, 0, 6, 0]]) / 6.0,
}
"""Matrix that computes the Bezier control points of a segment from four authored points, by
basis."""


PER_CURVE = ("kept", "counts", "starts", "segments", "varying_starts")
"""Attributes of ``Strands`` with one value per curve."""

_AT_ONCE = 1 << 16
"""Number of segments that are computed together, which bounds the memory used."""


def runs(counts: Index) -> tuple[Index, Index]:
    """Returns, for runs of given lengths, each element's run and its index in the run."""
    owner = np.repeat(np.arange(len(counts)), counts)
    starts = np.cumsum(counts) - counts
    return owner, np.arange(len(owner)) - starts[owner]


@dataclass(frozen=True)
class Strands:
    """The layout of a prim's curves, as authored and as Bezier segments.

    Curves without segments are left out of the k curves of the layout.

    Attributes:
        basis: "linear", "bezier", "bspline" or "catmullRom".
        wrap: "nonperiodic", "periodic" or "pinned".
        kept: (k,) index of each curve among all curves of the prim.
        counts: (k,) number of authored points of each curve.
        starts: (k,) index of the first authored point of each curve.
        segments: (k,) number of segments of each curve.
        varying_starts: (k,) index of the first varying value of each curve.
        sizes: Required number of primvar values, by interpolation.
    """

    basis: str
    wrap: str
    kept: Index
    counts: Index
    starts: Index
    segments: Index
    varying_starts: Index
    sizes: dict[str, int]

    @property
    def cubic(self) -> bool:
        """Whether segments are cubic and have four control points."""
        return self.basis != "linear"

    @property
    def periodic(self) -> bool:
        """Whether the curves are closed."""
        return self.wrap == "periodic"

    @property
    def _step(self) -> int:
        """Number of control points from the start of a segment to the start of the next."""
        return 3 if self.cubic else 1

    @property
    def _lead(self) -> int:
        """Number of additional control points at each end of a closed curve."""
        return 1 if self.periodic else 0

    @property
    def _run_sizes(self) -> Index:
        """(k,) number of control points of each curve."""
        return self._step * self.segments + 1 + 2 * self._lead

    @property
    def count(self) -> int:
        """Number of segments of all curves."""
        return int(self.segments.sum())

    @property
    def point_count(self) -> int:
        """Number of points of the prim."""
        return self.sizes["vertex"]

    def only(self, kept: NDArray[np.bool_] | slice) -> Strands:
        """Returns the curves that a slice or a mask (k,) selects."""
        return replace(self, **{name: getattr(self, name)[kept] for name in PER_CURVE})

    def over_each(self, combine: np.ufunc, values: NDArray[Any]) -> NDArray[np.float64]:
        """Combines the values of each curve's authored points by a NumPy function such as maximum.

        Returns (k,).
        """
        owner, at = runs(self.counts)
        mine = np.asarray(values, np.float64)[self.starts[owner] + at]
        return np.asarray(combine.reduceat(mine, np.cumsum(self.counts) - self.counts))

    def greatest(self, values: NDArray[Any], kind: str) -> NDArray[np.float64]:
        """Returns the largest value (k,) of a primvar with values (n, 1) on each curve."""
        if kind == "vertex":
            return self.over_each(np.maximum, values[:, 0])
        first, last = self.ends(values, kind)
        starts = np.cumsum(self.segments) - self.segments
        return np.asarray(np.maximum.reduceat(np.maximum(first, last)[:, 0], starts))

    def segment_words(self) -> NDArray[np.uint32]:
        """Returns indices of the segments' first control points, combined with flags."""
        step, lead = self._step, self._lead
        sizes = self._run_sizes
        base = np.cumsum(sizes) - sizes + lead
        curve, at = runs(self.segments)
        words = (base[curve] + step * at).astype(np.uint32)
        words[(at > 0) | self.periodic] |= np.uint32(GOES_ON_BEFORE)
        words[(at < self.segments[curve] - 1) | self.periodic] |= np.uint32(GOES_ON_AFTER)
        return words

    def controls(self, values: NDArray[Any], kind: str) -> Array:
        """Interpolates primvar values (n, c) to all control points; returns float32.

        Args:
            values: Authored values of the primvar for the whole prim, ``sizes[kind]`` in number.
            kind: "constant", "uniform", "varying" or "vertex".
        """
        if kind == "vertex" and self.wrap == "nonperiodic" and self.basis in ("linear", "bezier"):
            if int(self.counts.sum()) == len(values):
                return np.ascontiguousarray(values, np.float32)
            owner, at = runs(self.counts)
            return np.ascontiguousarray(values[self.starts[owner] + at], np.float32)
        if self.count > _AT_ONCE and len(self.kept) > 1:
            return self._controls_by_parts(values, kind)
        if kind == "vertex":
            points = self._bezier(values)
        else:
            first, last = self.ends(values, kind)
            points = (
                [first, first + (last - first) / 3.0, first + (last - first) * (2.0 / 3.0), last]
                if self.cubic
                else [first, last]
            )
        return self._pack(points)

    def _controls_by_parts(self, values: NDArray[Any], kind: str) -> Array:
        out = np.empty((int(self._run_sizes.sum()), values.shape[1]), np.float32)
        part = np.cumsum(self.segments) // _AT_ONCE
        firsts = np.flatnonzero(np.diff(part, prepend=-1))
        at = 0
        for first, end in zip(firsts, [*firsts[1:], len(self.kept)], strict=True):
            made = self.only(slice(first, end)).controls(values, kind)
            out[at : at + len(made)] = made
            at += len(made)
        return out

    def at_controls(self, each: NDArray[Any]) -> Array:
        """Repeats each curve's value (k,) at all its control points; returns float32."""
        first = np.repeat(np.asarray(each, np.float64), self.segments)[:, None]
        return self._pack([first] * (4 if self.cubic else 2))[:, 0]

    def ends(
        self, values: NDArray[Any], kind: str
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Interpolates primvar values (n, c) to the first and last point of each segment."""
        values = np.asarray(values, np.float64)
        curve, at = runs(self.segments)
        if kind == "constant":
            first = last = np.repeat(values[:1], len(curve), axis=0)
        elif kind == "uniform":
            first = last = values[self.kept[curve]]
        elif kind == "varying":
            size = self.segments + (0 if self.periodic else 1)
            base = self.varying_starts[curve]
            first, last = values[base + at], values[base + (at + 1) % size[curve]]
        else:
            points = self._bezier(values)
            first, last = points[0], points[-1]
        return first, last

    def fit(self, primvar: Primvar, width: int) -> tuple[NDArray[Any], str]:
        """Returns values (n, width) of a primvar, and the interpolation that matches their number.

        Raises:
            PrimvarError: The number of values or components matches no interpolation.
        """
        values, kind = primvar.values, primvar.interpolation
        if values.shape[1] < width:
            raise PrimvarError(f"primvar {primvar.name!r} has too few components")
        values = values[:, :width]
        if kind == "faceVarying":
            kind = "varying"
        if len(values) == self.sizes.get(kind):
            return values, kind
        # Many files contain a primvar with a single value and without authored interpolation. The
        # value applies to all curves.
        if len(values) == 1:
            return values, "constant"
        raise PrimvarError(
            f"{primvar.name} ({kind}) has {len(values)} values where "
            f"{self.sizes.get(kind, 0)} are needed"
        )

    def _bezier(self, values: NDArray[Any]) -> list[NDArray[np.float64]]:
        """Returns the control points of each segment as 4 arrays (count, c); 2 arrays if linear."""
        curve, at = runs(self.segments)
        start, size = self.starts[curve], self.counts[curve]
        step = 3 if self.basis == "bezier" else 1
        shift = step * at - (1 if self.wrap == "pinned" and step == 1 and self.cubic else 0)

        def point(k: int) -> NDArray[np.float64]:
            i = shift + k
            if self.periodic:
                return np.asarray(values[start + i % size], np.float64)
            out = np.asarray(values[start + np.clip(i, 0, size - 1)], np.float64)
            # Extend a pinned curve by one point at each end, the reflection of its second or
            # next-to-last point at the end point, so that the curve reaches its end points.
            for outside, end, inner in ((i < 0, 0, 1), (i >= size, size - 1, size - 2)):
                where = np.flatnonzero(outside)
                if len(where):
                    a = start[where] + (end if isinstance(end, int) else end[where])
                    b = start[where] + (inner if isinstance(inner, int) else inner[where])
                    out[where] = 2.0 * np.asarray(values[a], np.float64) - values[b]
            return out

        points = [point(k) for k in range(4 if self.cubic else 2)]
        if self.basis not in _TO_BEZIER:
            return points
        return [
            sum((w * p for w, p in zip(row, points, strict=True) if w), np.zeros_like(points[0]))
            for row in _TO_BEZIER[self.basis]
        ]

    def _pack(self, points: list[NDArray[np.float64]]) -> Array:
        """Stores the control points of each curve in sequence; adjacent segments share end points.

        Closed curves get one additional control point at each end.
        """
        step, lead = self._step, self._lead
        sizes = self._run_sizes
        base = np.cumsum(sizes) - sizes + lead
        curve, at = runs(self.segments)
        out = np.empty((int(sizes.sum()), points[0].shape[1]), np.float32)
        for k in range(step):
            out[base[curve] + step * at + k] = points[k]
        last = np.cumsum(self.segments) - 1
        first = last - self.segments + 1
        end = base + step * self.segments
        out[end] = points[step][last]
        if lead:
            # Use bit-identical points for the start and the end of a closed curve.
            out[end] = points[0][first]
            out[base - 1] = points[step - 1][last]
            out[end + 1] = points[1][first]
        return out


def lay_out(counts: Index, basis: str, wrap: str) -> Strands:
    """Returns the layout of curves with ``counts`` points each."""
    if basis == "linear":
        segments = np.where(counts >= 2, counts - (0 if wrap == "periodic" else 1), 0)
        if wrap == "periodic":
            segments = np.where(counts >= 3, segments, 0)
    elif basis == "bezier":
        if wrap == "periodic":
            segments = np.where((counts >= 3) & (counts % 3 == 0), counts // 3, 0)
        else:
            segments = np.where((counts >= 4) & (counts % 3 == 1), counts // 3, 0)
    elif wrap == "periodic":
        segments = np.where(counts >= 3, counts, 0)
    elif wrap == "pinned":
        segments = np.where(counts >= 2, counts - 1, 0)
    else:
        segments = np.maximum(counts - 3, 0)
    kept = np.flatnonzero(segments > 0)
    varying = np.where(segments > 0, segments + (0 if wrap == "periodic" else 1), 0)
    return Strands(
        basis=basis,
        wrap=wrap,
        kept=kept,
        counts=counts[kept],
        starts=(np.cumsum(counts) - counts)[kept],
        segments=segments[kept],
        varying_starts=(np.cumsum(varying) - varying)[kept],
        sizes={
            "constant": 1,
            "uniform": len(counts),
            "varying": int(varying.sum()),
            "vertex": int(counts.sum()),
        },
    )


def lay_out_points(count: int) -> Strands:
    """Returns a layout in which each point is a curve of one segment, for primvars of points."""
    every = np.arange(count)
    one = np.ones(count, np.intp)
    sizes = {"constant": 1, "varying": count, "vertex": count}
    return Strands("linear", "periodic", every, one, every, one, every, sizes)


MIN_SHARE = 1.0 / 256.0
"""Smallest fraction of strands that is kept."""


class StrandDetail:
    """Stochastic simplification of thin strands for one camera view.

    Strands narrower than ``pixels`` are kept with probability width / ``pixels`` and widened by the
    inverse of this probability, which preserves coverage (Cook, Halstead, Planck and Ryu 2007). The
    choice depends on the strand's index in the prim, so that a larger distance removes further
    strands but restores none.
    """

    def __init__(self, view: ViewSize, pixels: float, report: LoadReport) -> None:
        """``pixels`` is the width in pixels below which strands are removed or widened."""
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
        """Returns the strands that are kept, and the widening factor of each.

        Args:
            path: Path of the prim.
            strands: All strands.
            points: (n, 3) authored points.
            widths: (k,) largest width of each strand, in units of the points.
            matrix: Transform from the prim to the world.
        """
        share = np.clip(self._pixels(strands, points, widths, matrix) / self.target, 0.0, 1.0)
        share = np.maximum(share, MIN_SHARE)
        kept = hash_to_unit(strands.kept) < share
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
        """Returns the width of each strand in pixels at its point closest to the camera."""
        to_world = np.array(matrix)
        size = np.cbrt(abs(np.linalg.det(to_world[:3, :3])))
        nearest = strands.over_each(np.minimum, self.view.distances(points, to_world))
        wide = widths * (size * self.view.per_length)
        return np.asarray(wide / np.maximum(nearest, 1e-30), np.float64)


def hash_to_unit(numbers: NDArray[np.intp]) -> NDArray[np.float64]:
    """Maps integers to pseudo-random numbers in [0, 1) with the finaliser of SplitMix64."""
    with np.errstate(over="ignore"):
        x = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    return np.asarray((x >> np.uint64(11)).astype(np.float64) * 2.0**-53, np.float64)
