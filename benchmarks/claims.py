# SPDX-License-Identifier: Apache-2.0
"""Measure the speed of Wavecomb against its targets.

    .venv/bin/python benchmarks/claims.py                       # everything: about 20 minutes
    .venv/bin/python benchmarks/claims.py --only lanes threads  # a part of it
    .venv/bin/python benchmarks/claims.py --quick               # check that it runs

- traversal: fraction of time that the trace and shadow phases take, for each policy. One fraction
  is relative to all thread time, another to the sum of all phases, which excludes idle threads.
- lanes: time of shading plus ordering with the maximum number of SIMD lanes, for each policy,
  compared with shading in arrival order on 1 lane and on the maximum number of lanes.
- reference: the wavefront at 1 lane and with default settings, compared with the scalar depth-first
  reference integrator.
- threads: speedup of --threads threads over one thread.
- linear: render time as a function of the number of samples or pixels. A line t = a + b n is fitted
  by least squares of the relative errors. Results are the largest deviation from the line and the
  constant cost of a call.
- waves: the default wave size compared with the best of 256 to 2^20.

A round renders every configuration of a stage once, in shuffled order; configurations that several
measurements share are rendered once. Ratios are taken within a round. Results are medians over
rounds with a bootstrap interval of 95 %. "best" is the policy or wave size with the lowest median.
Times exclude loading and scene construction. All images of one size and sample count must be
bitwise equal, or the benchmark fails. benchmarks/limit.py compares Wavecomb with Embree alone, and
benchmarks/peers compares it with other renderers.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from sitting import (
    head,
    load_stage,
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

import wavecomb
from wavecomb import _core

WIDEST = max(_core.lane_widths())
WAVE_SIZES = tuple(4**k for k in range(4, 11))
"""Wave sizes to compare, in paths: 256 to 2^20."""
SPP_FACTORS = (0.5, 1, 2, 4)
EDGE_FACTORS = (0.5, 0.7071, 1, 1.4142)
"""Factors by which the image width is multiplied; each step doubles the number of pixels."""

Choice = dict[str, Any]
Figures = dict[str, Any]


class Stage:
    """A loaded stage and its results: for each configuration, the times of one render per round."""

    def __init__(self, name: str, args: argparse.Namespace) -> None:
        self.name, self.args = name, args
        self.loaded = load_stage(name, args.folder, args.triangles)
        self.runs: dict[str, list[dict[str, Any]]] = {}
        self._pictures: dict[Any, str] = {}

    def render(self, choice: Choice) -> dict[str, Any]:
        """Render once and store the times."""
        full = {"spp": self.args.spp, "size": self.args.size, "threads": self.args.threads} | choice
        edge = full.pop("size")
        picture = wavecomb.render(self.loaded.scene, size=(edge, edge), **full)
        found = hashlib.sha256(picture.beauty.tobytes()).hexdigest()
        if self._pictures.setdefault((edge, full["spp"]), found) != found:
            sys.exit(f"{self.name}: {_key(choice)} gives a different image")
        run = phase_times(picture.stats) | {
            "threads": full["threads"],
            "wave_size": picture.stats["wave_size"],
        }
        self.runs.setdefault(_key(choice), []).append(run)
        return run

    def times(self, choice: Choice, *keys: str) -> list[float]:
        """Return the sum of the named times for each round; by default the render time."""
        return [sum(run[key] for key in keys or ("render_s",)) for run in self.runs[_key(choice)]]

    def quickest(self, choices: Sequence[Choice]) -> Choice:
        """The configuration with the lowest median time."""
        return min(choices, key=lambda choice: float(np.median(self.times(choice))))


def _key(choice: Choice) -> str:
    return ", ".join(f"{key} {value}" for key, value in sorted(choice.items())) or "default"


# ---- measurements: configurations to render, and their evaluation --------------------------------


def traversal_choices(args: argparse.Namespace) -> list[Choice]:
    return [{"policy": policy} for policy in args.policies]


def traversal(stage: Stage) -> Figures:
    """Return the fraction of render time that the trace and shadow phases take, for each policy."""
    choices = traversal_choices(stage.args)
    shares = {}
    for choice in choices:
        runs = stage.runs[_key(choice)]
        shares[choice["policy"]] = {
            "of_render": summary([r["traversal_s"] / (r["threads"] * r["render_s"]) for r in runs]),
            "of_phases": summary([r["traversal_s"] / r["phases_total_s"] for r in runs]),
        }
    best = stage.quickest(choices)["policy"]
    return {"best": best, "share": shares[best], "policies": shares}


def lanes_choices(args: argparse.Namespace) -> list[Choice]:
    return [*traversal_choices(args), {"policy": "none"}, {"policy": "none", "lanes": 1}]


def lanes(stage: Stage) -> Figures:
    """Return the speedup of shading due to the widest SIMD lanes and due to ordering."""
    best = stage.quickest(traversal_choices(stage.args))
    shading = ("shade_s", "order_s")
    scalar = stage.times({"policy": "none", "lanes": 1}, *shading)
    unordered = stage.times({"policy": "none"}, *shading)
    policies = {}
    for choice in traversal_choices(stage.args):
        ordered = stage.times(choice, *shading)
        policies[choice["policy"]] = {
            "one_lane_none": ratio(scalar, ordered),
            "widest_none": ratio(unordered, ordered),
        }
    return {"best": best["policy"], "lanes": WIDEST, **policies[best["policy"]], "all": policies}


REFERENCE: Choice = {"integrator": "reference"}
ONE_LANE = [{"lanes": 1}, {"lanes": 1, "policy": "none"}]


def reference_choices(args: argparse.Namespace) -> list[Choice]:
    return [REFERENCE, {}, *ONE_LANE]


def reference(stage: Stage) -> Figures:
    """Return the wavefront integrator's times relative to the scalar reference integrator."""
    scalar = stage.times(REFERENCE)
    return {
        "one_lane_to_reference": ratio(stage.times(ONE_LANE[0]), scalar),
        "one_lane_none_to_reference": ratio(stage.times(ONE_LANE[1]), scalar),
        "reference_to_default": ratio(scalar, stage.times({})),
    }


def threads_choices(args: argparse.Namespace) -> list[Choice]:
    return [{}, {"threads": 1}]


def threads(stage: Stage) -> Figures:
    """Speedup by threads."""
    return {
        "threads": stage.args.threads,
        "speedup": ratio(stage.times({"threads": 1}), stage.times({})),
    }


def series(args: argparse.Namespace) -> dict[str, list[tuple[int, Choice]]]:
    """Return configurations of increasing sample or pixel counts, as (count, configuration)."""
    spp = [max(1, round(factor * args.spp)) for factor in SPP_FACTORS]
    edges = [round(factor * args.size) for factor in EDGE_FACTORS]
    return {
        "spp": [(n, {} if n == args.spp else {"spp": n}) for n in spp],
        "pixels": [(e * e, {} if e == args.size else {"size": e}) for e in edges],
    }


def linear_choices(args: argparse.Namespace) -> list[Choice]:
    return [choice for points in series(args).values() for _, choice in points]


def linear(stage: Stage) -> Figures:
    """Fit render time linearly to samples and to pixels; return the relative deviations."""
    figures: Figures = {}
    for name, points in series(stage.args).items():
        amounts = np.array([amount for amount, _ in points], float)
        times = np.array([stage.times(choice) for _, choice in points])
        fits = [_fit(amounts, column) for column in times.T]
        once, slope, deviation = _fit(amounts, np.median(times, axis=1))
        figures[name] = {
            "amounts": amounts.tolist(),
            "median_s": np.median(times, axis=1).tolist(),
            "once_s": once,
            "slope_s": slope,
            "deviation_of_medians": deviation,
            "deviation": summary([fit[2] for fit in fits]),
            "slope_between_ends": summary(
                (np.diff(times[[0, -1]], axis=0)[0] / (amounts[-1] - amounts[0])).tolist()
            ),
        }
    return figures


def _fit(n: Any, t: Any) -> tuple[float, float, float]:
    """Fit t = a + b n by least relative squares; return a, b and the largest deviation."""
    columns = np.stack([1 / t, n / t], axis=1)
    (a, b), *_ = np.linalg.lstsq(columns, np.ones_like(t), rcond=None)
    return float(a), float(b), float(np.max(np.abs((a + b * n) / t - 1)))


def waves_choices(args: argparse.Namespace) -> list[Choice]:
    return [{}, *({"wave_size": size} for size in WAVE_SIZES)]


def waves(stage: Stage) -> Figures:
    """Compare the default wave size with the fastest; small images limit the size of waves."""
    sizes = [{"wave_size": size} for size in WAVE_SIZES]
    best = stage.quickest(sizes)
    return {
        "default": stage.runs[_key({})][0]["wave_size"],
        "best": best["wave_size"],
        "default_to_best": ratio(stage.times({}), stage.times(best)),
        "to_best": {
            choice["wave_size"]: {
                "time": ratio(stage.times(choice), stage.times(best)),
                "used": stage.runs[_key(choice)][0]["wave_size"],
            }
            for choice in sizes
        },
    }


Claim = tuple[Callable[[argparse.Namespace], list[Choice]], Callable[[Stage], Figures]]
CLAIMS: dict[str, Claim] = {
    "traversal": (traversal_choices, traversal),
    "lanes": (lanes_choices, lanes),
    "reference": (reference_choices, reference),
    "threads": (threads_choices, threads),
    "linear": (linear_choices, linear),
    "waves": (waves_choices, waves),
}


# ---- run -----------------------------------------------------------------------------------------


def main() -> None:
    """Run the benchmark, print the tables, write the JSON."""
    args = _arguments()
    figures: Figures = {name: {} for name in args.only}
    runs = {}
    for name in args.stages:
        stage = measure(name, args)
        runs[name] = stage.runs
        for claim in args.only:
            figures[claim][name] = CLAIMS[claim][1](stage)
        settings = {"size": args.size, "spp": args.spp, "threads": args.threads, "lanes": WIDEST}
        write_result(
            args.output,
            "wavecomb-claims/1",
            {"settings": settings, "rounds": args.rounds, "figures": figures, "runs": runs},
        )
    for line in report(figures):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = sitting_parser(__doc__, "claims")
    parser.add_argument("--only", nargs="+", default=list(CLAIMS), choices=list(CLAIMS))
    parser.add_argument(
        "--policies",
        nargs="+",
        default=["program", "material", "texture-locality", "adaptive"],
        metavar="NAME",
        help="wave sizes to search for the best",
    )
    return sitting_arguments(parser, size=80, spp=2, rounds=2, triangles=20_000)


def measure(name: str, args: argparse.Namespace) -> Stage:
    """Render every configuration that the measurements need, round by round."""
    stage = Stage(name, args)
    choices: list[Choice] = []
    for claim in args.only:
        for choice in CLAIMS[claim][0](args):
            if choice not in choices:
                choices.append(choice)
    wavecomb.render(stage.loaded.scene, size=(args.size, args.size), spp=1, threads=args.threads)
    for turns in shuffled_rounds(choices, args, name):
        for choice in turns:
            stage.render(choice)
    return stage


# ---- tables --------------------------------------------------------------------------------------


def report(figures: Figures) -> Iterable[str]:
    """Yield a Markdown line for each result and stage."""
    yield from head("claim", "stage", "figure", "value")
    for claim, stages in figures.items():
        for stage, found in stages.items():
            for name, value in _lines(claim, found):
                yield row(claim, stage, name, value)


def _lines(claim: str, found: Figures) -> Iterable[tuple[str, str]]:
    if claim == "traversal":
        for name, share in found["share"].items():
            yield f"trace + shadow, share {name}, {found['best']}", show(share)
    elif claim == "lanes":
        for name, base in (("1 lane", "one_lane_none"), (f"{WIDEST} lanes", "widest_none")):
            yield f"{name}, none / {WIDEST} lanes, {found['best']}: shading", show(found[base], 2)
    elif claim == "reference":
        yield "1 lane / reference", show(found["one_lane_to_reference"])
        yield "1 lane, none / reference", show(found["one_lane_none_to_reference"])
        yield "reference / default", show(found["reference_to_default"], 2)
    elif claim == "threads":
        yield f"1 thread / {found['threads']}", show(found["speedup"])
    elif claim == "linear":
        for name, fit in found.items():
            yield f"{name}: deviation from a line, medians", f"{fit['deviation_of_medians']:.3f}"
            yield f"{name}: deviation within a round", show(fit["deviation"])
            yield f"{name}: once, seconds", f"{fit['once_s']:.3f}"
    elif claim == "waves":
        ratio_text = show(found["default_to_best"])
        yield f"default {found['default']} / best {found['best']}", ratio_text
        for size, each in found["to_best"].items():
            used = "" if each["used"] == size else f" (in fact {each['used']})"
            yield f"{size}{used} / best", show(each["time"])


if __name__ == "__main__":
    main()
