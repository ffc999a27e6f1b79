# SPDX-License-Identifier: Apache-2.0
"""Test whether two renderers produce the same image, within their noise.

Each image comes as independent renders ("batches", (n, height, width, 3)). Means and variances are
computed across batches, so the noise within a render may have any distribution. Welch's t is
computed for each pixel and channel and converted to a normal deviate z. There are three tests:

- pixels: at least 99.75 % have p above the level that Sidak's correction gives for 0.01 (Mitsuba's
  rule);
- blocks of 8 x 8 pixels, which have an eighth of the noise: all must pass, with the same
  correction;
- bias: the mean of z over blocks per channel, which detects a small bias everywhere, and the mean
  relative difference, by Welch's t across batches. The mean of z over single pixels is not used: a
  bright sample raises the estimated variance of its pixel as well, so skewed noise, which differs
  between renderers, would shift it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]
OUT = Path(__file__).resolve().parents[2] / "out" / "statistics"

SIGNIFICANCE = 0.01
MEAN_SIGNIFICANCE = 1e-3
ACCEPTED = 0.9975
BLOCK = 8


def batches(render: Callable[[int], NDArray[np.float32]], count: int, first_seed: int = 0) -> Array:
    """Render with ``count`` seeds and return the images, (count, height, width, 3)."""
    return np.stack([np.asarray(render(first_seed + k), np.float64) for k in range(count)])


@dataclass(frozen=True)
class Agreement:
    """Result of the comparison of two renderers.

    Attributes:
        accepted: Fraction of pixels and channels that pass.
        blocks: Fraction of blocks and channels that pass.
        mean_z: Mean z of blocks per channel, in units of its standard error.
        excess: Mean relative difference of the first image to the second, per channel.
        excess_error: Standard error of ``excess``.
        excess_z: ``excess`` as a normal deviate.
        z: Deviates, (height, width, 3); NaN where both images have no noise.
        quiet: Largest relative difference where both images have no noise.
    """

    accepted: float
    blocks: float
    mean_z: Array
    excess: Array
    excess_error: Array
    excess_z: Array
    quiet: float
    z: Array = field(repr=False)

    def __str__(self) -> str:
        excess = " ".join(
            f"{100 * x:+.3f}±{100 * e:.3f}"
            for x, e in zip(self.excess, self.excess_error, strict=True)
        )
        mean = " ".join(f"{m:+.2f}" for m in self.mean_z)
        return (
            f"pixels {100 * self.accepted:.3f} %, blocks {100 * self.blocks:.2f} %, "
            f"mean z of blocks {mean} (standard errors), mean difference {excess} %, "
            f"without noise {self.quiet:.1e}"
        )


def welch(a: Array, b: Array, tolerance: Array | float, noisy: NDArray[np.bool_]) -> Array:
    """Welch's t of batches along axis 0, converted to a normal deviate; NaN where not ``noisy``."""
    va, vb = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    difference = a.mean(axis=0) - b.mean(axis=0)
    difference = np.sign(difference) * np.maximum(np.abs(difference) - tolerance, 0.0)
    error2 = np.where(noisy, va + vb, 1.0)
    freedom = error2**2 / np.maximum(va**2 / (len(a) - 1) + vb**2 / (len(b) - 1), 1e-300)
    freedom = np.where(noisy, freedom, 10.0)
    p = stats.t.sf(np.abs(difference) / np.sqrt(error2), freedom)
    z = np.sign(difference) * stats.norm.isf(np.clip(p, 1e-300, 0.5))
    return np.where(noisy, z, np.nan)


def _deviates(a: Array, b: Array, tolerance: float) -> tuple[Array, Array]:
    """Return z, NaN where there is no noise, and the relative difference."""
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    level = np.maximum(np.maximum(np.abs(mean_a), np.abs(mean_b)), 1e-6)
    error2 = a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)
    noisy = error2 > (2e-5 * level) ** 2
    return welch(a, b, tolerance * level, noisy), (mean_a - mean_b) / level


def _accepted(z: Array) -> float:
    seen = z[np.isfinite(z)]
    if seen.size == 0:
        return 1.0
    level = 1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / seen.size)
    return float(np.mean(np.abs(seen) < stats.norm.isf(level / 2.0)))


def _blocks(a: Array) -> Array:
    """Means over blocks, (n, height / 8, width / 8, 3); incomplete blocks are dropped."""
    n, height, width, channels = a.shape
    rows, columns = height // BLOCK, width // BLOCK
    cut = a[:, : rows * BLOCK, : columns * BLOCK]
    return cut.reshape(n, rows, BLOCK, columns, BLOCK, channels).mean(axis=(2, 4))


def agreement(a: Array, b: Array, tolerance: float = 0.0) -> Agreement:
    """Compare two images given as batches.

    Args:
        a: (n, height, width, 3).
        b: (m, height, width, 3).
        tolerance: Relative difference to ignore, for models that differ by design.
    """
    z, relative = _deviates(a, b, tolerance)
    noisy = np.isfinite(z)
    block_a, block_b = _blocks(a), _blocks(b)
    block_z, _ = _deviates(block_a, block_b, tolerance)
    seen = np.isfinite(block_z)
    mean_z = np.where(seen, block_z, 0.0).sum(axis=(0, 1))
    mean_z /= np.sqrt(np.maximum(seen.sum(axis=(0, 1)), 1))
    # Normalise by the brightness of each block, so that dark blocks count equally.
    level = np.maximum(0.5 * (block_a + block_b).mean(axis=0), 1e-4 * b.mean())
    share_a, share_b = ((x / level).mean(axis=(1, 2)) for x in (block_a, block_b))
    excess = share_a.mean(axis=0) - share_b.mean(axis=0)
    error2 = share_a.var(axis=0, ddof=1) / len(a) + share_b.var(axis=0, ddof=1) / len(b)
    excess_z = welch(share_a, share_b, tolerance, error2 > 1e-12)
    quiet = float(np.abs(relative[~noisy]).max()) if (~noisy).any() else 0.0
    return Agreement(
        accepted=_accepted(z),
        blocks=_accepted(block_z),
        mean_z=mean_z,
        excess=excess,
        excess_error=np.sqrt(error2),
        excess_z=np.nan_to_num(excess_z),
        quiet=quiet,
        z=z,
    )


def assert_agree(name: str, a: Array, b: Array, *, tolerance: float = 0.0) -> Agreement:
    """Fail if two images differ by more than noise; save them in out/statistics.

    Args:
        name: Name of the images.
        a: Batches of Wavecomb.
        b: Batches of the other renderer.
        tolerance: As in ``agreement``.
    """
    found = agreement(a, b, tolerance)
    print(f"{name}: {found}")
    good = found.accepted >= ACCEPTED and found.blocks >= 1.0 and found.quiet <= 1e-3
    limit = stats.norm.isf((1.0 - (1.0 - MEAN_SIGNIFICANCE) ** (1.0 / 3.0)) / 2.0)
    for deviate in (found.mean_z, found.excess_z):
        good = good and bool((np.abs(deviate) < limit).all())
    if not good or os.environ.get("WAVECOMB_PICTURES"):
        files = save_pictures(name, a, b, found.z)
    assert good, f"{name}: pictures differ: {found}; look at {files}"
    return found


def save_pictures(name: str, a: Array, b: Array, z: Array) -> Path:
    """Write a, b and z side by side (z: grey is 0, red a brighter, blue a darker, range ±5)."""
    OUT.mkdir(parents=True, exist_ok=True)
    path = OUT / f"{name.replace(' ', '-')}.png"
    picture_of(path, a, b, z)
    return path


def picture_of(path: Path, a: Array, b: Array, z: Array) -> None:
    """Write a, b and z, see ``save_pictures``."""
    from wavecomb.image.files.image import write_png

    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    scale = 0.8 / max(float(np.percentile(mean_b, 98)), 1e-6)
    shown = np.clip(np.nan_to_num(z).mean(axis=2) / 10.0 + 0.5, 0.0, 1.0)
    marked = np.stack([shown, np.minimum(shown, 1.0 - shown), 1.0 - shown], axis=2)
    row = np.concatenate([mean_a * scale, mean_b * scale, marked], axis=1)
    grown = np.repeat(np.repeat(row, 4, axis=0), 4, axis=1)
    write_png(path, np.ascontiguousarray(grown, np.float32))
