# SPDX-License-Identifier: Apache-2.0
"""The result folder of a suite. If the process is killed, at most one run is lost.

``runs.jsonl`` is authoritative: the object of a run is appended to it and flushed to disk before
the row is appended to ``runs.csv``. Resuming a suite removes an incomplete last line and rebuilds
``runs.csv``. ``runs.jsonl`` also holds all data without a column in ``runs.csv``, by ``run_id``
(docs/bench.md). In ``runs.csv`` an empty cell means "not measured" or "does not apply", never 0.
"""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, Literal

from wavecomb.bench.oracle import ORDERS
from wavecomb.bench.plan import Run
from wavecomb.bench.suite_model import Suite
from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import reason, replacing
from wavecomb.run.stats import SORTING

Kind = Literal["text", "integer", "number", "flag", "json"]


@dataclass(frozen=True)
class Column:
    """A column of ``runs.csv``.

    Attributes:
        name: Name of the column in the header.
        kind: "text", "integer", "number", "flag" (0 or 1) or "json" (an object in one cell).
        unit: Unit, or "".
        meaning: Description of the column in one sentence.
    """

    name: str
    kind: Kind
    unit: str
    meaning: str


PHASE_COLUMNS = (
    *("generate_s", "order_rays_s", "trace_s", "collect_s", "keys_s", "sort_s", "materialize_s"),
    *("shade_s", "shadow_s", "resolve_s", "metrics_s", "other_s"),
)
"""Columns of phase times in thread seconds. Phases do not overlap, and together with ``other_s``
they add up to threads x render_s."""

COUNTER_COLUMNS = (
    *("cycles", "instructions", "l1d_misses", "l2_misses", "llc_misses", "branch_misses"),
)
"""Hardware counters. The columns are empty if the kernel does not support the counters; see
machine.json."""

with (Path(__file__).parent / "columns.csv").open(encoding="utf-8", newline="") as _file:
    COLUMNS = tuple(Column(**row) for row in csv.DictReader(_file))  # type: ignore[arg-type]
"""All columns of runs.csv, in the order of the file. ``columns.csv`` describes them."""

NAMES = tuple(column.name for column in COLUMNS)
_BY_NAME = {column.name: column for column in COLUMNS}


def header_line() -> str:
    """Returns the header line of the file, with its line end."""
    return _line(NAMES)


def row_line(row: Mapping[str, Any]) -> str:
    """Formats a row as one line, with its line end.

    Raises:
        KeyError: A name is not a column.
    """
    unknown = set(row) - set(NAMES)
    if unknown:
        raise KeyError(f"no columns {', '.join(sorted(unknown))}")
    return _line([_cell(_BY_NAME[name], row.get(name)) for name in NAMES])


def parse_row(cells: Mapping[str, str]) -> dict[str, Any]:
    """Converts a row of ``csv.DictReader`` to typed values; empty cells become None."""
    return {name: _value(_BY_NAME[name], cells.get(name) or "") for name in NAMES}


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Reads all rows of a file, with typed values.

    Skips an incomplete last line. A run that failed and was repeated has several rows with one
    ``run_id``, of which only the last is kept.
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


# ---- From a worker's answer to a row of runs.csv -------------------------------------------------


_PHASES = (
    *("generate", "order_rays", "trace", "collect", "keys", "sort", "materialize"),
    *("shade", "shadow", "resolve", "metrics"),
)


def run_row(suite: Suite, run: Run, order: int, answer: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the columns whose values come from the plan and the worker's answer.

    The runner adds the columns about the state of the machine.
    """
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
    """Returns the columns that only Wavecomb reports."""
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


SCHEMA = "wavecomb-bench/1"
FOLDERS = ("images", "golden", "trace", "stages")


class ResultFolder:
    """A folder of results."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.runs_csv = path / "runs.csv"
        self.runs_jsonl = path / "runs.jsonl"
        self.machine_json = path / "machine.json"
        self.suite_toml = path / "suite.toml"
        self.objects: list[dict[str, Any]] = []

    def create(self, suite: Suite) -> None:
        """Creates the folder, which must not hold results yet."""
        if self.runs_csv.exists() or self.runs_jsonl.exists():
            raise WavecombError(
                f"{self.path}: holds results already; add --resume to continue, "
                "or choose another folder"
            )
        try:
            for name in FOLDERS:
                (self.path / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WavecombError(f"{self.path}: cannot be made: {reason(error)}") from error
        _write(self.suite_toml, suite.text)
        self._rewrite()

    def resume(self, suite: Suite) -> None:
        """Opens the folder of an earlier execution of the suite and repairs incomplete files."""
        if not self.suite_toml.is_file():
            raise WavecombError(f"{self.path}: nothing to resume here; leave --resume out")
        if self.suite_toml.read_text(encoding="utf-8") != suite.text:
            raise WavecombError(
                f"{self.path}: was made with another suite than {suite.path}; "
                "choose another folder, or give this folder's suite.toml, which also names "
                "the folder of --stages"
            )
        for name in FOLDERS:
            (self.path / name).mkdir(parents=True, exist_ok=True)
        self.objects = read_objects(self.runs_jsonl)
        self._rewrite()

    def done(self) -> set[str]:
        """Returns the ids of successful runs."""
        return {o["row"]["run_id"] for o in self.objects if o["row"]["status"] == "ok"}

    def append(self, entry: dict[str, Any]) -> None:
        """Appends a run, given as {"row": its row, ...}."""
        _append(self.runs_jsonl, json.dumps(entry, allow_nan=False) + "\n")
        _append(self.runs_csv, row_line(entry["row"]))
        self.objects.append(entry)

    def machine(self) -> dict[str, Any]:
        """Returns the contents of machine.json, or {} if there is no such file."""
        if not self.machine_json.is_file():
            return {}
        try:
            document: dict[str, Any] = json.loads(self.machine_json.read_text(encoding="utf-8"))
        except ValueError as error:
            raise WavecombError(f"{self.machine_json}: is not JSON: {error}") from error
        return document

    def write_machine(self, document: dict[str, Any]) -> None:
        """Replaces machine.json."""
        _write(self.machine_json, json.dumps({"schema": SCHEMA, **document}, indent=2) + "\n")

    def _rewrite(self) -> None:
        _write(self.runs_jsonl, "".join(json.dumps(o) + "\n" for o in self.objects))
        _write(self.runs_csv, header_line() + "".join(row_line(o["row"]) for o in self.objects))


def read_objects(path: Path) -> list[dict[str, Any]]:
    """Reads the objects of runs.jsonl, skipping an incomplete last line.

    Raises:
        WavecombError: A line before the last one is not a JSON object.
    """
    if not path.is_file():
        return []
    text = path.read_text(encoding="utf-8")
    objects = []
    for number, line in enumerate(text[: text.rfind("\n") + 1].splitlines(), 1):
        try:
            entry = json.loads(line)
            entry["row"]["run_id"]
        except (ValueError, KeyError, TypeError) as error:
            raise WavecombError(
                f"{path}: line {number} is not a run; remove that line, and --resume"
            ) from error
        objects.append(entry)
    return objects


def _write(path: Path, text: str) -> None:
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def _append(path: Path, line: str) -> None:
    """Appends a line with one write and a flush, so that only the last line can be incomplete."""
    fd = os.open(path, os.O_WRONLY | os.O_APPEND)
    try:
        os.write(fd, line.encode("utf-8"))
        os.fsync(fd)
    finally:
        os.close(fd)
