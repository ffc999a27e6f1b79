# SPDX-License-Identifier: Apache-2.0
"""What is learned brings: efficiency of a render to one without.

    .venv/bin/python benchmarks/guiding.py room cornell --spp 64 --seeds 5
    .venv/bin/python benchmarks/guiding.py mixed-lamps kitchen lights --ways power off auto light

Renders each stage in each way, several seeds in turns; the first way is what others are compared
with. ``power`` is without anything learned, ``off`` the defaults, of which shares of lights are
learned. Stages are generated ones, written as exporters do (``--plain``), with ``-lamps`` behind
their names lit by a key, a fill and a dim dome; or files. relMSE is that of
one picture: the variance over the seeds at each pixel over the square of the mean of all pictures,
plus 0.01; every combination has the same mean. Efficiency is 1 / (relMSE x seconds); seconds are of
the processor and have the training in them, so that other work on the machine counts little.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from sitting import RESULTS, stage_file, summary, write_result

import wavecomb

WAYS: dict[str, dict[str, str]] = {
    "power": {"light_weights": "power", "light_selection": "power"},
    "off": {},
    "roulette": {"roulette": "efficient"},
    "guiding": {"guiding": "on", "roulette": "throughput"},
    "both": {"guiding": "on"},
    "auto": {"guiding": "auto"},
    "light": {"transport": "auto"},
    "pixels": {"allocate": "error"},
}


def load(name: str, folder: Path) -> Any:
    """The scene of a generated stage, or of a file."""
    is_file = Path(name).suffix != ""
    scene, _, lamps = name.partition("-lamps")
    options = {"plain": True, "lamps": name != scene and not lamps}
    path = Path(name) if is_file else stage_file(folder / f"{name}.usdc", scene, **options)
    return wavecomb.load(path).scene


def measure(scene: Any, options: argparse.Namespace, spp: int) -> list[dict[str, Any]]:
    """A row for each way."""
    pictures: dict[str, list[Any]] = {way: [] for way in options.ways}
    seconds: dict[str, list[float]] = {way: [] for way in options.ways}
    learned: dict[str, Any] = {}
    for seed in range(options.seeds):
        turn = seed % len(options.ways)
        for way in options.ways[turn:] + options.ways[:turn]:
            begin = time.process_time()
            picture = wavecomb.render(
                scene, spp=spp, seed=seed, size=tuple(options.size), threads=options.threads,
                max_depth=7, filter="box", **WAYS[way],
            )  # fmt: skip
            seconds[way].append(time.process_time() - begin)
            pictures[way].append(np.asarray(picture.beauty, np.float64))
            learned[way] = picture.stats["guiding"]
    mean = np.mean([np.mean(p, axis=0) for p in pictures.values()], axis=0)
    rows = []
    for way in options.ways:
        stack = np.array(pictures[way])
        pixels = np.sort((stack.var(axis=0, ddof=1) / (mean**2 + 0.01)).mean(axis=-1).ravel())
        # Each round's own error, for the spread of the ratios.
        rounds = [
            float(((one - mean) ** 2 / (mean**2 + 0.01)).mean()) * took
            for one, took in zip(stack, seconds[way], strict=True)
        ]
        rows.append(
            {"spp": spp, "way": way, "rel_mse": float(pixels.mean()),
             "trimmed": float(pixels[: int(0.999 * len(pixels))].mean()),
             "seconds": float(np.mean(seconds[way])), "rounds": rounds,
             "mean": float(stack.mean()), "learned": learned[way]}
        )  # fmt: skip
    base = rows[0]
    for row in rows:
        for error in ("rel_mse", "trimmed"):
            row[f"efficiency_by_{error}"] = (
                base[error] * base["seconds"] / (row[error] * row["seconds"])
            )
        row["spread"] = summary([a / b for a, b in zip(base["rounds"], row["rounds"], strict=True)])
    return rows


def main() -> None:
    """Runs the sitting."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+")
    usual = ["off", "roulette", "guiding", "both", "auto"]
    parser.add_argument("--ways", nargs="+", default=usual, choices=list(WAYS))
    parser.add_argument("--spp", type=int, nargs="+", default=[64])
    parser.add_argument("--size", type=int, nargs=2, default=[240, 160])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("out/guiding"))
    parser.add_argument("--output", type=Path, default=RESULTS / "guiding.json")
    options = parser.parse_args()
    results: dict[str, Any] = {}
    for name in options.stages:
        scene = load(name, options.folder)
        results[Path(name).stem] = rows = []
        for spp in options.spp:
            for row in measure(scene, options, spp):
                rows.append(row)
                print(
                    f"{Path(name).stem:10} {row['spp']:4} {row['way']:9} "
                    f"relMSE {row['rel_mse']:.5f} {row['seconds']:6.2f} s  efficiency "
                    f"{row['efficiency_by_rel_mse']:.2f} ({row['spread']['min']:.2f} to "
                    f"{row['spread']['max']:.2f}), trimmed {row['efficiency_by_trimmed']:.2f}",
                    flush=True,
                )
        content = {"size": options.size, "rounds": options.seeds, "stages": results}
        write_result(options.output, "wavecomb-guiding/1", content)


if __name__ == "__main__":
    main()
