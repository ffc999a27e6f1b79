# SPDX-License-Identifier: Apache-2.0
"""Compare a render with its lower limit: the same rays traced by Embree alone.

    .venv/bin/python benchmarks/limit.py --spp 16 --threads 2 --rounds 5
    .venv/bin/python benchmarks/limit.py --quick          # check that it runs

Each stage is rendered once while all rays are recorded, by wave and wave stage, in traversal order.
Embree alone then traces them in the same order on the same number of threads, in a plain loop that
fills a packet, calls rtcIntersect or rtcOccluded, and counts hits, without filters and without
storing results. First, each kind of ray (camera, bounce, shadow) is traced with each packet width
and with each value of Embree's coherence flag, to find the fastest combination for the kind. A
round then measures, in shuffled order:

- render: the render, without a recorder;
- alone: wall time of Embree alone, with the fastest combination for each kind of ray;
- calls: the same rays, traced by the accelerator's functions that the render calls. These functions
  fill packets, use a filter that makes hits canonical (independent of packet width and ray order),
  and store hits.

Ratios are taken within a round:

- limit: render / alone, both wall time;
- traversal: the trace and shadow phases (per thread) / alone;
- calls: calls / alone, which shows the cost of the filter, of filling packets and of storing hits;
- filter share: (calls - alone) / the trace and shadow phases, which is the fraction of these phases
  that the filter takes.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterable
from typing import Any

from sitting import (
    head,
    load_stage,
    log,
    phase_times,
    ratio,
    row,
    show,
    shuffled_rounds,
    sitting_arguments,
    sitting_parser,
    summary,
    write_result,
)

from wavecomb import _core
from wavecomb.run.settings import make_settings

KINDS = ("camera", "bounce", "shadow")
WIDTHS = (1, 4, 8, 16)
COHERENCE = (True, False, None)
"""Values of Embree's coherence flag; None means the flag that each wave stage of the render set."""
Round = dict[str, float]


def main() -> None:
    """Run the benchmark, print the tables, write the JSON."""
    args = _arguments()
    stages: dict[str, Any] = {}
    for name in args.stages:
        stages[name] = measure(name, args)
        write_result(
            args.output,
            "wavecomb-limit/1",
            {
                "size": args.size,
                "spp": args.spp,
                "threads": args.threads,
                "rounds": args.rounds,
                "stages": stages,
            },
        )
    for line in report(stages):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = sitting_parser(__doc__, "limit")
    parser.add_argument(
        "--tuning-rounds", type=int, default=2, help="rounds that select packet widths"
    )
    parser.add_argument("--policy", default="program")
    parser.add_argument(
        "--memory-gb", type=float, default=4.0, help="limit of memory for recorded rays"
    )
    return sitting_arguments(parser, size=96, spp=4, rounds=2, triangles=20_000)


def measure(name: str, args: argparse.Namespace) -> dict[str, Any]:
    """Run all rounds of one stage."""
    scene = load_stage(name, args.folder, args.triangles).scene
    settings = make_settings(
        (args.size, args.size), args.spp, threads=args.threads, policy=args.policy
    )
    recording = _core.RayRecording(scene, int(args.memory_gb * 2**30))
    counts = _core.render(scene, settings, recorder=recording).stats["counts"]
    if (sum(recording.rays), sum(recording.shadow_rays)) != (counts["rays"], counts["shadow_rays"]):
        sys.exit(f"{name}: the recording does not hold all rays of the render")
    log(f"{name}: {counts['rays']} + {counts['shadow_rays']} rays, {recording.bytes >> 20} MiB")

    tuning = tune(recording, args)
    best = {kind: min(tuning[kind], key=lambda turn: turn["ns"]) for kind in KINDS}
    alone = {
        "width": tuple(best[kind]["width"] for kind in KINDS),
        "coherent": tuple(best[kind]["coherent"] for kind in KINDS),
    }
    widest = max(turn["width"] for turn in tuning["camera"])

    def render() -> Round:
        times = phase_times(_core.render(scene, settings).stats)
        return {"render": times["render_s"], "phases": times["traversal_s"] / args.threads}

    def by_embree() -> Round:
        turn = recording.replay(threads=args.threads, **alone)
        per_kind = zip(KINDS, turn["thread_s"], strict=True)
        return {"alone": turn["wall_s"]} | {f"alone_{kind}": t for kind, t in per_kind}

    def by_calls() -> Round:
        turn = recording.replay(alone=False, threads=args.threads, width=(widest,) * 3)
        return {"calls": turn["wall_s"]}

    rounds: list[Round] = []
    for turns in shuffled_rounds((render, by_embree, by_calls), args, name):
        done: Round = {}
        for turn in turns:
            done |= turn()
        rounds.append(done)

    def of(key: str) -> list[float]:
        return [done[key] for done in rounds]

    return {
        "rays": dict(zip(KINDS, _per_kind(recording), strict=True)),
        "recorded_bytes": recording.bytes,
        "tuning_ns_per_ray": tuning,
        "best": best,
        "seconds": {key: summary(of(key)) for key in rounds[0]},
        "limit": ratio(of("render"), of("alone")),
        "traversal": ratio(of("phases"), of("alone")),
        "calls": ratio(of("calls"), of("alone")),
        "filter_share": summary([(d["calls"] - d["alone"]) / d["phases"] for d in rounds]),
        "rounds": rounds,
    }


def _per_kind(recording: Any) -> tuple[int, int, int]:
    return recording.rays[0], sum(recording.rays[1:]), sum(recording.shadow_rays)


def tune(recording: Any, args: argparse.Namespace) -> dict[str, list[dict[str, Any]]]:
    """Return nanoseconds of thread time per ray, for each kind of ray, width and coherence flag."""
    least: dict[tuple[str, int, bool | None], float] = {}
    for _, width, coherent in itertools.product(range(args.tuning_rounds), WIDTHS, COHERENCE):
        try:
            turn = recording.replay(
                threads=args.threads, width=(width,) * 3, coherent=(coherent,) * 3
            )
        except _core.Error:
            continue  # this build of Embree does not support the width
        for kind, seconds, rays in zip(KINDS, turn["thread_s"], turn["rays"], strict=True):
            key = (kind, width, coherent)
            least[key] = min(least.get(key, float("inf")), 1e9 * seconds / max(1, rays))
    table: dict[str, list[dict[str, Any]]] = {kind: [] for kind in KINDS}
    for (kind, width, coherent), ns in least.items():
        table[kind].append({"width": width, "coherent": coherent, "ns": ns})
    return table


def report(stages: dict[str, Any]) -> Iterable[str]:
    """Yield the tables as Markdown lines."""
    yield from head(
        *("stage", "M rays", "Embree alone s", "trace + shadow s", "render s"),
        *("limit: render / alone", "traversal / alone", "calls / alone", "filter share"),
    )
    for name, found in stages.items():
        seconds = found["seconds"]
        yield row(
            name,
            f"{sum(found['rays'].values()) / 1e6:.2f}",
            *(f"{seconds[key]['median']:.3f}" for key in ("alone", "phases", "render")),
            *(show(found[key], 2) for key in ("limit", "traversal", "calls", "filter_share")),
        )
    yield ""
    yield from head("stage", "rays", "M rays", "width", "coherent", "ns per ray and thread")
    for name, found in stages.items():
        for kind in KINDS:
            best = found["best"][kind]
            rays = found["rays"][kind]
            yield row(
                *(name, kind, f"{rays / 1e6:.2f}", str(best["width"])),
                {True: "yes", False: "no", None: "as rendered"}[best["coherent"]],
                f"{best['ns']:.0f}",
            )


if __name__ == "__main__":
    main()
