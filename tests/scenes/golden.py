# SPDX-License-Identifier: Apache-2.0
"""Scenes with a reference image: <Name>/{scene.usda, test.toml, ref.exr, ref_var.exr}.

`ref.exr` is the mean of independent renders by the reference integrator (scalar, depth first),
`ref_var.exr` the variance of that mean for each pixel and channel. Only tools/update_references
writes the reference images.

The tested image also consists of independent renders ("batches" with one seed each), so nothing is
assumed about the noise within a render. There are three tests:

- pixels: z = (a - ref) / sqrt(var_a + var_ref), Welch's t; at least 99.75 % of the values must pass
  at the level 0.01 with Sidak's correction;
- blocks of 8 x 8 pixels, with an eighth of the noise: all must pass, with the same correction;
- image mean: the mean of each channel must pass at a level of 0.001, which finds a small bias.

Differences below the fraction TOLERANCE of the value are ignored, since some pixels have no noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

FOLDER = Path(__file__).resolve().parent
Array = NDArray[np.float64]

REFERENCE_SEED = 100_000
REFERENCE_BATCHES = 32
TEST_BATCHES = 16
ACCEPTED = 0.9975
SIGNIFICANCE = 0.01
MEAN_SIGNIFICANCE = 1e-3
TOLERANCE = 1e-4
BLOCK = 8


@dataclass(frozen=True)
class Golden:
    """A scene and its render options.

    Attributes:
        name: Name of the scene's folder.
        size: Width and height; multiples of 8.
        reference_spp: Samples of each of the reference's 32 batches.
        spp: Samples of each of the test's 16 batches.
        settings: Settings of the reference and of the test render.
    """

    name: str
    size: tuple[int, int]
    reference_spp: int
    spp: int
    settings: dict[str, Any]

    @property
    def folder(self) -> Path:
        """Folder of the scene."""
        return FOLDER / self.name

    def batches(self, count: int, first_seed: int, spp: int, **settings: Any) -> Array:
        """Render `count` seeds, (count, height, width, 3)."""
        import wavecomb

        stage = wavecomb.load(self.folder / "scene.usda")
        assert not stage.report.warnings, stage.report.lines()
        every = self.settings | settings
        return np.stack(
            [
                wavecomb.render(stage, size=self.size, spp=spp, seed=first_seed + k, **every).beauty
                for k in range(count)
            ]
        ).astype(np.float64)

    def reference(self) -> tuple[Array, Array]:
        """Read the mean and its variance, each (height, width, 3)."""
        from wavecomb.image.files.image import read_image

        mean, variance = (
            read_image(self.folder / name).astype(np.float64) for name in ("ref.exr", "ref_var.exr")
        )
        return mean, variance

    def update(self) -> None:
        """Render the reference again with the reference integrator."""
        from wavecomb.image.files.image import write_exr

        made = self.batches(
            REFERENCE_BATCHES, REFERENCE_SEED, self.reference_spp, integrator="reference"
        )
        variance = made.var(axis=0, ddof=1) / len(made)
        note = {"wavecomb:made_by": "tools/update_references"}
        write_exr(self.folder / "ref.exr", {"beauty": made.mean(axis=0)}, metadata=note)
        write_exr(self.folder / "ref_var.exr", {"beauty": variance}, metadata=note)


def read_golden(name: str) -> Golden:
    """Read the scene in folder `name`."""
    with open(FOLDER / name / "test.toml", "rb") as file:
        table = tomllib.load(file)
    width, height = table["size"]
    assert width % BLOCK == 0 and height % BLOCK == 0, f"{name}: size is no multiple of {BLOCK}"
    return Golden(
        name, (width, height), table["reference_spp"], table["spp"], table.get("settings", {})
    )


def golden_names() -> list[str]:
    """Names of all scenes."""
    return sorted(path.parent.name for path in FOLDER.glob("*/test.toml"))


@dataclass(frozen=True)
class Verdict:
    """Result of a comparison with a reference; `good` if the images differ only by noise."""

    pixels: float
    blocks: float
    mean_z: Array
    mean_difference: Array

    @property
    def good(self) -> bool:
        """Whether the tests of pixels, of blocks and of the image's mean all pass."""
        from scipy import stats

        limit = stats.norm.isf(MEAN_SIGNIFICANCE / 6.0)
        return (
            self.pixels >= ACCEPTED
            and self.blocks >= 1.0
            and bool((np.abs(self.mean_z) < limit).all())
        )

    def __str__(self) -> str:
        difference = " ".join(f"{100 * d:+.3f}" for d in self.mean_difference)
        z = " ".join(f"{d:+.2f}" for d in self.mean_z)
        return (
            f"pixels {100 * self.pixels:.3f} %, blocks {100 * self.blocks:.2f} %, "
            f"mean {difference} % (z {z})"
        )


def _deviates(made: Array, mean: Array, variance: Array) -> Array:
    """Welch's t of batches (axis 0) against a mean of REFERENCE_BATCHES, as normal deviates."""
    from scipy import stats

    n = len(made)
    own = made.var(axis=0, ddof=1) / n
    difference = made.mean(axis=0) - mean
    slack = TOLERANCE * np.abs(mean) + 1e-7
    difference = np.sign(difference) * np.maximum(np.abs(difference) - slack, 0.0)
    error2 = np.maximum(own + variance, (0.1 * slack) ** 2)
    spread = own**2 / (n - 1) + variance**2 / (REFERENCE_BATCHES - 1)
    freedom = np.clip(error2**2 / np.maximum(spread, 1e-60), 1.0, 1e6)
    p = stats.t.sf(np.abs(difference) / np.sqrt(error2), freedom)
    return np.sign(difference) * stats.norm.isf(np.clip(p, 1e-300, 0.5))


def _accepted(z: Array) -> float:
    from scipy import stats

    level = 1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / z.size)
    return float(np.mean(np.abs(z) < stats.norm.isf(level / 2.0)))


def _blocks(a: Array) -> Array:
    """Return means over blocks of the two axes before the last."""
    *rest, height, width, channels = a.shape
    cut = a.reshape(*rest, height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels)
    return cut.mean(axis=(-4, -2))


def verdict(made: Array, mean: Array, variance: Array) -> Verdict:
    """Test batches (n, height, width, 3) against a reference."""
    pixels = _accepted(_deviates(made, mean, variance))
    # Pixels are independent, so the variance of a mean of m pixels is the mean variance / m.
    area = BLOCK * BLOCK
    blocks = _accepted(_deviates(_blocks(made), _blocks(mean), _blocks(variance) / area))
    count = mean.shape[0] * mean.shape[1]
    whole, whole_mean = made.mean(axis=(1, 2)), mean.mean(axis=(0, 1))
    z = _deviates(whole, whole_mean, variance.mean(axis=(0, 1)) / count)
    return Verdict(pixels, blocks, z, whole.mean(axis=0) / whole_mean - 1.0)


def each(names: list[str]) -> Iterator[Golden]:
    """Yield the scenes with the given names, or all scenes if no names are given."""
    for name in names or golden_names():
        yield read_golden(name)
