# SPDX-License-Identifier: Apache-2.0
"""Compare Wavecomb with Mitsuba 3 and Cycles: speed, noise, memory, time to first image.

    benchmarks/peers/setup                      # once: Cycles, in a separate environment
    python benchmarks/peers/compare.py --rounds 5 --plain --stages cornell,mixed,dragon,room
    python benchmarks/peers/compare.py --stages smoke-200,fog-cornell --max-depth 24
    python benchmarks/peers/compare.py --stages head --renderers wavecomb,cycles --max-depth 12
    python benchmarks/peers/compare.py --stages shot.usd          # or any stage of meshes
    python benchmarks/peers/compare.py --quick                    # check that it runs

All renderers use the same arrays, camera, box filter and path depth, without denoising, clamping or
adaptive sampling. Roulette is each renderer's default. mitsuba_bridge.py and cycles_bridge.py
describe the conversion of materials.

- To measure speed, every round starts each renderer in a new process, in shuffled order. Each
  renderer loads the stage (Wavecomb reads USD, the others read the arrays that Wavecomb's loader
  made), renders one sample (start to first image), then an image with few and one with many
  samples. The marginal rate is the difference in samples over the difference in time. Peak memory
  is that of the renderer's process.
- Noise: relMSE is the mean of (x - r)^2 / (r^2 + 0.01) over pixels and seeds at equal samples,
  minus the error of r. The reference r is the same renderer's converged image with other seeds.
  Noise does not depend on the load of the machine; images are cached in --cache by version and
  settings.
- Efficiency is 1 / (relMSE * seconds), with seconds by the marginal rate at full size.

Ratios of Wavecomb to other renderers are taken within rounds; results are medians with a 95 %
bootstrap interval.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from noise import Noise
from renderers import RENDERERS, ROOT, USUAL, Job
from report import commit, machine, summary, tables
from speed import rounds
from stages import BELOW, VOLUMES

SCENES = ("cornell", "mixed", "dragon", "room")
STAGES = (*SCENES, *VOLUMES, *BELOW)


def prepare(scene: str, size: int, args: argparse.Namespace) -> Job:
    """Write a generated stage if it is missing, and the arrays of any stage."""
    from recording import record, write_volumes
    from stages import write_stage

    if scene in STAGES:
        stage = args.cache / f"{label(scene, args)}.usdc"
        if not stage.exists():
            stage = write_stage(scene, stage, args.plain)
    else:
        stage = Path(scene)
    recorded = args.cache / f"{label(scene, args)}-recorded"
    # Always record the scene again, because the USD loader may have changed.
    scene_record = record(stage)
    write_volumes(scene_record, recorded)
    scene_record.save(recorded)
    digest = hashlib.sha1()
    for file in sorted(recorded.iterdir()):
        digest.update(file.read_bytes())
    return Job(stage, recorded, digest.hexdigest(), size, args.threads, args.max_depth)


def label(scene: str, args: argparse.Namespace) -> str:
    """Name of a stage in tables and files."""
    if scene not in STAGES:
        return Path(scene).stem
    return f"{scene}-plain" if args.plain and scene in SCENES and scene != "room" else scene


def measure(scene: str, args: argparse.Namespace) -> dict[str, Any]:
    """Return all results of one stage."""
    from dataclasses import replace

    job = prepare(scene, args.size, args)
    small = replace(job, size=args.noise_size)
    turns: dict[str, Any] = {}
    noise: dict[str, Any] = {}
    found = Noise(small, args.cache, args.noise_spp, args.noise_seeds, args.reference_spp, args.set)
    if args.only != "speed":
        noise = {name: found.measure(name) for name in args.renderers}
    if args.only != "noise":
        turns = rounds(args.renderers, job, args.rounds, args.seed, args.cache, args.set)
    out = summary(turns, noise, args.size)
    if noise:
        for name, ratios in out["ratios"].items():
            ratios["picture"] = differ(found.converged("wavecomb"), found.converged(name))
        show(args.cache / f"{label(scene, args)}.png", args.renderers, found)
    return out


def differ(ours: Any, theirs: Any) -> dict[str, Any]:
    """Compare converged images by pixel and by blocks of 4 x 4 pixels.

    Only Wavecomb filters textures, so pixels may differ where the mean colours of blocks agree.
    """
    edge = len(ours) // 4 * 4
    a, b = (
        p[:edge, :edge].reshape(edge // 4, 4, edge // 4, 4, 3).mean((1, 3)) for p in (ours, theirs)
    )
    return {
        "mean_ratio": [float(v) for v in ours.mean(axis=(0, 1)) / theirs.mean(axis=(0, 1))],
        "mean_abs_of_blocks": float(np.abs(a - b).mean() / b.mean()),
    }


def show(path: Path, names: list[str], found: Noise) -> None:
    """Write a PNG: above, each renderer's image at equal samples; below, its converged image."""
    from wavecomb.image.files.image import write_png

    rows = [np.concatenate([f(n) for n in names], axis=1) for f in (found.noisy, found.converged)]
    write_png(path, np.concatenate(rows).astype(np.float32))


def arguments() -> argparse.Namespace:
    """Parse the command line."""

    def listed(known: Any) -> Any:
        def parse(text: str) -> list[str]:
            names = text.split(",")
            for name in names:
                if name not in known and not (known is STAGES and Path(name).is_file()):
                    raise argparse.ArgumentTypeError(f"{name!r} is none of {', '.join(known)}")
            return names

        return parse

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--stages", type=listed(STAGES), default=list(SCENES), help=",".join(STAGES) + ", or files")
    add("--plain", action="store_true", help="generate stages in exporter style")
    add("--renderers", type=listed(RENDERERS), default=list(USUAL), help=",".join(RENDERERS))
    add("--rounds", type=int, default=3)
    add("--threads", type=int, default=2)
    add("--size", type=int, default=600, help="edge of the timed image in pixels")
    add("--max-depth", type=int, default=7, help="scattering vertices")
    add("--only", choices=("speed", "noise"), help="run only this half")
    add("--noise-size", type=int, default=256, help="edge of the images that measure noise")
    add("--noise-spp", type=int, default=64)
    add("--noise-seeds", type=int, default=4)
    add(
        "--reference-spp",
        type=int,
        default=4096,
        help="samples of converged images; multiple of 256",
    )
    add("--set", type=json.loads, default={}, help="settings of Wavecomb as JSON")
    add("--seed", type=int, default=1, help="seed of the order of turns")
    add("--quick", action="store_true", help="one round of small images, to check that it runs")
    add(
        "--cache",
        type=Path,
        default=ROOT / "out" / "peers",
        help="folder of stages, images and logs",
    )
    add("--output", type=Path, help="JSON (default: benchmarks/results/peers.json)")
    args = parser.parse_args()
    if args.quick:
        args.rounds, args.size, args.noise_size = 1, 96, 32
        args.noise_spp, args.noise_seeds, args.reference_spp = 4, 2, 512
        args.cache = args.cache / "quick"
        args.output = args.output or args.cache / "peers.json"
    return args


def told() -> list[str]:
    """Return the command line without file locations."""
    words = iter(sys.argv[1:])
    out = []
    for word in words:
        if word in ("--output", "--cache"):
            next(words, None)
        elif not word.startswith(("--output=", "--cache=")):
            out.append(word)
    return out


def main() -> None:
    args = arguments()
    args.cache.mkdir(parents=True, exist_ok=True)
    plain = {k: v for k, v in vars(args).items() if k not in ("cache", "output")}
    result: dict[str, Any] = {
        "schema": "wavecomb-peers/2",
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        **commit(),
        "command": shlex.join(["benchmarks/peers/compare.py", *told()]),
        "rounds": args.rounds,
        "machine": machine(),
        "settings": {**plain, "filter": "box"},
        "scenes": {},
    }
    output = args.output or ROOT / "benchmarks" / "results" / "peers.json"
    output.parent.mkdir(parents=True, exist_ok=True)
    for scene in args.stages:
        result["scenes"][label(scene, args)] = measure(scene, args)
        result["machine"]["load_after"] = list(os.getloadavg())
        part = output.with_suffix(".part")
        part.write_text(json.dumps(result, indent=1) + "\n")
        part.replace(output)
        print(f"{scene}: in {output}", file=sys.stderr)
    print(tables(result["scenes"]))


if __name__ == "__main__":
    main()
