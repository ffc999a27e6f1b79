# SPDX-License-Identifier: Apache-2.0
"""Whether a picture of ours is a reference's, but for noise.

Ours comes as independent renders (batches). A reference is one picture whose samples are not known:
its noise is what is left of the differences between neighbouring pixels of *reference - ours* when
ours has its share taken off, block by block. (What is no noise but changes from pixel to pixel, as
an outline that is filtered in another way, counts as such there.)

Both noises are taken as independent from pixel to pixel, so that the variance of a block is the sum
of those of its pixels, with the freedom of all: z is a normal deviate.
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
"""Of all blocks of a picture together, by Sidak."""
ROUNDING = 1e-3
"""A block that differs by less of its own value, or of a hundredth of the picture's mean, agrees:
half floats, 50 faces around a sphere, and what else is no noise and no matter."""


@dataclass(frozen=True)
class Verdict:
    """What came of one picture.

    Attributes:
        difference: Of the mean to the reference's, relative.
        worst: The largest deviate of a block among those that differ by more than rounding.
        limit: What it may be.
        outside: Blocks and channels beyond it.
        blocks: All of them.
        noise: One standard error of the mean, relative, of both pictures.
        place: Column and row of the worst block, in blocks.
        excess: Relative difference there.
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
        """Whether the means are within half a percent."""
        return abs(self.difference) <= MEAN_LIMIT

    @property
    def mean_is_open(self) -> bool:
        """Whether the means are further apart than that, but by three standard errors at most."""
        return 0 < abs(self.difference) - MEAN_LIMIT <= 3 * self.noise

    @property
    def agrees(self) -> bool:
        """Whether that holds and each block is within noise."""
        return self.mean_agrees and self.outside == 0


def blocks_of(image: Array, size: int = BLOCK) -> Array:
    """Means over blocks, (rows, columns, channels); a rest at the edges is left out."""
    rows, columns = image.shape[0] // size, image.shape[1] // size
    cut = image[: rows * size, : columns * size]
    return np.asarray(cut.reshape(rows, size, columns, size, -1).mean((1, 3)))


def judge(batches: Array, reference: Array, size: int = BLOCK) -> Verdict:
    """Compares ours, (n, height, width, 3) of n >= 2 independent renders, with a reference."""
    ours = batches.mean(0)
    own = batches.var(0, ddof=1) / len(batches)  # of the mean, per pixel
    residual = reference - ours
    steps = np.diff(residual, axis=1) ** 2 / 2  # the variance of both, where that is all there is
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
