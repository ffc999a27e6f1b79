# SPDX-License-Identifier: Apache-2.0
"""Compare the default settings with combinations of guiding, light paths and `allocate`.

    .venv/bin/python benchmarks/defaults.py @tuning --ways plain default guided --spp 64
    .venv/bin/python benchmarks/defaults.py room caustics --ways plain default light --reference 0

Stages are given by their names in STAGES, as ``@tuning`` or ``@validation``, or as files. Each
stage is rendered with several seeds in each mode of ``--ways``, with one thread; the first mode is
the baseline. The mode ``@combinations`` stands for all combinations of guiding, light paths and
allocation. Errors are squared relative errors (x - r)^2 / (r^2 + 0.01) against a reference r. The
reference is the mean of four renders of ``--reference`` samples in the best mode for the stage, and
is cached in ``out/defaults``. With ``--reference 0``, r is the mean of all images of the stage,
which needs no further renders but understates errors by a few per cent. Error percentiles are taken
over pixels. Cost is user CPU time of the whole render, pilots included, so other work on the
machine has little effect. Efficiency is 1 / (error x cost).
"""

from __future__ import annotations

import argparse
import hashlib
import resource
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from sitting import RESULTS, log, stage_file, write_result

import wavecomb

ASSETS = Path(__file__).resolve().parents[2] / "shared" / "assets" / "usd"


@dataclass(frozen=True)
class Stage:
    """A stage: a generator with options, or a file in the asset folder.

    Attributes:
        scene: Name of the generator, or path of the file below the asset folder.
        best: Combination of settings that renders the reference.
        options: Options of the generator.
    """

    scene: str
    best: str = "plain"
    options: dict[str, Any] = field(default_factory=dict)


PLAIN_LAMPS = {"plain": True, "lamps": True}
TUNING = {
    "room": Stage("room", "guided"),
    "kitchen": Stage("kitchen"),
    "cornell": Stage("cornell"),
    "mixed-lamps": Stage("mixed", options=PLAIN_LAMPS),
    "studio": Stage("studio"),
    "caustics": Stage("caustics", "light"),
    "lens": Stage("lens", "light"),
    "fog": Stage("fog"),
    "fur": Stage("fur", options={"strands": 3000}),
    "lights": Stage("lights"),
}
VALIDATION = {
    "room-7": Stage("room", "guided", {"seed": 7, "plain": True}),
    "room-11": Stage("room", "guided", {"seed": 11, "plain": True}),
    "room-23": Stage("room", "guided", {"seed": 23, "plain": True}),
    "kitchen-3": Stage("kitchen", options={"seed": 3, "plain": True}),
    "kitchen-5": Stage("kitchen", options={"seed": 5, "plain": True}),
    "glass-dragon": Stage("cornell-dragon", "light", {"material": "glass"}),
    "gold-dragon": Stage("cornell-dragon", options={"material": "gold"}),
    "copper-dragon": Stage("cornell-dragon", options={"material": "copper"}),
    "dragon-lamps": Stage("dragon", options=PLAIN_LAMPS),
    "dragon": Stage("dragon", options={"plain": True}),
    "mixed-7": Stage("mixed", options={"seed": 7, "plain": True}),
    "spread": Stage("spread"),
    "spread-4": Stage("spread", options={"seed": 4}),
    "pool": Stage("pool", "light"),
    "prism": Stage("prism", "light"),
    "landscape": Stage("landscape", "light"),
    "drinks": Stage("drinks"),
    "clouds": Stage("clouds"),
    "candles": Stage("candles"),
    "head": Stage("head", options={"strands": 20_000}),
    "head-2": Stage("head", options={"seed": 2, "strands": 20_000}),
    "lights-5": Stage("lights", options={"seed": 5, "lights": 1000}),
    "lights-9": Stage("lights", options={"seed": 9, "lights": 1000}),
}
STAGES = TUNING | VALIDATION
SETS = {"@tuning": list(TUNING), "@validation": list(VALIDATION)}

WAYS: dict[str, dict[str, Any]] = {
    "default": {},
    "plain": {"guiding": "off", "transport": "path"},
    "guided": {"guiding": "on", "transport": "path"},
    "auto": {"guiding": "auto", "transport": "path"},
    "directions": {"guiding": "on", "transport": "path", "roulette": "throughput"},
    "light": {"guiding": "off", "transport": "light"},
    "light-auto": {"guiding": "off", "transport": "auto"},
    "merged": {"guiding": "off", "transport": "light", "merge_radius": 1.0},
}
COMBINATIONS = {
    f"{guiding} {transport} {allocate}": {"guiding": guiding, "allocate": allocate} | settings
    for guiding in ("off", "on")
    for transport, settings in {
        "path": {"transport": "path"},
        "light": {"transport": "light"},
        "merged": {"transport": "light", "merge_radius": 1.0},
    }.items()
    for allocate in ("even", "efficiency")
    if allocate == "even" or transport != "merged"
}
"""All combinations of guiding, light paths and allocation; merging needs even allocation."""
WAYS |= COMBINATIONS
SETS["@combinations"] = list(COMBINATIONS)
PERCENTILES = (50, 90, 99, 99.9)


def load(name: str, folder: Path) -> Any:
    """Load the scene of a stage by its name in STAGES or by its path."""
    stage = STAGES.get(name)
    if stage is None:
        path = Path(name)
        path = path if path.exists() else ASSETS / name
    else:
        path = stage_file(folder / f"{name}.usdc", stage.scene, **stage.options)
    # A loaded stage would keep its renderer, with the results of pilot renders; a scene does not.
    return wavecomb.load(path).scene


def render(scene: Any, way: str, spp: int, seed: int, size: tuple[int, int]) -> tuple[Any, float]:
    """Render with one thread; return the image and the user CPU seconds that it took."""
    begin = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    picture = wavecomb.render(
        scene, spp=spp, seed=seed, size=size, threads=1, max_depth=7, filter="box",
        filter_width=1.0, **WAYS[way],
    )  # fmt: skip
    return picture, resource.getrusage(resource.RUSAGE_SELF).ru_utime - begin


def reference(name: str, scene: Any, options: argparse.Namespace) -> Any:
    """Return a converged image and its variance per pixel, from a cached file if there is one."""
    way = STAGES[name].best if name in STAGES else "plain"
    key = hashlib.sha256(f"{name} {way} {options.size} {options.reference}".encode()).hexdigest()
    path = options.folder / f"{Path(name).stem}-{key[:12]}.npy"
    if not path.exists():
        log(f"{name}: reference of 4 x {options.reference} samples")
        images = [
            render(scene, way, options.reference, 1000 + i, tuple(options.size))[0].beauty
            for i in range(4)
        ]
        stack = np.array(images, np.float64)
        np.save(path, np.array([stack.mean(axis=0), stack.var(axis=0, ddof=1) / len(stack)]))
    return np.load(path)


def figures(images: Any, mean: Any, variance: Any) -> dict[str, Any]:
    """Return error statistics of images; mean errors exclude the variance of the reference."""
    scale = 1 / (mean**2 + 0.01)
    errors = ((images - mean) ** 2 * scale).mean(axis=-1).reshape(len(images), -1)
    noise = (variance * scale).mean(axis=-1).ravel()
    order = np.sort(errors, axis=1)
    most = int(0.999 * order.shape[1])
    return {
        "rel_mse": float(errors.mean() - noise.mean()),
        "trimmed": float(order[:, :most].mean() - np.sort(noise)[:most].mean()),
        "percentiles": [float(np.percentile(order, p)) for p in PERCENTILES],
        "seeds": [float(e.mean() - noise.mean()) for e in errors],
    }


def chosen(stats: dict[str, Any]) -> str:
    """Describe whether a render used light paths and guiding, with the predicted gains."""
    words = []
    if transport := stats.get("transport"):
        words.append(f"{transport['chosen']} ({transport['gain'] or 0:.2f})")
    if guiding := stats.get("guiding"):
        words.append(f"{'guided' if guiding.get('used') else 'not guided'}")
        words.append(f"({guiding.get('gain') or 0:.2f})")
    return " ".join(words)


def measure(name: str, options: argparse.Namespace, spp: int) -> list[dict[str, Any]]:
    """Render one stage in all modes; return one table row per mode."""
    scene = load(name, options.folder)
    images: dict[str, list[Any]] = {way: [] for way in options.ways}
    seconds: dict[str, list[float]] = {way: [] for way in options.ways}
    words = {}
    for seed in range(options.seeds):
        turn = seed % len(options.ways)
        for way in options.ways[turn:] + options.ways[:turn]:
            # Each call makes a new renderer, so that no training of an earlier render is reused.
            picture, took = render(scene, way, spp, seed, tuple(options.size))
            images[way].append(np.asarray(picture.beauty, np.float64))
            seconds[way].append(took)
            words[way] = chosen(picture.stats)
    if options.reference > 0:
        mean, variance = reference(name, scene, options)
    else:
        mean = np.mean([np.mean(i, axis=0) for i in images.values()], axis=0)
        variance = np.zeros_like(mean)
    rows = []
    for way in options.ways:
        row = figures(np.array(images[way]), mean, variance)
        row |= {"stage": name, "spp": spp, "way": way, "seconds": float(np.mean(seconds[way])),
                "chosen": words[way], "mean": float(np.mean(images[way]))}  # fmt: skip
        rows.append(row)
        base = rows[0]
        for error in ("rel_mse", "trimmed"):
            row[f"efficiency_{error}"] = (
                base[error] * base["seconds"] / max(row[error] * row["seconds"], 1e-30)
            )
        row["percentile_ratios"] = [
            own / max(of_base, 1e-30)
            for own, of_base in zip(row["percentiles"], base["percentiles"], strict=True)
        ]
        show(row)
    return rows


def show(row: dict[str, Any]) -> None:
    """Print a row."""
    ratios = " ".join(f"{r:5.2f}" for r in row["percentile_ratios"])
    print(
        f"{row['stage']:12} {row['spp']:4} {row['way']:11} {row['rel_mse']:9.5f} "
        f"{row['trimmed']:9.5f}  {row['seconds']:6.2f} s  efficiency "
        f"{row['efficiency_rel_mse']:5.2f} trimmed {row['efficiency_trimmed']:5.2f}  "
        f"percentiles {ratios}  mean {row['mean']:.5f}  {row['chosen']}",
        flush=True,
    )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+")
    parser.add_argument(
        "--ways", nargs="+", default=["plain", "default"], choices=[*WAYS, "@combinations"]
    )
    parser.add_argument("--spp", type=int, nargs="+", default=[64])
    parser.add_argument("--size", type=int, nargs=2, default=[96, 96])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--reference", type=int, default=1024, help="samples; 0: no reference")
    parser.add_argument("--folder", type=Path, default=Path("out/defaults"))
    parser.add_argument("--output", type=Path, default=RESULTS / "defaults.json")
    options = parser.parse_args()
    names = [name for given in options.stages for name in SETS.get(given, [given])]
    options.ways = [way for given in options.ways for way in SETS.get(given, [given])]
    rows: list[dict[str, Any]] = []
    for name in names:
        for spp in options.spp:
            rows += measure(name, options, spp)
            content = {"size": options.size, "rounds": options.seeds, "rows": rows}
            write_result(options.output, "wavecomb-defaults/1", content)


if __name__ == "__main__":
    main()
