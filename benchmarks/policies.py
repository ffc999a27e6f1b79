# SPDX-License-Identifier: Apache-2.0
"""What the order of shading brings: policies, roulette and ray orders, interleaved in one sitting.

    .venv/bin/python benchmarks/policies.py --minutes 10     # as many samples as fit
    .venv/bin/python benchmarks/policies.py --spp 256        # the dissertation's, however long
    .venv/bin/python benchmarks/policies.py --quick          # does it run?

Sections:

- policies: each policy x roulette x lane width on each scene. Ratios are to `none` with the same
  roulette and width, so order and roulette stay apart; `random-runs` is the placebo.
- roulette: each roulette under `none` and under `program`, against `throughput`: work, time and,
  with --reference-spp, error and efficiency 1 / (relMSE x time).
- ray orders: of bounce and of shadow rays, policy `program`, against slot order.

A repetition renders every choice of a scene once, in an order shuffled by a fixed seed. Ratios are
taken within a repetition; tables have medians, and for time a bootstrap interval of 95 %. Pictures
and counts must be equal within a roulette, bit for bit, or the sitting fails. Times are thread
seconds of the phases, and wall seconds of the render without load and acceleration structure.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import random
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sitting import RESULTS, ROOT, bootstrap, head, load_stage, log, phase_times, row, write_result

import wavecomb
from wavecomb import _core

ROULETTES = ("throughput", "cost-aware")
RAY_ORDERS = (
    ("slot", "slot"),
    ("morton", "slot"),
    ("morton-octant", "slot"),
    ("direction", "slot"),
    ("auto", "slot"),
    ("slot", "morton"),
    ("slot", "morton-octant"),
    ("slot", "direction"),
    ("slot", "auto"),
    ("auto", "auto"),
)
Run = dict[str, Any]
Choice = dict[str, Any]


def main() -> None:
    args = _arguments()
    sitting = Sitting(args)
    sitting.measure()
    sitting.write()
    for line in sitting.report():
        print(line)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["mixed", "dragon"], metavar="NAME")
    parser.add_argument("--size", nargs=2, type=int, default=(600, 600), metavar=("W", "H"))
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--minutes", type=float, help="fewer samples if need be, to fit")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--policies", nargs="+", default=_core.policies(), metavar="NAME")
    parser.add_argument("--roulettes", nargs="+", default=list(ROULETTES), metavar="NAME")
    parser.add_argument("--lanes", nargs="+", type=int, default=[1, max(_core.lane_widths())])
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--max-depth", type=int, default=8)
    parser.add_argument("--wave-size", type=int, default=0)
    parser.add_argument("--materialize", default="auto", choices=["auto", "on", "off"])
    parser.add_argument("--reference-spp", type=int, default=0, help="0: no error, no efficiency")
    parser.add_argument("--seed", type=int, default=1, help="of the order of the runs")
    parser.add_argument(
        "--sections", nargs="+", default=["policies", "rays"], choices=["policies", "rays"]
    )
    parser.add_argument("--stages", type=Path, default=ROOT / "out" / "stages")
    parser.add_argument("--triangles", type=int, default=250_000, help="of a dragon")
    parser.add_argument("--output", type=Path, default=RESULTS / "policies.json")
    parser.add_argument("--quick", action="store_true", help="small; for trying the program")
    args = parser.parse_args()
    if args.quick:
        args.size, args.spp, args.repetitions, args.triangles = (80, 80), 4, 2, 20_000
        args.stages, args.output = ROOT / "out" / "quick", ROOT / "out" / "quick" / "policies.json"
    if "none" not in args.policies:
        args.policies = ["none", *args.policies]
    return args


class Sitting:
    """All runs of one call, and what they come to."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.args = args
        self.runs: list[Run] = []
        self.errors: dict[str, dict[str, float]] = {}
        self.spp: dict[str, int] = {}
        self.settings: Choice = {
            "size": tuple(args.size),
            "threads": args.threads,
            "max_depth": args.max_depth,
            "wave_size": args.wave_size,
            "materialize": args.materialize,
        }

    def measure(self) -> None:
        """Every choice, repetition by repetition."""
        rng = random.Random(self.args.seed)
        for name in self.args.scenes:
            scene = self._scene(name)
            choices = self._choices()
            self.spp[name] = self._samples(scene, choices)
            started = time.perf_counter()
            for repetition in range(self.args.repetitions):
                rng.shuffle(choices)
                for choice in choices:
                    self.runs.append(self._run(name, scene, choice, repetition))
                done = time.perf_counter() - started
                log(f"{name}: repetition {repetition + 1}, {self.spp[name]} spp, {done:.0f} s")
                self.write()
            self._expect_equal(name)
            if self.args.reference_spp:
                self.errors[name] = self._errors(scene, self.spp[name])

    def _scene(self, name: str) -> Any:
        return load_stage(name, self.args.stages, self.args.triangles).scene

    def _choices(self) -> list[Choice]:
        choices: list[Choice] = []
        slot = {"ray_order": "slot", "shadow_order": "slot"}
        if "policies" in self.args.sections:
            for policy, roulette, lanes in itertools.product(
                self.args.policies, self.args.roulettes, self.args.lanes
            ):
                choices.append({"policy": policy, "roulette": roulette, "lanes": lanes, **slot})
        if "rays" in self.args.sections:
            widest = {"policy": "program", "roulette": "throughput", "lanes": max(self.args.lanes)}
            for ray, shadow in RAY_ORDERS:
                choice = {**widest, "ray_order": ray, "shadow_order": shadow}
                if choice not in choices:
                    choices.append(choice)
        return choices

    def _samples(self, scene: Any, choices: Sequence[Choice]) -> int:
        """Samples that fit in the time given: by two short renders per lane width."""
        spp = int(self.args.spp)
        if self.args.minutes is None:
            return spp
        fixed, per_sample = 0.0, 0.0
        for lanes in {choice["lanes"] for choice in choices}:
            times = []
            for samples in (1, 5):
                started = time.perf_counter()
                wavecomb.render(scene, spp=samples, lanes=lanes, policy="none", **self.settings)
                times.append(time.perf_counter() - started)
            count = sum(choice["lanes"] == lanes for choice in choices)
            slope = max(1e-4, (times[1] - times[0]) / 4)
            per_sample += count * slope
            fixed += count * max(0.0, times[0] - slope)
        seconds = 60.0 * self.args.minutes / len(self.args.scenes) / self.args.repetitions
        return max(1, min(spp, int((seconds - fixed) / per_sample)))

    def _run(self, name: str, scene: Any, choice: Choice, repetition: int) -> Run:
        picture = wavecomb.render(scene, spp=self.spp[name], **self.settings, **choice)
        stats = picture.stats
        phases, times = stats["phases_s"], phase_times(stats)
        return {
            "scene": name,
            "repetition": repetition,
            **choice,
            "shade_s": times["shade_s"],
            "order_s": times["order_s"],
            "ordered_shade_s": times["shade_s"] + times["order_s"],
            "order_rays_s": phases["order_rays"],
            "trace_s": phases["trace"],
            "shadow_s": phases["shadow"],
            "total_s": times["render_s"],
            "phases_s": phases,
            **stats["coherence"],
            "lane_utilisation": stats["lane_utilisation"],
            "counts": {
                key: stats["counts"][key] for key in ("samples", "rays", "shadow_rays", "records")
            },
            "rays": stats["counts"]["rays"] + stats["counts"]["shadow_rays"],
            "records": stats["counts"]["records"],
            "cost_prediction": stats["cost_prediction"],
            "policy_uses": stats["policy_uses"],
            "picture": hashlib.sha256(picture.beauty.tobytes()).hexdigest(),
        }

    def _expect_equal(self, name: str) -> None:
        """One picture and one amount of work for each roulette, whatever the order."""
        for roulette in self.args.roulettes:
            runs = [r for r in self.runs if r["scene"] == name and r["roulette"] == roulette]
            if len({(run["picture"], repr(run["counts"])) for run in runs}) > 1:
                sys.exit(f"{name}, roulette {roulette}: pictures or counts differ among policies")

    def _errors(self, scene: Any, spp: int) -> dict[str, float]:
        """Error (relMSE) of each roulette's picture against a long render with another seed."""
        reference = wavecomb.render(
            scene, spp=self.args.reference_spp, seed=99, roulette="off", **self.settings
        )
        errors = {}
        for roulette in self.args.roulettes:
            picture = wavecomb.render(scene, spp=spp, roulette=roulette, **self.settings)
            errors[roulette] = float(wavecomb.compare(picture, reference).rel_mse)
        return errors

    def write(self) -> None:
        """All of it as JSON."""
        write_result(
            self.args.output,
            "wavecomb-benchmark-policies/1",
            {
                "settings": self.settings,
                "spp": self.spp,
                "repetitions": self.args.repetitions,
                "errors": self.errors,
                "runs": self.runs,
            },
        )

    # ---- tables ----------------------------------------------------------------------------------

    def report(self) -> Iterable[str]:
        """The tables, as Markdown."""
        for name in self.args.scenes:
            width, height = self.settings["size"]
            yield (
                f"## {name}: {width} x {height}, {self.spp[name]} spp, "
                f"{self.args.repetitions} repetitions"
            )
            yield ""
            if "policies" in self.args.sections:
                for roulette, lanes in itertools.product(self.args.roulettes, self.args.lanes):
                    yield f"Roulette {roulette}, {lanes} lane{'s' if lanes > 1 else ''}:"
                    yield ""
                    yield from self._policy_table(name, roulette, lanes)
                    yield ""
                yield "Roulettes, ratios to throughput:"
                yield ""
                yield from self._roulette_table(name)
                yield ""
            if "rays" in self.args.sections:
                yield "Ray orders, policy program, ratios to slot:"
                yield ""
                yield from self._ray_table(name)
                yield ""

    def _policy_table(self, scene: str, roulette: str, lanes: int) -> Iterable[str]:
        yield from head(
            *("policy", "shade s", "to none", "order s", "shade + order to none", "total to none"),
            *("run length", "material", "texture", "lanes full", "M rays"),
        )
        fixed = {"scene": scene, "roulette": roulette, "lanes": lanes, **_SLOT}
        for policy in self.args.policies:
            runs = self._pick(policy=policy, **fixed)
            base = self._pick(policy="none", **fixed)
            yield row(
                policy,
                f"{_median(runs, 'shade_s'):.3f}",
                _ratio(runs, base, "shade_s"),
                f"{_median(runs, 'order_s'):.3f}",
                _ratio(runs, base, "ordered_shade_s"),
                _ratio(runs, base, "total_s"),
                f"{_median(runs, 'run_length'):.1f}",
                f"{_median(runs, 'material_homogeneity'):.3f}",
                f"{_median(runs, 'texture_homogeneity'):.3f}",
                f"{_median(runs, 'lane_utilisation'):.3f}",
                f"{_median(runs, 'rays') / 1e6:.2f}",
            )

    def _roulette_table(self, scene: str) -> Iterable[str]:
        yield from head(
            *("policy", "lanes", "roulette", "rays", "records", "shade", "total"),
            *("relMSE", "efficiency"),
        )
        errors = self.errors.get(scene, {})
        for policy, lanes, roulette in itertools.product(
            ("none", "program"), self.args.lanes, self.args.roulettes
        ):
            fixed = {"scene": scene, "lanes": lanes, "policy": policy, **_SLOT}
            runs = self._pick(roulette=roulette, **fixed)
            base = self._pick(roulette=self.args.roulettes[0], **fixed)
            if not runs or not base:
                continue
            error = efficiency = "-"
            if errors:
                first = errors[self.args.roulettes[0]]
                error = f"{errors[roulette]:.3g}"
                factor = first / errors[roulette]
                efficiency = _ratio(base, runs, "total_s", scale=factor)
            yield row(
                policy,
                str(lanes),
                roulette,
                *(_ratio(runs, base, key) for key in ("rays", "records", "shade_s", "total_s")),
                error,
                efficiency,
            )

    def _ray_table(self, scene: str) -> Iterable[str]:
        yield from head(
            "bounce", "shadow", "order_rays s", "trace", "shadow time", "all three", "total"
        )
        fixed = {
            "scene": scene,
            "lanes": max(self.args.lanes),
            "policy": "program",
            "roulette": "throughput",
        }

        def of(ray: str, shadow: str) -> list[Run]:
            runs = self._pick(ray_order=ray, shadow_order=shadow, **fixed)
            for run in runs:
                run["traversal_s"] = run["order_rays_s"] + run["trace_s"] + run["shadow_s"]
            return runs

        base = of("slot", "slot")
        for ray, shadow in RAY_ORDERS:
            runs = of(ray, shadow)
            yield row(
                ray,
                shadow,
                f"{_median(runs, 'order_rays_s'):.3f}",
                *(
                    _ratio(runs, base, key)
                    for key in ("trace_s", "shadow_s", "traversal_s", "total_s")
                ),
            )

    def _pick(self, **fixed: Any) -> list[Run]:
        runs = [run for run in self.runs if all(run[key] == value for key, value in fixed.items())]
        return sorted(runs, key=lambda run: run["repetition"])


_SLOT = {"ray_order": "slot", "shadow_order": "slot"}


def _median(runs: Sequence[Run], key: str) -> float:
    return float(np.median([run[key] for run in runs])) if runs else float("nan")


def _ratio(runs: Sequence[Run], base: Sequence[Run], key: str, scale: float = 1.0) -> str:
    """Median over repetitions of the ratio within each, with its bootstrap interval."""
    ratios = np.array(
        [scale * a[key] / b[key] for a, b in zip(runs, base, strict=True) if b[key] > 0]
    )
    if ratios.size == 0:
        return "-"
    text = f"{np.median(ratios):.3f}"
    if np.ptp(ratios) == 0.0:
        return text
    low, high = bootstrap(ratios)
    return f"{text} ({low:.3f} to {high:.3f})"


if __name__ == "__main__":
    main()
