# SPDX-License-Identifier: Apache-2.0
"""Generates benchmark results with known times, for tests of the analysis and the report."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wavecomb.bench.results import header_line, row_line

DEFAULTS: dict[str, Any] = {
    **{"suite": "made-up", "experiment": "policies", "stage": "mixed", "renderer": "wavecomb"},
    **{"seed": 1, "width": 64, "height": 48, "spp": 16, "threads": 2, "lanes": 16},
    **{"wave_size": 4096, "policy": "none", "roulette": "throughput", "ray_order": "slot"},
    **{"shadow_order": "slot", "max_depth": 6, "status": "ok", "load_average": 0.4},
    **{"noisy": False, "spin_s": 0.05, "picture_sha256": "0" * 64},
    **{"case": "", "time_limit": None},
}
POLICY_FACTORS = {
    **{"none": 1.0, "program": 0.6, "material": 0.58, "texture": 0.61},
    **{"texture-locality": 0.6, "cost-benefit": 0.57, "random-runs": 0.6},
    **{"oracle": 0.55, "adaptive": 0.585},
}
_PHASES = {
    **{"generate_s": 0.03, "order_rays_s": 0.0, "trace_s": 0.4, "shadow_s": 0.2},
    **{"resolve_s": 0.02, "metrics_s": 0.01, "other_s": 0.04},
}


def run_row(
    time: float, rng: np.random.Generator, noise: float, shake: float, **settings: Any
) -> dict[str, Any]:
    """Returns a result row whose shading time is ``time``, multiplied by ``shake`` and noise."""
    row = {**DEFAULTS, **settings}
    order = 0.0 if row["policy"] == "none" else 0.02
    scale = shake * float(np.exp(rng.normal(0, noise)))
    shade = (time - order) * scale
    phases = {name: value * scale for name, value in _PHASES.items()}
    keys, sort, move = (order * scale * share for share in (0.3, 0.5, 0.2))
    render = (shade + order * scale + sum(phases.values())) / row["threads"]
    samples = row["width"] * row["height"] * row["spp"]
    rel_mse = row.pop("rel_mse", 0.4 / row["spp"])
    grouped = row["policy"] != "none"
    varied = ("threads", "lanes", "wave_size", "roulette", "ray_order")
    key = [row["renderer"], *(f"{name}-{row[name]}" for name in varied)]
    config = ".".join(
        [
            row["experiment"],
            row["stage"],
            *([row["case"]] if row.get("case") else []),
            *key,
            f"spp-{row['spp']}",
            f"policy-{row['policy']}",
        ]
    )
    return {
        **row,
        **phases,
        **{"config": config, "run_id": f"{config}-{row['repetition']}"},
        **{"wall_s": render + 1.2, "load_s": 0.8, "build_s": 0.1, "render_s": render},
        **{"keys_s": keys, "sort_s": sort, "materialize_s": move, "order_s": order * scale},
        **{"shade_s": shade, "shade_and_order_s": shade + order * scale},
        "run_length_coherence": 120.0 if grouped else 6.0,
        "cache_line_homogeneity": 0.99 if grouped else 0.84,
        "texture_homogeneity": 0.45 if row["policy"] == "texture-locality" else 0.15,
        "hits_per_material": {"/M/gold": 9000, "/M/clay": 5000},
        **{"sort_overhead_s": order * scale, "sort_overhead": order / time},
        **{"records": 3 * samples, "rays": 4 * samples, "shadow_rays": 2 * samples},
        **{"packets": samples, "lane_utilisation": 0.96 if grouped else 0.35},
        **{"samples_per_s": samples / render, "rays_per_s": 6 * samples / render},
        **{"rel_mse": rel_mse, "efficiency": 1 / (rel_mse * render), "peak_rss_mb": 300.0},
        **{"variance": rel_mse * 0.3, "cost_prediction_r2": 0.9, "cost_prediction_error": 0.1},
        "started": "2026-01-01T12:00:00Z",
    }


def runs_of(
    vary: Mapping[str, Sequence[Any]],
    time: Callable[..., float],
    *,
    repetitions: int = 8,
    noise: float = 0.01,
    shake: float = 0.05,
    seed: int = 1,
    **settings: Any,
) -> list[dict[str, Any]]:
    """Returns rows for all combinations of ``vary``. ``time`` returns the expected shading time."""
    rng = np.random.default_rng(seed)
    rows: list[dict[str, Any]] = []
    for repetition in range(repetitions):
        of_round = float(np.exp(rng.normal(0, shake)))
        for values in itertools.product(*vary.values()):
            chosen = dict(zip(vary, values, strict=True))
            place = {"repetition": repetition, "order_in_sitting": len(rows)}
            row_settings = {**settings, **chosen, **place}
            rows.append(run_row(time(**chosen), rng, noise, of_round, **row_settings))
    return rows


CASE_ERRORS = {"off": 0.02, "aimed": 0.01}
"""Maps the cases of the experiment `parts` to their relative MSE."""


def policy_rows(**more: Any) -> list[dict[str, Any]]:
    """Returns rows of all policies on two stages and two lane widths, with ``POLICY_FACTORS``."""

    def time(stage: str, lanes: int, policy: str) -> float:
        gain = POLICY_FACTORS[policy] if lanes == 16 else 1.0
        return (1.0 if stage == "mixed" else 1.6) * gain * (1.0 if lanes == 16 else 2.5)

    vary = {"stage": ["mixed", "dragon"], "lanes": [1, 16], "policy": list(POLICY_FACTORS)}
    return runs_of(vary, time, **more)


def everything() -> list[dict[str, Any]]:
    """Returns a small experiment of each kind that the report supports."""
    rows = policy_rows(repetitions=4)
    rows += runs_of(
        {
            **{"lanes": [1, 16], "wave_size": [4096, 65536], "roulette": ["throughput", "off"]},
            **{"policy": ["none", "material", "adaptive"]},
        },
        lambda lanes, wave_size, roulette, policy: (
            (2.0 if lanes == 1 else 1.0)
            * (1.1 if wave_size == 65536 else 1.0)
            * (1.3 if roulette == "off" else 1.0)
            * (0.6 if policy != "none" and lanes == 16 else 1.0)
        ),
        experiment="ablation",
        repetitions=4,
    )
    for case, error in CASE_ERRORS.items():
        rows += runs_of(
            {"case": [case]}, lambda case: 1.0, experiment="parts", repetitions=4, noise=0.0,
            shake=0.0, rel_mse=error, time_limit=5.0,
        )  # fmt: skip
    for factor, values in {"threads": [1, 2, 4], "wave_size": [64, 1024, 16384, 262144]}.items():
        for value in values:
            rows += runs_of(
                {"policy": ["none", "program"]},
                lambda policy, v=value, f=factor: (
                    (1.0 if policy == "none" else 0.6) * (1.0 if f == "threads" else 1 + 40 / v)
                ),
                experiment=f"scaling-{factor}",
                repetitions=4,
                **{"factor": factor, "factor_value": value, factor: value},
            )
    rows += runs_of(
        {"spp": [4, 16, 64], "policy": ["none", "program"]},
        lambda spp, policy: spp / 16 * (1.0 if policy == "none" else 0.6),
        experiment="error",
        repetitions=4,
    )
    rows += runs_of(
        {"renderer": ["wavecomb", "mitsuba-llvm"]},
        lambda renderer: 1.0 if renderer == "wavecomb" else 1.4,
        experiment="peers",
        repetitions=4,
    )
    rows[7]["noisy"] = True
    return rows


def write_folder(
    folder: Path, rows: Sequence[Mapping[str, Any]], *, pictures: bool = False
) -> Path:
    """Writes a result folder as the runner does."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "runs.csv").write_text(header_line() + "".join(row_line(row) for row in rows))
    rng = np.random.default_rng(5)
    with (folder / "runs.jsonl").open("w") as file:
        for row in rows:
            record = {"row": row, "job": _job(row), "stats": statistics(rng)}
            file.write(json.dumps(record) + "\n")
    (folder / "suite.toml").write_text('name = "made-up"\ntitle = "Times that were made up"\n')
    (folder / "machine.json").write_text(json.dumps(MACHINE))
    if pictures:
        write_pictures(folder, rows)
    return folder


MACHINE = {
    "cpu": "Made-up CPU <4 GHz> & friends",
    "cores": 2,
    "memory_bytes": 8 << 30,
    "isa": "avx512",
    "commit": "0123456789abcdef",
    "dirty": False,
    "versions": {"wavecomb": "0.1.0", "numpy": "2.4.6"},
    "counters": {"events": {}, "missing": {"cycles": "perf_event_paranoid is 3"}},
    "governor": None,
    "sittings": [
        {
            "started": "2026-01-01T12:00:00+00:00",
            "command": "wavecomb bench run made-up.toml -o results",
            "load_before": [0.1, 0.1, 0.1],
        }
    ],
    "noise": {"noisy": True, "lines": ["equal runs vary by 12% (made up)"], "noisy_runs": 1},
    "spins_s": [0.05, 0.051],
}


def _job(row: Mapping[str, Any]) -> dict[str, Any]:
    job: dict[str, Any] = {"golden": f"golden/{_golden(row)}"}
    if has_picture(row):
        job["image"] = f"images/{row['run_id']}.npy"
    return job


def _golden(row: Mapping[str, Any]) -> str:
    """Returns the file name of a golden image. Each stage has one golden image for Wavecomb and one
    per peer."""
    peer = "" if row["renderer"] == "wavecomb" else f"-{row['renderer']}"
    return f"{row['stage']}{peer}-64x48-0a1b2c3d.npy"


def has_picture(row: Mapping[str, Any]) -> bool:
    """Returns whether a run saves its image: the first run of each policy at 16 lanes."""
    return row["experiment"] == "policies" and row["repetition"] == 0 and row["lanes"] == 16


def statistics(rng: np.random.Generator) -> dict[str, Any]:
    """Returns costs of twelve materials.

    The measured cost is 5 + 1.1 times the calibrated cost, with noise.
    """
    materials = []
    for k in range(12):
        calibrated = 40.0 + 15.0 * k
        measured = (5.0 + 1.1 * calibrated) * float(np.exp(rng.normal(0, 0.03)))
        materials.append(
            {
                "name": f"/M/{k}",
                "program": ("diffuse", "metal", "plastic")[k % 3],
                **{"records": 5000, "timed_records": 600, "ns_per_record": measured},
                **{"calibrated_ns": calibrated, "predicted_ns": measured * 1.01},
            }
        )
    return {
        "materials": materials,
        "depths": {"rays": [100, 60, 30], "records": [90, 50, 20], "paths_ended": [40, 30, 30]},
    }


def write_pictures(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Writes golden images, and noisy versions of them.

    All policies but cost-benefit have the same noise.
    """
    rng = np.random.default_rng(6)
    y, x = np.mgrid[0:48, 0:64] / 48.0
    golden = np.stack([0.2 + 0.5 * x / 1.3, 0.3 + 0.4 * y, 0.5 - 0.2 * x * y], axis=2)
    shared = rng.normal(0, 0.1, golden.shape)
    for name in sorted({_golden(row) for row in rows}):
        (folder / "golden").mkdir(exist_ok=True)
        np.save(folder / "golden" / name, golden.astype(np.float32))
    (folder / "images").mkdir(exist_ok=True)
    for row in rows:
        if has_picture(row):
            noise = rng.normal(0, 0.1, golden.shape) if row["policy"] == "cost-benefit" else shared
            noisy = golden * np.exp(noise)
            np.save(folder / "images" / f"{row['run_id']}.npy", noisy.astype(np.float32))
