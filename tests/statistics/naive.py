# SPDX-License-Identifier: Apache-2.0
"""Compare random scenes with the naive integrator (tests/naive), which shares no sampling code.

    .venv/bin/python tests/statistics/naive.py 17                    # one seed, with its images
    .venv/bin/python tests/statistics/naive.py --from 0 --count 500  # many; exit code 1 on a fault

Both integrators render batches with different random numbers. Means over blocks of 4 x 4 pixels and
over the image are compared per channel by Welch's t. Suspicious results (|z| of 3.3 or more) are
rendered again with new random numbers and 12 times the samples, and if still suspicious with 60
times. Only a difference beyond the limit each time is a fault; the level is Sidak's correction of 1
% for all scenes of a run. Repetition is needed because the mean is usually too low if uniform
directions seldom find the light; more samples reduce this effect.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "statistics")]

from agreement import Array, welch  # noqa: E402
from random_scenes import RandomScene, make_scene  # noqa: E402
from scipy import stats  # noqa: E402

SIZE, BLOCK, BATCHES = 12, 4, 10
SPP, SAMPLES, DIRECTIONS = 96, 12, 4
"""Samples per batch of both integrators, and directions of the naive one at the first vertex."""
SUSPICION = 3.3
MORE = (12, 60)
LEVEL = 0.01
TRIES = 64
"""Number of sample values with which the naive integrator searches for delta lobes."""


def naive_module() -> ModuleType:
    """Import the naive integrator of this build.

    Raises:
        ImportError: The module is not built, or older than the core.
    """
    import wavecomb._core  # noqa: F401  # its scenes are taken

    for folder in sorted(ROOT.glob("build/*/tests/naive")):
        for module in folder.glob("wavecomb_naive*.so"):
            core = folder.parents[1] / "libwavecomb.a"
            if core.exists() and core.stat().st_mtime > module.stat().st_mtime:
                # An older module could expect a different memory layout of scenes.
                raise ImportError("it is older than the core; run make build-test-tools")
            sys.path.insert(0, str(folder))
            return importlib.import_module("wavecomb_naive")
    raise ImportError("it is not built; run make build-test-tools")


@dataclass(frozen=True)
class Comparison:
    """Images of one scene by both integrators, as batches, and their differences.

    Attributes:
        ours: Images of Wavecomb, (n, height, width, 3).
        naive: Images of the naive integrator.
        z: Deviates of blocks and of the whole image, flat; positive if Wavecomb is brighter.
        events: Number of contributions of size ``contribution`` that make up each difference, flat.
        contribution: Largest ``typical_contribution`` of a pixel in either image, per channel.
        difference: Relative difference of the mean image per channel.
        error: Standard error of ``difference``.
    """

    ours: Array
    naive: Array
    z: Array
    events: Array
    contribution: Array
    difference: Array
    error: Array

    @property
    def worst(self) -> float:
        """Largest magnitude of z."""
        return float(np.abs(self.z).max())

    def of_mean(self) -> Comparison:
        """The comparison of the image means only."""
        return replace(self, z=self.z[-3:], events=self.events[-3:])

    def is_fault(self, scenes: int) -> bool:
        """Whether the difference is too large to be chance, given the number of scenes."""
        return self.worst > limit(self.z.size * scenes)

    def is_sure(self, scenes: int) -> bool:
        """Whether a difference exceeds both normal noise and the effect of a few rare bright paths.

        Welch's t takes the variance from the batches. Where a few paths carry most of the light, a
        render that has found none of these paths has a small variance and the wrong mean. If both
        renders expect the same number of such paths, all n paths that were found are in the same
        render with a probability of 2^(1 - n).
        """
        tests = self.z.size * scenes
        beyond = (np.abs(self.z) > limit(tests)) & (self.events > 1.0 - np.log2(level(tests)))
        return bool(beyond.any())

    def __str__(self) -> str:
        parts = zip(self.difference, self.error, strict=True)
        text = " ".join(f"{100 * d:+.2f}±{100 * e:.2f}" for d, e in parts)
        return f"largest |z| {self.worst:.1f}, mean difference {text} %"


def level(tests: int) -> float:
    """Significance level of each of ``tests`` tests, by Sidak's correction."""
    return float(-np.expm1(np.log1p(-LEVEL) / tests))


def limit(tests: int) -> float:
    """Limit of |z| for each of ``tests`` tests."""
    return float(stats.norm.isf(level(tests) / 2.0))


def typical_contribution(batches: Array, samples: int) -> Array:
    """Contribution of a path, averaged with the contribution as weight, (height, width, 3).

    The result is the ratio of variance to mean of single samples, which is E[x^2] / E[x] for rare
    paths. If all light comes from paths of one contribution, the value is that contribution.

    Args:
        batches: Images, (n, height, width, 3).
        samples: Number of samples per pixel of each image.
    """
    mean = np.abs(batches.mean(axis=0))
    return np.where(mean > 0, samples * batches.var(axis=0, ddof=1) / np.maximum(mean, 1e-300), 0.0)


def judge(
    ours: Array,
    naive: Array,
    *,
    tolerance: float = 0.0,
    samples: int = 1,
    contribution: Array | float = 0.0,
) -> Comparison:
    """Compare two images given as batches.

    Args:
        ours: Images of the first renderer, (n, height, width, 3).
        naive: Images of the second renderer.
        tolerance: Relative difference to ignore.
        samples: Number of samples per pixel of a batch, for ``Comparison.events``.
        contribution: Least value of ``Comparison.contribution``, from earlier comparisons.
    """

    def tested(x: Array) -> Array:
        n, height, width, _ = x.shape
        cut = x.reshape(n, height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3)
        blocks = cut.mean(axis=(2, 4)).reshape(n, -1)
        return np.concatenate([blocks, x.mean(axis=(1, 2))], axis=1)

    a, b = tested(ours), tested(naive)
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    brightness = np.maximum(np.maximum(np.abs(mean_a), np.abs(mean_b)), 1e-6)
    error2 = a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)
    noisy = error2 > (1e-5 * brightness) ** 2
    z = welch(a, b, tolerance * brightness, noisy)
    relative = (mean_a - mean_b) / brightness
    # Without noise, only rounding may differ.
    z = np.where(
        noisy, z, np.where(np.abs(relative) > tolerance + 1e-3, 99.0 * np.sign(relative), 0.0)
    )
    typical = [typical_contribution(x, samples).max(axis=(0, 1)) for x in (ours, naive)]
    largest = np.maximum(np.maximum(*typical), contribution)
    # A contribution changes the mean of a block by its size over the samples of the block.
    counts = np.full(a.shape[1], len(a) * samples * BLOCK**2)
    counts[-3:] = len(a) * samples * ours[0, ..., 0].size
    size = np.maximum(np.resize(largest, a.shape[1]), 1e-300)
    excess = np.maximum(np.abs(mean_a - mean_b) - tolerance * brightness, 0.0)
    error = (np.sqrt(error2) / brightness)[-3:]
    return Comparison(ours, naive, z, excess * counts / size, largest, relative[-3:], error)


def compare(scene: RandomScene, *, more: int = 1, first_seed: int = 0) -> Comparison:
    """Render a scene with both integrators, with ``more`` times as many samples."""
    import wavecomb

    module = naive_module()
    loaded = wavecomb.load(scene.stage, **scene.load)
    fresnel = "schlick" if scene.schlick else "exact"

    def ours(seed: int) -> NDArray[Any]:
        return wavecomb.render(
            loaded,
            size=(SIZE, SIZE),
            spp=SPP * more,
            max_depth=scene.depth,
            seed=seed,
            filter="box",
            filter_width=1.0,
            fresnel=fresnel,
            threads=1,
            **scene.settings,
        ).beauty

    def naive(seed: int) -> NDArray[Any]:
        return module.render(
            loaded.scene,
            width=SIZE,
            height=SIZE,
            samples=SAMPLES * more,
            max_depth=scene.depth,
            directions=DIRECTIONS,
            delta_tries=TRIES if scene.delta else 0,
            seed=seed,
            schlick_fresnel=scene.schlick,
        )

    seeds = range(first_seed, first_seed + BATCHES)
    return judge(
        np.stack([np.asarray(ours(s), np.float64) for s in seeds]),
        np.stack([naive(s) for s in seeds]),
    )


def examine(scene: RandomScene) -> Comparison:
    """Compare, and repeat with more samples and new random numbers if the result is suspicious."""
    found = compare(scene)
    for turn, more in enumerate(MORE, 1):
        if found.worst < SUSPICION:
            break
        found = compare(scene, more=more, first_seed=1000 * turn)
    return found


def save(found: Comparison, folder: Path) -> None:
    """Write both images as EXR files, and side by side with z as a PNG."""
    from agreement import picture_of

    from wavecomb.image.files.exr import write_exr

    for name, batches in (("ours", found.ours), ("naive", found.naive)):
        layers = {"beauty": batches.mean(axis=0).astype(np.float32)}
        write_exr(folder / f"{name}.exr", layers)
    count = (SIZE // BLOCK) ** 2
    z = found.z[: 3 * count].reshape(SIZE // BLOCK, SIZE // BLOCK, 3)
    z = np.repeat(np.repeat(z, BLOCK, axis=0), BLOCK, axis=1)
    picture_of(folder / "pictures.png", found.ours, found.naive, z)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("seed", nargs="?", type=int, help="seed of a single scene")
    parser.add_argument("--from", dest="first", type=int, default=0, metavar="SEED")
    parser.add_argument(
        "--count", type=int, default=30, help="number of scenes, if no seed is given"
    )
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "out" / "naive")
    options = parser.parse_args()
    one = options.seed is not None
    seeds = [options.seed] if one else range(options.first, options.first + options.count)
    faults = 0
    for seed in seeds:
        with tempfile.TemporaryDirectory() as temporary:
            folder = options.out / str(seed) if one else Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.iterdir():
                old.unlink()
            scene = make_scene(seed, folder)
            begin = time.process_time()
            found = compare(scene, more=MORE[0], first_seed=1000) if one else examine(scene)
            bad = found.is_fault(len(seeds))
            faults += bad
            if one:
                save(found, folder)
        seconds = time.process_time() - begin
        if bad or one:
            print(f"{seed}: {'FAULT' if bad else 'agrees'}: {found} ({seconds:.1f} s)")
            print(f"    {', '.join(scene.features)}; depth {scene.depth}", flush=True)
    print(f"{len(seeds)} scenes, {faults} faults" + (f"; {options.out / str(seed)}" if one else ""))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
