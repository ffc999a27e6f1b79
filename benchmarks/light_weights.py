# SPDX-License-Identifier: Apache-2.0
"""Compare calibrated light shares with shares by power, and with Mitsuba.

    .venv/bin/python benchmarks/light_weights.py
    .venv/bin/python benchmarks/light_weights.py --quick       # check that it runs

The stage `studio` has a key light, a fill light and a dim dome, as is common. Further stages are
those of benchmarks/light_selection.py and of the isolation benchmark. For each seed, one render
uses `light_weights` power and another uses calibrated shares. Mitsuba 3 selects lights uniformly.
It renders `studio` from the same arrays with the samplers `independent` and `multijitter`, and its
images are compared with a converged image by Mitsuba.

Results:

- relMSE: mean of (x - r)^2 / (r^2 + 0.01) at equal samples, minus the noise of the reference;
- trimmed: relMSE without the worst 0.1 % of pixels, which a few bright paths dominate;
- ratio: calibrated / power within a round, median with its 95 % interval;
- calibration: seconds of calibration for an image of `--timed-size`, also as a fraction of 10 s.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sitting import RESULTS, ROOT, head, log, ratio, row, show, stage_file, summary, write_result

import wavecomb

Picture = NDArray[np.float64]
OUTLIERS = 1e-3
"""Fraction of the pixels that the trimmed error leaves out; these have the largest errors."""
STAGES: dict[str, tuple[str, dict[str, Any]]] = {
    "studio": ("studio", {"triangles": 20_000}),
    "mixed": ("mixed", {"triangles": 50_000}),
    "dragon": ("dragon", {"triangles": 50_000}),
    "cornell": ("cornell", {}),
    "lights-10": ("lights", {"lights": 10}),
    "lights-1000": ("lights", {"lights": 1000}),
}


def main() -> None:
    """Render, print the tables, write the JSON."""
    args = _arguments()
    found: dict[str, Any] = {}
    for name in args.stages:
        for depth in args.max_depth:
            key = f"{name}, depth {depth}"
            found[key] = measure(name, depth, args)
            log(f"{key}: {found[key]}")
            content = {"size": args.size, "spp": args.spp, "rounds": args.rounds, "stages": found}
            write_result(args.output, "wavecomb-light-weights/1", content)
    for line in report(found):
        print(line)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stages", nargs="+", choices=list(STAGES), default=list(STAGES))
    parser.add_argument("--max-depth", nargs="+", type=int, default=[1, 7])
    parser.add_argument("--size", type=int, default=150)
    parser.add_argument("--timed-size", type=int, default=600)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--reference", type=int, default=4096, help="samples per pixel")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--sampler", default="independent")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--no-mitsuba", action="store_true")
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "out" / "quick", help="folder of generated stages"
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "light_weights.json")
    parser.add_argument("--quick", action="store_true", help="small renders, to check that it runs")
    args = parser.parse_args()
    if args.quick:
        args.size, args.spp, args.reference, args.rounds = 48, 16, 256, 5
        args.stages, args.max_depth, args.timed_size = ["studio", "lights-10"], [1], 128
        args.output = args.folder / "light_weights.json"
    return args


def stage_path(name: str, folder: Path) -> Path:
    """Return the stage file; write it if it is missing."""
    scene, options = STAGES[name]
    path = folder / f"weights-{name}.usdc"
    return stage_file(path, scene, **options)


def measure(name: str, depth: int, args: argparse.Namespace) -> dict[str, Any]:
    """Return all results of one stage with paths of `depth` vertices."""
    path = stage_path(name, args.folder)
    scene = wavecomb.load(path).scene

    def render(weights: str, seed: int, spp: int) -> Any:
        return wavecomb.render(
            scene, size=(args.size, args.size), spp=spp, seed=seed, threads=args.threads,
            max_depth=depth, light_weights=weights, sampler=args.sampler, filter="box",
            filter_width=1.0,
        )  # fmt: skip

    reference = render("calibrated", 1_000_003, args.reference)
    truth = reference.beauty.astype(np.float64)
    errors: dict[str, list[tuple[float, float]]] = {"power": [], "calibrated": []}
    for seed in range(args.rounds):
        for weights, of in errors.items():
            picture = render(weights, seed, args.spp).beauty.astype(np.float64)
            of.append(error(picture, truth, args.spp / args.reference))
    figures: dict[str, Any] = {
        "shares": reference.stats["light_calibration"]["shares"],
        "tilted_nodes": reference.stats["light_calibration"]["tilted_nodes"],
        "ours": {weights: _figures(of) for weights, of in errors.items()},
        "ratio": _ratio(errors["calibrated"], errors["power"], 0),
        "trimmed_ratio": _ratio(errors["calibrated"], errors["power"], 1),
        "calibration_s": summary([_calibration_s(scene, depth, args) for _ in range(args.rounds)]),
    }
    if name == "studio" and not args.no_mitsuba:
        figures["mitsuba"] = _mitsuba(path, depth, args)
    return figures


def _calibration_s(scene: Any, depth: int, args: argparse.Namespace) -> float:
    """Return the seconds that calibrating light shares takes for an image of ``--timed-size``."""
    size = (args.timed_size, args.timed_size)
    stats = wavecomb.render(scene, size=size, spp=1, max_depth=depth, threads=args.threads).stats
    return float(stats["light_calibration"]["seconds"])


def error(picture: Picture, truth: Picture, doubt: float) -> tuple[float, float]:
    """Return the relMSE and trimmed relMSE of an image, minus the reference's noise."""
    errors = np.sort(((picture - truth) ** 2 / (truth**2 + 0.01)).mean(axis=2).ravel())
    kept = round(len(errors) * (1.0 - OUTLIERS))
    return (
        float(errors.mean() / (1.0 + doubt)),
        float(errors[:kept].sum() / len(errors) / (1.0 + doubt)),
    )


def _figures(errors: list[tuple[float, float]]) -> dict[str, Any]:
    whole, trimmed = ([e[k] for e in errors] for k in (0, 1))
    return {"relmse": summary(whole), "trimmed": summary(trimmed)}


def _ratio(
    ours: list[tuple[float, float]], theirs: list[tuple[float, float]], which: int
) -> dict[str, float]:
    return ratio([e[which] for e in ours], [e[which] for e in theirs])


def _mitsuba(path: Path, depth: int, args: argparse.Namespace) -> dict[str, Any]:
    """Mitsuba's errors by sampler, with a new seed per round."""
    sys.path.insert(0, str(Path(__file__).with_name("peers")))
    from mitsuba_bridge import MitsubaScene, PeerSettings, load_mitsuba
    from recording import record

    mi = load_mitsuba("scalar_rgb")
    recorded = record(path)

    def opened(sampler: str) -> MitsubaScene:
        settings = PeerSettings(args.size, args.size, max_depth=depth, sampler=sampler)
        return MitsubaScene(mi, recorded, settings)

    # Render the reference image with fewer samples in Mitsuba, since its scalar variant is slow.
    samples = max(args.spp, args.reference // 4)
    truth = opened("independent").render(samples, 1_000_003).astype(np.float64)
    found = {}
    own = (0.0, 0.0)  # sum and square of the errors of Mitsuba's reference image
    for sampler in ("independent", "multijitter"):
        scene = opened(sampler)
        pictures = [scene.render(args.spp, seed + 1) for seed in range(args.rounds)]
        errors = [error(picture.astype(np.float64), truth, 0.0) for picture in pictures]
        if sampler == "independent":
            doubt = args.spp / samples
            mean = np.mean(errors, axis=0) * (doubt / (1.0 + doubt))
            own = (float(mean[0]), float(mean[1]))
        found[sampler] = _figures([(whole - own[0], trim - own[1]) for whole, trim in errors])
    return found


def report(found: dict[str, Any]) -> list[str]:
    """Return the tables as Markdown lines."""
    lines = head(
        "stage", "relMSE by power", "calibrated", "ratio", "trimmed, ratio", "calibration, s",
        "of a render of 10 s",
    )  # fmt: skip
    for name, figures in found.items():
        ours, seconds = figures["ours"], figures["calibration_s"]
        lines.append(
            row(
                name,
                show(ours["power"]["relmse"], 4),
                show(ours["calibrated"]["relmse"], 4),
                show(figures["ratio"], 2),
                show(figures["trimmed_ratio"], 2),
                show(seconds),
                f"{10.0 * seconds['median']:.1f} %",
            )
        )
    with_peer = {name: f for name, f in found.items() if "mitsuba" in f}
    if with_peer:
        lines += [
            "",
            *head("stage", "calibrated", "Mitsuba, independent", "Mitsuba, multijitter"),
            *[
                row(
                    name,
                    show(f["ours"]["calibrated"]["relmse"], 4),
                    *(show(f["mitsuba"][s]["relmse"], 4) for s in ("independent", "multijitter")),
                )
                for name, f in with_peer.items()
            ],
        ]
    return lines


if __name__ == "__main__":
    main()
