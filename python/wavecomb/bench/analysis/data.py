# SPDX-License-Identifier: Apache-2.0
"""A result folder in memory, and the groups of its runs that may be compared."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.oracle import BEST, COSTS, ORACLES
from wavecomb.bench.results import COLUMNS, read_rows
from wavecomb.errors import WavecombError
from wavecomb.extras import needed
from wavecomb.image.files.output_file import reason

if TYPE_CHECKING:
    import pandas as pd

SETTINGS = (
    *("experiment", "stage", "renderer", "width", "height", "spp", "time_limit", "case"),
    *("threads", "lanes"),
    *("wave_size", "policy", "roulette", "ray_order", "shadow_order", "max_depth"),
    *("factor", "factor_value"),
)
"""Settings of a run. Runs that agree in all of these columns are repetitions of one
configuration."""

BASELINES = {
    "policy": "none",
    "roulette": "throughput",
    "ray_order": "slot",
    "shadow_order": "slot",
    "renderer": "wavecomb",
    "case": "off",
}
"""Baseline level of each factor, with which other levels are compared. The baseline of a numeric
factor is its smallest level."""

POLICIES = (
    *("none", "program", "material", "texture", "texture-locality", "cost-benefit"),
    *("random-runs", "adaptive", "oracle", "oracle-best", "oracle-worst"),
)
"""Policies, in the order of tables and figures."""

PLACEBO = "random-runs"
BEST_FIRST = (BEST, COSTS)
"""Oracle policies, in order of preference, whose times define the possible gain of ordering."""
BOUNDS = (PLACEBO, *ORACLES)
"""Policies that are of no practical use, but whose times bound the possible gain of ordering."""


@dataclass(frozen=True)
class Results:
    """Contents of a result folder.

    Attributes:
        folder: Path of the folder.
        runs: Successful runs, one row each, with the columns of ``columns``.
        failed: Failed runs, with the same columns.
        machine: Contents of machine.json, or {} if there is no such file.
        suite_text: Contents of suite.toml, or "" if there is no such file.
    """

    folder: Path
    runs: pd.DataFrame
    failed: pd.DataFrame
    machine: dict[str, Any]
    suite_text: str

    def experiments(self) -> list[tuple[str, pd.DataFrame]]:
        """Returns names and runs of the experiments, in the order of the suite."""
        found = [(str(name), runs) for name, runs in self.runs.groupby("experiment")]
        return sorted(found, key=lambda entry: self.suite_text.find(f'name = "{entry[0]}"'))

    def records(self) -> Iterator[dict[str, Any]]:
        """Iterates over the objects {"row": ..., "stats": ...} of runs.jsonl.

        Skips an incomplete last line.
        """
        path = self.folder / "runs.jsonl"
        if not path.is_file():
            return
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                if not line.endswith("\n"):
                    return
                try:
                    record = json.loads(line)
                    record["row"]["run_id"]
                except (ValueError, KeyError, TypeError) as error:
                    raise WavecombError(f"{path}: line {number} is not a run") from error
                yield record


def load(folder: Path) -> Results:
    """Reads a result folder.

    Raises:
        WavecombError: The path is not a result folder, or the folder holds no successful run. The
            message names the file.
    """
    pandas = needed("pandas", "the analysis")
    path = folder / "runs.csv"
    if not path.is_file():
        raise WavecombError(f"{folder}: holds no runs.csv; `wavecomb bench run` makes one")
    try:
        rows = read_rows(path)
    except (OSError, ValueError, KeyError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise WavecombError(f"{path}: cannot be read: {why}") from error
    frame = pandas.DataFrame(rows, columns=[column.name for column in COLUMNS])
    for column in COLUMNS:
        if column.kind in ("number", "integer"):
            frame[column.name] = pandas.to_numeric(frame[column.name])
    ended = frame["status"] == "ok"
    if not ended.any():
        raise WavecombError(f"{path}: no run succeeded")
    return Results(
        folder=folder,
        runs=frame[ended].reset_index(drop=True),
        failed=frame[~ended].reset_index(drop=True),
        machine=_json(folder / "machine.json"),
        suite_text=_text(folder / "suite.toml"),
    )


def cells(
    runs: pd.DataFrame, vary: str | Sequence[str], ignore: Sequence[str] = ()
) -> Iterator[tuple[dict[str, Any], pd.DataFrame]]:
    """Yields groups of runs that agree in every setting except ``vary`` and ``ignore``.

    A case of a suite may change settings that have no column in runs.csv. Runs of such cases are
    distinguished by the name of their configuration.
    """
    varied = {vary} if isinstance(vary, str) else set(vary)
    keys = [name for name in SETTINGS if name not in varied and name not in ignore]
    for values, group in runs.groupby(keys, dropna=False, sort=True):
        cell = dict(zip(keys, values, strict=True))
        levels = group.groupby(sorted(varied), dropna=False)["config"].nunique()
        if levels.max() <= 1:
            yield cell, group
            continue
        names = group["config"].map(lambda name: _without(name, varied, "experiment" in ignore))
        for variant, part in group.groupby(names, sort=False):
            yield {**cell, "variant": variant}, part


def rounds(group: pd.DataFrame, by: str, metric: str) -> tuple[list[Any], NDArray[np.float64]]:
    """Returns the levels, and the metric as (rounds, levels) with NaN for missing runs."""
    table = group.pivot_table(index="repetition", columns=by, values=metric, aggfunc="mean")
    levels = in_order(by, list(table.columns))
    return levels, table[levels].to_numpy(np.float64)


def baseline_of(factor: str, levels: Sequence[Any]) -> Any:
    """Returns the baseline level of a factor, or None if the baseline was not run."""
    wanted = BASELINES.get(factor)
    if wanted is not None:
        return wanted if wanted in levels else None
    return levels[0] if len(levels) else None


def in_order(factor: str, levels: Sequence[Any]) -> list[Any]:
    """Sorts levels for tables: policies as documented, the baseline first, numbers ascending."""
    if factor == "policy":
        place = {name: k for k, name in enumerate(POLICIES)}
        return sorted(levels, key=lambda name: (place.get(name, len(place)), str(name)))
    return sorted(levels, key=lambda level: (level != BASELINES.get(factor), level))


_LABELS: dict[str, Callable[[Any], str]] = {
    "lanes": lambda v: f"{v:.0f} lane{'s' if v != 1 else ''}",
    "spp": lambda v: f"{v:.0f} spp",
    "time_limit": lambda v: f"{v:g} s",
    "threads": lambda v: f"{v:.0f} thread{'s' if v != 1 else ''}",
    "wave_size": lambda v: f"waves of {short_count(v)}",
    "width": lambda v: f"{v:.0f} wide",
    "roulette": lambda v: f"roulette {v}",
    "ray_order": lambda v: f"rays by {v}",
    "shadow_order": lambda v: f"shadow rays by {v}",
    "factor_value": lambda v: f"asked for {short_count(v)}",
}


def label(cell: dict[str, Any], names: Sequence[str]) -> str:
    """Returns a short name of a group of comparable runs from its settings ``names``."""
    known = [(name, cell.get(name)) for name in names]
    parts = [
        _LABELS.get(name, str)(value)
        for name, value in known
        if value is not None and value != "" and value == value
    ]
    return ", ".join(parts) or str(cell.get("stage", "all"))


def varying(cells: Sequence[dict[str, Any]]) -> list[str]:
    """Returns "stage" and the names of all other settings in which groups of runs differ.

    The column `factor_value`, the value that the suite requests, is included if no other setting
    differs. A renderer may use a smaller value, for example if a wave is larger than the image.
    """
    # Names of columns that a report's heading already shows, or that are functions of another
    # column.
    redundant = ("experiment", "height", "factor", "factor_value")
    names = [name for name in (*SETTINGS, "variant") if name not in redundant]
    differ = [n for n in names if len({str(cell.get(n, "")) for cell in cells}) > 1]
    names = differ if "stage" in differ else ["stage", *differ]

    def apart(keys: Sequence[str]) -> int:
        return len({tuple(str(cell.get(key, "")) for key in keys) for cell in cells})

    return names if apart(names) == apart([*names, "factor_value"]) else [*names, "factor_value"]


def labelled(
    rows: list[dict[str, Any]],
    only: Sequence[str] = (),
    column: str = "cell",
    default: str = "all",
    leave_out: Sequence[str] = (),
) -> pd.DataFrame:
    """Returns rows as a table with a column of short names that distinguish their groups of runs.

    Args:
        rows: Rows that hold the settings of a group of runs.
        only: Settings that may appear in names; empty means all.
        column: Column for the names.
        default: Name if no setting varies.
        leave_out: Settings that may differ within a group of runs.
    """
    names = varying(rows) if rows else []
    names = [n for n in names if n not in leave_out and (not only or n in only)]
    for row in rows:
        row[column] = label(row, names) if names else default
    return needed("pandas", "the analysis").DataFrame(rows)


def short_count(value: float) -> str:
    """Formats a count, multiples of 1024 in binary units: 4096 -> 4 K, but 50000 -> 50 k.

    >>> short_count(65536), short_count(1 << 20), short_count(100), short_count(1e6)
    ('64 K', '1 M', '100', '1 million')
    """
    binary, decimal = (("M", 1 << 20), ("K", 1 << 10)), (("million", 10**6), ("k", 10**3))
    for unit, size in binary if value % 1024 == 0 else decimal:
        if value >= size:
            return f"{value / size:.4g} {unit}"
    return f"{value:.3g}" if value < 1000.0 else f"{value:.4g}"


def _without(config: str, varied: set[str], across: bool) -> str:
    """Returns the name of a configuration without those parts that state varied settings.

    With ``across``, which groups runs of all experiments, also drops the experiment's name.
    """
    parts = config.split(".")[1 if across else 0 :]
    return ".".join(part for part in parts if not any(part.startswith(f"{v}-") for v in varied))


def _json(path: Path) -> dict[str, Any]:
    text = _text(path)
    try:
        document = json.loads(text) if text else {}
    except ValueError as error:
        raise WavecombError(f"{path}: is not JSON: {error}") from error
    return document if isinstance(document, dict) else {}


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.is_file() else ""
