# SPDX-License-Identifier: Apache-2.0
"""Tests `wavecomb bench compare` with two result folders that have known ratios."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from bench_results import MACHINE, runs_of, write_folder
from click.testing import CliRunner

from wavecomb.bench.analysis.folder_changes import compare_folders
from wavecomb.cli import main
from wavecomb.errors import WavecombError


def made(
    path: Path,
    seed: int,
    factor: float = 1.0,
    policies: tuple[str, ...] = ("none", "program"),
    **more: Any,
) -> Path:
    def time(policy: str) -> float:
        return 10.0 * (factor if policy == "program" else 1.0)

    return write_folder(
        path,
        runs_of({"policy": list(policies)}, time, seed=seed, shake=0.01, repetitions=16, **more),
    )


def test_known_ratios_are_found(tmp_path: Path) -> None:
    before = made(tmp_path / "a", 1)
    after = made(tmp_path / "b", 2, 0.8, ("none", "program", "material"))
    found = compare_folders(before, after, "shade_and_order_s")
    by_policy = {change.config.rsplit("-", 1)[1]: change for change in found.changes}
    program = by_policy["program"]
    assert program.ratio == pytest.approx(0.8, rel=0.02) and program.verdict == "faster"
    assert program.low is not None and program.high is not None
    assert program.low < 0.8 < program.high and program.p < 1e-6 and program.runs == (16, 16)
    none = by_policy["none"]
    assert none.low is not None and none.high is not None and none.low < 1.0 < none.high
    assert none.verdict != "faster" and none.verdict != "slower"
    assert found.mean_ratio == pytest.approx((program.ratio * none.ratio) ** 0.5)
    assert not found.only_before and "material" in found.only_after[0]
    told = json.loads(json.dumps(found.to_dict()))
    assert told["changes"][0]["ratio"] == found.changes[0].ratio and told["pictures"] == 32


def test_pictures_and_machines_are_compared(tmp_path: Path) -> None:
    before, after = made(tmp_path / "a", 1), made(tmp_path / "b", 2, picture_sha256="1" * 64)
    same = compare_folders(before, before)
    assert same.pictures == 32 and same.pictures_different == 0 and same.mean_ratio == 1.0
    (after / "machine.json").write_text(json.dumps({**MACHINE, "cpu": "Other", "spins_s": [0.1]}))
    other = compare_folders(before, after)
    assert other.pictures_different == 32
    text = " ".join(other.warnings)
    assert (
        "another CPU" in text and "2.00 times as long" in text and "noisy machine in AFTER" in text
    )


def test_one_run_has_no_interval(tmp_path: Path) -> None:
    folders = [
        write_folder(
            tmp_path / n, runs_of({"policy": ["none"]}, lambda policy: 1.0, repetitions=1, seed=s)
        )
        for s, n in enumerate("ab")
    ]
    (change,) = compare_folders(*folders).changes
    assert change.low is None and change.verdict == "one run"


def test_command(tmp_path: Path) -> None:
    before, after = made(tmp_path / "a", 1), made(tmp_path / "b", 2, 0.8)

    def run(*words: Any) -> Any:
        return CliRunner().invoke(main, ["bench", "compare", *map(str, words)])

    text = run(before, after).stdout
    assert "AFTER / BEFORE" in text and "faster" in text and "the same, bit for bit" in text
    document = json.loads(run(before, after, "--json").stdout)
    assert len(document["changes"]) == 2
    missing = run(before, tmp_path / "none")
    assert missing.exit_code == 2 and "runs.csv" in missing.stderr
    with pytest.raises(WavecombError, match="no configuration has load_s in both"):
        compare_folders(before, made(tmp_path / "c", 3, stage="other"), "load_s")
