# SPDX-License-Identifier: Apache-2.0
"""Whether two noisy pictures can be of the same scene, given the variance of their pixels."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.extras import needed
from wavecomb.picture.compare import colour_layer, colour_pair, layers_of

if TYPE_CHECKING:
    from wavecomb.picture.compare import Source

Array = NDArray[np.float64]
TILE = 8
SIGNIFICANCE = 0.01
ROUNDING = 1e-5


@dataclass(frozen=True)
class ZTest:
    """What ``z_test`` found.

    Attributes:
        agrees: ``p_value`` is at least ``significance``.
        p_value: The least p-value over tiles, the picture's mean and their channels, times Sidak.
        tests: How many values that is the least of: (tiles + 1) x channels.
        significance: The level of ``agrees``.
        tile: Side of a tile in pixels.
        worst_tile: Column and row of the tile with the least p, in pixels; None if it is the mean.
        mean_z: Deviate of the mean of the whole picture, for each channel.
        pixels_accepted: Share of pixels and channels with p above Sidak's level for their number.
        p_pixels: p-values of pixels, (height, width, channels).
        z_pixels: Their deviates, A - B in standard errors; 0 where neither has noise.
    """

    agrees: bool
    p_value: float
    tests: int
    significance: float
    tile: int
    worst_tile: tuple[int, int] | None
    mean_z: tuple[float, ...]
    pixels_accepted: float
    p_pixels: Array = field(repr=False, compare=False)
    z_pixels: Array = field(repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """The figures without those of pixels, for JSON."""
        names = [f.name for f in dataclasses.fields(self) if f.repr]
        return {name: getattr(self, name) for name in names}


def sidak(p: float, tests: int) -> float:
    """The chance that the least of so many independent p-values is at most p: 1 - (1 - p)^n.

    >>> round(sidak(0.01, 5), 6)
    0.04901
    """
    return float(-np.expm1(tests * np.log1p(-min(p, 1.0)))) if p < 1.0 else 1.0


def z_test(
    a: Source,
    b: Source,
    *,
    variance_a: Source | None = None,
    variance_b: Source | None = None,
    tile: int = TILE,
    significance: float = SIGNIFICANCE,
) -> ZTest:
    """Tests that A and B have the same expectation.

    z = (A - B) / sqrt(var A + var B), p = 2 (1 - Phi(|z|)), for means over tiles, which see a
    tile's side less of the noise, and over the picture; Sidak's correction makes one p-value of
    all. Variances are of each pixel's *mean* (of the picture as it is, not of one sample) and taken
    as known, so they should come from some 30 independent renders or more. Pixels are taken as
    independent; a filter wider than a pixel makes the test too strict.

    Where neither has any noise, a difference of up to 1e-5 of the value is rounding.

    Args:
        a: Picture under test.
        b: Reference.
        variance_a: Variance of A's pixels, of its size; None: exact.
        variance_b: Likewise of B.
        tile: Side in pixels.
        significance: Of the verdict.

    Raises:
        ValueError: No variance, other sizes, or a variance that is negative or not finite.
    """
    special = needed("scipy.special", "the z-test")
    if variance_a is None and variance_b is None:
        raise ValueError("the z-test needs a variance picture of A or of B")
    if tile < 1:
        raise ValueError(f"a tile has a side of at least 1 pixel, not {tile}")
    pixels_a, pixels_b = (p.astype(np.float64) for p in colour_pair(a, b))
    variance = _variance(variance_a, pixels_a, "A") + _variance(variance_b, pixels_b, "B")
    finite = np.isfinite(pixels_a) & np.isfinite(pixels_b)
    difference = np.where(finite, pixels_a, 0) - np.where(finite, pixels_b, 0)
    variance = np.where(finite, variance, 0)
    size = np.where(finite, np.abs(pixels_b), 0)

    def tested(d: Array, v: Array, s: Array) -> tuple[Array, Array]:
        noisy = v > 0
        z = np.where(noisy, d / np.sqrt(np.where(noisy, v, 1)), 0)
        quiet = np.where(np.abs(d) <= ROUNDING * s, 1.0, 0.0)
        return z, np.where(noisy, 2 * special.ndtr(-np.abs(z)), quiet)

    z_pixels, p_pixels = tested(difference, variance, size)
    sums = [_tile_sums(values, tile) for values in (difference, variance, size)]
    _, p_tiles = tested(*sums)
    mean_z, p_mean = tested(*(values.sum(axis=(0, 1)) for values in sums))
    tests = p_tiles.size + p_mean.size
    at = np.unravel_index(int(p_tiles.argmin()), p_tiles.shape)
    p_value = sidak(min(float(p_tiles.min()), float(p_mean.min())), tests)
    level = 1.0 - (1.0 - significance) ** (1.0 / p_pixels.size)
    return ZTest(
        agrees=p_value >= significance,
        p_value=p_value,
        tests=tests,
        significance=significance,
        tile=tile,
        worst_tile=(int(at[1]) * tile, int(at[0]) * tile) if p_tiles.min() < p_mean.min() else None,
        mean_z=tuple(float(z) for z in mean_z),
        pixels_accepted=float((p_pixels >= level).mean()),
        p_pixels=p_pixels,
        z_pixels=z_pixels,
    )


def _variance(source: Source | None, like: Array, name: str) -> Array:
    if source is None:
        return np.zeros_like(like)
    variance = colour_layer(layers_of(source), f"the variance of {name}").astype(np.float64)
    if variance.shape != like.shape:
        raise ValueError(
            f"the variance of {name} has the shape {variance.shape}, the picture {like.shape}"
        )
    if not (np.isfinite(variance).all() and (variance >= 0).all()):
        raise ValueError(f"the variance of {name} has values that are negative or not finite")
    return variance


def _tile_sums(values: Array, tile: int) -> Array:
    """Sums over tiles; those at the right and the bottom may be smaller."""
    rows = np.arange(0, values.shape[0], tile)
    columns = np.arange(0, values.shape[1], tile)
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
