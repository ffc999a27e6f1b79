# SPDX-License-Identifier: Apache-2.0
"""Timed rounds: new processes in shuffled order."""

from __future__ import annotations

import random
import sys
from pathlib import Path
from typing import Any

from renderers import RENDERERS, Job, Process


def rounds(
    names: list[str], job: Job, count: int, seed: int, logs: Path, ours: dict[str, Any]
) -> dict[str, list[dict[str, Any]]]:
    """Run the rounds; return the measurements of each renderer by name."""
    rng = random.Random(seed)
    turns: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    for number in range(count):
        for name in rng.sample(names, len(names)):
            turns[name].append(turn(name, job, number, rng, logs, ours))
            rate = turns[name][-1]["marginal_rate"] / 1e6
            head = f"{job.stage.stem}: round {number + 1}/{count}: {name}"
            print(f"{head} {rate:.2f} million samples/s", file=sys.stderr)
    return turns


def turn(
    name: str, job: Job, number: int, rng: random.Random, logs: Path, ours: dict[str, Any]
) -> dict[str, Any]:
    """Run a process from start to end, with a short and a long render.

    The sample rate is taken from the long render. The marginal rate, the difference in samples over
    the difference in time, excludes the constant cost of a call.
    """
    chosen = RENDERERS[name]
    process = Process(name, job, logs / f"{name}.log", ours if name == "wavecomb" else {})
    if chosen.warm:
        for spp in chosen.spp:
            process.render(spp, 100)
    jobs = [(spp, 2 * number + k) for k, spp in enumerate(chosen.spp)]
    done = {spp: process.render(spp, seed) for spp, seed in rng.sample(jobs, len(jobs))}
    process.close()
    few, many = (done[spp] for spp in chosen.spp)
    pixels = job.size**2
    extra = many["seconds"] - few["seconds"]
    return {
        "start_to_first_picture_s": process.start_s,
        "load_s": process.facts["load_s"],
        "short_s": few["seconds"],
        "long_s": many["seconds"],
        "spp": [few["spp"], many["spp"]],
        "rate": pixels * many["spp"] / many["seconds"],
        "marginal_rate": pixels * (many["spp"] - few["spp"]) / max(extra, 1e-6),
        "rays_per_s": many["rays"] / many["seconds"] if many["rays"] else None,
        "rays_per_sample": many["rays"] / (pixels * many["spp"]) if many["rays"] else None,
        "peak_mb": many["peak_mb"],
        "mean": many["mean"],
        "version": process.facts["version"],
        "settings": process.facts["settings"],
    }
