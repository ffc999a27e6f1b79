# SPDX-License-Identifier: Apache-2.0
"""Compare each scheduling policy with the best policy of each stage, to check the default.

    .venv/bin/python benchmarks/policies.py                       # generated stages, half an hour
    .venv/bin/python benchmarks/policies.py --files shot.usd ...  # and third-party stages

Each stage is rendered with few and many samples, and in small, default and large waves. In each of
these cases, all policies render in shuffled order, in one process. The time of shading plus
ordering and the render time of each policy are divided by the times of the best *fixed* policy of
the case, which has the lowest median. Prints a Markdown table of the worst case of each policy, and
of every case of the default policy. The JSON file has all results. All images of a case must be
bitwise equal.
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path
from typing import Any

import everything
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

GENERATED: dict[str, dict[str, Any]] = {
    "cornell": {"plain": True},
    "room": {},
    "mixed": {"plain": True},
    "dragon": {"plain": True},
    "heavy": {"materials": 64, "texture_mb": 64.0, "triangles": 200_000},
    "everything": {},
}
FIXED = ("none", "program", "code", "material", "texture-locality")
WAVES = (512, 0, 65_536)
SAMPLES = (4, 32)


def main() -> None:
    """Render, print the tables, write the JSON."""
    args = _arguments()
    stages: list[tuple[str, dict[str, Any] | None]] = [(n, GENERATED[n]) for n in args.stages]
    stages += [(str(path), None) for path in args.files]
    found: dict[str, Any] = {}
    for name, options in stages:
        stage = _stage(name, options, args)
        for wave in WAVES:
            for spp in args.samples:
                case = f"{Path(name).stem}, waves of {wave or 'the default'}, {spp} samples"
                found[case] = measure(stage, wave, spp, args)
                log(f"{case}: best is {found[case]['best']}")
    content = {"size": args.size, "rounds": args.rounds, "threads": args.threads, "cases": found}
    write_result(args.output, "wavecomb-policies/1", content)
    for line in report(found):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--stages", nargs="*", default=list(GENERATED), help="names of generated stages"
    )
    parser.add_argument("--files", type=Path, nargs="*", default=[], help="files of other stages")
    parser.add_argument("--samples", type=int, nargs="+", default=list(SAMPLES))
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "policies", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "policies.json")
    return parser.parse_args()


def _stage(name: str, options: dict[str, Any] | None, args: argparse.Namespace) -> Any:
    if options is None:
        return wavecomb.load(name)
    if name == "everything":
        path = args.folder / "everything.usda"
        return wavecomb.load(path if path.exists() else everything.write(path))
    return wavecomb.load(stage_file(args.folder / f"{name}.usdc", name, **options))


def measure(stage: Any, wave: int, spp: int, args: argparse.Namespace) -> dict[str, Any]:
    """Render one case with all policies."""
    shuffle = random.Random(1)
    default = settings()["policy"].default
    policies = [*FIXED, *(p for p in (default, "adaptive") if p not in FIXED)]
    times: dict[str, list[dict[str, float]]] = {policy: [] for policy in policies}
    picture: np.ndarray | None = None
    for turn in range(args.rounds + 1):
        for policy in shuffle.sample(policies, len(policies)):
            done = wavecomb.render(
                stage, size=(args.size, args.size), spp=spp, threads=args.threads,
                wave_size=wave, policy=policy,
            )  # fmt: skip
            if picture is None:
                picture = done.beauty
            elif not np.array_equal(picture, done.beauty):
                raise SystemExit(f"{policy} gives a different image")
            if turn > 0:  # the first round fills the caches and is not measured
                times[policy].append(phase_times(done.stats))

    def shading(policy: str) -> list[float]:
        return [t["shade_s"] + t["order_s"] for t in times[policy]]

    def rendering(policy: str) -> list[float]:
        return [t["render_s"] for t in times[policy]]

    best = min(FIXED, key=lambda policy: float(np.median(shading(policy))))
    return {
        "best": best,
        "shade_and_order": {p: ratio(shading(p), shading(best)) for p in policies},
        "render": {p: ratio(rendering(p), rendering(best)) for p in policies},
        "times": times,
    }


def report(found: dict[str, Any]) -> list[str]:
    """Return the tables as Markdown lines."""
    default = settings()["policy"].default
    policies = list(next(iter(found.values()))["render"])
    lines = head("policy", "shade + order to the best: median over cases", "worst case", "which")
    for policy in policies:
        medians = {case: f["shade_and_order"][policy]["median"] for case, f in found.items()}
        worst = max(medians, key=lambda case: medians[case])
        median = float(np.median(list(medians.values())))
        lines.append(row(policy, f"{median:.2f}", f"{medians[worst]:.2f}", worst))
    lines += ["", *head("case", "best", f"{default}: shade + order to it", "render to it")]
    for case, figures in found.items():
        cells = [show(figures[what][default], 2) for what in ("shade_and_order", "render")]
        lines.append(row(case, figures["best"], *cells))
    return lines


if __name__ == "__main__":
    main()
