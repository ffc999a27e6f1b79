# SPDX-License-Identifier: Apache-2.0
"""What every sitting shares: stages, ratios with intervals, where and on what it was measured."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wavecomb
from wavecomb.picture.files import replacing
from wavecomb.run.stats import SORTING, machine
from wavecomb.scenes import write_scene

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
STAGES = ("cornell", "mixed", "dragon")


# ---- what is rendered ----------------------------------------------------------------------------


def stage_file(path: Path, name: str, **options: Any) -> Path:
    """`path`, where a generated stage is written unless it is there. Options: of `write_scene`."""
    if not path.exists():
        log(f"writing {path}")
        path.parent.mkdir(parents=True, exist_ok=True)
        write_scene(name, path, **options)
    return path


def load_stage(name: str, folder: Path, triangles: int) -> Any:
    """A generated stage, loaded; written to `folder` where it is not there yet."""
    path = folder / f"{name}-{triangles}.usdc"
    options = {} if name == "cornell" else {"triangles": triangles}
    return wavecomb.load(stage_file(path, name, **options))


def phase_times(stats: Mapping[str, Any]) -> dict[str, float]:
    """Thread seconds of a render that sittings ask for, from Picture.stats or Result.stats.

    shade_s, order_s (what an order of shading costs), traversal_s (trace and shadow phases),
    phases_total_s; and render_s, wall seconds without loading and building.
    """
    phases = stats["phases_s"]
    return {
        "shade_s": phases["shade"],
        "order_s": sum(phases[phase] for phase in SORTING),
        "traversal_s": phases["trace"] + phases["shadow"],
        "phases_total_s": sum(phases.values()),
        "render_s": stats["seconds"]["render"],
    }


# ---- figures -------------------------------------------------------------------------------------


def bootstrap(values: Any, statistic: Callable[[Any], Any] = np.median) -> tuple[float, float]:
    """95 % interval of a statistic over rounds."""
    rng = np.random.default_rng(0)
    draws = [statistic(rng.choice(values, len(values))) for _ in range(1000)]
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(low), float(high)


def summary(values: Sequence[float]) -> dict[str, float]:
    """Median over rounds, its bootstrap interval, and the range."""
    low, high = bootstrap(np.asarray(values))
    return {
        "median": float(np.median(values)),
        "low": low,
        "high": high,
        "min": float(min(values)),
        "max": float(max(values)),
    }


def ratio(ours: Sequence[float], theirs: Sequence[float]) -> dict[str, float]:
    """Summary of ours / theirs, taken within each round."""
    return summary([a / b for a, b in zip(ours, theirs, strict=True)])


# ---- output --------------------------------------------------------------------------------------


def write_result(path: Path, schema: str, content: Mapping[str, Any]) -> None:
    """Writes a sitting as JSON, whole or not at all, with commit, command, machine and load."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--", "src", "python", "bindings", "CMakeLists.txt")
    script = Path(sys.argv[0]).resolve()
    named = script.relative_to(ROOT) if script.is_relative_to(ROOT) else script.name
    document = {
        "schema": schema,
        "commit": git("rev-parse", "HEAD"),
        "changed": changed.splitlines(),
        "command": shlex.join([str(named), *_what_counts(sys.argv[1:])]),
        "machine": machine(),
        "load": os.getloadavg(),
        **content,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as part:
        part.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _what_counts(words: Sequence[str]) -> list[str]:
    """Arguments without those that say where files go on this machine."""
    kept, places = [], ("--folder", "--output", "--cache", "--pictures")
    for before, word in zip(("", *words), words, strict=False):
        if before not in places and word.split("=")[0] not in places:
            kept.append(word)
    return kept


def head(*names: str) -> list[str]:
    """The first two lines of a Markdown table."""
    return [row(*names), "|" + " --- |" * len(names)]


def row(*cells: str) -> str:
    """A line of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


def show(figure: Mapping[str, float], digits: int = 3) -> str:
    """Median and interval."""
    median, low, high = (f"{figure[key]:.{digits}f}" for key in ("median", "low", "high"))
    return f"{median} ({low} to {high})"


def log(text: str) -> None:
    """Progress, on the error stream."""
    print(text, file=sys.stderr, flush=True)
