# SPDX-License-Identifier: Apache-2.0
"""Tests that the examples of docs/writing-a-policy.md run as printed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import wavecomb
from wavecomb.options import settings
from wavecomb.scheduling import COLUMNS

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "writing-a-policy.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)


@pytest.mark.slow
def test_python_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("wavecomb._core")
    from wavecomb.scenes import write_scene

    (example,) = blocks("python")
    lines = [line for line in example.splitlines() if line.strip()]
    assert len(lines) <= 10
    monkeypatch.chdir(tmp_path)
    write_scene("cornell", Path("shot.usda"))
    Path("shot.usda").rename("shot.usd")
    names: dict[str, Any] = {}
    exec(compile(example, "writing-a-policy.md", "exec"), names)
    picture = names["picture"]
    assert picture.stats["settings"]["policy"] == "expensive-first"
    run_length, overhead = (float(word) for word in capsys.readouterr().out.split())
    assert run_length > 2
    assert 0 < overhead < 1
    plain = wavecomb.render("shot.usd", size=(300, 200), spp=16, policy="none")
    assert wavecomb.compare(picture, plain).equal
    assert picture.stats["coherence"]["run_length"] > plain.stats["coherence"]["run_length"]


def test_cpp_example_is_like_the_real_ones() -> None:
    example = blocks("cpp")[0]
    assert len(example.splitlines()) <= 40
    real = (ROOT / "src/wavecomb/schedule/policies/material.cpp").read_text(encoding="utf-8")
    shared = {line for line in real.splitlines() if line.strip()} & set(example.splitlines())
    assert len(shared) > 12, "the interface has changed: bring the page up to date"


def test_pages_name_every_choice() -> None:
    page = (ROOT / "docs" / "scheduling.md").read_text(encoding="utf-8")
    options = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8")
    for name in (
        *settings()["policy"].choices,
        *settings()["ray_order"].choices,
        "cost-aware",
        "throughput",
    ):
        assert f"`{name}`" in page
        assert f"`{name}`" in options
    for column in COLUMNS:
        assert f'`"{column}"`' in PAGE
