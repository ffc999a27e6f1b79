# SPDX-License-Identifier: Apache-2.0
"""Measure the gain of ordered shading in its best case: 64 heavy materials, 2 GB of textures.

    .venv/bin/python benchmarks/heavy.py              # 2 GB: minutes to write the stage, once
    .venv/bin/python benchmarks/heavy.py --quick      # check that it runs

Uses the stage of `wavecomb scene heavy`. Every policy renders it with one SIMD lane and with the
maximum number of lanes, in rounds of shuffled order, in one process. A second stage with textures
that fit into the caches shows the effect of the textures. Prints a Markdown table for each stage
and the spread of material costs, and writes all results to a JSON file. All images must be bitwise
equal.

Results are medians over rounds with 95 % intervals, relative to arrival order in the same round:
the time of shading plus ordering, and the render time.
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path
from typing import Any

import numpy as np
from sitting import (
    RESULTS,
    ROOT,
    head,
    log,
    phase_times,
    ratio,
    row,
    show,
    stage_file,
    write_result,
)

import wavecomb
from wavecomb.options import settings

SMALL_MB = 2.0
LANES = (0, 1)
"""Numbers of SIMD lanes to compare; 0 means the widest."""
SEEN = 1000
"""Materials with fewer shaded hits than this are excluded from the spread of costs."""


def main() -> None:
    """Render, print the tables, write the JSON."""
    args = _arguments()
    found: dict[str, Any] = {}
    for texture_mb in (args.texture_mb, SMALL_MB):
        found[f"{texture_mb:g}"] = measure(texture_mb, args)
        content = {
            "materials": args.materials, "size": args.size, "spp": args.spp,
            "rounds": args.rounds, "texture_mb": found,
        }  # fmt: skip
        write_result(args.output, "wavecomb-heavy/1", content)
    for line in report(found):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--materials", type=int, default=64)
    parser.add_argument("--texture-mb", type=float, default=2000.0)
    parser.add_argument("--triangles", type=int, default=2_000_000)
    parser.add_argument("--size", type=int, default=400)
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "heavy", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "heavy.json")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    args = parser.parse_args()
    if args.quick:
        args.materials, args.texture_mb, args.triangles = 16, 8.0, 50_000
        args.size, args.spp, args.rounds = 96, 4, 2
        args.output = args.folder / "quick.json"
    return args


def measure(texture_mb: float, args: argparse.Namespace) -> dict[str, Any]:
    """Return all results of one stage."""
    path = stage_file(
        args.folder / f"heavy-{args.materials}-{args.triangles}-{texture_mb:g}.usdc",
        "heavy", materials=args.materials, texture_mb=texture_mb, triangles=args.triangles,
    )  # fmt: skip
    stage = wavecomb.load(path).scene
    textures = sum(size for _, size in stage.textures)
    shuffle = random.Random(1)
    times: dict[str, list[dict[str, float]]] = {}
    picture: np.ndarray | None = None
    spread = 0.0
    # Render once before the measurements, to fill the caches and the allocator's memory pools.
    render(stage, args, lanes=0, policy="program")
    for turn in range(args.rounds):
        cases = [(width, policy) for width in LANES for policy in settings()["policy"].choices]
        for width, policy in shuffle.sample(cases, len(cases)):
            done = render(stage, args, lanes=width, policy=policy)
            if picture is None:
                picture = done.beauty
            elif not np.array_equal(picture, done.beauty):
                raise SystemExit(f"{policy} at {width} lanes gives a different image")
            times.setdefault(f"{width}/{policy}", []).append(phase_times(done.stats))
            if (width, policy) == (0, "material"):
                spread = cost_spread(done.stats)
        log(f"{texture_mb:g} MB: round {turn + 1} of {args.rounds}")
    return {
        "texture_bytes": textures,
        "cost_spread": spread,
        "shade_and_order": _ratios(times, lambda t: t["shade_s"] + t["order_s"]),
        "render": _ratios(times, lambda t: t["render_s"]),
        "times": times,
    }


def render(stage: Any, args: argparse.Namespace, **settings: Any) -> Any:
    """Render once."""
    return wavecomb.render(
        stage, size=(args.size, args.size), spp=args.spp, threads=args.threads, **settings
    )


def cost_spread(stats: dict[str, Any]) -> float:
    """Return the ratio of the highest to the lowest shading time per hit among materials."""
    costs = [m["ns_per_record"] for m in stats["materials"] if m["records"] >= SEEN]
    return max(costs) / min(costs)


def _ratios(times: dict[str, list[dict[str, float]]], of: Any) -> dict[str, Any]:
    """Ratios of each configuration to arrival order with the same number of lanes."""
    return {
        case: ratio([of(t) for t in runs], [of(t) for t in times[f"{case.split('/')[0]}/none"]])
        for case, runs in times.items()
    }


def report(found: dict[str, Any]) -> list[str]:
    """Return the tables as Markdown lines."""
    lines = []
    for texture_mb, figures in found.items():
        lines += [
            f"{figures['texture_bytes'] / 1e6:.0f} MB of textures (asked for: {texture_mb}), the "
            f"dearest material {figures['cost_spread']:.0f} times the cheapest:",
            "",
            *head("policy", "one lane: shade + order", "render", "widest: shade + order", "render"),
        ]
        for policy in settings()["policy"].choices:
            cells = [
                show(figures[what][f"{width}/{policy}"], 2)
                for width in reversed(LANES)
                for what in ("shade_and_order", "render")
            ]
            lines.append(row(policy, *cells))
        lines.append("")
    return lines


if __name__ == "__main__":
    main()
