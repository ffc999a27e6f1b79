# SPDX-License-Identifier: Apache-2.0
"""The result folder, written so that a kill at any moment loses at most one run.

``runs.jsonl`` is authoritative: each object is appended and flushed to disk before the row in
``runs.csv``. Resuming a folder cuts off an incomplete last line and rebuilds ``runs.csv``.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from wavecomb.bench.columns import header_line, row_line
from wavecomb.bench.suite_model import Suite
from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import reason, replacing

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
        """Opens the folder of the same suite and repairs incomplete files."""
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
        """Returns the contents of machine.json, or {} without that file."""
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
        WavecombError: Another line is not a JSON object.
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
    """Appends a line with one write and a flush, so that only the last can be incomplete."""
    fd = os.open(path, os.O_WRONLY | os.O_APPEND)
    try:
        os.write(fd, line.encode("utf-8"))
        os.fsync(fd)
    finally:
        os.close(fd)
