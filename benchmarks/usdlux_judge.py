# SPDX-License-Identifier: Apache-2.0
"""Test whether an image equals a reference within the noise of both.

Our image consists of several independent renders, called batches. The reference is a single image
with an unknown number of samples. The joint noise of both images is estimated per block from the
differences between neighbouring pixels of *reference - ours*, and is at least the noise of our
image, which is known from its batches. Other differences between neighbouring pixels, such as
differently filtered outlines, therefore count as noise.

Noise is assumed to be independent between pixels, so that the variance of a block is the sum over
its pixels. Deviations of blocks in standard errors are assumed to be normally distributed.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 16
MEAN_LIMIT = 0.005
SIGNIFICANCE = 0.01
"""Significance level for all blocks of an image together, by Sidak's correction."""
ROUNDING = 1e-3
"""Blocks agree if they differ by less than this fraction of their value or of a hundredth of the
image mean. This tolerance covers negligible differences, for example due to half floats or spheres
with 50 faces around.
"""


@dataclass(frozen=True)
class Verdict:
    """Result of testing one image against its reference.

    Attributes:
        difference: Relative difference between the means of the image and the reference.
        worst: Largest deviation of a block, in standard errors, among blocks that differ by more
            than rounding.
        limit: Limit of ``worst``.
        outside: Number of pairs of a block and a channel whose deviation exceeds `limit`.
        blocks: Number of all pairs of a block and a channel.
        noise: Standard error of `difference`, from the noise of both images.
        place: Column and row of the worst block, in blocks.
        excess: Relative difference between the two images in the worst block.
    """

    difference: float
    worst: float
    limit: float
    outside: int
    blocks: int
    noise: float
    place: tuple[int, int]
    excess: float

    @property
    def mean_agrees(self) -> bool:
        """Whether the means agree within half a per cent."""
        return abs(self.difference) <= MEAN_LIMIT

    @property
    def mean_is_open(self) -> bool:
        """Whether the means differ by over 0.5 %, but by at most 0.5 % plus 3 standard errors."""
        return 0 < abs(self.difference) - MEAN_LIMIT <= 3 * self.noise

    @property
    def agrees(self) -> bool:
        """Whether the means agree and each block is within noise."""
        return self.mean_agrees and self.outside == 0


def blocks_of(image: Array, size: int = BLOCK) -> Array:
    """Means over blocks, (rows, columns, channels); incomplete blocks are dropped."""
    rows, columns = image.shape[0] // size, image.shape[1] // size
    cut = image[: rows * size, : columns * size]
    return np.asarray(cut.reshape(rows, size, columns, size, -1).mean((1, 3)))


def judge(batches: Array, reference: Array, size: int = BLOCK) -> Verdict:
    """Compare n >= 2 independent renders, (n, height, width, 3), with a reference."""
    ours = batches.mean(0)
    own = batches.var(0, ddof=1) / len(batches)  # variance of each pixel's mean over the batches
    residual = reference - ours
    # Expected variance of the difference between the two images if they differ only by noise.
    steps = np.diff(residual, axis=1) ** 2 / 2
    both = blocks_of(np.concatenate([steps, steps[:, -1:]], axis=1), size)
    variance = np.maximum(both, blocks_of(own, size)) / size**2
    mine, theirs = blocks_of(ours, size), blocks_of(reference, size)
    mean = max(float(theirs.mean()), 1e-12)
    excess = (mine - theirs) / np.maximum(np.abs(theirs), 0.01 * mean)
    z = np.where(np.abs(excess) > ROUNDING, mine - theirs, 0.0) / np.sqrt(variance + 1e-30)
    level = -np.expm1(np.log1p(-SIGNIFICANCE) / z.size)
    limit = NormalDist().inv_cdf(1 - level / 2)
    row, column, channel = np.unravel_index(np.abs(z).argmax(), z.shape)
    return Verdict(
        difference=float(ours.mean() / reference.mean() - 1),
        worst=float(np.abs(z).max()),
        limit=limit,
        outside=int((np.abs(z) > limit).sum()),
        blocks=z.size,
        noise=float(np.sqrt(variance.mean() / z[..., 0].size)) / mean,
        place=(int(column), int(row)),
        excess=float(excess[row, column, channel]),
    )
