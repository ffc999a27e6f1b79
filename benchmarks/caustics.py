# SPDX-License-Identifier: Apache-2.0
"""Compare the efficiency of ``--transport light`` and ``auto`` (light paths) with ``path``.

    .venv/bin/python benchmarks/caustics.py caustics pool lens prism landscape mixed dragon

For each stage, two references with different seeds are rendered first, with light paths that are
merged within half a pixel. Short renders determine how many samples each mode takes in
``--seconds``. The modes are then rendered in turn, each round with a new seed. Modes named
``merged`` have ``--merge-radius 1``, and ``unaimed`` is ``light`` with ``--light-aim off``.

Efficiency is 1 / (relMSE x seconds). relMSE is the mean of (image - reference 1) x (image -
reference 2) / (m^2 + 0.01 L^2), where m is the mean of both references and L the mean luminance of
m. The noise of the references is independent, so it does not change the expected relMSE. Seconds
are wall time, which includes training and pilot renders but not loading. Results are given for the
whole image and for the caustics: pixels where light paths contribute more than half of the
references. Trimmed errors leave out the 0.1 % of the pixels with the largest errors.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sitting import RESULTS, ROOT, log, ratio, show, stage_file, summary, write_result

import wavecomb
from wavecomb.image.compare.comparison import TRIMMED_SHARE, luminance

STAGES = ("caustics", "pool", "lens", "prism", "landscape", "mixed", "dragon")
WAYS: dict[str, dict[str, Any]] = {
    "path": {"transport": "path"},
    "light": {"transport": "light"},
    "merged": {"transport": "light", "merge_radius": 1.0},
    "unaimed": {"transport": "light", "light_aim": "off"},
    "auto": {"transport": "auto"},
    "auto merged": {"transport": "auto", "merge_radius": 1.0},
}
FIGURES = ("whole", "whole_trimmed", "caustics", "caustics_trimmed")
REFERENCE_SEEDS, TRIAL_SEED = (1_000_003, 1_000_037), 1_000_033


class Stage:
    """A stage with its references and the pixels of its caustics."""

    def __init__(self, name: str, options: argparse.Namespace) -> None:
        path = options.folder / f"caustics-{name}.usdc"
        self.scene = wavecomb.load(stage_file(path, name, triangles=options.triangles)).scene
        self.options = options
        self.references, by_light, seconds = [], [], 0.0
        for seed in REFERENCE_SEEDS:
            picture, took = self.render(
                options.reference // len(REFERENCE_SEEDS), seed,
                transport="light", merge_radius=0.5, aovs=("techniques",),
            )  # fmt: skip
            self.references.append(np.asarray(picture.beauty, np.float64))
            by_light.append(luminance(np.asarray(picture.aovs["by_light_paths"])))
            seconds += took
        log(f"{name}: references of {options.reference} samples in {seconds:.0f} s")
        self.truth = np.mean(self.references, axis=0)
        bright = luminance(self.truth)
        self.mask: NDArray[np.bool_] = np.mean(by_light, axis=0) > 0.5 * np.maximum(bright, 1e-12)
        self.scale = 1.0 / (self.truth**2 + 0.01 * float(bright.mean()) ** 2)

    def render(self, spp: int, seed: int, **settings: Any) -> tuple[wavecomb.Picture, float]:
        """Render, and return the image and the time in seconds."""
        begin = time.perf_counter()
        picture = wavecomb.render(
            self.scene,
            size=tuple(self.options.size),
            spp=spp,
            seed=seed,
            threads=self.options.threads,
            **settings,
        )
        return picture, time.perf_counter() - begin

    def samples(self, way: str) -> int:
        """Estimate from short renders how many samples the mode `way` takes in ``--seconds``."""
        spp, most = 4, self.options.reference // 4
        done, before = 0, 0.0
        while True:
            _, seconds = self.render(spp, TRIAL_SEED, **WAYS[way])
            each = max(1e-4, (seconds - before) / (spp - done))
            wanted = max(1, min(most, round(spp + (self.options.seconds - seconds) / each)))
            if wanted < 1.3 * spp or spp >= most:
                return wanted
            done, before = spp, seconds
            spp = min(wanted, 4 * spp)

    def errors(self, picture: wavecomb.Picture) -> dict[str, float]:
        """Return the relMSE of the whole image and of its caustics (0 if there are none)."""
        one, other = (np.asarray(picture.beauty, np.float64) - r for r in self.references)
        pixels = (one * other * self.scale).mean(2)
        some = pixels[self.mask] if self.mask.any() else np.zeros(1)
        return {
            "whole": float(pixels.mean()),
            "whole_trimmed": trimmed(pixels),
            "caustics": float(some.mean()),
            "caustics_trimmed": trimmed(some),
        }


def trimmed(errors: NDArray[np.float64]) -> float:
    """Return the mean of all values except the 0.1 % with the largest magnitude."""
    by_size = errors.ravel()[np.argsort(np.abs(errors), axis=None)]
    return float(by_size[: by_size.size - int(by_size.size * TRIMMED_SHARE)].mean())


def measure(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """Return all results of one stage."""
    stage = Stage(name, options)
    spp = {way: stage.samples(way) for way in options.ways}
    seconds: dict[str, list[float]] = {way: [] for way in options.ways}
    costs: dict[str, dict[str, list[float]]] = {
        way: {figure: [] for figure in FIGURES} for way in options.ways
    }
    facts: dict[str, Any] = {}
    for turn in range(options.rounds):
        first = turn % len(options.ways)
        for way in options.ways[first:] + options.ways[:first]:
            picture, took = stage.render(spp[way], turn, **WAYS[way])
            seconds[way].append(took)
            for figure, error in stage.errors(picture).items():
                costs[way][figure].append(error * took)
            stats = picture.stats
            facts[way] = {"transport": stats["transport"], "light_aiming": stats["light_aiming"]}
    ways = {}
    for way in options.ways:
        efficiency = {}
        for figure in FIGURES:
            base, own = costs[options.ways[0]][figure], costs[way][figure]
            if min(own) > 0.0:
                efficiency[figure] = ratio(base, own)
                # Ratio of the mean errors over all rounds, to which a single round with a low error
                # contributes little.
                efficiency[figure]["of_means"] = float(np.mean(base) / np.mean(own))
        ways[way] = {
            "spp": spp[way], "seconds": summary(seconds[way]), "efficiency": efficiency,
            "error_seconds": costs[way], **facts[way],
        }  # fmt: skip
    return {"caustic_share": float(stage.mask.mean()), "ways": ways}


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "stages", nargs="*", default=list(STAGES), help="names out of " + " ".join(STAGES)
    )
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--size", type=int, nargs=2, default=[320, 240])
    parser.add_argument("--seconds", type=float, default=10.0, help="time of each render")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument(
        "--reference", type=int, default=8192, help="samples per pixel of both references together"
    )
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "caustics", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "caustics.json")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    options = parser.parse_args()
    if options.quick:
        options.size, options.seconds, options.reference = [64, 48], 0.3, 256
        options.triangles, options.output = 20_000, options.folder / "caustics.json"
    results: dict[str, Any] = {}
    for name in options.stages:
        results[name] = measure(name, options)
        for way, row in results[name]["ways"].items():
            said = [
                f"{figure} {show(row['efficiency'][figure], 2)}" for figure in row["efficiency"]
            ]
            print(f"{name:10} {way:11} {row['spp']:5} spp  " + ", ".join(said), flush=True)
        content = {
            "size": options.size, "rounds": options.rounds, "seconds": options.seconds,
            "reference_spp": options.reference, "triangles": options.triangles, "stages": results,
        }  # fmt: skip
        write_result(options.output, "wavecomb-caustics/1", content)


if __name__ == "__main__":
    main()
