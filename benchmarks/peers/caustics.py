# SPDX-License-Identifier: Apache-2.0
"""Compare caustics at equal time with Mitsuba 3 (path, ptracer) and Cycles (with and without MNEE).

    benchmarks/peers/setup                      # once: Cycles, in a separate environment
    python benchmarks/peers/caustics.py caustics lens pool prism --seconds 20
    python benchmarks/peers/caustics.py caustics --quick        # check that it runs

A pilot render determines how many samples each renderer takes in ``--seconds``. The renderers then
run in rounds of shuffled order. A contact sheet shows the reference and then the images, three to a
row. The reference is rendered by Wavecomb with other seeds and with light paths merged within half
a pixel. relMSE is the mean of (x - r)^2 / (r^2 + 0.01 mean(r)^2) without the worst thousandth of
the pixels, for the whole image and
for the caustics: pixels whose light in the reference comes mostly from light paths. Materials are
converted as mitsuba_bridge.py and cycles_bridge.py describe. Where the material of another renderer
is an approximation, its error includes the resulting difference, so image means are printed as
well. Mitsuba's ptracer has no MIS and cannot render what the camera sees through glass.
"""

from __future__ import annotations

import argparse
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from renderers import ROOT, Job, Process
from report import commit, machine

sys.path.insert(0, str(ROOT / "benchmarks"))
from pictures import white_of, write_row
from sitting import ratio, show, summary, write_result

from wavecomb.image.compare.comparison import trimmed_mean

STAGES = ("caustics", "lens", "pool", "prism", "landscape")
COLUMNS: dict[str, tuple[str, dict[str, Any]]] = {
    "wavecomb path": ("wavecomb", {"transport": "path"}),
    "wavecomb light": ("wavecomb", {"transport": "light"}),
    "wavecomb merged": ("wavecomb", {"transport": "light", "merge_radius": 1.0}),
    "wavecomb auto": ("wavecomb", {"transport": "auto"}),
    "mitsuba path": ("mitsuba-llvm-multijitter", {}),
    "mitsuba ptracer": ("mitsuba-llvm-ptracer", {}),
    "cycles": ("cycles", {}),
    "cycles MNEE": ("cycles-shadow-caustics", {}),
}
REFERENCE_SEED, TRIAL_SEED = 1_000_003, 1_000_033
Image = NDArray[np.float64]


def main() -> None:
    """Run the benchmark, print a table, write images and JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+", choices=STAGES)
    parser.add_argument("--columns", nargs="+", default=list(COLUMNS), choices=list(COLUMNS))
    parser.add_argument("--seconds", type=float, default=20.0, help="time of each render")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--size", type=int, default=320, help="image edge in pixels")
    parser.add_argument("--max-depth", type=int, default=8)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--reference", type=int, default=8192, help="samples per pixel")
    parser.add_argument("--cache", type=Path, default=ROOT / "out" / "peers")
    parser.add_argument("--pictures", type=Path, help="folder for the sheets of images")
    output = ROOT / "benchmarks" / "results" / "peers-caustics.json"
    parser.add_argument("--output", type=Path, default=output)
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    args = parser.parse_args()
    if args.quick:
        args.seconds, args.rounds, args.size, args.reference = 0.5, 1, 64, 256
        args.output = args.cache / "quick-caustics.json"
    args.cache.mkdir(parents=True, exist_ok=True)
    args.pictures = args.pictures or args.cache
    args.pictures.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = {}
    for name in args.stages:
        found[name] = measure(name, args)
        content = {"size": args.size, "rounds": args.rounds, "seconds": args.seconds}
        content |= {**commit(), "machine": machine(), "stages": found}
        write_result(args.output, "wavecomb-peers-caustics/1", content)


def measure(name: str, args: argparse.Namespace) -> dict[str, Any]:
    """Return all results of one stage, and write its sheet of images."""
    job = prepare(name, args)
    truth, mask = reference(job, args)
    scale = 1.0 / (truth**2 + 0.01 * float(truth.mean()) ** 2)
    costs: dict[str, dict[str, list[float]]] = {
        column: {"whole": [], "caustics": [], "spp": [], "seconds": []} for column in args.columns
    }
    shown: dict[str, Image] = {}
    shuffle = random.Random(name)
    spp: dict[str, int] = {}
    for number in range(args.rounds):
        for column in shuffle.sample(args.columns, len(args.columns)):
            process = opened(column, job, args)
            if column not in spp:
                spp[column] = samples(process, args)
            image, answer = picture(process, spp[column], number, args)
            process.close()
            shown.setdefault(column, image)
            error = ((image - truth) ** 2 * scale).mean(2)
            some = error[mask] if mask.any() else np.zeros(1)
            took = float(answer["seconds"])
            costs[column]["seconds"].append(took)
            costs[column]["spp"].append(answer["spp"])
            costs[column]["whole"].append(trimmed_mean(error) * took)
            costs[column]["caustics"].append(trimmed_mean(some) * took)
    rows = [shown[column].astype(np.float32) for column in args.columns]
    sheet = args.pictures / f"beside-{name}.jpg"
    seen = truth.astype(np.float32)
    write_row(sheet, [seen, *rows], white_of(seen), columns=3)
    print(f"{name}: {sheet}: reference, {', '.join(args.columns)}", flush=True)
    out: dict[str, Any] = {}
    best = "wavecomb auto" if "wavecomb auto" in args.columns else args.columns[0]
    for column, cost in costs.items():
        out[column] = {
            "spp": cost["spp"], "seconds": summary(cost["seconds"]),
            "mean": [float(v) for v in shown[column].mean((0, 1))],
            "error_seconds": {kind: cost[kind] for kind in ("whole", "caustics")},
            "efficiency_of_ours": {
                kind: ratio(cost[kind], costs[best][kind])
                for kind in ("whole", "caustics") if min(costs[best][kind]) > 0
            },
        }  # fmt: skip
        ours = out[column]["efficiency_of_ours"]
        print(
            f"  {column:16} {np.mean(cost['spp']):7.0f} samples {np.mean(cost['seconds']):5.1f} s"
            f"  mean {np.mean(out[column]['mean']):.4f}  {best} to it: "
            + ", ".join(f"{kind} {show(value)}" for kind, value in ours.items()),
            flush=True,
        )
    return {"share": float(mask.mean()), "mean": [float(v) for v in truth.mean((0, 1))], **out}


def prepare(name: str, args: argparse.Namespace) -> Job:
    """Write the stage and its arrays, which Mitsuba and Cycles load."""
    from recording import record
    from stages import write_stage

    stage = args.cache / f"{name}.usdc"
    if not stage.exists():
        write_stage(name, stage, plain=False)
    recorded = args.cache / f"{name}-recorded"
    record(stage).save(recorded)
    return Job(stage, recorded, "", args.size, args.threads, args.max_depth)


def opened(column: str, job: Job, args: argparse.Namespace) -> Process:
    """Start the renderer of a table column and load the scene."""
    kind, options = COLUMNS[column]
    return Process(kind, job, args.cache / f"{column.replace(' ', '-')}.log", options)


def picture(
    process: Process, spp: int, seed: int, args: argparse.Namespace
) -> tuple[Image, dict[str, Any]]:
    """Return an image, and the statistics that the renderer reports."""
    file = args.cache / "caustics.npy"
    answer = process.render(spp, seed, file)
    return np.load(file).astype(np.float64), answer


def samples(process: Process, args: argparse.Namespace, spp: int = 4) -> int:
    """Return the number of samples that fit into ``--seconds``; a square number for multijitter.

    The first render takes ``spp`` samples, and those that follow four times as many each.
    """
    while True:
        process.render(spp, TRIAL_SEED)  # compiles kernels
        took = process.render(spp, TRIAL_SEED + spp)["seconds"]
        more = args.seconds / max(took, 1e-3)
        if more < 6 or spp >= args.reference:
            return max(1, round((spp * more) ** 0.5) ** 2)
        spp *= 4


def reference(job: Job, args: argparse.Namespace) -> tuple[Image, NDArray[np.bool_]]:
    """Return a converged image, and a mask of pixels that get most light from light paths."""
    import wavecomb
    from wavecomb.image.compare.comparison import luminance

    made = wavecomb.render(
        wavecomb.load(job.stage).scene, size=(args.size, args.size),
        spp=args.reference, seed=REFERENCE_SEED, transport="light", merge_radius=0.5,
        aovs=("techniques",),
        filter="box", filter_width=1.0, max_depth=args.max_depth, threads=args.threads,
    )  # fmt: skip
    truth = np.asarray(made.beauty, np.float64)
    by_light = luminance(np.asarray(made.aovs["by_light_paths"]))
    return truth, by_light > 0.5 * np.maximum(luminance(truth), 1e-12)


if __name__ == "__main__":
    main()
