# SPDX-License-Identifier: Apache-2.0
"""Tests the log of render statistics without Qt: runs, series, rates, ratios and the table."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

import numpy as np
import pytest

from wavecomb.gui.scheduling.run_log import (
    MAX_LOOKS,
    MAX_SERIES,
    Run,
    RunLog,
    describe,
    labels,
    last_of,
    take_look,
)
from wavecomb.gui.scheduling.run_rates import compare, compare_runs, moments, rate, t975, time_of
from wavecomb.gui.scheduling.run_table import COLUMNS, as_csv, as_text, rows
from wavecomb.run.progress import count_text

PROGRAM = {"policy": "program", "lanes": 0, "roulette": "throughput"}
MATERIAL = {**PROGRAM, "policy": "material"}


def statistics(seconds: float, samples: float, length: float = 5.0) -> dict[str, Any]:
    """Returns statistics of a render with 2 hit records per sample and half-filled packets."""
    records = int(2 * samples)
    return {
        "seconds": {"render": seconds},
        "counts": {
            "samples": int(samples),
            "rays": int(3 * samples),
            "shadow_rays": int(samples),
            "records": records,
            "packet_lanes": 2 * records,
        },
        "phases_s": {"shade": 0.5 * seconds, "sort": 0.1 * seconds, "trace": 0.4 * seconds},
        "coherence": {"run_length": length, "material_homogeneity": 0.5},
    }


def fill(
    log: RunLog, settings: dict[str, Any], speed: float, seconds: float = 4.0, *,
    picture: Any = "picture", noise: float = 0.0, seed: int = 1, looks: int = 12,
) -> None:  # fmt: skip
    """Adds a run with the given mean speed, whose first half is twice as fast as the second."""
    rng = np.random.default_rng(seed)
    time = samples = 0.0
    dearness = np.where(np.arange(looks) < looks // 2, 1.0, 2.0)
    for i in range(looks):
        samples += 1000.0 / dearness.mean()
        time += 1000.0 / dearness.mean() * dearness[i] * rng.lognormal(0.0, noise)
        log.add(statistics(time * seconds / (1000 * looks) / speed, samples), settings, picture,
                finished=i == looks - 1)  # fmt: skip


def test_time_that_stood_still_counts_nowhere() -> None:
    log = RunLog()
    for seconds, held in ((1.0, 0.0), (5.0, 3.0), (6.0, 3.0)):
        stats = statistics(seconds, 100 * (seconds - held))
        stats["seconds"]["held"] = held
        log.add(stats, PROGRAM, 0)
    (series,) = log.series
    (run,) = series.runs
    assert [look.seconds for look in run.looks] == [0.0, 1.0, 2.0, 3.0]
    assert rate(run, "samples").value == pytest.approx(100.0)


def test_counters_of_real_statistics() -> None:
    wavecomb = pytest.importorskip("wavecomb")
    pytest.importorskip("wavecomb._core")
    builder = wavecomb.SceneBuilder()
    quad = np.array([[-2, -2, -3], [2, -2, -3], [2, 2, -3], [-2, 2, -3]], np.float32)
    mesh = builder.add_mesh(
        quad, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), material=builder.add_material("diffuse")
    )
    builder.add_to_group(0, mesh)
    builder.add_light("dome", np.eye(4))
    builder.set_camera(np.eye(4), window=(-1, 1, -1, 1))
    stats = wavecomb.render(builder.build(), size=(32, 32), spp=8).stats
    look = take_look(stats)
    assert look.samples == 32 * 32 * 8 and look.records > 0
    assert look.rays == stats["counts"]["rays"] + stats["counts"]["shadow_rays"]
    run = Run()
    run.add(stats)
    assert run.lane_utilisation() == pytest.approx(stats["lane_utilisation"])
    assert rate(run, "samples").value == pytest.approx(stats["samples_per_s"], rel=1e-6)
    assert rate(run, "rays").value == pytest.approx(stats["rays_per_s"], rel=1e-6)
    assert sum(look.phases.values()) == pytest.approx(sum(stats["phases_s"].values()))
    assert run.shading_ns() > 1.0


def test_runs_and_series() -> None:
    log = RunLog()
    fill(log, PROGRAM, 1.0)
    fill(log, MATERIAL, 1.0)
    fill(log, PROGRAM, 1.0)  # back again: a repeat
    assert [one.settings["policy"] for one in log.series] == ["program", "material"]
    assert [len(one.runs) for one in log.series] == [2, 1]
    assert log.series[1].changed == "material"
    assert log.current is log.series[0] and log.base is log.series[0]
    fill(log, PROGRAM, 1.0, picture="other camera")
    assert log.series[2].changed == "other picture"
    assert log.base is log.series[2], "the first of that picture"
    log.pin(log.series[1])
    assert log.base is log.series[1]


def test_counters_that_fall_begin_a_run_of_the_same_series() -> None:
    log = RunLog()
    for seconds, samples in ((0.3, 100), (0.6, 200), (0.2, 50), (0.5, 150)):
        log.add(statistics(seconds, samples), PROGRAM, 0)
    (series,) = log.series
    assert [run.last.samples for run in series.runs] == [200, 150]


def test_short_runs_that_were_abandoned_are_forgotten() -> None:
    log = RunLog()
    for camera in range(50):  # as while orbiting
        log.add(statistics(0.02, 10), PROGRAM, camera)
    assert len(log.series) == 1 and log.current is log.series[0]
    log.add(statistics(0.02, 1000), PROGRAM, "quick but whole", finished=True)
    log.add(statistics(0.02, 1000), MATERIAL, "quick but whole", finished=True)
    assert [one.picture for one in log.series] == ["quick but whole"] * 2


def test_last_statistics_twice_are_one_run() -> None:
    log = RunLog()
    for _ in range(2):
        log.add(statistics(0.6, 200), PROGRAM, 0, finished=True)
    assert len(log.series) == 1 and len(log.series[0].runs) == 1


def test_memory_is_bounded() -> None:
    run = Run()
    for i in range(5000):
        run.add(statistics(i + 1.0, 100.0 * (i + 1)))
    assert len(run.looks) <= MAX_LOOKS
    assert run.looks[0].samples == 0 and run.last.samples == 500_000
    assert rate(run, "samples").value == pytest.approx(100.0)
    assert rate(run, "samples").spread < 1e-3
    log = RunLog()
    for i in range(MAX_SERIES + 20):
        fill(log, {"policy": f"p{i}"}, 1.0, looks=2)
        if i == 3:
            log.pin(log.current)
    assert len(log.series) == MAX_SERIES and log.pinned in log.series


def test_rate_is_of_the_whole_run_and_has_a_spread() -> None:
    log = RunLog()
    fill(log, PROGRAM, 1.0, seconds=4.0)
    run = log.series[0].run
    all_of_it = rate(run, "samples")
    assert all_of_it.value == pytest.approx(run.last.samples / run.last.seconds)
    assert not all_of_it.is_short and 0.2 < all_of_it.spread < 0.6, "twice as dear below"
    times, values = moments(run, "samples")
    assert len(times) == 12 and values[0] == pytest.approx(2 * values[-1], rel=0.01)
    short = RunLog()
    fill(short, PROGRAM, 1.0, seconds=0.5)
    assert rate(short.series[0].run, "samples").is_short
    assert rate(Run(), "samples").value == 0.0


def test_time_of_is_linear_between_looks() -> None:
    run = Run()
    run.add(statistics(1.0, 100))
    run.add(statistics(3.0, 200))
    assert [time_of(run, n) for n in (0, 50, 100, 150, 200, 900)] == [0, 0.5, 1, 2, 3, 3]


def test_runs_are_compared_at_equal_samples() -> None:
    """The faster first half of a run has a higher rate; at equal samples, the speeds are equal."""
    log = RunLog()
    fill(log, PROGRAM, 1.0)
    whole = log.series[0].run
    half = Run(looks=whole.looks[: len(whole.looks) // 2 + 1])
    assert rate(half, "samples").value > 1.3 * rate(whole, "samples").value
    assert compare_runs(half, whole).value == pytest.approx(1.0)
    log = RunLog()
    fill(log, PROGRAM, 1.0, noise=0.03, seed=1)
    fill(log, MATERIAL, 1.25, noise=0.03, seed=2)
    found = compare_runs(log.series[1].run, log.series[0].run)
    assert found.low < 1.25 < found.high and found.high / found.low < 1.15
    back = compare_runs(log.series[0].run, log.series[1].run)
    assert back.value == pytest.approx(1 / found.value)


def test_a_difference_holds_only_with_repeats() -> None:
    log = RunLog()
    for i in range(4):
        fill(log, PROGRAM, 1.0, noise=0.02, seed=10 + i)
        fill(log, MATERIAL, 1.25, noise=0.02, seed=20 + i)
        found = compare(log.series[1], log.series[0])
        assert found is not None and found.repeats == i + 1
        assert found.holds == (i >= 2)
    assert found.verdict() == "faster"
    assert compare(log.series[0], log.series[1]).verdict() == "slower"  # type: ignore[union-attr]


def test_no_difference_is_claimed_where_repeats_do_not_hold_it() -> None:
    """A single pair of runs seems to differ, because the machine was slower in one of them.
    Repeated runs show no difference.
    """
    log = RunLog()
    for i, drift in enumerate((1.2, 0.9, 1.1, 0.85)):
        fill(log, PROGRAM, 1.0, noise=0.01, seed=30 + i)
        fill(log, MATERIAL, drift, noise=0.01, seed=40 + i)
        if i == 0:
            first = compare(log.series[1], log.series[0])
            assert first is not None and first.differs and not first.holds
            assert first.verdict() == "1 of 3 repeats"
    found = compare(log.series[1], log.series[0])
    assert found is not None and not found.differs and found.verdict() == "not shown"


def test_too_short_to_say() -> None:
    log = RunLog()
    fill(log, PROGRAM, 1.0, seconds=0.4)
    fill(log, MATERIAL, 2.0, seconds=0.4)
    found = compare(log.series[1], log.series[0])
    assert found is not None and found.short and found.verdict() == "too short"
    assert found.high == math.inf
    table = rows(log)
    assert table[1].texts[COLUMNS.index("samples/s")].startswith("(")
    assert table[1].texts[COLUMNS.index("verdict")] == "too short"


def test_other_work_is_not_compared() -> None:
    log = RunLog()
    fill(log, PROGRAM, 1.0)
    fill(log, {**PROGRAM, "roulette": "off"}, 2.0)
    assert compare(log.series[1], log.series[0]) is None
    log.pin(log.series[0])
    assert rows(log)[1].texts[COLUMNS.index("verdict")] == "other work"


def test_labels() -> None:
    log = RunLog()
    fill(log, PROGRAM, 1.0)
    fill(log, {**PROGRAM, "lanes": 1}, 1.0)
    fill(log, {**PROGRAM, "lanes": 4}, 1.0, picture=2)
    fill(log, {**PROGRAM, "lanes": 4}, 1.0, picture=3)
    assert labels(log.series) == [
        "program, widest lanes",
        "program, 1 lane",
        "program, 4 lanes #3",
        "program, 4 lanes #4",
    ]
    assert labels(log.series[:1]) == ["program"]
    assert describe({"noise": 0.0, "adaptive": 0.01}) == "no noise, pixel error 0.01"


def test_last_of_keeps_the_pinned() -> None:
    log = RunLog()
    for i in range(9):
        fill(log, {"policy": f"p{i}"}, 1.0)
    shown = last_of(log.series, 4, log.series[1])
    assert [one.number for one in shown] == [2, 7, 8, 9]
    assert last_of(log.series, 4, log.series[8]) == log.series[-4:]


def test_clear_keeps_the_run_that_goes_on() -> None:
    log = RunLog()
    fill(log, PROGRAM, 1.0)
    fill(log, MATERIAL, 1.0)
    log.pin(log.series[0])
    log.clear()
    assert [one.settings["policy"] for one in log.series] == ["material"] and log.pinned is None
    assert log.series[0].changed == ""


def test_text_and_csv() -> None:
    log = RunLog()
    for i in range(3):
        fill(log, PROGRAM, 1.0, noise=0.02, seed=i)
        fill(log, MATERIAL, 1.5, noise=0.02, seed=50 + i)
    table = rows(log)
    lines = as_text(table).splitlines()
    assert len(lines) == 3 and "verdict" in lines[0]
    assert " base " in lines[1] and " faster " in lines[2]
    assert "50 %" in lines[1] and "1.5" in lines[2]
    records = list(csv.DictReader(io.StringIO(as_csv(table))))
    assert len(records) == 6, "a line for each run"
    assert {one["policy"] for one in records} == {"program", "material"}
    assert float(records[3]["speed"]) == pytest.approx(1.5, rel=0.1)
    assert float(records[0]["shade_s"]) == pytest.approx(0.5 * float(records[0]["seconds"]))
    assert as_csv([]).count("\n") == 1


@pytest.mark.parametrize(
    ("value", "text"), [(0, "0"), (12.34, "12.3"), (999.7, "1 k"), (4.567e9, "4.57 G")]
)
def test_amount(value: float, text: str) -> None:
    assert count_text(value) == text


def test_quantiles_of_t() -> None:
    """The integral of Student's density up to the quantile is 97.5 %."""
    for degrees in (1, 2, 7, 30):
        edges = np.linspace(0.0, t975(degrees), 20_001)
        x = (edges[1:] + edges[:-1]) / 2
        density = (
            (1 + x * x / degrees) ** (-(degrees + 1) / 2)
            * math.exp(math.lgamma((degrees + 1) / 2) - math.lgamma(degrees / 2))
            / math.sqrt(degrees * math.pi)
        )
        assert 0.5 + density.sum() * (edges[1] - edges[0]) == pytest.approx(0.975, abs=2e-5)
    assert abs(t975(31) - 2.04) < 0.09
