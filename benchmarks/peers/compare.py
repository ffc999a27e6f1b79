# SPDX-License-Identifier: Apache-2.0
"""Wavecomb beside Mitsuba 3 and Cycles on the same stages: speed, noise, memory, first picture.

    benchmarks/peers/setup                      # once: Cycles, in an environment of its own
    python benchmarks/peers/compare.py --rounds 5 --plain --stages cornell,mixed,dragon,room
    python benchmarks/peers/compare.py --stages smoke-200,fog-cornell --max-depth 24
    python benchmarks/peers/compare.py --stages head --renderers wavecomb,cycles --max-depth 12
    python benchmarks/peers/compare.py --stages shot.usd          # or any stage of meshes
    python benchmarks/peers/compare.py --quick                    # does it run?

All renderers get the same arrays, camera, box filter and depth; no denoising, clamping, adaptive
sampling; roulette is as each has it by default. What materials become is in mitsuba_bridge.py and
cycles_bridge.py.

- Speed: in each round every renderer starts in a fresh process, in shuffled order. It loads the
  stage (Wavecomb reads USD, the others the arrays that Wavecomb's reader made of it), renders one
  sample (start to first picture), then a short and a long picture. The marginal rate is more
  samples over more time. Peak memory is that of the process.
- Noise: relMSE = mean of (x - r)^2 / (r^2 + 0.01) at equal samples, r each renderer's own converged
  picture of other seeds, less the error of r itself; mean over seeds. Noise does not depend on the
  load of the machine; pictures are kept under --cache and made once for each version and setting.
- Efficiency is 1 / (relMSE * seconds), seconds by the marginal rate at full size.

Ratios of Wavecomb to the others are medians within rounds, with a 95 % bootstrap interval.
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
    """Writes a generated stage where it is missing, and the arrays of any."""
    from recording import record, write_volumes
    from stages import write_stage

    if scene in STAGES:
        stage = args.cache / f"{label(scene, args)}.usdc"
        if not stage.exists():
            stage = write_stage(scene, stage, args.plain)
    else:
        stage = Path(scene)
    recorded = args.cache / f"{label(scene, args)}-recorded"
    # Always anew: the reader may have changed.
    scene_record = record(stage)
    write_volumes(scene_record, recorded)
    scene_record.save(recorded)
    digest = hashlib.sha1()
    for file in sorted(recorded.iterdir()):
        digest.update(file.read_bytes())
    return Job(stage, recorded, digest.hexdigest(), size, args.threads, args.max_depth)


def label(scene: str, args: argparse.Namespace) -> str:
    """What a stage is called in tables and files."""
    if scene not in STAGES:
        return Path(scene).stem
    return f"{scene}-plain" if args.plain and scene in SCENES and scene != "room" else scene


def measure(scene: str, args: argparse.Namespace) -> dict[str, Any]:
    """All figures of one stage."""
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
    """Converged pictures beside each other, both averaged over blocks of 4 by 4 pixels as well.

    Textures are filtered by Wavecomb alone, so that pixels differ where mean colours do not.
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
    """A PNG: above, each renderer's picture at equal samples; below, what it converges to."""
    from wavecomb.picture.image import write_png

    rows = [np.concatenate([f(n) for n in names], axis=1) for f in (found.noisy, found.converged)]
    write_png(path, np.concatenate(rows).astype(np.float32))


def arguments() -> argparse.Namespace:
    """The command line."""

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
    add("--plain", action="store_true", help="generated stages without names of programs")
    add("--renderers", type=listed(RENDERERS), default=list(USUAL), help=",".join(RENDERERS))
    add("--rounds", type=int, default=3)
    add("--threads", type=int, default=2)
    add("--size", type=int, default=600, help="edge of the timed picture, pixels")
    add("--max-depth", type=int, default=7, help="scattering vertices")
    add("--only", choices=("speed", "noise"), help="half of it")
    add("--noise-size", type=int, default=256, help="edge of the pictures of which noise is taken")
    add("--noise-spp", type=int, default=64)
    add("--noise-seeds", type=int, default=4)
    add("--reference-spp", type=int, default=4096, help="of a converged picture; in steps of 256")
    add("--set", type=json.loads, default={}, help="settings of Wavecomb, JSON")
    add("--seed", type=int, default=1, help="of the order of turns")
    add("--quick", action="store_true", help="one round of small pictures, for a trial")
    add("--cache", type=Path, default=ROOT / "out" / "peers", help="stages, pictures, logs")
    add("--output", type=Path, help="JSON (default: benchmarks/results/peers.json)")
    args = parser.parse_args()
    if args.quick:
        args.rounds, args.size, args.noise_size = 1, 96, 32
        args.noise_spp, args.noise_seeds, args.reference_spp = 4, 2, 512
        args.cache = args.cache / "quick"
        args.output = args.output or args.cache / "peers.json"
    return args


def told() -> list[str]:
    """The command line but for where files go."""
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
