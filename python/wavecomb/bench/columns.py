# SPDX-License-Identifier: Apache-2.0
"""The columns of ``runs.csv``: one row for each run that came to an end.

A result folder has, besides, ``runs.jsonl`` with one JSON object for each row, by ``run_id``, which
holds everything that a row leaves out; docs/bench.md says what.

An empty cell means "not measured" or "does not apply", never 0.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, Literal

from wavecomb.bench.oracle import ORDERS
from wavecomb.bench.plan import Run
from wavecomb.bench.suite_model import Suite
from wavecomb.run.stats import SORTING

Kind = Literal["text", "integer", "number", "flag", "json"]


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: In the header.
        kind: "text", "integer", "number", "flag" (0 or 1) or "json" (an object in one cell).
        unit: "" where there is none.
        meaning: One sentence.
    """

    name: str
    kind: Kind
    unit: str
    meaning: str


PHASE_COLUMNS = (
    *("generate_s", "order_rays_s", "trace_s", "collect_s", "keys_s", "sort_s", "materialize_s"),
    *("shade_s", "shadow_s", "resolve_s", "metrics_s", "other_s"),
)
"""Phases, exclusive; with the rest in ``other_s`` they add up to threads x render_s."""

COUNTER_COLUMNS = (
    *("cycles", "instructions", "l1d_misses", "l2_misses", "llc_misses", "branch_misses"),
)
"""Hardware counters; empty, with the reason in machine.json, where the kernel gives none."""

with (Path(__file__).parent / "columns.csv").open(encoding="utf-8", newline="") as _file:
    COLUMNS = tuple(Column(**row) for row in csv.DictReader(_file))  # type: ignore[arg-type]
"""All columns, in the order of the file; ``columns.csv`` describes them."""

NAMES = tuple(column.name for column in COLUMNS)
_BY_NAME = {column.name: column for column in COLUMNS}


def header_line() -> str:
    """The first line of the file, with its end."""
    return _line(NAMES)


def row_line(row: Mapping[str, Any]) -> str:
    """A row as one line, with its end.

    Raises:
        KeyError: A name is no column.
    """
    unknown = set(row) - set(NAMES)
    if unknown:
        raise KeyError(f"no columns {', '.join(sorted(unknown))}")
    return _line([_cell(_BY_NAME[name], row.get(name)) for name in NAMES])


def parse_row(cells: Mapping[str, str]) -> dict[str, Any]:
    """A row of ``csv.DictReader`` with types; empty cells are None."""
    return {name: _value(_BY_NAME[name], cells.get(name) or "") for name in NAMES}


def read_rows(path: Path) -> list[dict[str, Any]]:
    """All rows of a file, typed.

    A torn last line is left out, and of rows with one ``run_id``, which a run that failed and was
    tried again has, all but the last.
    """
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    rows = (parse_row(cells) for cells in csv.DictReader(StringIO(whole)))
    return list({row["run_id"]: row for row in rows}.values())


def _line(cells: Any) -> str:
    out = StringIO()
    csv.writer(out, lineterminator="\n").writerow(cells)
    return out.getvalue()


def _cell(column: Column, value: Any) -> str:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if column.kind == "json":
        return json.dumps(value, separators=(",", ":"))
    if column.kind == "flag":
        return str(int(bool(value)))
    if column.kind == "number":
        return f"{float(value):.9g}"
    return " ".join(str(value).split())


def _value(column: Column, cell: str) -> Any:
    if cell == "":
        return "" if column.kind == "text" else None
    if column.kind == "integer":
        return int(cell)
    if column.kind == "number":
        return float(cell)
    if column.kind == "flag":
        return cell == "1"
    return json.loads(cell) if column.kind == "json" else cell


# ---- From what a worker answered to a row of runs.csv --------------------------------------------


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
