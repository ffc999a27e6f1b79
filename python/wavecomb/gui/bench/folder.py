# SPDX-License-Identifier: Apache-2.0
"""What there is to see in a results folder of `wavecomb bench`. No Qt."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb.bench.columns import COLUMNS, Column, read_rows
from wavecomb.bench.report_facts import machine_parts, warnings_of
from wavecomb.bench.report_parts import Report, read_report
from wavecomb.errors import WavecombError
from wavecomb.gui.compare.picture_sides import SUFFIXES
from wavecomb.picture.files import reason

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PAGES = (".html", ".htm", ".md", ".txt", ".toml")
_FIRST = (
    *("status", "experiment", "stage", "policy", "lanes", "spp", "repetition", "render_s"),
    *("shade_and_order_s", "samples_per_s", "rel_mse", "efficiency", "noisy"),
)
"""Columns that a table of runs begins with, after the name of the run."""


@dataclass(frozen=True)
class Shot:
    """A picture of a run, or a converged one.

    Attributes:
        name: For people.
        path: Its file.
        golden: The converged picture that it is to be compared with; None: it is one itself.
    """

    name: str
    path: Path
    golden: Path | None = None


@dataclass(frozen=True)
class BenchFolder:
    """A results folder.

    Attributes:
        path: Where it is.
        name: Of the suite.
        title: Of the suite, one line.
        machine: What the figures were made on, HTML as the report has it.
        warnings: Why its figures deserve care, as the report says it.
        columns: Of runs.csv: those that hold anything, those of interest first.
        runs: Rows of runs.csv, typed.
        report: Its parts; None: none was made yet.
        pages: Texts beside the report.
        shots: Pictures of runs, then converged ones.
    """

    path: Path
    name: str
    title: str
    machine: str
    warnings: tuple[str, ...]
    columns: tuple[Column, ...]
    runs: tuple[Mapping[str, Any], ...]
    report: Report | None
    pages: tuple[Path, ...]
    shots: tuple[Shot, ...]


def read_folder(path: Path) -> BenchFolder:
    """Reads a results folder, or one of its files.

    Raises:
        WavecombError: It is none; one line that says what to do.
    """
    if path.is_file() and path.parent.joinpath("runs.csv").is_file():
        path = path.parent
    if not path.is_dir():
        raise WavecombError(f"{path}: no such folder")
    file = path / "runs.csv"
    if not file.is_file():
        raise WavecombError(
            f"{path}: holds no results (no runs.csv); choose a folder that `wavecomb bench run` "
            "has written, or run a suite"
        )
    try:
        rows = read_rows(file)
    except (OSError, ValueError, KeyError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise WavecombError(f"{file}: cannot be read: {why}") from error
    machine = _json(path / "machine.json")
    warnings = warnings_of(machine, rows)
    report = None
    try:
        report = read_report(path)
    except WavecombError as error:
        warnings.append(str(error))
    name, title = _suite(path)
    return BenchFolder(
        path=path,
        name=name or (str(rows[0]["suite"]) if rows else path.name),
        title=title,
        machine="".join(machine_parts(machine)),
        warnings=tuple(warnings),
        columns=_columns(rows),
        runs=tuple(rows),
        report=report,
        pages=_pages(path, report is not None),
        shots=_shots(path),
    )


def _suite(path: Path) -> tuple[str, str]:
    """Name and title, of a suite that may be damaged."""
    try:
        document = tomllib.loads((path / "suite.toml").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return "", ""
    return str(document.get("name", "")), str(document.get("title", ""))


def _json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}


def _columns(rows: list[dict[str, Any]]) -> tuple[Column, ...]:
    held = [c for c in COLUMNS if any(row[c.name] not in (None, "") for row in rows)]
    order = {name: place for place, name in enumerate(("run_id", *_FIRST))}
    return tuple(sorted(held, key=lambda c: order.get(c.name, len(order))))


def _pages(folder: Path, reported: bool) -> tuple[Path, ...]:
    """Texts; the page of a report whose parts are known is not one of them."""
    found = [p for p in folder.iterdir() if p.is_file() and p.suffix.lower() in PAGES]
    found = [p for p in found if not (reported and p.name == "report.html")]
    place = {suffix: k for k, suffix in enumerate(PAGES)}
    return tuple(sorted(found, key=lambda p: (place[p.suffix.lower()], p.name)))


def _shots(folder: Path) -> tuple[Shot, ...]:
    found: list[Shot] = []
    for job, run_id in _jobs(folder / "runs.jsonl"):
        image, golden = _inside(folder, job.get("image")), _inside(folder, job.get("golden"))
        if image is not None:
            found.append(Shot(run_id, image, golden))
    kept = folder / "golden"
    if kept.is_dir():
        for path in sorted(p for p in kept.iterdir() if p.suffix in SUFFIXES):
            found.append(Shot(f"golden: {path.stem}", path))
    return tuple({shot.path: shot for shot in found}.values())


def _inside(folder: Path, name: Any) -> Path | None:
    """A file of the folder that is there."""
    if not isinstance(name, str) or not name:
        return None
    path = folder / name
    return path if path.is_file() else None


def _jobs(path: Path) -> list[tuple[dict[str, Any], str]]:
    """What runs.jsonl says of files; lines that are no runs are left out."""
    found = []
    if path.is_file():
        with path.open(encoding="utf-8", errors="replace") as file:
            for line in file:
                try:
                    entry = json.loads(line)
                    found.append((dict(entry["job"]), str(entry["row"]["run_id"])))
                except (ValueError, KeyError, TypeError):
                    continue
    return found
