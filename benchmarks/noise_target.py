# SPDX-License-Identifier: Apache-2.0
"""Measure the bias and the gain of adaptive sampling.

    .venv/bin/python benchmarks/noise_target.py
    .venv/bin/python benchmarks/noise_target.py --quick          # check that it runs

A pixel that stops as soon as its samples appear to have little noise sometimes stops too early, so
its mean is biased, mostly towards darker values. For each stage and noise target:

- `--seeds` renders stop at the target; n is the mean number of samples per pixel;
- the same number of non-adaptive renders take n samples each;
- two references with other seeds take 64 n samples each.

Results:

- total bias: relative difference between the mean brightness of the adaptive images and of the
  reference, with its standard error over seeds;
- bias / noise: root mean square of the bias of pixels, divided by the root mean square of the noise
  of one adaptive render. Bias and noise are relative to brightness, as in relMSE. The square of the
  bias is estimated as (a1 - r1) (a2 - r2), where a1 and a2 are the mean images of two halves of the
  seeds and r1 and r2 the references, so that noise does not count as bias; a negative result means
  that no bias was detected;
- error: true mean relative error of one adaptive render, which the target limits;
- gain: relMSE of the non-adaptive renders / relMSE of the adaptive renders, at equal samples.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sitting import RESULTS, ROOT, head, load_stage, log, row, write_result

import wavecomb

Stack = NDArray[np.float64]


def main() -> None:
    """Render, print the table, write the JSON."""
    args = _arguments()
    stages: dict[str, Any] = {}
    for name in args.stages:
        scene = load_stage(name, args.folder, args.triangles).scene
        for target in args.targets:
            stages[f"{name} {target:g}"] = measure(scene, target, args)
            log(f"{name}, target {target:g}: {stages[f'{name} {target:g}']}")
        write_result(
            args.output,
            "wavecomb-noise-target/1",
            {"size": args.size, "seeds": args.seeds, "most": args.most, "stages": stages},
        )
    for line in report(stages):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stages", nargs="+", default=["cornell", "mixed"], metavar="NAME")
    parser.add_argument("--targets", nargs="+", type=float, default=[0.1, 0.04])
    parser.add_argument("--size", type=int, default=96, help="image edge in pixels")
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--most", type=int, default=4096, help="samples per pixel")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--triangles", type=int, default=20_000, help="triangles of the dragon")
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "quick", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "noise_target.json")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    args = parser.parse_args()
    if args.quick:
        args.size, args.seeds, args.targets = 32, 4, [0.2]
        args.output = args.folder / "noise_target.json"
    return args


def measure(scene: Any, target: float, args: argparse.Namespace) -> dict[str, float]:
    """Return all results of one stage and target."""

    def render(seed: int, spp: int, **settings: Any) -> wavecomb.Picture:
        size = (args.size, args.size)
        return wavecomb.render(
            scene, size=size, spp=spp, seed=seed, threads=args.threads, **settings
        )

    pictures = [render(seed, args.most, noise=target) for seed in range(args.seeds)]
    samples = float(np.mean([p.samples.mean() for p in pictures]))
    adaptive = np.array([p.beauty for p in pictures], np.float64)
    plain = np.array([render(1000 + k, round(samples)).beauty for k in range(args.seeds)])
    references = [render(2000 + k, round(64 * samples)).beauty.astype(np.float64) for k in range(2)]
    truth = np.mean(references, axis=0)
    weight = 1.0 / (truth**2 + 0.01)  # of relMSE
    totals = adaptive.mean(axis=(1, 2, 3)) / truth.mean() - 1.0
    halves = [adaptive[0::2].mean(axis=0), adaptive[1::2].mean(axis=0)]
    bias2 = float(((halves[0] - references[0]) * (halves[1] - references[1]) * weight).mean())
    noise2 = float((adaptive.var(axis=0, ddof=1) * weight).mean())
    return {
        "samples": samples,
        "total_bias": float(totals.mean()),
        "total_bias_error": float(totals.std(ddof=1) / np.sqrt(len(totals))),
        "bias_to_noise": float(np.sign(bias2) * np.sqrt(abs(bias2) / noise2)),
        "told_error": float(np.mean([p.stats["error"] for p in pictures])),
        "true_error": float(np.abs(adaptive - truth).mean() / truth.mean()),
        "gain": _rel_mse(plain, truth, weight) / _rel_mse(adaptive, truth, weight),
    }


def _rel_mse(pictures: Stack, truth: Stack, weight: Stack) -> float:
    return float((((pictures - truth) ** 2) * weight).mean())


def report(stages: dict[str, Any]) -> list[str]:
    """Return the table as Markdown lines."""
    lines = list(
        head(
            *("stage, target", "samples a pixel", "total bias %", "bias / noise"),
            *("error told %", "true %", "gain"),
        )
    )
    for name, found in stages.items():
        lines.append(
            row(
                name,
                f"{found['samples']:.0f}",
                f"{100 * found['total_bias']:+.3f} ± {100 * found['total_bias_error']:.3f}",
                f"{found['bias_to_noise']:.2f}",
                f"{100 * found['told_error']:.1f}",
                f"{100 * found['true_error']:.1f}",
                f"{found['gain']:.2f}",
            )
        )
    return lines


if __name__ == "__main__":
    main()
