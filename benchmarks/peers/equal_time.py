# SPDX-License-Identifier: Apache-2.0
"""Compare the default settings with Mitsuba 3 and Cycles at equal time, pilot renders included.

    benchmarks/peers/setup                      # once: Cycles, in a separate environment
    python benchmarks/peers/equal_time.py @validation --seconds 5
    python benchmarks/peers/equal_time.py room-7 kitchen-3 --seconds 5 20 60
    python benchmarks/peers/equal_time.py room --quick          # check that it runs

Stages are named as in benchmarks/defaults.py, and their materials are UsdPreviewSurface. A trial
determines how many samples per pixel each renderer takes in ``--seconds``. Then the renderers take
turns in shuffled order, each with a new seed in each round, in processes that stay alive. Loading
and the compilation of kernels by Dr.Jit are not counted; calibration, pilot renders and training of
Wavecomb are.

The error of an image x is the mean of (x - r)^2 / (r^2 + 0.01) over all pixels, minus the error of
the reference r, which is the converged image of the same renderer; without the worst thousandth of
the pixels it is called trimmed. Wavecomb renders its reference with the best technique for the
stage. Mitsuba and Cycles hardly find the caustics of some stages, neither in the image nor in the
reference, so their error is too small there. Efficiency is 1 / (error x seconds).
"""

from __future__ import annotations

import argparse
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np
from caustics import picture, samples  # of this folder, not of its parent
from noise import Picture, rel_errors
from renderers import RENDERERS, ROOT, Job, Process

sys.path.insert(0, str(ROOT / "benchmarks"))
from defaults import SETS, STAGES, WAYS
from sitting import log, ratio, show, stage_file, write_result

from wavecomb.image.compare.comparison import trimmed_mean

NAMES = ("wavecomb", "mitsuba-llvm-multijitter", "cycles-no-tree")
BATCH = 256
"""Samples per pixel of one batch of a reference; a square, as multijitter requires."""
UNLIKE = {
    "candles": "wax with subsurface scattering",
    "drinks": "liquids with media",
    "fog": "a medium",
    "clouds": "a volume",
    "head": "skin with subsurface scattering, and hair",
    "head-2": "skin with subsurface scattering, and hair",
    "fur": "hair",
}
"""Stages that mitsuba_bridge.py and cycles_bridge.py cannot translate, so images would differ."""


def main() -> None:
    """Run the benchmark, print a table and write JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+", choices=[*STAGES, *SETS])
    parser.add_argument("--renderers", nargs="+", default=list(NAMES), choices=list(RENDERERS))
    parser.add_argument("--seconds", type=float, nargs="+", default=[5.0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--size", type=int, default=128, help="image edge in pixels")
    parser.add_argument("--max-depth", type=int, default=7)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--cache", type=Path, default=ROOT / "out" / "peers" / "equal")
    output = ROOT / "benchmarks" / "results" / "peers-equal-time.json"
    parser.add_argument("--output", type=Path, default=output)
    parser.add_argument("--figure", type=Path, help="SVG of the efficiency on each stage")
    parser.add_argument("--only-references", action="store_true", help="render references only")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    args = parser.parse_args()
    if args.quick:
        args.seconds, args.rounds, args.size, args.reference_spp = [0.5], 2, 32, 512
        args.cache = args.cache / "quick"
        args.output = args.cache / "equal-time.json"
    args.cache.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for name in [name for given in args.stages for name in SETS.get(given, [given])]:
        if name in UNLIKE:
            log(f"{name}: left out, since it has {UNLIKE[name]}")
            continue
        job, references, reasons = prepare(name, args)
        if args.only_references:
            continue
        for seconds in args.seconds:
            rows.append({"stage": name, "seconds": seconds, "missing": reasons})
            rows[-1] |= measure(name, job, references, seconds, args)
            content = {"size": args.size, "rounds": args.rounds, "rows": rows}
            write_result(args.output, "wavecomb-equal-time/1", content)
    if rows and args.figure:
        draw(rows, args.renderers[1:], args.figure)
    for seconds in args.seconds if rows else ():
        overall([row for row in rows if row["seconds"] == seconds], args.renderers[1:])


def prepare(
    name: str, args: argparse.Namespace
) -> tuple[Job, dict[str, tuple[Picture, Picture]], dict[str, str]]:
    """Write a stage and its arrays; return the references, and why renderers lack one."""
    from recording import record

    stage = STAGES[name]
    options = {"aspect": 1.0, "plain": True, **stage.options}
    path = stage_file(args.cache / f"{name}.usdc", stage.scene, **options)
    recorded = args.cache / f"{name}-recorded"
    if not recorded.exists():
        record(path).save(recorded)
    job = Job(path, recorded, "", args.size, args.threads, args.max_depth)
    references, reasons = {}, {}
    for renderer in args.renderers:
        try:
            references[renderer] = converged(name, renderer, job, args)
        except SystemExit as error:  # The renderer does not support the stage.
            reasons[renderer] = str(error).split(" (see ")[0]
            log(f"{name}: {reasons[renderer]}")
    return job, references, reasons


def converged(
    name: str, renderer: str, job: Job, args: argparse.Namespace
) -> tuple[Picture, Picture]:
    """Return the mean of batches with other seeds, and the variance of this mean per pixel."""
    count = max(2, args.reference_spp // BATCH)
    file = args.cache / f"{name}-{renderer}-{args.size}-{args.max_depth}-{count}.npz"
    if not file.exists():
        best = WAYS[STAGES[name].best] if renderer == "wavecomb" else {}
        process = Process(renderer, job, args.cache / f"{renderer}.log", best)
        total, squares = np.zeros(()), np.zeros(())
        for k in range(count):
            image, _ = picture(process, BATCH, 1000 + k, args)
            total, squares = total + image, squares + image**2
        process.close()
        mean = total / count
        spread = np.maximum(squares / count - mean**2, 0.0) / (count - 1)
        np.savez(file, mean=mean, spread=spread)
        log(f"{name}: reference of {renderer}")
    found = np.load(file)
    return found["mean"], found["spread"]


def errors(image: Picture, reference: tuple[Picture, Picture]) -> tuple[float, float]:
    """Return the error over all pixels and the trimmed error."""
    mean, spread = reference
    pixels = rel_errors(image, mean)
    noise = (spread / (mean**2 + 0.01)).mean(axis=2)
    return float(pixels.mean() - noise.mean()), trimmed_mean(pixels) - trimmed_mean(noise)


def measure(
    name: str,
    job: Job,
    references: dict[str, tuple[Picture, Picture]],
    seconds: float,
    args: argparse.Namespace,
) -> dict[str, Any]:
    """Render the rounds of one stage with one budget of time; return the table row."""
    processes = {r: Process(r, job, args.cache / f"{r}.log", {}) for r in references}
    trial = argparse.Namespace(seconds=seconds, reference=args.reference_spp)
    # Wavecomb decides by the number of samples whether it guides paths, so renders much shorter
    # than `seconds` do not predict the time. The second call starts with the result of the first.
    spp = {r: samples(p, trial, samples(p, trial)) for r, p in processes.items()}
    for r, process in processes.items():
        if RENDERERS[r].warm:
            process.render(spp[r], 100)
    found: dict[str, dict[str, list[float]]] = {
        r: {"spp": [], "seconds": [], "error": [], "trimmed": [], "mean": []} for r in references
    }
    shuffle = random.Random(name)
    for number in range(args.rounds):
        for r in shuffle.sample(list(processes), len(processes)):
            image, answer = picture(processes[r], spp[r], number, args)
            error, trimmed = errors(image, references[r])
            values = (answer["spp"], answer["seconds"], error, trimmed, image.mean())
            for key, value in zip(found[r], values, strict=True):
                found[r][key].append(float(value))
    for process in processes.values():
        process.close()
    out: dict[str, Any] = {"renderers": found, "efficiency": {}, "trimmed_efficiency": {}}
    ours = found.get("wavecomb")
    for r, theirs in found.items():
        log(
            f"{name} {seconds:g} s: {r:25} {spp[r]:5} samples, "
            f"{np.mean(theirs['seconds']):.2f} s, relMSE {np.mean(theirs['error']):.5f}, "
            f"trimmed {np.mean(theirs['trimmed']):.5f}, mean {np.mean(theirs['mean']):.4f}"
        )
        if ours is None or r == "wavecomb":
            continue
        for key, kind in (("efficiency", "error"), ("trimmed_efficiency", "trimmed")):
            out[key][r] = ratio(products(theirs, kind), products(ours, kind))
            # Errors of single rounds scatter where few pixels dominate, so the mean is added.
            out[key][r]["of_means"] = float(
                np.mean(products(theirs, kind)) / np.mean(products(ours, kind))
            )
        log(
            f"{name} {seconds:g} s: efficiency to {r}: {show(out['efficiency'][r], 2)}, "
            f"of means {out['efficiency'][r]['of_means']:.2f}, "
            f"trimmed {show(out['trimmed_efficiency'][r], 2)}"
        )
    return out


def products(values: dict[str, list[float]], kind: str) -> list[float]:
    """Return error x seconds of each round; errors are at least 1e-9."""
    return [
        max(error, 1e-9) * took for error, took in zip(values[kind], values["seconds"], strict=True)
    ]


def draw(rows: list[dict[str, Any]], others: list[str], path: Path) -> None:
    """Draw the efficiency relative to each renderer, for the first budget of time."""
    from matplotlib.figure import Figure

    rows = [row for row in rows if row["seconds"] == rows[0]["seconds"]]
    chart = Figure(figsize=(7, 0.9 + 0.34 * len(rows)), layout="constrained")
    axes = chart.subplots()
    height = 0.8 / len(others)
    for k, r in enumerate(others):
        found = [(i, row["efficiency"][r]["of_means"]) for i, row in enumerate(rows)
                 if r in row["efficiency"]]  # fmt: skip
        places = [i + (k - (len(others) - 1) / 2) * height for i, _ in found]
        axes.barh(places, [value for _, value in found], height, label=f"to {r}")
    axes.axvline(1, color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_yticks(range(len(rows)), [row["stage"] for row in rows])
    axes.invert_yaxis()
    axes.set_xlabel(f"efficiency of Wavecomb's defaults, {rows[0]['seconds']:g} s per image")
    axes.legend()
    chart.savefig(path, metadata={"Date": None})


def overall(rows: list[dict[str, Any]], others: list[str]) -> None:
    """Print the geometric means over the stages."""
    for key in ("efficiency", "trimmed_efficiency"):
        for r in others:
            each = [row[key][r]["of_means"] for row in rows if r in row[key]]
            if each:
                mean = float(np.exp(np.mean(np.log(each))))
                print(f"{rows[0]['seconds']:g} s: {key} to {r}: {mean:.2f} of {len(each)} stages")


if __name__ == "__main__":
    main()
