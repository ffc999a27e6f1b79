# SPDX-License-Identifier: Apache-2.0
"""Tests the benchmark analysis on generated runs with known answers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.stats
from bench_results import POLICY_FACTORS, policy_rows, runs_of, write_folder

from wavecomb.bench.analysis.data import Results, cells, load
from wavecomb.bench.analysis.factorial import calibration, effects, material_costs
from wavecomb.bench.analysis.interval import (
    Estimate,
    bootstrap,
    holm,
    paired_p,
    to_column,
    verdict,
)
from wavecomb.bench.analysis.ratios import order_effects, ratios, regrets
from wavecomb.errors import WavecombError


def ratio(times: np.ndarray, numerator: int, denominator: int) -> Estimate:
    return to_column(times, denominator)[numerator]


def results(tmp_path: Path, rows: list) -> Results:
    return load(write_folder(tmp_path / "results", rows))


# ---- intervals -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n", [3, 7, 8, 16])
def test_intervals_cover_as_often_as_they_say(n: int) -> None:
    """Confidence intervals cover the true time ratio of 0.9 as often as stated, despite drift."""
    rng = np.random.default_rng(8)
    covered = 0
    for _ in range(200):
        shake = np.exp(rng.normal(0, 0.1, (n, 1)))
        times = shake * rng.lognormal(0, 0.05, (n, 2)) * [0.9, 1.0]
        found = ratio(times, 0, 1)
        covered += found.low <= 0.9 <= found.high
    # Binomial(200, 0.95): P(less than 181) and P(all 200) are below 0.5 %.
    assert 181 <= covered < 200


def test_pairing_takes_out_what_a_round_shares() -> None:
    rng = np.random.default_rng(2)
    shake = np.exp(rng.normal(0, 0.5, (12, 1)))
    times = shake * np.exp(rng.normal(0, 0.01, (12, 2))) * [0.97, 1.0]
    found = ratio(times, 0, 1)
    assert found.value == pytest.approx(times[:, 0].sum() / times[:, 1].sum())
    assert found.high - found.low < 0.03
    assert found.low < 0.97 < found.high
    assert paired_p(times[:, 0], times[:, 1]) < 1e-3


def test_p_value_is_students() -> None:
    a, b = np.random.default_rng(3).lognormal(0, 0.3, (2, 7))
    expected = scipy.stats.ttest_rel(np.log(a), np.log(b)).pvalue
    assert paired_p(a, b) == pytest.approx(expected)
    a[2] = np.nan
    expected = scipy.stats.ttest_rel(np.log(a), np.log(b), nan_policy="omit").pvalue
    assert paired_p(a, b) == pytest.approx(expected)


def test_ties_and_single_runs() -> None:
    same = np.full((6, 2), 3.0)
    tie = ratio(same, 0, 1)
    assert (tie.value, tie.low, tie.high) == (1.0, 1.0, 1.0)
    assert paired_p(same[:, 0], same[:, 1]) == 1.0
    assert verdict(tie, 1.0) == "same (1 %)"
    once = ratio(same[:1] * [2.0, 1.0], 0, 1)
    assert once.value == 2.0
    assert math.isnan(once.low)
    assert verdict(once, 1.0) == "one run"
    assert paired_p(np.array([2.0, 2.0]), np.array([1.0, 1.0])) == 0.0


def test_missing_runs_leave_the_others() -> None:
    times = np.array([[2.0, 1.0], [np.nan, 1.0], [2.0, 1.0], [2.0, np.nan]])
    found = ratio(times, 0, 1)
    assert (found.value, found.low, found.high) == (2.0, 2.0, 2.0)


def test_intervals_repeat() -> None:
    times = np.random.default_rng(0).lognormal(size=(8, 2))
    assert ratio(times, 0, 1) == ratio(times, 0, 1)


def test_mean_interval_of_a_normal_sample_is_students() -> None:
    values = np.random.default_rng(4).normal(10, 1, (30, 1))
    found = bootstrap(values, lambda means: means)[0]
    half = 2.045 * values.std(ddof=1) / math.sqrt(30)
    assert found.high - found.low == pytest.approx(2 * half, rel=0.08)


def test_holm_and_verdicts() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert verdict(Estimate(0.9, 0.88, 0.92, 9), 0.01) == "faster"
    assert verdict(Estimate(1.1, 1.05, 1.2, 9), 0.01) == "slower"
    assert verdict(Estimate(0.95, 0.88, 1.02, 9), 0.2) == "not shown"
    assert verdict(Estimate(1.001, 0.995, 1.006, 9), 0.2) == "same (1 %)"


# ---- ratios --------------------------------------------------------------------------------------


def test_ratios_find_the_factors(tmp_path: Path) -> None:
    runs = results(tmp_path, policy_rows(repetitions=12, noise=0.004)).runs
    table = ratios(runs, "policy", "shade_and_order_s")
    assert len(table) == 4 * len(POLICY_FACTORS)
    for row in table.itertuples():
        truth = POLICY_FACTORS[row.level] if row.lanes == 16 else 1.0
        assert row.ratio == pytest.approx(truth, rel=0.02)
        if row.is_baseline:
            assert row.ratio == row.low == row.high == 1.0
        elif row.lanes == 16:
            assert row.verdict == "faster"
        else:
            assert row.verdict in ("not shown", "same (1 %)")
    assert table["cell"].nunique() == 4


def test_configurations_that_no_column_tells_apart_are_not_mixed(tmp_path: Path) -> None:
    rows = runs_of({"policy": ["none", "material"]}, lambda policy: 1.0, repetitions=2)
    twice = [{**row, "config": "gather." + row["config"]} for row in rows]
    twice = [{**row, "run_id": "x" + row["run_id"]} for row in twice]
    found = list(cells(results(tmp_path, rows + twice).runs, "policy"))
    assert len(found) == 2
    assert {len(group) for _, group in found} == {4}
    assert found[0][0]["variant"] != found[1][0]["variant"]


def test_folders_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(WavecombError, match=r"holds no runs\.csv"):
        load(tmp_path)
    rows = runs_of({"policy": ["none"]}, lambda policy: 1.0, repetitions=1, status="failed")
    with pytest.raises(WavecombError, match="no run succeeded"):
        results(tmp_path, rows)


# ---- order ---------------------------------------------------------------------------------------


def test_share_between_placebo_and_oracle(tmp_path: Path) -> None:
    runs = results(tmp_path, policy_rows(repetitions=16, noise=0.003)).runs
    table = order_effects(runs).set_index(["lanes", "policy"])
    wide = table.loc[16]
    assert wide["cells"].tolist() == [2] * len(wide)
    truth = math.log(0.6 / 0.57) / math.log(0.6 / 0.55)
    row = wide.loc["cost-benefit"]
    assert row.share == pytest.approx(truth, abs=0.06)
    assert row.share_low < truth < row.share_high
    assert row.ratio == pytest.approx(0.57, rel=0.01)
    assert row.placebo_ratio == pytest.approx(0.57 / 0.6, rel=0.01)
    assert row.verdict == "faster"
    assert wide.loc["random-runs"].share == pytest.approx(0.0)
    assert wide.loc["oracle"].share == pytest.approx(1.0)
    assert wide.loc["oracle"].verdict == "bound"
    scalar = table.loc[1]
    assert not scalar["gap_shown"].any()
    assert scalar["share"].isna().all()


def test_order_is_apart_from_roulette(tmp_path: Path) -> None:
    """Roulette halves the work, and the analysis must not attribute that to the shading order."""
    runs = results(
        tmp_path,
        runs_of(
            {"roulette": ["throughput", "cost-aware"], "policy": ["none", "material"]},
            lambda roulette, policy: (
                (0.5 if roulette == "cost-aware" else 1.0) * (0.9 if policy == "material" else 1)
            ),
            noise=0.002,
        ),
    ).runs
    table = order_effects(runs)
    ordered = table[table["policy"] == "material"]
    assert set(ordered["roulette"]) == {"throughput", "cost-aware"}
    assert ordered["ratio"].tolist() == pytest.approx([0.9, 0.9], rel=0.01)


def test_regret(tmp_path: Path) -> None:
    times = {"none": 1.0, "program": 0.8, "material": 1.2, "adaptive": 0.88, "random-runs": 0.5}
    runs = results(
        tmp_path, runs_of({"policy": list(times)}, lambda policy: times[policy], noise=0.001)
    ).runs
    table = regrets(runs, "shade_and_order_s").set_index("policy")
    assert set(table["best"]) == {"program"}
    assert "random-runs" not in table.index
    assert table.loc["adaptive", "regret"] == pytest.approx(0.1, abs=0.005)
    assert table.loc["adaptive", "low"] < 0.1 < table.loc["adaptive", "high"]
    assert table.loc["program", "regret"] == table.loc["program", "low"] == 0.0


# ---- factorial -----------------------------------------------------------------------------------


def test_main_effects_and_interactions(tmp_path: Path) -> None:
    def time(stage: str, lanes: int, policy: str, roulette: str) -> float:
        gain = {"none": 1.0, "material": 0.9, "program": 0.8}[policy]
        both = 0.7 if lanes == 16 and policy == "program" else 1.0
        base = {"mixed": 1.0, "dragon": 3.0}[stage] * (1.4 if roulette == "off" else 1.0)
        return base * gain * both * (0.5 if lanes == 16 else 1.0)

    vary = {
        "stage": ["mixed", "dragon"],
        "lanes": [1, 16],
        "policy": ["none", "material", "program"],
        "roulette": ["throughput", "off"],
    }
    runs = results(tmp_path, runs_of(vary, time, repetitions=10, noise=0.003)).runs
    table = effects(runs, "shade_and_order_s").set_index("name")
    truth = {
        "policy material": 0.9,
        "policy program": 0.8 * math.sqrt(0.7),
        "lanes 16": 0.5 * 0.7 ** (1 / 3),
        "roulette off": 1.4,
        "policy program × lanes 16": 0.7,
        "policy material × lanes 16": 1.0,
        "policy program × roulette off": 1.0,
    }
    for name, value in truth.items():
        row = table.loc[name]
        assert row.ratio == pytest.approx(value, rel=0.006), name
        assert row.low <= value * 1.002, name
        assert row.high >= value * 0.998, name
    assert table.loc["policy program × lanes 16"].verdict == "less"
    assert table.loc["policy material × lanes 16"].verdict == "same (1 %)"
    assert table.loc["policy material"].cells == 8
    assert set(table[table["kind"] == "main"].index) == {
        *("policy material", "policy program", "lanes 16", "roulette off")
    }


def test_incomplete_factorials_use_matched_pairs(tmp_path: Path) -> None:
    rows = runs_of(
        {"lanes": [1, 16], "policy": ["none", "material"]},
        lambda lanes, policy: lanes * (0.5 if policy == "material" else 1.0),
        noise=0.0,
        shake=0.0,
    )
    rows = [r for r in rows if (r["lanes"], r["policy"]) != (16, "none")]
    table = effects(results(tmp_path, rows).runs, "shade_and_order_s").set_index("name")
    assert table.loc["policy material"].ratio == pytest.approx(0.5)
    assert table.loc["policy material"].cells == 1
    assert table.loc["lanes 16"].ratio == pytest.approx(16.0)
    assert "policy material × lanes 16" not in table.index


def test_interactions_do_not_take_in_what_differs_besides(tmp_path: Path) -> None:
    # The runs have large waves at both lane widths, and small waves at 16 lanes only. Ordering
    # helps at 16 lanes for both wave sizes, so wave size and ordering do not interact.
    def time(wave_size: int, lanes: int, policy: str) -> float:
        gain = 0.5 if policy == "material" and lanes == 16 else 1.0
        return gain * 16 / lanes * (1.2 if wave_size == 65536 else 1.0)

    vary = {"wave_size": [4096, 65536], "lanes": [1, 16], "policy": ["none", "material"]}
    rows = runs_of(vary, time, noise=0.0, shake=0.0)
    rows = [r for r in rows if (r["wave_size"], r["lanes"]) != (4096, 1)]
    table = effects(results(tmp_path, rows).runs, "shade_and_order_s").set_index("name")
    assert table.loc["policy material × waves 64 K"].ratio == pytest.approx(1.0)
    assert table.loc["policy material × lanes 16"].ratio == pytest.approx(0.5)


# ---- costs ---------------------------------------------------------------------------------------


def test_calibration_line(tmp_path: Path) -> None:
    found = results(tmp_path, runs_of({"policy": ["none"]}, lambda policy: 1.0))
    costs = material_costs(found)
    assert len(costs) == 8 * 12
    line = calibration(costs, "calibrated_ns")
    assert line["materials"] == 12
    assert line["slope"] == pytest.approx(1.1, abs=0.03)
    assert line["intercept"] == pytest.approx(5.0, abs=3.0)
    assert line["slope_low"] < 1.1 < line["slope_high"]
    assert line["r2"] < calibration(costs, "predicted_ns")["r2"] <= 1.0
    exact = costs.assign(calibrated_ns=costs["measured_ns"])
    assert calibration(exact, "calibrated_ns")["r2"] == pytest.approx(1.0)
    assert calibration(exact, "calibrated_ns")["slope"] == pytest.approx(1.0)
    weighted = costs.assign(timed_records=np.where(costs["material"] == "/M/0", 1e-9, 1.0))
    odd = weighted.assign(
        measured_ns=np.where(weighted["material"] == "/M/0", 1e6, weighted["measured_ns"])
    )
    assert calibration(odd, "calibrated_ns")["slope"] == pytest.approx(1.1, abs=0.05)
    assert calibration(costs.iloc[:2], "calibrated_ns") == {}


def test_nothing_varied_is_no_error(tmp_path: Path) -> None:
    runs = results(tmp_path, runs_of({"policy": ["none"]}, lambda policy: 1.0)).runs
    for table in (
        ratios(runs, "policy", "render_s"),
        order_effects(runs),
        regrets(runs),
        effects(runs, "render_s"),
    ):
        assert isinstance(table, pd.DataFrame)
        assert table.empty
