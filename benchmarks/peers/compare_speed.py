# SPDX-License-Identifier: Apache-2.0
"""Samples per second of Wavecomb beside Mitsuba 3, in one interleaved sitting.

    .venv/bin/python benchmarks/peers/compare_speed.py            # the full sitting
    .venv/bin/python benchmarks/peers/compare_speed.py --quick    # does it run?

Each renderer runs in a process of its own that loads a stage, renders it once (warm-up:
acceleration structure, compilation), and then waits for its turns. Rounds go through the renderers
in an order that is shuffled each time; a turn times a short and a long render (two sample counts),
both with a fresh seed. From a turn come

- the rate: samples of the long render over its wall time;
- the marginal rate: more samples over more time, which leaves out what a call costs once.

The result is medians over rounds, and ratios of Wavecomb to each other renderer, taken within a
round, with a bootstrap interval of 95 % of their median. All renderers get the same arrays, camera,
box filter and depth; materials are the nearest (mitsuba_bridge.py says which). Roulette is as each
has it by default.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SCENES = ("cornell", "mixed")
RENDERERS = ("wavecomb", "mitsuba-llvm", "mitsuba-scalar")
VARIANTS = {"mitsuba-llvm": "llvm_ad_rgb", "mitsuba-scalar": "scalar_rgb"}
SPP = {
    "wavecomb": (16, 64),
    "mitsuba-llvm": (16, 64),
    "mitsuba-scalar": (4, 16),
}
"""Short and long render: the slower ones take fewer samples, so that turns last alike."""


# ---- one renderer in its process ---------------------------------------------------------------


def serve(args: argparse.Namespace) -> None:
    """Loads and warms up, then renders on demand: lines of JSON in, lines of JSON out."""
    sys.path.insert(0, str(Path(__file__).parent))
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what libraries print goes to the log
    started = time.perf_counter()
    render, facts = _open(args)
    loaded = time.perf_counter()
    render(args.warm_spp, 0)
    facts |= {"load_s": loaded - started, "warm_up_s": time.perf_counter() - loaded}
    print(json.dumps(facts), file=out)
    for line in sys.stdin:
        job = json.loads(line)
        begin = time.perf_counter()
        picture = render(job["spp"], job["seed"])
        seconds = time.perf_counter() - begin
        print(json.dumps({"seconds": seconds, "mean": [float(v) for v in picture]}), file=out)


def _open(args: argparse.Namespace) -> tuple[Any, dict[str, Any]]:
    """A function (spp, seed) -> mean colour, and facts about the renderer."""
    size = (args.size, args.size)
    if args.serve == "wavecomb":
        import wavecomb
        from wavecomb import _core

        stage = wavecomb.load(args.stage)
        options = {"filter": "box", "filter_width": 1.0, "max_depth": args.max_depth}
        options |= {"threads": args.threads} | json.loads(args.set)

        def ours(spp: int, seed: int) -> Any:
            result = wavecomb.render(stage, size=size, spp=spp, seed=seed, **options)
            facts["settings"] = result.stats["settings"]
            return result.beauty.mean(axis=(0, 1))

        facts: dict[str, Any] = {"build": _core.build_info()}
        facts["settings"] = _core.Settings(width=size[0], height=size[1], **options).to_dict()
        return ours, facts

    from mitsuba_bridge import MitsubaScene, PeerSettings, load_mitsuba
    from recording import record

    mi = load_mitsuba(VARIANTS[args.serve], args.threads)
    if args.serve == "mitsuba-scalar":
        import drjit as dr

        dr.set_thread_count(args.threads)
    settings = PeerSettings(
        args.size, args.size, args.max_depth, rr_depth=5, instancing=args.name != "cornell"
    )
    peer = MitsubaScene(mi, record(Path(args.stage)), settings)

    def theirs(spp: int, seed: int) -> Any:
        # np.array in `render` waits for the result.
        return peer.render(spp, seed).mean(axis=(0, 1))

    facts = {"build": {"version": mi.__version__, "variant": mi.variant()}}
    facts["settings"] = {"rr_depth": 5, "max_depth": args.max_depth + 1, "sampler": "independent"}
    return theirs, facts


# ---- the sitting ---------------------------------------------------------------------------------


class Renderer:
    """A renderer in its process."""

    def __init__(self, name: str, scene: str, stage: Path, args: argparse.Namespace) -> None:
        self.name = name
        command = [sys.executable, __file__, "--serve", name, "--stage", str(stage)]
        command += ["--name", scene, "--size", str(args.size), "--threads", str(args.threads)]
        command += ["--max-depth", str(args.max_depth), "--set", args.set]
        command += ["--warm-spp", str(1 if args.quick else 4)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.facts = self._read()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self.name} ended with {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def render(self, spp: int, seed: int) -> dict[str, Any]:
        """Wall seconds and mean colour of a render."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"spp": spp, "seed": seed}) + "\n")
        self._process.stdin.flush()
        return self._read()

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def sit(scene: str, stage: Path, args: argparse.Namespace) -> dict[str, Any]:
    """All rounds of one scene."""
    rng = random.Random(args.seed)
    renderers = []
    for name in args.renderers:
        print(f"{scene}: {name} loads", file=sys.stderr)
        renderers.append(Renderer(name, scene, stage, args))
    turns: dict[str, list[dict[str, float]]] = {r.name: [] for r in renderers}
    means: dict[str, list[list[float]]] = {r.name: [] for r in renderers}
    pixels = args.size**2
    for number in range(args.rounds):
        for r in rng.sample(renderers, len(renderers)):
            short_spp, long_spp = (1, 2) if args.quick else SPP[r.name]
            jobs = [(short_spp, 2 * number + 1), (long_spp, 2 * number + 2)]
            done = {}
            for spp, seed in rng.sample(jobs, 2):
                done[spp] = r.render(spp, seed)
            means[r.name].append(done[long_spp]["mean"])
            few, many = done[short_spp]["seconds"], done[long_spp]["seconds"]
            extra = max(many - few, 1e-6)
            turns[r.name].append(
                {
                    "short_s": few,
                    "long_s": many,
                    "rate": pixels * long_spp / many,
                    "marginal_rate": pixels * (long_spp - short_spp) / extra,
                }
            )
        rates = ", ".join(f"{k} {v[-1]['rate'] / 1e6:.2f}" for k, v in turns.items())
        print(f"{scene}: round {number + 1}/{args.rounds}: {rates} M/s", file=sys.stderr)
    out: dict[str, Any] = {"renderers": {}, "ratios": {}}
    for r in renderers:
        r.close()
        out["renderers"][r.name] = {
            "spp": [1, 2] if args.quick else list(SPP[r.name]),
            "rate": float(np.median([t["rate"] for t in turns[r.name]])),
            "marginal_rate": float(np.median([t["marginal_rate"] for t in turns[r.name]])),
            "mean_colour": np.mean(means[r.name], axis=0).tolist(),
            "turns": turns[r.name],
            **r.facts,
        }
    if "wavecomb" in turns:
        for name in turns:
            if name != "wavecomb":
                out["ratios"][name] = {
                    kind: ratio(turns["wavecomb"], turns[name], kind, args.seed)
                    for kind in ("rate", "marginal_rate")
                }
    return out


def ratio(
    ours: list[dict[str, float]], theirs: list[dict[str, float]], kind: str, seed: int
) -> dict[str, float]:
    """Median over rounds of our rate over theirs, with a bootstrap interval."""
    values = np.array([a[kind] / b[kind] for a, b in zip(ours, theirs, strict=True)])
    rng = np.random.default_rng(seed)
    again = np.median(rng.choice(values, (4000, len(values))), axis=1)
    low, high = np.percentile(again, [2.5, 97.5])
    return {"median": float(np.median(values)), "low": float(low), "high": float(high)}


# ---- what it was measured on ---------------------------------------------------------------------


def machine() -> dict[str, Any]:
    """CPU, cores, instruction set, load."""
    cpu = platform.processor() or platform.machine()
    isa: list[str] = []
    if Path("/proc/cpuinfo").exists():
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.split(":", 1)[1].strip()
            if line.startswith("flags"):
                flags = line.split(":", 1)[1].split()
                isa = [f for f in ("sse4_2", "avx2", "avx512f", "avx512vl") if f in flags]
                break
    return {
        "cpu": cpu,
        "cores": len(os.sched_getaffinity(0)),
        "isa": isa,
        "load_before": list(os.getloadavg()),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
    }


def commit() -> dict[str, Any]:
    """The commit, and whether sources differ from it."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True)
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--", "src", "python", "bindings", "CMakeLists.txt")
    return {"commit": git("rev-parse", "HEAD"), "changed": changed.splitlines()}


def table(result: dict[str, Any]) -> str:
    """The figures as Markdown."""
    lines = [
        "| stage | renderer | million samples/s | marginal | Wavecomb to it | marginal |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for scene, found in result["scenes"].items():
        for name, r in found["renderers"].items():
            cells = [scene, name, f"{r['rate'] / 1e6:.2f}", f"{r['marginal_rate'] / 1e6:.2f}"]
            for kind in ("rate", "marginal_rate"):
                q = found["ratios"].get(name, {}).get(kind)
                cells.append(f"{q['median']:.2f} [{q['low']:.2f}, {q['high']:.2f}]" if q else "")
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=SCENES, choices=SCENES)
    parser.add_argument("--renderers", nargs="+", default=RENDERERS, choices=RENDERERS)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--size", type=int, default=600, help="edge of the picture, pixels")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--max-depth", type=int, default=7, help="scattering vertices")
    parser.add_argument("--set", default="{}", help="settings of Wavecomb, JSON")
    parser.add_argument("--seed", type=int, default=1, help="of the order of turns")
    parser.add_argument("--quick", action="store_true", help="one or two samples, for a trial")
    parser.add_argument("--stages", type=Path, default=ROOT / "out" / "peers", help="folder")
    parser.add_argument("--output", type=Path, help="JSON (default: first-figures.json)")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    parser.add_argument("--stage", help=argparse.SUPPRESS)
    parser.add_argument("--name", help=argparse.SUPPRESS)
    parser.add_argument("--warm-spp", type=int, default=4, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve(args)
        return
    from wavecomb.scenes import write_scene

    result: dict[str, Any] = {
        "schema": "wavecomb-peers/1",
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        **commit(),
        "machine": machine(),
        "settings": {
            "size": [args.size, args.size],
            "threads": args.threads,
            "max_depth": args.max_depth,
            "rounds": args.rounds,
            "quick": args.quick,
            "filter": "box",
            "wavecomb": json.loads(args.set),
        },
        "scenes": {},
    }
    for scene in args.scenes:
        stage = args.stages / f"{scene}.usdc"
        if not stage.exists():
            write_scene(scene, stage, aspect=1.0)
        result["scenes"][scene] = sit(scene, stage, args)
    result["machine"]["load_after"] = list(os.getloadavg())
    output = args.output or ROOT / "benchmarks" / "results" / "first-figures.json"
    output.parent.mkdir(parents=True, exist_ok=True)
    part = output.with_suffix(".part")
    part.write_text(json.dumps(result, indent=1) + "\n")
    part.replace(output)
    print(table(result))


if __name__ == "__main__":
    main()
