# SPDX-License-Identifier: Apache-2.0
"""Compare the adaptive policy with the best fixed policy, and measure the overhead of cost timers.

    .venv/bin/python benchmarks/adaptive.py out/mixed.usdc out/dragon.usdc out/cornell.usda

Renders each stage with every policy, in rounds of shuffled order, in one process. Prints medians of
the render time, of the ratio of the adaptive policy's time to the best fixed policy's, and of the
ratio of shading times with and without cost measurement.
"""

from __future__ import annotations

import argparse
import random
import statistics

import wavecomb

POLICIES = ("none", "program", "material", "texture-locality", "adaptive")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="+")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, default=600)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    shuffle = random.Random(1)
    for path in options.stages:
        stage = wavecomb.load(path).scene

        def render(**settings: str) -> dict[str, object]:
            size = (options.size, options.size)
            picture = wavecomb.render(
                stage,  # noqa: B023 (called within the round)
                size=size,
                spp=options.spp,
                threads=options.threads,
                **settings,
            )
            return dict(picture.stats)

        seconds: dict[str, list[float]] = {policy: [] for policy in POLICIES}
        overhead = []
        for _ in range(options.rounds):
            for policy in shuffle.sample(POLICIES, len(POLICIES)):
                stats = render(policy=policy)
                seconds[policy].append(stats["seconds"]["render"])  # type: ignore[index]
            shade = {}
            for costs in shuffle.sample(("auto", "model"), 2):
                stats = render(policy="material", costs=costs)
                shade[costs] = stats["phases_s"]["shade"]  # type: ignore[index]
            overhead.append(shade["auto"] / shade["model"])
        median = {policy: statistics.median(times) for policy, times in seconds.items()}
        best = min(time for policy, time in median.items() if policy != "adaptive")
        print(path, {policy: round(time, 3) for policy, time in median.items()})
        print(f"  adaptive to the best fixed: {median['adaptive'] / best:.3f}")
        print(f"  shading with costs measured to without: {statistics.median(overhead):.3f}")


if __name__ == "__main__":
    main()
