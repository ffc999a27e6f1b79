# SPDX-License-Identifier: Apache-2.0
"""Statistical test whether two noisy images with known variances have equal expectations."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.extras import needed
from wavecomb.image.compare.comparison import colour_layer, colour_pair, layers_of

if TYPE_CHECKING:
    from wavecomb.image.compare.comparison import Source

Array = NDArray[np.float64]
TILE = 8
SIGNIFICANCE = 0.01
ROUNDING = 1e-5


@dataclass(frozen=True)
class ZTest:
    """Result of ``z_test``.

    Attributes:
        agrees: Whether ``p_value`` is at least the level ``significance``.
        p_value: Smallest p-value of all tiles, of the image mean and of all channels, after Sidak's
            correction.
        tests: Number of combined tests, (tiles + 1) x channels.
        significance: Significance level.
        tile: Edge of the tiles in pixels.
        worst_tile: Column and row, in pixels, of the tile with the smallest p-value; None if the
            p-value of the image mean is smaller.
        mean_z: Deviate of the image mean for each channel, in standard errors.
        pixels_accepted: Fraction of pixel values whose p-value is above the Sidak level for a test
            of all pixel values.
        p_pixels: p-values of pixels, with shape (height, width, channels).
        z_pixels: Deviates (A - B) of pixels in standard errors; 0 for pixels without variance.
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
        """Returns all results that can be written as JSON, without the per-pixel arrays."""
        names = [f.name for f in dataclasses.fields(self) if f.repr]
        return {name: getattr(self, name) for name in names}


def sidak(p: float, tests: int) -> float:
    """Returns 1 - (1 - p)^n, the probability that the smallest of n p-values is at most p.

    This holds for independent p-values.

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
    """Tests the hypothesis that A and B have the same expectation.

    The deviate is z = (A - B) / sqrt(var A + var B), and the p-value is 2 (1 - Phi(|z|)). Both are
    computed for the image mean and for means over tiles, which have less noise than pixels. Sidak's
    correction combines all p-values. Each variance is the variance of a pixel's mean, not of one
    sample. The test treats variances as exact, so they should come from at least about 30
    independent renders. The test treats pixels as independent, and is therefore too strict if the
    pixel filter is wider than a pixel.

    If both variances are 0, a relative difference of up to 1e-5 counts as a rounding error.

    Args:
        a: Image under test.
        b: Reference image.
        variance_a: Variance of A's pixels, with the shape of A; None means that A has no noise.
        variance_b: Variance of B's pixels, with the shape of B; None means that B has no noise.
        tile: Side of a tile in pixels.
        significance: Significance level.

    Raises:
        ValueError: Both variances are missing, sizes differ, or a variance is negative or not
            finite.
    """
    special = needed("scipy.special", "the z-test")
    if variance_a is None and variance_b is None:
        raise ValueError("the z-test needs a variance image of A or B")
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
            f"the variance of {name} has the shape {variance.shape}, the image {like.shape}"
        )
    if not (np.isfinite(variance).all() and (variance >= 0).all()):
        raise ValueError(f"the variance of {name} has values that are negative or not finite")
    return variance


def _tile_sums(values: Array, tile: int) -> Array:
    """Returns sums over tiles. Tiles at the right and bottom edges may be smaller."""
    rows = np.arange(0, values.shape[0], tile)
    columns = np.arange(0, values.shape[1], tile)
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
