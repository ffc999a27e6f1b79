# SPDX-License-Identifier: Apache-2.0
"""Compare the efficiency of renders with training (guiding, light shares) and without.

    .venv/bin/python benchmarks/guiding.py room cornell --spp 64 --seeds 5
    .venv/bin/python benchmarks/guiding.py mixed-lamps kitchen lights --ways power off auto light
    .venv/bin/python benchmarks/guiding.py room --seconds 20 --ways power lights lights+pixels

Renders each stage in each mode, with several seeds in turn; the first mode is the baseline.
Mode ``power`` trains nothing, and ``off`` is the default, which calibrates light shares. Other
modes are names of trained features in ``PARTS``, joined by ``+``. Stages are files, or are
generated in exporter style (``--plain``). Stages with the suffix ``-lamps`` are lit by a key light,
a fill light and a dim dome. The pixel filter is a box of one pixel. The relMSE of one image is the
variance over seeds at each pixel, divided by m^2 + 0.01, where m is the mean of all images. The
images of all modes are averaged because all modes have the same expectation. Efficiency is 1 /
(relMSE x seconds). Seconds are CPU time including training, so that other work on the machine has
little effect. With ``--seconds``, each render ends after this wall time, training included, and
seconds are wall time.
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
}
PARTS: dict[str, dict[str, str]] = {
    "lights": {"light_weights": "calibrated", "light_selection": "auto"},
    "pixels": {"allocate": "error"},
    "paths": {"roulette": "efficient"},
    "directions": {"guiding": "on"},
}
"""For each trained feature, the settings that enable it while other training is off."""


def way(name: str) -> dict[str, str]:
    """Return the settings of a mode: one of WAYS, or PARTS joined by ``+``.

    Raises:
        argparse.ArgumentTypeError: There is no mode of this name.
    """
    if name in WAYS:
        return WAYS[name]
    parts = name.split("+")
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        known = ", ".join([*WAYS, *PARTS])
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is none of {known}")
    settings = {**WAYS["power"], "roulette": "throughput"}
    for part in parts:
        settings |= PARTS[part]
    return settings


def known(name: str) -> str:
    """Check the name of a mode and return it."""
    way(name)
    return name


def load(name: str, folder: Path) -> Any:
    """Load a generated stage or a file."""
    is_file = Path(name).suffix != ""
    scene, _, lamps = name.partition("-lamps")
    options = {"plain": True, "lamps": name != scene and not lamps}
    path = Path(name) if is_file else stage_file(folder / f"{name}.usdc", scene, **options)
    return wavecomb.load(path).scene


def measure(
    scene: Any, options: argparse.Namespace, budget: dict[str, Any]
) -> list[dict[str, Any]]:
    """Return a table row per mode. `budget` sets ``spp`` or ``limit`` (seconds) of a render."""
    clock, ends = time.process_time, budget
    if "limit" in budget:
        clock, ends = time.perf_counter, {"spp": 1 << 20, "time_limit": budget["limit"]}
    pictures: dict[str, list[Any]] = {name: [] for name in options.ways}
    seconds: dict[str, list[float]] = {name: [] for name in options.ways}
    learned: dict[str, Any] = {}
    for seed in range(options.seeds):
        turn = seed % len(options.ways)
        for name in options.ways[turn:] + options.ways[:turn]:
            begin = clock()
            picture = wavecomb.render(
                scene, **ends, seed=seed, size=tuple(options.size), threads=options.threads,
                max_depth=7, filter="box", filter_width=1.0, **way(name),
            )  # fmt: skip
            seconds[name].append(clock() - begin)
            pictures[name].append(np.asarray(picture.beauty, np.float64))
            learned[name] = picture.stats["guiding"]
    mean = np.mean([np.mean(p, axis=0) for p in pictures.values()], axis=0)
    rows = []
    for name in options.ways:
        stack = np.array(pictures[name])
        pixels = np.sort((stack.var(axis=0, ddof=1) / (mean**2 + 0.01)).mean(axis=-1).ravel())
        # Relative squared error of each round's image, times the seconds that the round took. The
        # spread of the efficiency ratios is computed from these products.
        rounds = [
            float(((one - mean) ** 2 / (mean**2 + 0.01)).mean()) * took
            for one, took in zip(stack, seconds[name], strict=True)
        ]
        rows.append(
            {**budget, "way": name, "rel_mse": float(pixels.mean()),
             "trimmed": float(pixels[: int(0.999 * len(pixels))].mean()),
             "seconds": float(np.mean(seconds[name])), "rounds": rounds,
             "mean": float(stack.mean()), "learned": learned[name]}
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
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+")
    usual = ["off", "roulette", "guiding", "both", "auto"]
    parser.add_argument("--ways", nargs="+", default=usual, type=known)
    parser.add_argument("--spp", type=int, nargs="+", default=[64])
    parser.add_argument(
        "--seconds", type=float, nargs="+", help="time of each render, instead of --spp"
    )
    parser.add_argument("--size", type=int, nargs=2, default=[240, 160])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("out/guiding"))
    parser.add_argument("--output", type=Path, default=RESULTS / "guiding.json")
    options = parser.parse_args()
    limits = [{"limit": seconds} for seconds in options.seconds or ()]
    budgets: list[dict[str, Any]] = limits or [{"spp": spp} for spp in options.spp]
    results: dict[str, Any] = {}
    for name in options.stages:
        scene = load(name, options.folder)
        results[Path(name).stem] = rows = []
        for budget in budgets:
            for row in measure(scene, options, budget):
                rows.append(row)
                print(
                    f"{Path(name).stem:10} {next(iter(budget.values())):4} {row['way']:9} "
                    f"relMSE {row['rel_mse']:.5f} {row['seconds']:6.2f} s  efficiency "
                    f"{row['efficiency_by_rel_mse']:.2f} ({row['spread']['min']:.2f} to "
                    f"{row['spread']['max']:.2f}), trimmed {row['efficiency_by_trimmed']:.2f}",
                    flush=True,
                )
        content = {"size": options.size, "rounds": options.seeds, "stages": results}
        write_result(options.output, "wavecomb-guiding/1", content)


if __name__ == "__main__":
    main()
