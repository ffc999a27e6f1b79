# SPDX-License-Identifier: Apache-2.0
"""Compare light selection by tree with selection by power, for increasing numbers of lights.

    .venv/bin/python benchmarks/light_selection.py
    .venv/bin/python benchmarks/light_selection.py --quick       # check that it runs

Uses the street of `wavecomb scene lights`, which has the same total light for any number of lights
from 10 to 10,000. For each number of lights, each of `--rounds` rounds has one render by power and
one by tree with the same seed. Errors are those of the layer `direct`, and of `direct` plus
`indirect`; lights that the camera sees directly do not depend on selection. Most of the error of
indirect light comes from rare paths that end close to a light, which light selection cannot find.

Results are ratios of selection by tree to selection by power unless stated otherwise:

- error: relMSE against a render by tree with `--reference` samples per pixel;
- time: render seconds, median of the rounds with its 95 % interval;
- efficiency: error x time by power / error x time by tree, which is the ratio of errors at equal
  time, for direct light and for all light;
- us a sample: microseconds per sample with selection by tree, for all threads together.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from sitting import RESULTS, ROOT, head, log, ratio, row, show, stage_file, write_result

import wavecomb

Layers = dict[str, np.ndarray]


def main() -> None:
    """Render, print the table, write the JSON."""
    args = _arguments()
    found: dict[str, Any] = {}
    for count in args.lights:
        found[str(count)] = measure(count, args)
        log(f"{count} lights: {found[str(count)]}")
        content = {"size": args.size, "spp": args.spp, "rounds": args.rounds, "lights": found}
        write_result(args.output, "wavecomb-light-selection/1", content)
    for line in report(found):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lights", nargs="+", type=int, default=[4, 10, 100, 1000, 10_000])
    parser.add_argument("--size", nargs=2, type=int, default=[120, 80], metavar=("W", "H"))
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--reference", type=int, default=1024, help="samples per pixel")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--max-depth", type=int, default=4)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "quick", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "light_selection.json")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    args = parser.parse_args()
    if args.quick:
        args.size, args.spp, args.reference, args.rounds = [48, 32], 8, 256, 3
        args.lights = [10, 1000]
        args.output = args.folder / "light_selection.json"
    return args


def measure(count: int, args: argparse.Namespace) -> dict[str, Any]:
    """Return all results for one number of lights."""
    path = stage_file(args.folder / f"lights-{count}.usdc", "lights", lights=count)
    scene = wavecomb.load(path).scene
    size = (args.size[0], args.size[1])

    def render(selection: str, seed: int, spp: int) -> tuple[Layers, Any]:
        picture = wavecomb.render(
            scene, size=size, spp=spp, seed=seed, threads=args.threads,
            max_depth=args.max_depth, light_selection=selection, aovs=["direct", "indirect"],
        )  # fmt: skip
        direct = picture.aovs["direct"].astype(np.float64)
        return {"direct": direct, "all": direct + picture.aovs["indirect"]}, picture.stats

    truth, _ = render("tree", 1000, args.reference)
    weight = 1.0 / (truth["all"] ** 2 + 0.01 * truth["all"].mean() ** 2)
    error: dict[str, dict[str, list[float]]] = {
        kind: {"power": [], "tree": []} for kind in ("direct", "all")
    }
    seconds: dict[str, list[float]] = {"power": [], "tree": []}
    samples = 0
    for seed in range(args.rounds):
        for selection in ("power", "tree") if seed % 2 else ("tree", "power"):
            lit, stats = render(selection, seed, args.spp)
            for kind, of in error.items():
                of[selection].append(float(((lit[kind] - truth[kind]) ** 2 * weight).mean()))
            seconds[selection].append(stats["seconds"]["render"])
            samples = stats["counts"]["samples"]
    time = ratio(seconds["tree"], seconds["power"])
    figures: dict[str, Any] = {"time": time}
    for kind, of in error.items():
        mean = {selection: float(np.mean(values)) for selection, values in of.items()}
        figures[kind] = {
            "relmse": mean,
            "efficiency": mean["power"] / (mean["tree"] * time["median"]),
        }
    figures["sample_us"] = {k: 1e6 * float(np.median(v)) / samples for k, v in seconds.items()}
    return figures


def report(found: dict[str, Any]) -> list[str]:
    """Return the table as Markdown lines."""
    lines = head(
        "lights", "direct light: relMSE by power", "by tree", "time", "efficiency",
        "efficiency, all light", "us a sample by power", "by tree",
    )  # fmt: skip
    for count, figures in found.items():
        direct = figures["direct"]
        lines.append(
            row(
                f"{int(count):,}",
                f"{direct['relmse']['power']:.4f}",
                f"{direct['relmse']['tree']:.4f}",
                show(figures["time"], 2),
                f"{direct['efficiency']:.1f}",
                f"{figures['all']['efficiency']:.1f}",
                f"{figures['sample_us']['power']:.2f}",
                f"{figures['sample_us']['tree']:.2f}",
            )
        )
    return lines


if __name__ == "__main__":
    main()
