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
_FACTS = {
    "cpu": "CPU",
    "isa": "Instruction set",
    "cores": "Cores",
    "memory_bytes": "Memory",
    "kernel": "Kernel",
    "frequency_mhz": "Frequency, MHz",
    "caches_bytes": "Caches, bytes",
    "commit": "Commit",
    "dirty": "Source changed after it",
    "versions": "Versions",
    "pinning": "Pinning",
    "load_before": "Load before",
}


@dataclass(frozen=True)
class Figure:
    """A figure: its name and the files that hold it."""

    name: str
    png: Path | None
    svg: Path | None


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
        facts: Of the machine: name and value.
        warnings: Why its figures deserve care.
        columns: Of runs.csv: those that hold anything, those of interest first.
        runs: Rows of runs.csv, typed.
        figures: In figures/, by name.
        pages: Texts, the report first.
        shots: Pictures of runs, then converged ones.
    """

    path: Path
    name: str
    title: str
    facts: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    columns: tuple[Column, ...]
    runs: tuple[Mapping[str, Any], ...]
    figures: tuple[Figure, ...]
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
    name, title = _suite(path)
    return BenchFolder(
        path=path,
        name=name or (str(rows[0]["suite"]) if rows else path.name),
        title=title,
        facts=tuple(_facts(machine)),
        warnings=tuple(_warnings(machine, rows)),
        columns=_columns(rows),
        runs=tuple(rows),
        figures=_figures(path / "figures"),
        pages=_pages(path),
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


def _facts(machine: Mapping[str, Any]) -> list[tuple[str, str]]:
    found = []
    for key, what in _FACTS.items():
        value = machine.get(key)
        if value not in (None, "", {}, []):
            found.append((what, _text(key, value)))
    for number, sitting in enumerate(machine.get("sittings") or (), 1):
        if isinstance(sitting, dict):
            when = str(sitting.get("started", ""))[:16].replace("T", " ")
            found.append((f"Sitting {number}, {when} UTC", str(sitting.get("command", ""))))
    return found


def _text(key: str, value: Any) -> str:
    if key == "memory_bytes":
        return f"{value / 2**30:.1f} GiB"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_text('', v)}" for k, v in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_text("", v) for v in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _warnings(machine: Mapping[str, Any], rows: list[dict[str, Any]]) -> list[str]:
    noise = machine.get("noise")
    lines = [f"Noisy machine: {line}" for line in (noise or {}).get("lines", ())]
    noisy = sum(bool(row["noisy"]) for row in rows)
    if noisy and not lines:
        lines.append(f"{noisy} of {len(rows)} runs were disturbed by other work on the machine")
    failed = [row for row in rows if row["status"] != "ok"]
    if failed:
        lines.append(
            f"{len(failed)} runs failed; the first: {failed[0]['run_id']}: {failed[0]['error']}"
        )
    if not rows:
        lines.append("No run has come to an end yet")
    return lines


def _columns(rows: list[dict[str, Any]]) -> tuple[Column, ...]:
    held = [c for c in COLUMNS if any(row[c.name] not in (None, "") for row in rows)]
    order = {name: place for place, name in enumerate(("run_id", *_FIRST))}
    return tuple(sorted(held, key=lambda c: order.get(c.name, len(order))))


def _figures(folder: Path) -> tuple[Figure, ...]:
    if not folder.is_dir():
        return ()
    names = sorted({p.stem for p in folder.iterdir() if p.suffix in (".png", ".svg")})

    def file(name: str, suffix: str) -> Path | None:
        path = folder / f"{name}{suffix}"
        return path if path.is_file() else None

    return tuple(Figure(name, file(name, ".png"), file(name, ".svg")) for name in names)


def _pages(folder: Path) -> tuple[Path, ...]:
    found = [p for p in folder.iterdir() if p.is_file() and p.suffix.lower() in PAGES]
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
