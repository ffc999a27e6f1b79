# SPDX-License-Identifier: Apache-2.0
"""A few broken stages of each kind. ``fuzz_stages.py`` checks thousands."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz_cases import KINDS, make_case, plan
from fuzz_stages import GOOD, Verdict, run, table

pytest.importorskip("wavecomb._core")


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
def test_cases_come_from_their_numbers_alone(tmp_path: Path) -> None:
    for kind in KINDS:
        folders = [tmp_path / f"{kind}-{turn}" for turn in range(3)]
        texts = []
        for folder, number in zip(folders, (5, 5, 6), strict=True):
            folder.mkdir()
            stage = make_case(kind, 1, number, folder)
            assert stage.parent == folder and stage.exists()
            texts.append(
                {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
            )
        assert texts[0] == texts[1], kind
        assert texts[0] != texts[2] or kind == "deep", kind


MENDED = (
    "checkpoint/3", "merge/16", "costs/49", "usdc splice/79", "usdc counts/135", "usdc types/142",
    "usda words/148", "usda words/150", *(("vdb/13",) if "vdb" in KINDS else ()),
)  # fmt: skip
"""Cases that once failed."""


@pytest.fixture(scope="module")
def verdicts() -> list[Verdict]:
    """Results of a case of each kind, and then of ``MENDED``, run in one batch."""
    cases = [case.split("/") for case in MENDED]
    return run([*plan(len(KINDS)), *((kind, int(number)) for kind, number in cases)], seed=1)


@pytest.mark.slow
def test_broken_stages_end_in_a_line(verdicts: list[Verdict]) -> None:
    verdicts = verdicts[: len(KINDS)]
    faults = [f"{v.name}: {v.outcome} {v.said}" for v in verdicts if v.outcome not in GOOD]
    assert not faults
    assert {v.kind for v in verdicts} == set(KINDS)
    # Some cases must fail, since otherwise this test checks nothing.
    outcomes = [v.outcome for v in verdicts]
    assert outcomes.count("refused") > 5 and outcomes.count("warned") > 5
    assert all(v.said for v in verdicts if v.outcome != "rendered")


@pytest.mark.slow
@pytest.mark.parametrize("case", MENDED)
def test_what_was_found_and_mended(case: str, verdicts: list[Verdict]) -> None:
    (verdict,) = (v for v in verdicts[len(KINDS) :] if v.name == case)
    assert verdict.outcome in GOOD, verdict.said


def test_table() -> None:
    text = table([Verdict("png cut", 0, "warned", "x", 0.5), Verdict("deep", 1, "hang", "y", 9.0)])
    assert "| png cut | 1 |  | 1 |" in text and "| all | 2 |" in text
