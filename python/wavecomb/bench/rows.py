# SPDX-License-Identifier: Apache-2.0
"""From what a worker answered to a row of runs.csv."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wavecomb.bench.columns import COUNTER_COLUMNS
from wavecomb.bench.oracle import ORDERS
from wavecomb.bench.plan import Run
from wavecomb.bench.suite_model import Suite
from wavecomb.run.stats import SORTING

_PHASES = (
    *("generate", "order_rays", "trace", "collect", "keys", "sort", "materialize"),
    *("shade", "shadow", "resolve", "metrics"),
)


def run_row(suite: Suite, run: Run, order: int, answer: Mapping[str, Any]) -> dict[str, Any]:
    """What the plan and the answer give; the runner adds the state of the machine."""
    config = run.config
    settings = config.settings
    width, height = settings["size"]
    row: dict[str, Any] = {
        "run_id": run.run_id,
        "suite": suite.name,
        "experiment": config.experiment,
        "stage": config.stage,
        "renderer": config.renderer,
        "config": config.name,
        "repetition": run.repetition,
        "order_in_sitting": order,
        "seed": run.repetition,
        "width": width,
        "height": height,
        "spp": settings["spp"],
        "time_limit": settings.get("time_limit"),
        "case": config.case,
        "factor": config.factor,
        "factor_value": config.factor_value,
        "status": answer["status"],
        "error": answer.get("error", ""),
        "picture_sha256": answer.get("picture_sha256", ""),
        "rel_mse": answer.get("rel_mse"),
        "variance": answer.get("mse"),
    }
    stats = answer.get("stats")
    if not stats:
        return {**row, **{key: settings.get(key) for key in ("threads", "max_depth")}}
    seconds = stats["seconds"]
    row |= {
        "load_s": seconds["load"],
        "build_s": seconds["build"],
        "render_s": seconds["render"],
        "threads": stats.get("threads", settings.get("threads")),
        "max_depth": stats["settings"].get("max_depth", settings.get("max_depth")),
        "samples_per_s": stats["samples_per_s"],
        "peak_rss_mb": stats["peak_rss_bytes"] / 1e6,
    }
    if row["rel_mse"] and row["render_s"]:
        row["efficiency"] = 1.0 / (row["rel_mse"] * row["render_s"])
    if "phases_s" in stats:
        row |= _wavefront(settings, stats, answer)
    return row


def _wavefront(
    settings: Mapping[str, Any], stats: Mapping[str, Any], answer: Mapping[str, Any]
) -> dict[str, Any]:
    """What only Wavecomb tells."""
    used, phases, counts = stats["settings"], stats["phases_s"], stats["counts"]
    order = sum(phases[name] for name in SORTING)
    coherence, prediction = stats["coherence"], stats["cost_prediction"]
    compared = bool(prediction["materials"]) and settings.get("policy") not in ORDERS
    row = {
        "lanes": stats["lanes"],
        "wave_size": stats["wave_size"],
        "policy": settings.get("policy", used["policy"]),
        **{key: used[key] for key in ("roulette", "ray_order", "shadow_order")},
        **{f"{name}_s": phases.get(name) for name in _PHASES},
        "order_s": order,
        "sort_overhead_s": order,
        "shade_and_order_s": phases["shade"] + order,
        "other_s": stats["threads"] * stats["seconds"]["render"] - sum(phases.values()),
        "run_length_coherence": coherence["run_length"],
        "cache_line_homogeneity": coherence["material_homogeneity"],
        "texture_homogeneity": coherence["texture_homogeneity"],
        "hits_per_material": {m["name"]: m["records"] for m in stats["materials"] if m["records"]},
        "sort_overhead": stats["sort_overhead"],
        **{name: counts[name] for name in ("records", "rays", "shadow_rays")},
        "packets": counts.get("packets"),
        "lane_utilisation": stats["lane_utilisation"],
        "rays_per_s": stats["rays_per_s"],
        "cost_prediction_r2": prediction["r2"] if compared else None,
        "cost_prediction_error": prediction["mean_error"] if compared else None,
    }
    counted = answer.get("counters") or {}
    if counts["records"]:
        row |= {k: v / counts["records"] for k, v in counted.items() if k in COUNTER_COLUMNS}
    return row
