# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from click.testing import CliRunner, Result
from fake_core import Error, Fake, install
from parts import needs

from wavecomb.cli import main
from wavecomb.image.files.image import read_layers, read_metadata, write_exr


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Fake:
    return install(monkeypatch)


@pytest.fixture
def stage(tmp_path: Path) -> str:
    path = tmp_path / "stage.usda"
    path.write_text("#usda 1.0\n")
    return str(path)


def run(*arguments: Any) -> Result:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert "Traceback" not in result.output
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def error_line(result: Result) -> str:
    assert result.exit_code == 2, result.output
    lines = [line for line in result.stderr.splitlines() if not line.startswith("warning: ")]
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0]


# ---- render, with a stand-in for the core --------------------------------------------------------


def test_render_writes_everything(fake: Fake, stage: str, tmp_path: Path) -> None:
    out, png, stats = tmp_path / "a.exr", tmp_path / "a.png", tmp_path / "a.json"
    result = run(
        *("render", stage, "-o", out, "--png", png, "--stats", stats, "--size", 40, 30),
        *("--variant", "/World/Car{paint}=red", "--variant", "lod=high", "--purpose", "proxy"),
        *("--spp", 4, "--camera", "/Cam", "--frame", 7, "--lanes", "8", "--seed", 3),
        *("--filter", "box", "--filter-width", 1, "--roulette", "off", "--fresnel", "schlick"),
        *("--light-selection", "tree"),
        *("--integrator", "reference", "--threads", 1, "--wave-size", 64, "--sampler", "sobol"),
        *("--clamp-indirect", 2.5, "--max-depth", 5),
        *("--policy", "texture-locality", "--materialize", "on", "--ray-order", "morton"),
        *("--shadow-order", "auto", "--costs", "model", "--cost-weight", 0.5),
    )
    assert result.exit_code == 0, result.output
    assert fake.loaded[0]["camera"] == "/Cam"
    assert fake.loaded[0]["frame"] == 7.0
    assert fake.loaded[0]["purposes"] == ("default", "proxy")
    assert fake.loaded[0]["variants"] == {"/World/Car{paint}": "red", "lod": "high"}
    assert fake.rendered[0] == {
        "width": 40, "height": 30, "spp": 4, "lanes": 8, "seed": 3, "filter": "box",
        "filter_width": 1.0, "roulette": "off", "fresnel": "schlick", "integrator": "reference",
        "threads": 1, "wave_size": 64, "sampler": "sobol", "clamp_indirect": 2.5, "max_depth": 5,
        "light_selection": "tree",
        "policy": "texture-locality", "materialize": "on", "ray_order": "morton",
        "shadow_order": "auto", "costs": "model", "cost_weight": 0.5,
    }  # fmt: skip
    layers = read_layers(out)
    assert list(layers) == ["beauty", "albedo", "normal", "depth", "samples"]
    assert layers["beauty"].shape == (30, 40, 3)
    metadata = read_metadata(out)
    assert metadata["wavecomb:stage"] == stage
    assert json.loads(metadata["wavecomb:settings"])["spp"] == 4
    assert metadata["wavecomb:render_seconds"] == pytest.approx(0.5)
    assert png.stat().st_size > 0
    document = json.loads(stats.read_text())
    assert document["schema"] == "wavecomb-statistics/1"
    seconds = {"load": 0.25, "build": 0.1, "render": 0.5}
    others = dict.fromkeys(("first_samples", "resumed", "denoise"), 0.0)
    assert document["seconds"].pop("write") > 0.0
    assert document["seconds"] == {**seconds, **others}
    assert document["counts"]["samples"] == 4800
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "a.exr", "a.json", "a.png", "stage.usda"
    ]  # fmt: skip


def test_defaults(fake: Fake, stage: str, tmp_path: Path) -> None:
    assert run("render", stage, "-o", tmp_path / "a.exr").exit_code == 0
    defaults = {"width": 600, "height": 600, "spp": 64, "seed": 0, "threads": 0}
    assert fake.rendered == [defaults]
    assert fake.loaded[0]["camera"] is None
    assert fake.loaded[0]["purposes"] is None


def test_summary_and_warnings(fake: Fake, stage: str, tmp_path: Path) -> None:
    result = run("render", stage, "-o", tmp_path / "a.exr", "--size", 8, 8, "--verbose")
    assert "load 0.250 s, build 0.100 s, render 0.500 s" in result.stdout
    assert "trace" in result.stdout
    assert "60.0" in result.stdout
    assert "memory   123 MB" in result.stdout
    assert result.stdout.count("volumes: /Smoke") == 1
    assert "note: no light: /" in result.stdout
    assert result.stderr.splitlines() == [
        "warning: missing texture: ./wood.png",
        "warning: mesh /Bad: 3 triangles left out",
    ]


def test_quiet(fake: Fake, stage: str, tmp_path: Path) -> None:
    result = run("render", stage, "-o", tmp_path / "a.exr", "--size", 8, 8, "--quiet")
    assert result.stdout == ""
    assert result.stderr.count("warning: ") == 2


def test_nan_pixels_are_said(fake: Fake, stage: str, tmp_path: Path) -> None:
    fake.nan_pixels = 5
    result = run("render", stage, "-o", tmp_path / "a.exr", "--size", 8, 8)
    assert result.exit_code == 0
    assert "warning: 5 pixels of the picture are not finite" in result.stderr


def test_interrupt_keeps_what_is_done(fake: Fake, stage: str, tmp_path: Path) -> None:
    fake.interrupt_at = 0.4
    before = signal.getsignal(signal.SIGINT)
    result = run("render", stage, "-o", tmp_path / "a.exr", "--size", 10, 10)
    assert result.exit_code == 130
    assert "stopped at 40 %" in result.stderr
    assert read_layers(tmp_path / "a.exr")["beauty"].shape == (10, 10, 3)
    assert signal.getsignal(signal.SIGINT) is before


def test_interrupt_before_the_first_sample(fake: Fake, stage: str, tmp_path: Path) -> None:
    fake.interrupt_at = 0.0
    result = run("render", stage, "-o", tmp_path / "a.exr", "--size", 10, 10)
    assert result.exit_code == 130
    assert not (tmp_path / "a.exr").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--size", 0, 10], "size 0 x 10"),
        (["--size", -5, 10], "size -5 x 10"),
        (["--size", 65537, 10], "from 1 to 65536"),
        pytest.param(["--size", 65536, 65536, "--denoise"], "GiB of memory", marks=needs("pyoidn")),
        (["--size", "x", 10], "'x' is no size"),
        (["--spp", 0], "0 samples per pixel"),
        (["--camera", "/Nowhere"], "no camera /Nowhere there are: /Camera"),
        (["--lanes", 4], "setting lanes: 4 is not built"),
        (["--lanes", 5], "'5' is not one of"),
        (["--filter-width", 0], "must be above 0"),
        (["--filter-width", "nan"], "not a finite number"),
        (["--clamp-indirect", -1], "at least 0"),
        (["--exposure", "inf"], "not a finite number"),
        (["--frame", "x"], "'x' is not a number"),
        (["--variant", "red"], "must be PRIM{SET}=NAME"),
        (["--camera", ""], "--camera is empty"),
        (["--png", "a.exr"], "must end in .png"),
        (["--png", "/proc/nowhere/a.png"], "/proc/nowhere/a.png: cannot be written"),
        (["--stats", "/proc/nowhere/a.json"], "/proc/nowhere/a.json: cannot be written"),
        (["--nonsense"], "No such option"),
        (["--policy", "best"], "'best' is not one of"),
        (["--roulette", "russian"], "'russian' is not one of"),
        (["--ray-order", "hilbert"], "'hilbert' is not one of"),
        (["--costs", "mesured"], "one of auto, measured, model, or a file whose name ends in"),
        (["--costs", "/proc/nowhere/a.json"], "/proc/nowhere/a.json: cannot be written"),
        (["--cost-weight", -0.5], "at least 0"),
    ],
)
def test_bad_options(
    fake: Fake, stage: str, tmp_path: Path, arguments: list[Any], says: str
) -> None:
    result = run("render", stage, "-o", tmp_path / "a.exr", *arguments)
    assert says in error_line(result)
    assert fake.rendered == []
    assert [path.name for path in tmp_path.iterdir()] == ["stage.usda"]


@pytest.mark.parametrize(
    ("output", "says"),
    [
        ("/proc/nowhere/a.exr", "/proc/nowhere/a.exr: cannot be written"),
        ("{tmp}", "must end in .exr"),
        ("{tmp}/folder.exr", "is a folder"),
        ("{tmp}/stage.usda/a.exr", "is not a folder"),
        ("{tmp}/pipe.exr", "is not a regular file"),
        ("a.jpg", "must end in .exr or .png"),
    ],
)
def test_bad_output(fake: Fake, stage: str, tmp_path: Path, output: str, says: str) -> None:
    (tmp_path / "folder.exr").mkdir()
    os.mkfifo(tmp_path / "pipe.exr")
    result = run("render", stage, "-o", output.replace("{tmp}", str(tmp_path)))
    assert says in error_line(result)
    assert fake.loaded == []
    assert stat.S_ISFIFO((tmp_path / "pipe.exr").stat().st_mode)


def test_outputs_must_differ(fake: Fake, stage: str, tmp_path: Path) -> None:
    out = tmp_path / "a.exr"
    assert "is the same file as -o" in error_line(run("render", stage, "-o", out, "--stats", out))
    assert "is the same file as the stage" in error_line(
        run("render", stage, "-o", out, "--stats", stage)
    )
    assert Path(stage).read_text() == "#usda 1.0\n"


def test_failed_render_keeps_the_old_file(fake: Fake, stage: str, tmp_path: Path) -> None:
    out = tmp_path / "a.exr"
    out.write_text("old")
    for problem in (Error("mesh /M:\nbad"), MemoryError(), RuntimeError("boom"), OSError("full")):
        fake.fail = problem
        error_line(run("render", stage, "-o", out))
        assert out.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 2


def test_missing_stage(fake: Fake, tmp_path: Path) -> None:
    assert "no.usd: no such file" in error_line(run("render", "no.usd", "-o", tmp_path / "a.exr"))
    assert "no.usd: no such file" in error_line(run("info", "no.usd"))


def test_cost_profile_is_written_and_read(fake: Fake, stage: str, tmp_path: Path) -> None:
    file = tmp_path / "costs.json"
    arguments = ("render", stage, "-o", tmp_path / "a.exr", "--size", 8, 8, "--costs", file)
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    assert fake.costs == [None]
    assert str(file) in result.stdout
    document = json.loads(file.read_text())
    assert document == {
        "schema": "wavecomb-costs/1",
        "materials": {"Gold": 50.0, "Chalk": 25.5},
        "textures": {"wood.png": 60.0},
    }
    del document["schema"]
    assert run(*arguments, "--quiet").exit_code == 0
    assert fake.costs[1] == document
    assert "costs" not in fake.rendered[1]
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is not a cost profile"),
        ("[" * 100_000, "is not a cost profile"),
        ("\x00\xff", "is not a cost profile"),
        ("[]", "no schema wavecomb-costs/1"),
        ('{"materials": {}, "textures": {}}', "no schema wavecomb-costs/1"),
        ('{"schema": "wavecomb-costs/1", "materials": {}}', "textures is not a table"),
        ('{"schema": "wavecomb-costs/1", "materials": [1], "textures": {}}', "materials is no"),
        *(
            (
                '{"schema": "wavecomb-costs/1", "materials": {"Gold": '
                + cost
                + '}, "textures": {}}',
                "cost of Gold is",
            )
            for cost in ("-1", "NaN", "Infinity", "1e13", '"3"', "null", "true", "[1]")
        ),
    ],
)
def test_broken_cost_profiles(fake: Fake, stage: str, tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "costs.json"
    file.write_text(text, encoding="latin-1")
    line = error_line(run("render", stage, "-o", tmp_path / "a.exr", "--costs", file))
    assert says in line
    assert "costs.json" in line
    assert len(line) < 400
    assert file.read_text(encoding="latin-1") == text
    assert fake.loaded == []


def test_cost_profile_must_be_another_file(fake: Fake, stage: str, tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    line = error_line(
        run("render", stage, "-o", tmp_path / "a.exr", "--stats", file, "--costs", file)
    )
    assert "is the same file as --stats" in line


def test_summary_of_scheduling(fake: Fake, stage: str, tmp_path: Path) -> None:
    materials = [
        {"name": f"M{i}", "program": "metal", "records": 1000 - i, "timed_records": 10,
         "ns_per_record": 50.4, "calibrated_ns": 40.0, "predicted_ns": 49.6}
        for i in range(9)
    ]  # fmt: skip
    fake.stats = {
        "settings": {"policy": "adaptive", "width": 8, "height": 8},
        "phases_s": {"trace": 1.0, "keys": 0.1, "sort": 0.1, "shade": 1.8},
        "counts": {
            **{"samples": 100, "rays": 250, "shadow_rays": 100, "records": 9000},
            **{"packets": 700, "packet_lanes": 11200},
        },
        "depths": {"rays": [100, 80, 40, 20, 5, 2, 1, 1, 1], "shadow_rays": [], "records": []},
        "coherence": {"run_length": 12.34, "material_homogeneity": 0.9, "texture_homogeneity": 0.3},
        "lane_utilisation": 0.8,
        "programs": {"metal": {"records": 9000, "ns_per_record": 50.4}},
        "materials": materials,
        "cost_prediction": {"r2": 0.93, "mean_error": 0.05, "materials": 9, "calibration_s": 0.01},
        "policy_uses": {"none": 25, "program": 75, "texture": 0},
    }
    result = run(
        *("render", stage, "-o", tmp_path / "a.exr", "--size", 8, 8),
        *("--stats", tmp_path / "a.json", "--verbose"),
    )
    for text in (
        "policy adaptive: sorting takes 10 % of the time of sorting and shading; 80 % of lanes",
        "records: 12.3 in a row have the same material",
        "queues by policy: program 75 %, none 25 %",
        "predicted costs of 9 materials: R2 0.93, mean error 5 %",
        "rays per path: 2.5; at each depth: 1 0.8 0.4 0.2 0.05 0.02 0.01 0.01 ...",
        "and 3 more materials",
    ):
        assert text in result.stdout
    assert "M5" in result.stdout
    assert "M6" not in result.stdout
    stats = json.loads((tmp_path / "a.json").read_text())
    assert len(stats["materials"]) == 9
    assert stats["sort_overhead"] == pytest.approx(0.1)
    assert stats["mean_path_length"] == 2.5


# ---- info, scene, compare, help ------------------------------------------------------------------


def test_info(fake: Fake, stage: str) -> None:
    result = run("info", stage)
    assert result.exit_code == 0, result.stderr
    for text in ("1,000 (90,000 with", "1 diffuse, 2 metal", "5.0 MB", "3 RectLight", "/Smoke"):
        assert text in result.stdout
    assert "3: 1 dome, 2 rect" in result.stdout
    assert "/Closeup" in result.stdout
    assert "missing texture" in result.stderr


def test_info_json(fake: Fake, stage: str) -> None:
    info = json.loads(run("info", stage, "--json").stdout)
    assert info["triangles"] == {"unique": 1000, "instanced": 90000}
    assert info["materials"] == {"count": 3, "by_program": {"diffuse": 1, "metal": 2}}
    assert info["textures"]["bytes"] == 5_000_000
    assert info["lights_by_kind"] == {"dome": 1, "rect": 2}
    assert info["cameras"] == ["/Camera", "/Closeup"]
    assert info["unsupported"] == [{"what": "volumes", "count": 1, "places": ["/Smoke"]}]


def test_scene_list() -> None:
    result = run("scene", "--list")
    assert result.exit_code == 0
    assert "cornell" in result.stdout
    assert "mixed" in result.stdout


def test_scene(tmp_path: Path) -> None:
    out = tmp_path / "box.usda"
    assert run("scene", "cornell", "-o", out).exit_code == 0
    assert out.read_text().startswith("#usda")
    assert "wavecomb:program" in out.read_text()
    assert run("scene", "cornell", "-o", out, "--plain").exit_code == 0
    assert "wavecomb:program" not in out.read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "give a NAME and -o FILE"),
        (["cornell"], "give a NAME and -o FILE"),
        (["nonsense", "-o", "a.usda"], "no scene 'nonsense'"),
        (["cornell", "-o", "a.txt"], ".usda, .usdc or .usd"),
        (["cornell", "-o", "/proc/nowhere/a.usda"], "/proc/nowhere/a.usda: cannot be written"),
        (["cornell", "-o", "a.usda", "--triangles", "0"], "--triangles"),
        (["cornell-dragon", "-o", "a.usda", "--dragon", "no.obj"], "no.obj"),
        (["heavy", "-o", "a.usda", "--plain"], "heavy has no plain form"),
    ],
)
def test_bad_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in error_line(run("scene", *arguments))
    assert list(tmp_path.glob("*.usd*")) == []


def test_compare(tmp_path: Path) -> None:
    a, b, other = tmp_path / "a.exr", tmp_path / "b.exr", tmp_path / "other.exr"
    picture = np.full((4, 6, 3), 0.5, np.float32)
    write_exr(a, {"beauty": picture})
    write_exr(other, {"beauty": picture[:2]})
    changed = picture.copy()
    changed[1, 2] += 0.25
    write_exr(b, {"beauty": changed})

    assert run("compare", a, a).exit_code == 0
    result = run("compare", b, a, "--heatmap", tmp_path / "h.png")
    assert result.exit_code == 1
    assert "different: 1 of 24 pixels" in result.stdout
    assert "max 0.25 at (2, 1)" in result.stdout
    assert (tmp_path / "h.png").exists()
    document = json.loads(run("compare", b, a, "--json").stdout)
    assert document["equal"] is False
    assert document["mean_signed"] == pytest.approx([0.25 / 24] * 3)
    assert run("compare", b, a, "--tolerance", 0.3).exit_code == 0
    assert run("compare", b, a, "--tolerance", 0.2).exit_code == 1
    assert "only images of the same size" in error_line(run("compare", a, other))
    assert "no such file" in error_line(run("compare", a, tmp_path / "no.exr"))
    assert "must end in .png" in error_line(run("compare", a, b, "--heatmap", "h.exr"))
    other.write_text("no picture")
    assert "cannot be read as an image" in error_line(run("compare", a, other))


@pytest.mark.parametrize("command", [[], ["render"], ["info"], ["scene"], ["compare"]])
def test_help_has_examples(command: list[str]) -> None:
    result = run(*command, "--help")
    assert result.exit_code == 0
    assert "Examples:\n" in result.stdout
    assert "  wavecomb " in result.stdout


def test_version() -> None:
    assert run("--version").stdout.startswith("wavecomb ")


def test_unknown_command() -> None:
    assert "No such command" in error_line(run("redner"))


def test_starts_quickly_and_lazily() -> None:
    code = (
        "import sys; from wavecomb.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'pxr', 'OpenImageIO', 'rich', 'wavecomb._core'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    best = 9.0
    for _ in range(3):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
        best = min(best, time.perf_counter() - start)
    assert best < 0.6


def test_python_m() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "wavecomb", "--help"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("Usage: wavecomb ")


# ---- the real thing ------------------------------------------------------------------------------


def wavecomb(*arguments: Any) -> subprocess.CompletedProcess[str]:
    return forks.wavecomb(*arguments)


@pytest.mark.slow
def test_from_scene_to_comparison(tmp_path: Path) -> None:
    pytest.importorskip("wavecomb._core")
    stage, small = tmp_path / "box.usda", ("--size", 48, 40, "--spp", 4)
    a, b = tmp_path / "a.exr", tmp_path / "b.exr"
    assert wavecomb("scene", "cornell", "-o", stage).returncode == 0
    info = json.loads(wavecomb("info", stage, "--json").stdout)
    assert info["triangles"]["instanced"] == 30
    assert info["camera"] == "/World/Camera"
    assert info["unsupported"] == []
    done = wavecomb(
        *("render", stage, "-o", a, "--png", tmp_path / "a.png", *small),
        *("--stats", tmp_path / "a.json"),
    )
    assert (done.returncode, done.stderr) == (0, "")
    stats = json.loads((tmp_path / "a.json").read_text())
    assert stats["counts"]["samples"] == 48 * 40 * 4
    assert stats["counts"]["rays"] > stats["counts"]["samples"]
    assert stats["peak_rss_bytes"] > 1_000_000
    for options in (
        ("--threads", 1, "--wave-size", 64),
        ("--lanes", 1),
        ("--integrator", "reference"),
        ("--policy", "adaptive", "--ray-order", "auto", "--shadow-order", "auto"),
        ("--costs", tmp_path / "costs.json", "--policy", "cost-benefit"),
        ("--costs", tmp_path / "costs.json", "--policy", "material", "--materialize", "on"),
    ):
        done = wavecomb("render", stage, "-o", b, *small, *options, "--quiet")
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        assert wavecomb("compare", a, b).returncode == 0, options
    assert len(json.loads((tmp_path / "costs.json").read_text())["materials"]) == 4
    done = wavecomb("render", stage, "-o", b, *small, "--cost-weight", 2)
    assert (done.returncode, "cost_weight is 2" in done.stderr) == (2, True)
    done = wavecomb("render", stage, "-o", b, *small, "--seed", 1, "--quiet")
    assert done.returncode == 0
    done = wavecomb("compare", a, b, "--heatmap", tmp_path / "h.png")
    assert done.returncode == 1
    assert "different: " in done.stdout
    assert wavecomb("compare", a, stage).returncode == 2


@pytest.mark.slow
def test_lane_widths_that_are_not_built(tmp_path: Path) -> None:
    from wavecomb import _core

    built = _core.lane_widths()
    assert len(built) == 1 or built[0] == 1
    shown = "|".join(["auto", *(str(width) for width in built)])
    assert f"--lanes [{shown}]" in wavecomb("render", "--help-all").stdout
    stage, out = tmp_path / "stage.usdc", tmp_path / "a.exr"
    assert wavecomb("scene", "cornell", "-o", stage).returncode == 0
    for width in (1, 4, 8, 16):
        done = wavecomb("render", stage, "-o", out, "--size", 8, 8, "--lanes", width, "--quiet")
        assert (done.returncode == 0) == out.exists() == (width in built), width
        if width in built:
            out.unlink()
            continue
        lines = done.stderr.splitlines()
        assert (done.returncode, len(lines)) == (2, 1)
        assert f"lanes is {width}, which the " in lines[0]
        assert "make build LANES=all" in lines[0]
