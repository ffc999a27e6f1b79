# SPDX-License-Identifier: Apache-2.0
"""Shared code of benchmarks: stages, rounds, ratios with intervals, and machine information."""

from __future__ import annotations

import argparse
import json
import os
import random
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy import stats

import wavecomb
from wavecomb.image.files.output_file import replacing
from wavecomb.run.stats import SORTING, machine
from wavecomb.scenes import write_scene

T = TypeVar("T")

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
STAGES = ("cornell", "mixed", "dragon")


# ---- arguments and rounds ------------------------------------------------------------------------


def sitting_parser(doc: str, name: str) -> argparse.ArgumentParser:
    """Return a parser with the common arguments. Results are written to ``name``.json."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--stages", nargs="+", default=list(STAGES), metavar="NAME")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, default=600, help="image edge in pixels")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--triangles", type=int, default=250_000, help="triangles of the dragon")
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "stages", help="folder of generated stages"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the order of renders")
    parser.add_argument("--output", type=Path, default=RESULTS / f"{name}.json")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    return parser


def sitting_arguments(parser: argparse.ArgumentParser, **quick: Any) -> argparse.Namespace:
    """Parse the arguments; with --quick, the values in ``quick`` replace the user's values."""
    args = parser.parse_args()
    if args.quick:
        folder = ROOT / "out" / "quick"
        vars(args).update(quick, folder=folder, output=folder / args.output.name)
    return args


def shuffled_rounds(
    turns: Sequence[T], args: argparse.Namespace, name: str
) -> Iterator[Iterator[T]]:
    """Yield each case once per round, in shuffled order, and log the end of each round."""
    shuffle = random.Random(args.seed)
    started = time.perf_counter()
    for number in range(args.rounds):
        yield iter(shuffle.sample(turns, len(turns)))
        log(f"{name}: round {number + 1}/{args.rounds}, {time.perf_counter() - started:.0f} s")


# ---- what is rendered ----------------------------------------------------------------------------


def stage_file(path: Path, name: str, **options: Any) -> Path:
    """Write a generated stage to `path` unless it exists; options are those of `write_scene`."""
    if not path.exists():
        log(f"writing {path}")
        path.parent.mkdir(parents=True, exist_ok=True)
        write_scene(name, path, **options)
    return path


def load_stage(name: str, folder: Path, triangles: int) -> Any:
    """Load a generated stage; write it to `folder` if it is missing."""
    path = folder / f"{name}-{triangles}.usdc"
    options = {} if name == "cornell" else {"triangles": triangles}
    return wavecomb.load(stage_file(path, name, **options))


def phase_times(stats: Mapping[str, Any]) -> dict[str, float]:
    """Return thread seconds of a render by phase, from Picture.stats or Result.stats.

    Keys: shade_s, order_s (cost of ordering the shading), traversal_s (trace and shadow phases),
    phases_total_s; and render_s, wall seconds without loading and scene construction.
    """
    phases = stats["phases_s"]
    return {
        "shade_s": phases["shade"],
        "order_s": sum(phases[phase] for phase in SORTING),
        "traversal_s": phases["trace"] + phases["shadow"],
        "phases_total_s": sum(phases.values()),
        "render_s": stats["seconds"]["render"],
    }


# ---- statistics ----------------------------------------------------------------------------------


def bootstrap(values: Any, statistic: Callable[[Any], Any] = np.median) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of a statistic over rounds."""
    if len(values) < 2:
        value = float(statistic(np.asarray(values)))
        return value, value
    found = stats.bootstrap(
        (np.asarray(values),), statistic, n_resamples=1000, vectorized=False,
        method="percentile", rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return float(found.low), float(found.high)


def summary(values: Sequence[float]) -> dict[str, float]:
    """Return the median over rounds, its bootstrap interval, the minimum and the maximum."""
    low, high = bootstrap(np.asarray(values))
    return {
        "median": float(np.median(values)),
        "low": low,
        "high": high,
        "min": float(min(values)),
        "max": float(max(values)),
    }


def ratio(ours: Sequence[float], theirs: Sequence[float]) -> dict[str, float]:
    """Summarise the ratios ours / theirs, each of which is taken within a round."""
    return summary([a / b for a, b in zip(ours, theirs, strict=True)])


# ---- output --------------------------------------------------------------------------------------


def write_result(path: Path, schema: str, content: Mapping[str, Any]) -> None:
    """Write results as JSON atomically, with commit, command, machine and load."""

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
    """Return the command-line arguments without file locations of this machine."""
    kept, places = [], ("--folder", "--output", "--cache", "--pictures")
    for before, word in zip(("", *words), words, strict=False):
        if before not in places and word.split("=")[0] not in places:
            kept.append(word)
    return kept


def head(*names: str) -> list[str]:
    """The first two lines of a Markdown table."""
    return [row(*names), "|" + " --- |" * len(names)]


def row(*cells: str) -> str:
    """A row of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


def show(figure: Mapping[str, float], digits: int = 3) -> str:
    """Return a median and its interval as text."""
    median, low, high = (f"{figure[key]:.{digits}f}" for key in ("median", "low", "high"))
    return f"{median} ({low} to {high})"


def log(text: str) -> None:
    """Log progress to stderr."""
    print(text, file=sys.stderr, flush=True)
