# SPDX-License-Identifier: Apache-2.0
"""Tests suites, plan, runner and data of the benchmark."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from click.testing import CliRunner
from parts import is_long, not_here

from wavecomb.bench import jobs, machine
from wavecomb.bench import process as workers
from wavecomb.bench import results as tables
from wavecomb.bench.oracle import policy_of
from wavecomb.bench.plan import Estimator, Limits, chosen, configurations, schedule
from wavecomb.bench.process import run_process
from wavecomb.bench.results import ResultFolder
from wavecomb.bench.suite import find_suite, load_suite, suite_names
from wavecomb.bench.suite_model import naming_folder, with_folder
from wavecomb.cli import main
from wavecomb.errors import WavecombError

LIMITS = Limits(threads=2, lanes=8, cache_bytes={"L2": 1_000_000, "L3": 32_000_000})
TINY = """
name = "tiny"
repetitions = 2
warm_up = 0
[stage.box]
scene = "cornell"
[golden]
spp = 16
[[experiment]]
name = "order"
images = "first"
golden = true
settings = { size = [16, 12], spp = 4 }
[experiment.vary]
policy = ["none", "oracle"]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "tiny.toml"
    path.write_text(text)
    return path


def bench(*arguments: Any) -> Any:
    return CliRunner().invoke(main, ["bench", *(str(a) for a in arguments)])


# Suites


@pytest.mark.parametrize("name", suite_names())
def test_our_suites_are_sound(name: str) -> None:
    suite = load_suite(find_suite(name))
    configs = configurations(suite, LIMITS)
    assert configs and suite.title
    assert suite.repetitions >= {"paper": 3, "learning": 5}.get(name, 16)
    from wavecomb import _core

    for settings in {json.dumps(c.settings): c.settings for c in configs}.values():
        policy = policy_of(settings).get("policy", settings.get("policy"))
        width, height = settings["size"]
        rest = {k: v for k, v in settings.items() if k not in ("size", "policy", "lanes")}
        _core.Settings(
            width=width, height=height, **rest, **({"policy": policy} if policy else {})
        ).check()


def test_suites_are_as_large_as_they_should_be() -> None:
    def count(name: str, experiment: str) -> int:
        configs = configurations(load_suite(find_suite(name)), LIMITS)
        return sum(config.experiment == experiment for config in configs)

    assert count("ablation", "factorial") == 2 * (2 * 3 * 8 * 3 * 5)
    assert count("paper", "orders") == 2 * 2 * 4 * 4
    parts = ("light_weights", "allocate", "roulette", "guiding")
    learning = configurations(load_suite(find_suite("learning")), LIMITS)
    of = {c.case: tuple(c.settings[part] for part in parts) for c in learning}
    assert len(of) == len(set(of.values())) == 1 + 4 + 6 + 1 + 2, "alone, in pairs, all, and auto"
    assert {c.case for c in learning if c.settings["time_limit"] == 5} == set(of)
    assert len(load_suite(find_suite("scenes")).stages) >= 12


def test_settings_that_only_change_noise_share_a_golden_picture() -> None:
    config = configurations(load_suite(find_suite("peers")), LIMITS)[0]

    def key(**settings: object) -> str:
        return replace(config, settings={**config.settings, **settings}).golden_key()

    for alike in ({"roulette": "off"}, {"sampler": "independent"}, {"cosine_sampling": True}):
        assert key(**alike) == key()
    for other in ({"firefly": "reweight"}, {"merge_radius": 1.0}, {"texture_filter": "whole"},
                  {"alpha": True}, {"max_depth": 3}, {"size": [9, 9]}):  # fmt: skip
        assert key(**other) != key()


def test_variants_of_a_renderer_share_a_golden_picture() -> None:
    configs = configurations(load_suite(find_suite("peers")), LIMITS)
    keys = {
        renderer: {c.golden_key() for c in configs if c.renderer == renderer and c.golden}
        for renderer in {c.renderer for c in configs}
    }
    assert keys["mitsuba-scalar"] == keys["mitsuba-llvm"]
    assert not keys["mitsuba-llvm"] & (keys["cycles"] | keys["wavecomb"])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[golden]", "[golden", "is not TOML"),
        ("repetitions = 2", "repetitions = 0", "repetitions: must be at least 1"),
        ("repetitions = 2", "repetitions = 'x'", "must be a whole number"),
        ("warm_up = 0", "warmup = 0", "warmup: no such key; there are stage, golden"),
        ('scene = "cornell"', 'scene = "sponza"', "stage.box: scene: no scene 'sponza'"),
        ('scene = "cornell"', 'scene = "cornell"\nsize = 2', "stage.box: size: a generated stage"),
        ('scene = "cornell"', "", "give either scene = NAME or file = PATH"),
        ('name = "order"', 'name = "a b"', "experiment 1: name: give a name of letters"),
        ('images = "first"', 'images = "last"', "one of none, first, all, not 'last'"),
        ('images = "first"', 'stages = ["x"]', "experiment order: stages: no stage 'x'"),
        ('images = "first"', 'renderers = ["x"]', "renderers: no 'x'"),
        ('images = "first"', 'factor = "spp"', "factor: 'spp' is not varied"),
        ("spp = 4 }", "sppp = 4 }", "settings.sppp: no setting 'sppp'"),
        ("spp = 4 }", "spp = 4.5 }", "settings.spp: must be integer, not 4.5"),
        ("size = [16, 12]", "size = 16", "must be [width, height], not 16"),
        ('policy = ["none", "oracle"]', 'policy = "none"', "vary.policy: give a list"),
        ('policy = ["none", "oracle"]', "stage.x = [1]", "x: a generated stage has no such option"),
        ('policy = ["none", "oracle"]', 'stage.texture_mb = ["L9"]', "like 'L2' or '4*L3'"),
        ("[experiment.vary]", '[[experiment.case]]\nname = "a b"\n[experiment.vary]', "case.name"),
        (
            "[experiment.vary]",
            '[[experiment.case]]\nname = "a"\n[[experiment.case]]\nname = "a"\n[experiment.vary]',
            "case.name: two cases have the same",
        ),
    ],
)
def test_bad_suites_are_named(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in TINY
    path = written(tmp_path, TINY.replace(old, new))
    result = bench("run", path, "-o", tmp_path / "out", "--dry-run")
    assert result.exit_code == 2
    assert says in result.stderr and "tiny.toml" in result.stderr
    assert result.stderr.count("\n") == 1 and not (tmp_path / "out").exists()


def test_values_of_the_machine(tmp_path: Path) -> None:
    text = TINY.replace(
        'policy = ["none", "oracle"]',
        'threads = [1, 2, 4, "all"]\nlanes = [1, "widest"]\nstage.texture_mb = ["L2", "4*L3"]',
    )
    configs = configurations(load_suite(written(tmp_path, text)), LIMITS)
    assert {c.settings["threads"] for c in configs} == {1, 2}
    assert {c.settings["lanes"] for c in configs} == {1, 8}
    assert {c.source.options["texture_mb"] for c in configs} == {1.0, 128.0}
    assert len({c.name for c in configs}) == len(configs) == 8


def test_order_is_random_in_rounds_and_repeats_itself(tmp_path: Path) -> None:
    configs = configurations(load_suite(find_suite("quick")), LIMITS)
    runs = schedule(configs, 3, seed=5)
    size = len(configs)
    for k in range(3):
        part = runs[k * size : (k + 1) * size]
        assert {run.repetition for run in part} == {k}
        assert {run.config.name for run in part} == {config.name for config in configs}
    names = [run.config.name for run in runs]
    assert names[:size] != names[size : 2 * size]
    assert [run.run_id for run in schedule(configs, 3, seed=5)] == [run.run_id for run in runs]
    assert len(chosen(configs, "orders.dragon.*")) == 8


def test_stages_of_a_folder(tmp_path: Path) -> None:
    suite = load_suite(find_suite("scenes"))
    (tmp_path / "mine.usda").write_text("#usda 1.0\n")
    assert "mine" in {c.stage for c in configurations(with_folder(suite, tmp_path), LIMITS)}
    # The suite's text names the folder, so results can be resumed without the option.
    kept = tmp_path / "suite.toml"
    kept.write_text(naming_folder(suite, tmp_path).text)
    assert load_suite(kept).stages["mine"].file == (tmp_path / "mine.usda").resolve()
    (tmp_path / "mixed.usda").write_text("#usda 1.0\n")
    with pytest.raises(WavecombError, match="mixed has the same name as another stage"):
        with_folder(suite, tmp_path)


# Rows


def test_rows_come_back(tmp_path: Path) -> None:
    row = {
        "run_id": "a-0",
        "error": 'one, two\n"three"',
        "spp": 4,
        "render_s": 0.125,
        "rel_mse": float("nan"),
        "noisy": True,
        "hits_per_material": {"/M,1": 3},
    }
    file = tmp_path / "runs.csv"
    file.write_text(tables.header_line() + tables.row_line(row) + "a-1,torn")
    (read,) = tables.read_rows(file)
    assert read["error"] == 'one, two "three"' and read["spp"] == 4 and read["render_s"] == 0.125
    assert read["rel_mse"] is None and read["noisy"] is True and read["wall_s"] is None
    assert read["hits_per_material"] == {"/M,1": 3}
    with pytest.raises(KeyError, match="speling"):
        tables.row_line({"speling": 1})
    assert all(c.meaning.endswith(".") for c in tables.COLUMNS)
    assert len(set(tables.NAMES)) == len(tables.NAMES)


# Noise


def rows_with(spread: float, noisy_share: float) -> list[dict[str, Any]]:
    rng = random.Random(3)
    return [
        {
            "config": f"c{k % 5}",
            "status": "ok",
            "render_s": rng.gauss(1.0, spread),
            "noisy": rng.random() < noisy_share,
        }
        for k in range(400)
    ]


def test_noise_is_found_and_quiet_is_not() -> None:
    quiet = machine.judge(rows_with(0.02, 0.05))
    assert not quiet.noisy and quiet.variation == pytest.approx(0.02, rel=0.2)
    assert "vary by" in machine.judge(rows_with(0.2, 0.0)).lines[0]
    assert "were disturbed" in machine.judge(rows_with(0.02, 0.6)).lines[0]
    assert machine.judge([]).variation is None
    spins = [0.0100 + 0.0001 * (k % 7) for k in range(80)] + [0.02] * 10
    reference = machine.spin_reference(spins)
    assert reference == pytest.approx(0.0101, abs=1e-4)
    assert not machine.is_noisy(0.0, 0.0105, reference)
    assert machine.is_noisy(0.0, 0.0120, reference)
    assert machine.is_noisy(0.06, 0.0100, reference) and not machine.is_noisy(
        None, 0.0100, reference
    )


def test_estimates_follow_what_was_measured() -> None:
    configs = configurations(load_suite(find_suite("quick")), LIMITS)
    estimator = Estimator()
    before = estimator.seconds(configs[1])
    estimator.learn(configs[0], 3.0 * estimator.seconds(configs[0]))
    assert estimator.seconds(configs[1]) == pytest.approx(3.0 * before)
    estimator.learn(configs[1], 7.0)
    assert estimator.seconds(configs[1]) == 7.0


# The runner


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the complete tiny suite. In `make test`, its processes are forked."""
    folder = tmp_path_factory.mktemp("bench")
    with pytest.MonkeyPatch.context() as patch:
        if not is_long():
            patch.setattr(subprocess, "Popen", forks.Popen)
        result = bench("run", written(folder, TINY), "-o", folder / "out")
    assert result.exit_code == 0, result.stderr
    assert "4/4 order.box.policy-" in result.stderr
    return folder / "out"


@pytest.mark.slow
def test_a_suite_from_end_to_end(results: Path) -> None:
    rows = tables.read_rows(results / "runs.csv")
    assert sorted(row["run_id"] for row in rows) == [
        f"order.box.policy-{policy}-{k}" for policy in ("none", "oracle") for k in (0, 1)
    ]
    assert [row["order_in_sitting"] for row in rows] == [0, 1, 2, 3]
    for row in rows:
        assert row["status"] == "ok" and (row["width"], row["height"], row["spp"]) == (16, 12, 4)
        assert row["policy"] in row["run_id"] and row["roulette"] == "throughput"
        phases = sum(row[name] or 0.0 for name in tables.PHASE_COLUMNS)
        assert phases == pytest.approx(row["threads"] * row["render_s"], rel=1e-6)
        order = row["keys_s"] + row["sort_s"] + row["materialize_s"]
        assert row["order_s"] == pytest.approx(order, abs=1e-8)
        assert sum(row["hits_per_material"].values()) == row["records"] > 0
        assert row["efficiency"] == pytest.approx(1 / (row["rel_mse"] * row["render_s"]), rel=1e-6)
        assert 0.0 < row["render_s"] < row["wall_s"] and row["spin_s"] > 0.0
    # The order does not change the image; another repetition has other noise.
    pictures = {(row["repetition"], row["picture_sha256"]) for row in rows}
    assert len(pictures) == 2 == len({digest for _, digest in pictures})


@pytest.mark.slow
def test_everything_is_kept(results: Path) -> None:
    assert (results / "suite.toml").read_text() == TINY
    entries = [json.loads(line) for line in (results / "runs.jsonl").read_text().splitlines()]
    assert {"row", "job", "stats", "costs", "spins_s", "comparison"} <= set(entries[0])
    assert entries[0]["stats"]["depths"]["rays"][0] == 16 * 12 * 4
    golden = np.load(results / entries[0]["job"]["golden"])
    assert golden.shape == (12, 16, 3)
    images = {path.name for path in (results / "images").iterdir()}
    assert images == {f"order.box.policy-{policy}-0.npy" for policy in ("none", "oracle")}
    (profile,) = (results / "trace").glob("*.json")
    costs = json.loads(profile.read_text())["materials"]
    assert len(costs) > 1 and all(ns > 0.0 for ns in costs.values())
    oracle = next(e for e in entries if e["row"]["policy"] == "oracle")
    # The true costs do not change during the render.
    for name, ns in oracle["costs"]["materials"].items():
        assert ns == pytest.approx(costs[name], rel=1e-4)
    machine = json.loads((results / "machine.json").read_text())
    for key in ("cpu", "isa", "cores", "caches_bytes", "load_before", "versions", "native_sha256"):
        assert machine[key], key
    assert set(machine["counters"]["events"]) | set(machine["counters"]["missing"]) == set(
        tables.COUNTER_COLUMNS
    )
    assert machine["noise"]["runs"] == 4 and len(machine["sittings"]) == 1


@pytest.mark.slow
def test_results_are_not_overwritten(results: Path, tmp_path: Path) -> None:
    before = (results / "runs.csv").read_bytes()
    again = bench("run", written(tmp_path, TINY), "-o", results)
    assert again.exit_code == 2 and "add --resume" in again.stderr
    other = written(tmp_path, TINY.replace("spp = 4", "spp = 5"))
    assert "another suite" in bench("run", other, "-o", results, "--resume").stderr
    assert "nothing to resume" in bench("run", other, "-o", tmp_path / "x", "--resume").stderr
    assert (results / "runs.csv").read_bytes() == before


@pytest.mark.slow
def test_dry_run_does_nothing_and_estimates(results: Path, tmp_path: Path) -> None:
    suite = written(tmp_path, TINY)
    result = bench("run", suite, "-o", results, "--dry-run", "--repetitions", 3, "--resume")
    assert "2 runs of 2 configurations, about" in result.output
    assert "from results in the folder" in result.output
    other = tmp_path / "none"
    fresh = bench("run", suite, "-o", other, "--dry-run", "--only", "*none")
    assert fresh.exit_code == 0 and "2 runs of 1 configurations" in fresh.output
    assert "from a short calibration" in fresh.output and not other.exists()
    assert "matches none" in bench("run", suite, "-o", other, "--only", "x", "--dry-run").stderr


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_stopped_and_resumed(tmp_path: Path, how: signal.Signals) -> None:
    text = TINY.replace("golden = true", "").replace('"oracle"', '"program"')
    suite, out = written(tmp_path, text), tmp_path / "out"
    # A shell makes its background processes ignore SIGINT, so install Python's handler.
    start = (
        "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "runpy.run_module('wavecomb', run_name='__main__', alter_sys=True)"
    )
    command = [sys.executable, "-c", start, "bench", "run", str(suite), "-o", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    csv, jsonl = out / "runs.csv", out / "runs.jsonl"
    until = time.monotonic() + 120
    while process.poll() is None and time.monotonic() < until:
        if csv.exists() and csv.read_text().count("\n") >= 2:
            break
        time.sleep(0.02)
    process.send_signal(how)
    assert process.wait() == (-9 if how == signal.SIGKILL else 130)
    done = csv.read_text().splitlines()
    assert 2 <= len(done) < 5
    with jsonl.open("a") as file:
        file.write('{"row": {"run_id": "torn')
    with csv.open("a") as file:
        file.write("torn,tiny,ord")
    result = bench("run", suite, "-o", out, "--resume")
    assert result.exit_code == 0, result.stderr
    lines = csv.read_text().splitlines()
    assert lines[: len(done)] == done and len(lines) == 5
    assert len({row["run_id"] for row in tables.read_rows(csv)}) == 4
    assert len(jsonl.read_text().splitlines()) == 4
    assert len(json.loads((out / "machine.json").read_text())["sittings"]) == 2


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
def test_a_run_that_fails_is_a_row_and_is_tried_again(tmp_path: Path) -> None:
    (tmp_path / "bad.usda").write_text("#usda 1.0\nnonsense")
    text = TINY.replace('scene = "cornell"', 'file = "bad.usda"').replace("golden = true", "")
    suite = written(tmp_path, text.replace(', "oracle"', "").replace("tions = 2", "tions = 1"))
    result = bench("run", suite, "-o", tmp_path / "out")
    assert "FAILED" in result.stderr and "1 runs failed" in result.stderr
    (row,) = tables.read_rows(tmp_path / "out" / "runs.csv")
    assert row["status"] == "failed" and "bad.usda" in row["error"] and row["render_s"] is None
    from wavecomb.scenes import write_scene

    write_scene("cornell", tmp_path / "bad.usda")
    assert bench("run", suite, "-o", tmp_path / "out", "--resume", "--quiet").exit_code == 0
    (row,) = tables.read_rows(tmp_path / "out" / "runs.csv")
    assert row["status"] == "ok"


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
def test_events_for_programs_and_only_some_stages(tmp_path: Path) -> None:
    text = TINY.replace("golden = true", "").replace('"oracle"', '"program"')
    suite = written(tmp_path, text + '[stage.other]\nfile = "missing.usda"\n')
    words = ("run", suite, "-o", tmp_path / "out", "--repetitions", 1)
    result = bench(*words, "--stage", "box", "--progress", "json")
    assert result.exit_code == 0, result.stderr
    events = [json.loads(line) for line in result.stdout.splitlines()]
    kinds = [event["event"] for event in events]
    assert kinds == ["prepare", "plan", "begin", "run", "begin", "run", "done"]
    assert events[0]["what"] == "stage" and events[0]["name"] == "box"
    assert events[1]["runs"] == 2 and events[1]["done"] == 0 and events[1]["seconds_left"] > 0.0
    assert [event["number"] for event in events[2:6]] == [1, 1, 2, 2]
    assert events[3]["run"] == events[2]["run"] and events[3]["status"] == "ok"
    assert events[-1] == {**events[-1], "whole": True, "failed": 0}
    unknown = bench(*words, "--stage", "boxx")
    assert unknown.exit_code == 2 and "--stage boxx: no such stage" in unknown.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
def test_time_limit(tmp_path: Path) -> None:
    text = TINY.replace("golden = true", "").replace('"oracle"', '"program"')
    arguments = ("run", written(tmp_path, text), "-o", tmp_path / "out", "--time-limit", 0.0001)
    result = bench(*arguments)
    assert result.exit_code == 0 and "4 runs are left" in result.stderr
    assert tables.read_rows(tmp_path / "out" / "runs.csv") == []


def test_processes_that_die_are_said() -> None:
    killed = run_process(["sh", "-c", "kill -9 $$"], {}).answer
    assert killed["status"] == "failed" and "killed by signal 9" in killed["error"]
    silent = run_process(["sh", "-c", "echo why >&2; exit 3"], {}).answer
    assert silent["error"] == "ended with code 3: why"


def test_counters_count_between_start_and_stop(tmp_path: Path) -> None:
    events = workers.available({"cycles": ("task-clock",)}).events
    if not events:
        not_here("perf does not count")
    session = workers.Session(events, tmp_path / "perf.csv")
    code = (
        "import json, sys; from wavecomb.bench.process import Switch;"
        "s = Switch(json.load(sys.stdin)['perf']); sum(range(10**7));"
        "s.start(); sum(range(10**5)); s.stop(); print(json.dumps({'status': 'ok'}))"
    )
    job = {"perf": session.job}
    outcome = run_process([*session.command, sys.executable, "-c", code], job, fds=session.fds)
    milliseconds = session.close()["cycles"]
    assert outcome.answer["status"] == "ok"
    assert 0.0 < milliseconds < 250.0 * outcome.wall_s


def test_missing_peers_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs, "WORKER", tmp_path / "worker.py")
    result = bench("run", "peers", "-o", tmp_path / "out", "--only", "*mitsuba-llvm*")
    assert result.exit_code == 2 and "needs benchmarks/peers/worker.py" in result.stderr
    assert not (tmp_path / "out").exists()


def test_folder_that_is_torn_in_the_middle(tmp_path: Path) -> None:
    suite = load_suite(written(tmp_path, TINY))
    folder = ResultFolder(tmp_path / "out")
    folder.create(suite)
    folder.runs_jsonl.write_text('{"row": {"run_id": "a"}}\nnonsense\n')
    with pytest.raises(WavecombError, match=r"runs\.jsonl: line 2 is not a run"):
        ResultFolder(tmp_path / "out").resume(suite)
