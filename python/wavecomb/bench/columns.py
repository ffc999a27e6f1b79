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


def _of(kind: Kind, *rows: tuple[str, str, str]) -> tuple[Column, ...]:
    return tuple(Column(name, kind, unit, meaning) for name, unit, meaning in rows)


PHASE_COLUMNS = (
    *("generate_s", "order_rays_s", "trace_s", "collect_s", "keys_s", "sort_s", "materialize_s"),
    *("shade_s", "shadow_s", "resolve_s", "metrics_s", "other_s"),
)
"""Phases, exclusive; with the rest in ``other_s`` they add up to threads x render_s."""

COUNTER_COLUMNS = (
    *("cycles", "instructions", "l1d_misses", "l2_misses", "llc_misses", "branch_misses"),
)
"""Hardware counters; empty, with the reason in machine.json, where the kernel gives none."""

_KEYS = (
    *_of(
        "text",
        ("run_id", "", "Names the run in its folder: configuration and repetition."),
        ("suite", "", "Name of the suite."),
        ("experiment", "", "Which experiment of the suite."),
        ("stage", "", "Name of the stage; with its parameters where a factor changes it."),
        ("renderer", "", "wavecomb, or a peer: mitsuba-scalar, mitsuba-llvm, cycles."),
        ("config", "", "Short name of everything that was chosen; equal for all repetitions."),
        ("case", "", "Name of the settings that change together; else empty."),
    ),
    *_of(
        "integer",
        ("repetition", "", "From 0. Repetition k of all configurations ran in one round."),
        ("order_in_sitting", "", "Place of the run in time, from 0, warm-ups counted."),
        ("seed", "", "Of the picture."),
        ("width", "pixels", "Of the picture."),
        ("height", "pixels", "Of the picture."),
        ("spp", "", "Samples per pixel; with a time limit, the most."),
        ("threads", "", "As used."),
        ("lanes", "", "SIMD width, as used."),
        ("wave_size", "paths", "As used."),
    ),
    *_of("number", ("time_limit", "s", "That rendering may take; else empty.")),
    *_of(
        "text",
        ("policy", "", "Order of shading: docs/scheduling.md; oracles: docs/bench.md."),
        ("roulette", "", "off, throughput, cost-aware."),
        ("ray_order", "", "Order of bounce rays."),
        ("shadow_order", "", "Order of shadow rays."),
    ),
    *_of("integer", ("max_depth", "", "Scattering vertices of a path.")),
    *_of("text", ("factor", "", "Scaling: which factor the experiment varies; else empty.")),
    *_of("number", ("factor_value", "", "Scaling: its value; of texture_mb in 1e6 bytes.")),
    *_of(
        "text",
        ("status", "", "ok, or failed."),
        ("error", "", "Why it failed, in one line."),
    ),
)

_TIMES = (
    *_of(
        "number",
        ("wall_s", "s", "From the start of the process to its end."),
        ("load_s", "s", "Wall time to read the stage."),
        ("build_s", "s", "Wall time to build the acceleration structure."),
        ("render_s", "s", "Wall time of the render; without load, build and calibration."),
        ("generate_s", "thread s", "Phase: camera rays."),
        ("order_rays_s", "thread s", "Phase: order of rays before traversal."),
        ("trace_s", "thread s", "Phase: nearest hits."),
        ("collect_s", "thread s", "Phase: hits to shading records, where it is a phase."),
        ("keys_s", "thread s", "Phase: the policy's keys."),
        ("sort_s", "thread s", "Phase: the sort by key."),
        ("materialize_s", "thread s", "Phase: records moved into that order."),
        ("order_s", "thread s", "keys_s + sort_s + materialize_s."),
        ("shade_s", "thread s", "Phase: materials, light sampling, next rays."),
        ("shadow_s", "thread s", "Phase: shadow rays."),
        ("resolve_s", "thread s", "Phase: samples into the film."),
        ("metrics_s", "thread s", "Phase: measuring coherence."),
        ("other_s", "thread s", "threads x render_s less all phases: waiting, starting, joining."),
        ("shade_and_order_s", "thread s", "shade_s + order_s: what orders are compared by."),
    ),
)

_METRICS = (
    *_of(
        "number",
        ("run_length_coherence", "records", "Mean number of consecutive records of one material."),
        ("cache_line_homogeneity", "", "Share of neighbours that access the same material record."),
        ("texture_homogeneity", "", "Share of textured neighbours at one place of one texture."),
    ),
    *_of("json", ("hits_per_material", "records", "Shading hits by name of the material.")),
    *_of(
        "number",
        ("sort_overhead_s", "thread s", "method.md's name of order_s."),
        ("sort_overhead", "", "order_s / shade_and_order_s."),
    ),
    *_of(
        "integer",
        ("records", "", "Hits queued for shading."),
        ("rays", "", "Camera and bounce rays."),
        ("shadow_rays", "", "Shadow rays."),
        ("packets", "", "Runs of the shading code."),
    ),
    *_of(
        "number",
        ("lane_utilisation", "", "records / lanes of all packets."),
        ("samples_per_s", "1/s", "Camera paths per second of render_s."),
        ("rays_per_s", "1/s", "rays + shadow_rays per second of render_s."),
        ("rel_mse", "", "Mean of (x - r)^2 / (r^2 + 0.01), golden r; its noise is taken off."),
        ("efficiency", "1/s", "1 / (rel_mse x render_s)."),
        (
            "variance",
            "",
            "Mean squared error of a pixel's channel against the golden picture: the variance, "
            "and the squared bias of settings that have one.",
        ),
        ("peak_rss_mb", "MB", "Largest resident memory of the process, 1e6 bytes."),
    ),
)

_COUNTERS = _of(
    "number",
    ("cycles", "1/record", "CPU cycles per record, of the timed render."),
    ("instructions", "1/record", "Likewise."),
    ("l1d_misses", "1/record", "Loads that missed the first level."),
    ("l2_misses", "1/record", "Requests that missed the second level."),
    ("llc_misses", "1/record", "Loads that missed the last level."),
    ("branch_misses", "1/record", "Mispredicted branches."),
)

_STATE = (
    *_of(
        "number",
        ("load_average", "", "Of one minute, when the run began."),
        ("others_share", "", "Share of all cores' time that other processes took."),
        ("spin_s", "s", "Mean time of the calibration spin before and after the run."),
    ),
    *_of(
        "flag",
        ("noisy", "", "1: others took over 5 % of the machine, or the spin over 10 % longer."),
    ),
    *_of(
        "number",
        ("cost_prediction_r2", "", "r2 of predicted against measured cost in the last pass."),
        ("cost_prediction_error", "", "Mean error of the same."),
    ),
    *_of(
        "text",
        ("picture_sha256", "", "Of the beauty's bytes: equal pictures have equal ones."),
        ("started", "", "Time of day, UTC, ISO 8601."),
    ),
)

COLUMNS: tuple[Column, ...] = (*_KEYS, *_TIMES, *_METRICS, *_COUNTERS, *_STATE)
"""All columns, in the order of the file."""

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
